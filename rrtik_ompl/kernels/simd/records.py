"""Tables and arrays as values inside numba kernels: :class:`rrtik_ompl.kernels.record.Record` and its views.

Both are addresses, whole numbers of 64 bits, that know what stands there. ``search.phase`` and ``row[k] += 1.0`` are
compiled to the one load or store that they say. Where a whole number is expected they are one.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeVar, get_type_hints

from llvmlite import ir
from numba import types
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_getattr, infer_global, signature
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_builtin,
    lower_cast,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

from rrtik_ompl.kernels.record import Record, View, holds_array, holds_table
from rrtik_ompl.kernels.simd.lanes import DOUBLE, INDEX, SINGLE, WHOLE, pointer

V = TypeVar("V", bound=View)

# What an element of a view is in memory, how many bytes it has, and what it is to a kernel.
_ELEMENTS = {
    "float64": (DOUBLE, 8, types.float64),
    "float32": (SINGLE, 4, types.float32),
    "int32": (INDEX, 4, types.int64),
    "int64": (WHOLE, 8, types.int64),
}


class _Address(types.Type):  # type: ignore[misc]
    def can_convert_to(self, typingctx: Any, other: Any) -> Any:
        return Conversion.safe if other == types.int64 else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """An address or a whole number, 0 for none, is a whole number."""
        return types.int64 if types.unliteral(other) == types.int64 else None


class RecordType(_Address):
    """Numba type of the address of a table."""

    def __init__(self, record: type[Record]) -> None:
        self.record = record
        super().__init__(name=f"{record.__module__}.{record.__qualname__}")


class ViewType(_Address):
    """Numba type of the address of an array."""

    def __init__(self, scalar: str) -> None:
        self.memory, self.size, self.element = _ELEMENTS[scalar]
        super().__init__(name=f"View({scalar})")


@register_model(RecordType)
@register_model(ViewType)
class _AddressModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, address: _Address) -> None:
        super().__init__(manager, address, WHOLE)


def _as_whole_number(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return value


def kernel_type(kind: Any) -> Any:
    """Numba's type of what is annotated as ``kind``; a whole number if it is nothing that is known here."""
    if holds_table(kind):
        return RecordType(kind)
    if holds_array(kind):
        return ViewType(kind.scalar)
    return types.float64 if kind is float else types.int64


def argument_types(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Numba's types of the arguments of a function by their annotations."""
    hints = get_type_hints(function)
    code = function.__code__
    return tuple(kernel_type(hints.get(name)) for name in code.co_varnames[: code.co_argcount])


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = RecordType

    def generic_resolve(self, table: RecordType, name: str) -> Any:
        kind = table.record.kinds.get(name)
        return None if kind is None else kernel_type(kind)


def _field(context: Any, builder: Any, table: RecordType, address: Any, name: str) -> Any:
    """LLVM's pointer to a field."""
    element = DOUBLE if table.record.kinds[name] is float else WHOLE
    return pointer(builder, element, address, ir.Constant(WHOLE, table.record.places[name]))


def _read_field(context: Any, builder: Any, table: RecordType, address: Any, name: str) -> Any:
    return builder.load(_field(context, builder, table, address, name), align=8)


def _write_field(context: Any, builder: Any, sig: Any, args: Any, name: str) -> None:
    builder.store(args[1], _field(context, builder, sig.args[0], args[0], name), align=8)


@infer_global(operator.getitem)
class _Element(AbstractTemplate):  # type: ignore[misc]
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0].element, args[0], types.int64) if isinstance(args[0], ViewType) else None


@infer_global(operator.setitem)
class _WrittenElement(AbstractTemplate):  # type: ignore[misc]
    def generic(self, args: Any, kws: Any) -> Any:
        view = args[0]
        return signature(types.none, view, types.int64, view.element) if isinstance(view, ViewType) else None


def _read_element(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    view = sig.args[0]
    value = builder.load(pointer(builder, view.memory, *args), align=view.size)
    return builder.sext(value, WHOLE) if view.memory == INDEX else value


def _write_element(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    view = sig.args[0]
    value = builder.trunc(args[2], INDEX) if view.memory == INDEX else args[2]
    builder.store(value, pointer(builder, view.memory, *args[:2]), align=view.size)
    return context.get_dummy_value()


def _row_at(typingctx: Any, array: Any, width: Any, number: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        skipped = builder.mul(args[1], args[2], flags=("nsw",))
        size = ir.Constant(WHOLE, array.size if isinstance(array, ViewType) else 8)
        return builder.add(args[0], builder.mul(size, skipped, flags=("nsw",)), flags=("nsw",))

    return array(array, types.int64, types.int64), emit


row_at: Callable[[V, int, int], V] = intrinsic(_row_at)  # of an array of rows, numbers in a row, number of the row


def table_reader(record: type[Record]) -> Any:
    """Function (addresses, number) that finds one of several tables, whose addresses an array holds."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(pointer(builder, WHOLE, *args), align=8)

    table = RecordType(record)
    return intrinsic(lambda typingctx, addresses, number: (table(addresses, types.int64), emit))


def _exists(typingctx: Any, address: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.icmp_signed("!=", args[0], ir.Constant(WHOLE, 0))

    return types.boolean(address), emit


exists: Callable[[Record | View], bool] = intrinsic(_exists)  # whether there is a table or array, which may be absent


def _same_place(typingctx: Any, one: Any, other: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.icmp_signed("==", *args)

    return types.boolean(one, other), emit


same_place: Callable[[View, View], bool] = intrinsic(_same_place)  # whether two arrays are one


def _type_of_record(record: Record, context: Any) -> RecordType:
    return RecordType(type(record))


def _type_of_view(array: View, context: Any) -> ViewType:
    return ViewType(array.scalar)


def _record_of_python(table: RecordType, record: Any, context: Any) -> Any:
    address = context.pyapi.object_getattr_string(record, "address")
    return _whole_number(address, context.pyapi)


def _view_of_python(view: ViewType, array: Any, context: Any) -> Any:
    memory = context.pyapi.object_getattr_string(array, "ctypes")
    address = context.pyapi.object_getattr_string(memory, "data")
    context.pyapi.decref(memory)
    return _whole_number(address, context.pyapi)


def _whole_number(number: Any, python: Any) -> Any:
    value = python.long_as_longlong(number)
    python.decref(number)
    return NativeValue(value)


lower_cast(_Address, types.int64)(_as_whole_number)
lower_getattr_generic(RecordType)(_read_field)
lower_setattr_generic(RecordType)(_write_field)
lower_builtin(operator.getitem, ViewType, types.int64)(_read_element)
lower_builtin(operator.setitem, ViewType, types.int64, types.Any)(_write_element)
typeof_impl.register(Record)(_type_of_record)
typeof_impl.register(View)(_type_of_view)
unbox(RecordType)(_record_of_python)
unbox(ViewType)(_view_of_python)
