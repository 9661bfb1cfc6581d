"""The largest and the smallest of wide lanes."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rrtik_ompl.fast.simd.lanes import DOUBLE, FAST_MATH, WIDE_LANES
from rrtik_ompl.fast.simd.processor import WIDTH


def _reduction(name: str) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.FunctionType(DOUBLE, [args[0].type])
        called = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.{name}.v{WIDTH}f64")
        return builder.call(called, args, fastmath=FAST_MATH)

    return intrinsic(lambda typingctx, x: (types.float64(x), emit) if x == WIDE_LANES else None)


lowest_of_wide = _reduction("fmin")
highest_of_wide = _reduction("fmax")
