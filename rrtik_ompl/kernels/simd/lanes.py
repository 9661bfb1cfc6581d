"""Vectors of ``WIDTH`` numbers as plain values inside numba kernels: one lane per configuration.

A value of these types lives in one or two vector registers of the processor. Arithmetic and comparison work lane by
lane and mix with scalars. Memory is addressed by integers (``array.ctypes.data``), without bounds checks: the tables
own their arrays, and the packer guarantees every index in them.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from rrtik_ompl.kernels.layout import ALIGNMENT
from rrtik_ompl.kernels.simd.processor import WIDTH

# Values are finite by contract and signs of zero do not matter; sums are not reordered, so error bounds hold.
FAST_MATH = ("nnan", "ninf", "nsz", "contract")

SINGLE, DOUBLE, INDEX, WHOLE = ir.FloatType(), ir.DoubleType(), ir.IntType(32), ir.IntType(64)


def _lowered(function: Callable[..., Any]) -> Any:
    """A function for kernels that is written in LLVM's instructions: given types, it returns how to emit them."""
    return intrinsic(function)


class LaneType(types.Type):  # type: ignore[misc]
    """Numba type of ``WIDTH`` floats of 32 or 64 bits."""

    def __init__(self, scalar: Any) -> None:
        self.scalar = scalar
        super().__init__(name=f"Lanes({WIDTH} x {scalar})")


class MaskType(types.Type):  # type: ignore[misc]
    """Numba type of ``WIDTH`` truth values."""

    def __init__(self) -> None:
        super().__init__(name=f"LaneMask({WIDTH})")


LANES, WIDE_LANES, LANE_MASK = LaneType(types.float32), LaneType(types.float64), MaskType()


@register_model(LaneType)
class _LaneModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, lane_type: LaneType) -> None:
        super().__init__(manager, lane_type, _vector(lane_type))


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, mask_type: MaskType) -> None:
        super().__init__(manager, mask_type, ir.VectorType(ir.IntType(1), WIDTH))


def _vector(lane_type: LaneType) -> Any:
    return ir.VectorType(SINGLE if lane_type.scalar == types.float32 else DOUBLE, WIDTH)


def _spread(builder: Any, value: Any) -> Any:
    """A vector with the same scalar in every lane."""
    vector = ir.VectorType(value.type, WIDTH)
    blank = ir.Constant(vector, ir.Undefined)
    single = builder.insert_element(blank, value, ir.Constant(INDEX, 0))
    return builder.shuffle_vector(single, blank, ir.Constant(ir.VectorType(INDEX, WIDTH), [0] * WIDTH))


def _vectors(builder: Any, sig: Any, args: Any) -> list[Any]:
    """The arguments of a lane operation, scalars spread over all lanes."""
    return [
        value if isinstance(kind, LaneType) else _spread(builder, value)
        for kind, value in zip(sig.args, args, strict=True)
    ]


def _operand_types(args: Any) -> tuple[LaneType, tuple[Any, ...]] | None:
    """Lane type of an operation and the types of its operands, scalars in the lanes' precision; None if not ours."""
    lane_types = {kind for kind in args if isinstance(kind, LaneType)}
    if len(lane_types) != 1 or not all(isinstance(k, (LaneType, types.Number)) for k in args):
        return None
    lane_type = lane_types.pop()
    return lane_type, tuple(kind if isinstance(kind, LaneType) else lane_type.scalar for kind in args)


def _define(symbol: Any, emit: Callable[[Any, list[Any]], Any], result: Any = None) -> None:
    """Teach numba an operator on lanes; ``result`` is the type it gives, the operands' own if None."""

    @infer_global(symbol)
    class _Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            known = _operand_types(args)
            return None if known is None else signature(result or known[0], *known[1])

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, _vectors(builder, sig, args))

    binary = [(LaneType, LaneType), (LaneType, types.Float), (types.Float, LaneType)]
    for shape in [(LaneType,)] if symbol is operator.neg else binary:
        lower_builtin(symbol, *shape)(lower)


def _arithmetic(name: str) -> Callable[[Any, list[Any]], Any]:
    return lambda builder, values: getattr(builder, name)(*values, flags=FAST_MATH)


def _comparison(sign: str) -> Callable[[Any, list[Any]], Any]:
    return lambda builder, values: builder.fcmp_ordered(sign, *values, flags=FAST_MATH)


for _symbol, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _define(_symbol, _arithmetic(_name))
_define(operator.truediv, _arithmetic("fdiv"))
_define(operator.neg, _arithmetic("fneg"))
for _symbol, _name in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _define(_symbol, _comparison(_name), LANE_MASK)


@infer_global(operator.and_)
@infer_global(operator.or_)
class _Joined(AbstractTemplate):  # type: ignore[misc]
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(LANE_MASK, *args) if args == (LANE_MASK, LANE_MASK) else None


lower_builtin(operator.and_, MaskType, MaskType)(lambda context, builder, sig, args: builder.and_(*args))
lower_builtin(operator.or_, MaskType, MaskType)(lambda context, builder, sig, args: builder.or_(*args))


