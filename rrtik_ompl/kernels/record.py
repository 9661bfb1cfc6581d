"""Tables that Python packs and kernels read: each is declared once, as a class whose fields are annotated.

::

    class CurveTable(Record):  # a curve through rounded corners, and places on it
        along: Doubles  # distance of each vertex from the first one
        widest: float  # the largest of the radii
        count: int

That is all there is to say of a table. Both sides use its names::

    @kernel
    def length(curve: CurveTable) -> float:
        return curve.along[curve.count - 1]

    curve = packed(CurveTable, along=distances, widest=0.2, count=3)  # see kernels/tables/memory.py
    curve.along[2], curve.count

In memory a table is a row of words of 8 bytes, one a field in the order of the class: a whole number, a float64, the
address of an array, the address of another table, or that of an array of addresses of tables. A kernel is given the
address of a table and knows its class by the annotation of its argument (:mod:`rrtik_ompl.kernels.simd.records`), so
that a field is one load or store with a constant offset, and an element of an array one more. There are no bounds
checks: whoever packs guarantees every index.
A class that inherits from another table has its fields first; a kernel that reads no others serves all that inherit.

In Python an object of the class owns the memory. Its numbers are read and written in place, its arrays are those of
numpy whose addresses the table holds, and its tables are objects like itself; all live as long as it does. The pages
that plan take the same names, and move what points by the kinds of the fields (:mod:`rrtik_ompl.kernels.wasm.image`).

This module imports no library but numpy, so that packing needs no compiler.
"""

from __future__ import annotations

from typing import Any, ClassVar, get_type_hints

import numpy as np

WORD = 8  # bytes of a field


class View(np.ndarray[Any, np.dtype[Any]]):
    """What a field that is an array is annotated as: an array in Python, an address with known elements in kernels.

    Subclasses tell what the numbers are about, for readers and the type checker; to a kernel their ``scalar`` is all.
    """

    scalar: ClassVar[str]


class Doubles(View):
    """Numbers of 64 bits."""

    scalar = "float64"


class Floats(View):
    """Numbers of 32 bits, in lanes or one by one."""

    scalar = "float32"


class Ints(View):
    """Whole numbers of 32 bits."""

    scalar = "int32"


class Wholes(View):
    """Whole numbers of 64 bits, or addresses."""

    scalar = "int64"


class Tables(View):
    """Addresses of tables. In Python the field is these tables, and the table that has it keeps them."""

    scalar = "int64"


class Record:
    """A table in memory; see the module.

    Attributes:
        kinds: The annotation of each field by its name, in the order of the fields.
        places: Number of each field by its name.
        memory: What :mod:`rrtik_ompl.kernels.tables.memory` has made.
        address: Of the table, for kernels.

    Args:
        memory: Fields and arrays of this table.
    """

    kinds: ClassVar[dict[str, Any]]
    places: ClassVar[dict[str, int]]

    def __init_subclass__(cls) -> None:
        hints = get_type_hints(cls)
        inherited = getattr(cls.__base__, "kinds", {})  # none of Record itself
        cls.kinds = inherited | {name: hints[name] for name in cls.__annotations__}
        cls.places = {name: place for place, name in enumerate(cls.kinds)}
        for name, place in cls.places.items():
            setattr(cls, name, _member(cls.kinds[name], place))

    def __init__(self, memory: Any) -> None:
        self.memory = memory
        self.address: int = memory.address
        self._wholes = memoryview(memory.header)  # numpy takes ten times as long for one number
        self._doubles = self._wholes.cast("B").cast("d")
        self.tables: dict[int, Any] = {}  # those whose addresses it holds, by their places

    def put(self, **fields: Any) -> None:
        """Set fields: numbers, tables, and arrays, which are not copied but take the place of those before."""
        for name, value in fields.items():
            if name not in self.kinds:
                raise AttributeError(f"{type(self).__name__} has no field {name}")
            setattr(self, name, value)

    def intact(self) -> bool:
        """Whether no kernel has written beyond an array of this table or its fields."""
        return bool(self.memory.intact())


def holds_array(kind: Any) -> bool:
    """Whether a field of this kind is the address of an array."""
    return isinstance(kind, type) and issubclass(kind, View)


def holds_table(kind: Any) -> bool:
    """Whether a field of this kind is the address of another table."""
    return isinstance(kind, type) and issubclass(kind, Record)


def holds_tables(kind: Any) -> bool:
    """Whether a field of this kind is the address of an array of addresses of tables."""
    return isinstance(kind, type) and issubclass(kind, Tables)


def word(kind: Any, number: float) -> int:
    """A number as the whole number that stands in a field of this kind."""
    return int(np.float64(number).view(np.int64)) if kind is float else int(number)


def _member(kind: Any, place: int) -> property:
    """The field in Python."""
    if holds_tables(kind):
        return _tables(place)
    if holds_array(kind):
        return _array(place)
    if holds_table(kind):
        return _table(place)
    return _double(place) if kind is float else _whole(place)


def _whole(place: int) -> property:
    def read(record: Record) -> int:
        return record._wholes[place]

    def write(record: Record, number: int) -> None:
        record._wholes[place] = number

    return property(read, write)


def _double(place: int) -> property:
    def read(record: Record) -> float:
        return record._doubles[place]

    def write(record: Record, number: float) -> None:
        record._doubles[place] = number

    return property(read, write)


def _array(place: int) -> property:
    def read(record: Record) -> Any:
        return record.memory[place]

    def write(record: Record, array: Any) -> None:
        record.memory.arrays[place] = array
        record._wholes[place] = array.ctypes.data

    return property(read, write)


def _tables(place: int) -> property:
    def read(record: Record) -> Any:
        return record.tables.get(place, ())

    return property(read)


def _table(place: int) -> property:
    """None for no table, whose address is 0."""

    def read(record: Record) -> Any:
        return record.tables.get(place)

    def write(record: Record, table: Any) -> None:
        record.tables[place] = table
        record._wholes[place] = 0 if table is None else table.address

    return property(read, write)
