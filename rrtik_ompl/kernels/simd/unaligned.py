"""Lanes that are read from any number of an array on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.lanes import DOUBLE, WIDE_LANES, pointer
from rrtik_ompl.kernels.simd.processor import WIDTH


def _unaligned_lanes(typingctx: Any, array: Any, first: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        vector = ir.VectorType(DOUBLE, WIDTH).as_pointer()
        return builder.load(builder.bitcast(pointer(builder, DOUBLE, *args), vector), align=8)

    return WIDE_LANES(types.int64, types.int64), emit


unaligned_lanes: Callable[[Doubles, int], Any] = intrinsic(_unaligned_lanes)  # of an array, the number of the first one
