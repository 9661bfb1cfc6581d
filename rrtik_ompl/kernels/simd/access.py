"""Named access to records in kernels: functions that read numbers, or find a record or row, at a fixed place.

``float_at``, ``int_at`` and their like in :mod:`rrtik_ompl.kernels.simd.lanes` take the place as a number. What is made
here has the place built in, so that a kernel names what it reads, and Python gives it a type where it is named; see
:mod:`rrtik_ompl.kernels.tables.accessors`. Each is compiled to the one load or sum that the number would be compiled
to. Fields of tables have names of their own (:mod:`rrtik_ompl.kernels.record`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rrtik_ompl.kernels.layout import ALIGNMENT, INT_BYTES
from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined
from rrtik_ompl.kernels.simd.lanes import DOUBLE, INDEX, LANES, SINGLE, WHOLE, pointer


def _constant(number: int) -> Any:
    return ir.Constant(WHOLE, number)


def _scaled(builder: Any, base: Any, factor: int, number: Any) -> Any:
    """``base + factor * number`` of whole numbers that do not overflow."""
    product = builder.mul(_constant(factor), number, flags=("nsw",))
    return builder.add(base, product, flags=("nsw",))


def _number_reader(element: Any, result: Any, align: int, place: int) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = builder.load(pointer(builder, element, args[0], _constant(place)), align=align)
        return builder.sext(value, WHOLE) if element == INDEX else value

    return intrinsic(lambda typingctx, record: (result(types.int64), emit))


def _column_reader(element: Any, result: Any, width: int, place: int) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        index = _scaled(builder, _constant(place), width, args[1])
        value = builder.load(pointer(builder, element, args[0], index), align=4)
        return builder.sext(value, WHOLE) if element == INDEX else value

    return intrinsic(lambda typingctx, array, number: (result(types.int64, types.int64), emit))


def int_reader(place: int) -> Any:
    """Function (record) that reads one of a record's int32."""
    return _number_reader(INDEX, types.int64, 4, place)


def float_reader(place: int) -> Any:
    """Function (record) that reads one of a record's float32."""
    return _number_reader(SINGLE, types.float32, 4, place)


def double_reader(place: int) -> Any:
    """Function (record) that reads one of a record's float64."""
    return _number_reader(DOUBLE, types.float64, 8, place)


def int_column(width: int, place: int) -> Any:
    """Function (array, number) that reads one int32 of a record; records have ``width`` of them."""
    return _column_reader(INDEX, types.int64, width, place)


def float_column(width: int, place: int) -> Any:
    """Function (array, number) that reads one float32 of a record; records have ``width`` of them."""
    return _column_reader(SINGLE, types.float32, width, place)


def vector_reader(place: int) -> Any:
    """Function (record) that reads three float32 from ``place`` on."""
    return _vector_of(float_reader, place)


def double_vector_reader(place: int) -> Any:
    """Function (record) that reads three float64 from ``place`` on."""
    return _vector_of(double_reader, place)


def _vector_of(reader: Any, place: int) -> Any:
    first, second, third = (reader(place + k) for k in range(3))

    @inlined
    def read(record: int) -> Any:
        return first(record), second(record), third(record)

    return read


def record_reader(size: int) -> Any:
    """Function (array, number) that finds a record in an array of records of ``size`` bytes, as an array itself."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _scaled(builder, args[0], size, args[1])

    return intrinsic(lambda typingctx, array, number: (array(array, types.int64), emit))


def _row_reader(size: int) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array, width, number = args
        return _scaled(builder, array, size, builder.mul(width, number, flags=("nsw",)))

    return intrinsic(lambda typingctx, array, width, number: (types.int64(types.int64, types.int64, types.int64), emit))


int_row = _row_reader(INT_BYTES)  # function (array, width, number): finds a row of ``width`` int32


def _emit_lane(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.extract_element(*args)


lane_at = intrinsic(lambda typingctx, lanes, number: (types.float32(LANES, types.int64), _emit_lane))  # of lanes


def _nonzero_ints() -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.VectorType(INDEX, WIDTH)
        numbers = builder.load(pointer(builder, kind, *args), align=ALIGNMENT // 2)
        mask = builder.icmp_signed("!=", numbers, ir.Constant(kind, None))
        return builder.zext(builder.bitcast(mask, ir.IntType(WIDTH)), WHOLE)

    return intrinsic(lambda typingctx, address, index: (types.int64(types.int64, types.int64), emit))


# Which of a block of ``WIDTH`` whole numbers of 32 bits are not 0, as an integer, the first in the lowest bit.
nonzero_ints: Callable[[Ints, int], int] = _nonzero_ints()