def _lane_function(name: str, count: int) -> Any:
    """An LLVM intrinsic of ``count`` operands that works lane by lane."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        vector = _vector(sig.return_type)
        full = f"{name}.v{WIDTH}f{32 if vector.element == SINGLE else 64}"
        called = cgutils.get_or_insert_function(builder.module, ir.FunctionType(vector, [vector] * count), full)
        return builder.call(called, _vectors(builder, sig, args), fastmath=FAST_MATH)

    def typed(args: tuple[Any, ...]) -> Any:
        known = _operand_types(args)
        return None if known is None else (signature(known[0], *known[1]), emit)

    if count == 1:
        return intrinsic(lambda typingctx, x: typed((x,)))
    return intrinsic(lambda typingctx, x, y: typed((x, y)))


absolute = _lane_function("llvm.fabs", 1)
floor = _lane_function("llvm.floor", 1)
nearest = _lane_function("llvm.rint", 1)
square_root = _lane_function("llvm.sqrt", 1)
smaller = _lane_function("llvm.minnum", 2)
larger = _lane_function("llvm.maxnum", 2)


def _reduction(name: str, lanes: Any, number: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.FunctionType(context.get_value_type(number), [args[0].type])
        full = f"llvm.vector.reduce.{name}.v{WIDTH}f{number.bitwidth}"
        called = cgutils.get_or_insert_function(builder.module, kind, full)
        return builder.call(called, args, fastmath=FAST_MATH)

    return intrinsic(lambda typingctx, x: (number(x), emit) if x == lanes else None)


lowest, highest = (_reduction(name, LANES, types.float32) for name in ("fmin", "fmax"))
lowest_of_wide, highest_of_wide = (_reduction(name, WIDE_LANES, types.float64) for name in ("fmin", "fmax"))


@_lowered
def choose(typingctx: Any, mask: Any, first: Any, second: Any) -> Any:
    """``first`` in the lanes of ``mask``, ``second`` in the others."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(*args)

    return signature(first, mask, first, second), emit


@_lowered
def bits(typingctx: Any, mask: Any) -> Any:
    """A mask as an integer, lane 0 in the lowest bit."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(WIDTH)), WHOLE)

    return types.int64(mask), emit


@_lowered
def first_bit(typingctx: Any, number: Any) -> Any:
    """Place of the lowest bit that is set in an integer other than 0."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), emit


@_lowered
def single(typingctx: Any, wide: Any) -> Any:
    """Wide lanes rounded to 32 bits."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fptrunc(args[0], _vector(LANES))

    return LANES(wide), emit


@_lowered
def lane_numbers(typingctx: Any) -> Any:
    """Wide lanes 0, 1, 2, ..."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return ir.Constant(_vector(WIDE_LANES), [ir.Constant(DOUBLE, float(k)) for k in range(WIDTH)])

    return signature(WIDE_LANES), emit


@_lowered
def rounded_sum(typingctx: Any, first: Any, second: Any) -> Any:
    """Sum of wide lanes, never fused with a product that is one of them: the same to the bit as numpy's."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fadd(*args)

    return WIDE_LANES(first, second), emit


def _spreader(lane_type: LaneType) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _spread(builder, args[0])

    return intrinsic(lambda typingctx, x: (lane_type(lane_type.scalar), emit))


spread = _spreader(LANES)
spread_wide = _spreader(WIDE_LANES)


def pointer(builder: Any, element: Any, address: Any, index: Any) -> Any:
    """LLVM's pointer to element number ``index`` of an array at an address."""
    return builder.gep(builder.inttoptr(address, element.as_pointer()), [index])


def _reader(element: Any, result: Any, align: int) -> Any:
    """Function (address, index) that reads element number ``index`` of an array at an address."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = builder.load(pointer(builder, element, *args), align=align)
        return builder.sext(value, WHOLE) if element == INDEX else value

    return intrinsic(lambda typingctx, address, index: (result(types.int64, types.int64), emit))


def _writer(element: Any, value_type: Any, align: int) -> Any:
    """Function (address, index, value) that sets element number ``index`` of an array at an address."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = builder.trunc(args[2], element) if value_type == types.int64 else args[2]
        builder.store(value, pointer(builder, element, *args[:2]), align=align)
        return context.get_dummy_value()

    return intrinsic(lambda typingctx, address, index, value: (types.void(types.int64, types.int64, value_type), emit))


@_lowered
def set_truths(typingctx: Any, address: Any, index: Any, mask: Any) -> Any:
    """Write a mask as ``WIDTH`` bytes of 0 or 1, the first at an index of an array of numpy's truth values."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = builder.add(args[0], args[1])
        kind = ir.VectorType(ir.IntType(8), WIDTH)
        builder.store(builder.zext(args[2], kind), builder.inttoptr(place, kind.as_pointer()), align=1)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, mask), emit


lanes_at = _reader(_vector(LANES), LANES, ALIGNMENT // 2)
wide_lanes_at = _reader(_vector(WIDE_LANES), WIDE_LANES, ALIGNMENT)
double_at = _reader(DOUBLE, types.float64, 8)
float_at = _reader(SINGLE, types.float32, 4)
int_at = _reader(INDEX, types.int64, 4)
field = _reader(WHOLE, types.int64, 8)  # of a table: see :mod:`rrtik_ompl.kernels.layout`
set_lanes = _writer(_vector(LANES), LANES, ALIGNMENT // 2)
set_wide_lanes = _writer(_vector(WIDE_LANES), WIDE_LANES, ALIGNMENT)
set_double = _writer(DOUBLE, types.float64, 8)
set_int = _writer(INDEX, types.int64, 4)
set_float = _writer(SINGLE, types.float32, 4)
