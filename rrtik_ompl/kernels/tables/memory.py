"""Memory that Python makes and kernels work on: tables of fields, and the arrays whose addresses the fields hold.

There are two ways for whoever needs a table. :func:`packed` makes one that lives long, array by array; an array can be
replaced by a larger one that :func:`aligned` makes. :func:`planned` is for a table that every call makes anew: all its
arrays lie in a single piece, for numpy takes as long to give the address of an array as a small kernel runs. What a
table holds is declared in its class, a :class:`rrtik_ompl.kernels.record.Record`.

Kernels check no bounds. Therefore every array lies between guard words, at least ``ALIGNMENT`` bytes of a pattern
before and behind it (in a single piece behind it and behind the fields), and ``intact()`` says whether they are as they
were. Tests check it after each kernel.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.kernels.layout import ALIGNMENT
from rrtik_ompl.kernels.record import WORD, Record, holds_array, holds_tables, word
from rrtik_ompl.kernels.simd.processor import WIDTH

Header: TypeAlias = NDArray[np.int64]
R = TypeVar("R", bound=Record)

GUARD = 0xA5  # each byte of the guard words
GUARD_WORDS = ALIGNMENT // WORD
GUARD_WORD = float(np.full(WORD, GUARD, dtype=np.uint8).view(np.float64)[0])
COPIED_WORDS = 4096  # up to so many it is quicker to copy a whole piece than to set its guard words


def aligned(array: NDArray[Any]) -> NDArray[Any]:
    """A flat copy that starts on a multiple of ``ALIGNMENT`` bytes, between guard words; even an empty one does."""
    return _placed(array)[0]


def _placed(array: NDArray[Any], *, blank: bool = False) -> tuple[NDArray[Any], int]:
    """What :func:`aligned` makes, and its address, which numpy takes long to give; ``blank``: zeros in its place.

    The system gives zeros when a page is first used, so that large ones that are hardly used cost nothing.
    """
    memory = (np.zeros if blank else np.empty)(array.nbytes + 3 * ALIGNMENT, dtype=np.uint8)
    begin = int(memory.ctypes.data)
    start = ALIGNMENT + -begin % ALIGNMENT
    memory[:start] = memory[start + array.nbytes :] = GUARD
    copy: NDArray[Any] = np.ndarray(array.size, array.dtype, memory, start)
    if not blank:
        copy[:] = array.ravel()

    return copy, begin + start


def is_intact(array: NDArray[Any]) -> bool:
    """Whether the guard words around an array that :func:`aligned` or :func:`table` has made are as they were."""
    memory: Any = array.base
    start = int(array.ctypes.data) - int(memory.ctypes.data)
    end = start + array.nbytes
    is_alone = memory.nbytes == array.nbytes + 3 * ALIGNMENT
    first = 0 if is_alone else start - ALIGNMENT
    following = memory.nbytes if is_alone else end + ALIGNMENT + -array.nbytes % ALIGNMENT
    return bool((memory[first:start] == GUARD).all() and (memory[end:following] == GUARD).all())


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Fields for the kernels, where they are, and the arrays whose addresses they hold, all by their places."""

    header: Header
    arrays: dict[int, NDArray[Any]]
    address: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "address", int(self.header.ctypes.data))

    def __getitem__(self, place: int) -> NDArray[Any]:
        return self.arrays[place]

    def intact(self) -> bool:
        """Whether nothing has been written beyond an array or the fields."""
        return all(is_intact(array) for array in (self.header, *self.arrays.values()))


def table(fields: Mapping[int, int | NDArray[Any]]) -> Table:
    """The memory of a table that lives long, from its fields; every place from 0 up has one: a number or an array.

    Arrays are copied, flat, begin on a multiple of ``ALIGNMENT`` bytes and stay where they are as long as it lives.
    """
    given = {place: value for place, value in fields.items() if isinstance(value, np.ndarray)}
    header = np.array([0 if place in given else fields[place] for place in range(len(fields))], dtype=np.int64)
    values = [*given.values(), header]

    # All of them lie in one piece, with guard words around each.
    memory = np.empty(sum(value.nbytes + 2 * ALIGNMENT for value in values) + 2 * ALIGNMENT, dtype=np.uint8)
    begin = int(memory.ctypes.data)
    start = ALIGNMENT + -begin % ALIGNMENT
    memory[:start] = GUARD
    copies: list[NDArray[Any]] = []
    addresses = []
    for value in values:
        end = start + value.nbytes
        following = end + ALIGNMENT + -value.nbytes % ALIGNMENT
        memory[end:following] = GUARD
        copy: NDArray[Any] = np.ndarray(value.size, value.dtype, memory, start)
        copy[:] = value.ravel()
        copies.append(copy)
        addresses.append(begin + start)
        start = following

    copies[-1][list(given)] = addresses[:-1]
    return Table(copies[-1], dict(zip(given, copies[:-1], strict=True)))


def packed(kind: type[R], **fields: Any) -> R:
    """A table that lives long, from its fields by name: numbers, arrays to copy, other tables, and lists of tables.

    Numbers that are not given are 0, and so are the addresses of arrays and tables that are not there yet.
    """
    placed: dict[int, Any] = dict.fromkeys(range(len(kind.places)), 0)
    others = {}
    lists = {}

    for name, value in fields.items():
        place = kind.places[name]
        if isinstance(value, np.ndarray):
            placed[place] = value
        elif holds_tables(kind.kinds[name]):
            placed[place] = np.array([each.address for each in value], dtype=np.int64)
            lists[place] = tuple(value)
        else:
            others[name] = value

    made = kind(table(placed))
    made.tables |= lists
    made.put(**others)
    return made


def sizes_of(kind: type[Record], **fields: float) -> TablePlan:
    """Where the arrays of a table of this class lie in a single piece; ``kind(PlannedTable(plan))`` is such a table.

    Args:
        kind: The class.
        fields: How many words of 8 bytes each array has, by its name, in the order in which they lie in memory, and
            the numbers that are not 0.
    """
    arrays = [name for name in fields if holds_array(kind.kinds[name])]
    numbers = {
        kind.places[name]: word(kind.kinds[name], fields.get(name, 0)) for name in kind.places if name not in arrays
    }
    return TablePlan({kind.places[name]: int(fields[name]) for name in arrays}, numbers)


def with_own_arrays(shared: R, blank: Iterable[str] = (), **own: NDArray[Any]) -> R:
    """A table of the same fields for another thread: its arrays and tables are shared, but for copies of ``own``.

    Of the arrays named in ``blank`` it has its own, too, in which there are zeros.
    """
    placed = {shared.places[name]: _placed(getattr(shared, name), blank=True) for name in blank}
    placed |= {shared.places[name]: _placed(array) for name, array in own.items()}
    header = aligned(shared.memory.header)
    for place, (_, address) in placed.items():
        header[place] = address

    made = type(shared)(Table(header, shared.memory.arrays | {place: array for place, (array, _) in placed.items()}))
    made.tables |= shared.tables
    return made


def record(size: int, numbers: Mapping[int, float | NDArray[Any]]) -> NDArray[np.float64]:
    """A record of ``size`` numbers, each number or run of numbers by its place; the others are 0."""
    made = np.zeros(size)
    for place, value in numbers.items():
        if isinstance(value, np.ndarray):
            made[place : place + len(value)] = value
        else:
            made[place] = value

    return made


def whole_records(size: int, rows: Sequence[Mapping[int, int]]) -> NDArray[np.int32]:
    """Records of ``size`` whole numbers by their places, shape (len(rows), size)."""
    return np.array([[row[place] for place in range(size)] for row in rows], dtype=np.int32).reshape(-1, size)


class TablePlan:
    """Where the arrays of a table lie in a single piece of memory, for all tables of the same sizes.

    Args:
        arrays: How many words of 8 bytes each has, by the place of its address among the fields. They lie one after
            the other, the first on a multiple of ``ALIGNMENT`` bytes; guard words of as many bytes lie between them.
            One of no words has the address 0.
        numbers: The other fields.

    Attributes:
        spans: The words of each array.
        words: Of all, the fields and their guard words at the end.
        start, stop: The first word of the fields, and the one after the last.
        fields: Numbers, and how far arrays are from the first one in bytes.
        pointing: 1 for each field that is the address of an array, else 0.
        guards: Numbers of the guard words.
        blank: The whole piece with its guards and fields if it is short, else None.
    """

    def __init__(self, arrays: Mapping[int, int], numbers: Mapping[int, int]) -> None:
        self.spans: dict[int, slice] = {}
        self.fields, self.pointing = np.zeros((2, len(arrays) + len(numbers)), dtype=np.int64)
        guards = []
        end = 0

        for place, size in arrays.items():
            self.spans[place] = slice(end, end + size)
            if size:
                self.fields[place] = WORD * end
                self.pointing[place] = 1
                end += size + GUARD_WORDS
                guards.append(np.arange(end - GUARD_WORDS, end))

        for place, number in numbers.items():
            self.fields[place] = number
        self.start = end
        self.stop = end + len(self.fields)
        self.words = self.stop + GUARD_WORDS
        self.guards = np.concatenate([*guards, np.arange(self.stop, self.words)])
        self.blank: NDArray[np.float64] | None = None

        if self.words <= COPIED_WORDS:
            self.blank = np.zeros(self.words)
            self.blank[self.guards] = GUARD_WORD
            self.blank[self.start : self.stop].view(np.int64)[:] = self.fields


class PlannedTable:
    """The fields of a table and its arrays. Each call of a kernel has its own, so that threads do not meet.

    Attributes:
        header: The fields as the kernel reads them.
        address: Where they are.
    """

    def __init__(self, plan: TablePlan) -> None:
        whole = np.empty(GUARD_WORDS + plan.words)
        begin = int(whole.ctypes.data)
        unaligned = -begin % ALIGNMENT
        first = unaligned // WORD
        self._plan = plan
        self._words = whole[first : first + plan.words]
        self.header: Header = self._words[plan.start : plan.stop].view(np.int64)

        if plan.blank is not None:
            self._words[:] = plan.blank
        else:
            self._words[:] = 0.0  # what has been there must not matter
            self._words[plan.guards] = GUARD_WORD
            self.header[:] = plan.fields

        self.header += plan.pointing * (begin + unaligned)
        self.address = begin + unaligned + WORD * plan.start

    def __getitem__(self, place: int) -> NDArray[Any]:
        """One of the arrays, its words as float64; 0 at first."""
        return self._words[self._plan.spans[place]]

    @property
    def arrays(self) -> Mapping[int, NDArray[Any]]:
        """The arrays that have words, by the places of their addresses; no other array can take their places."""
        return MappingProxyType({place: self[place] for place in self._plan.spans if self._plan.pointing[place]})

    def intact(self) -> bool:
        """Whether nothing has been written beyond an array or the fields."""
        return bool((self._words[self._plan.guards] == GUARD_WORD).all())


def whole_lanes(row: NDArray[Any]) -> NDArray[Any]:
    """A row with zeros behind it, so that kernels can read it ``WIDTH`` numbers at a time."""
    return np.append(row, np.zeros(-len(row) % WIDTH, dtype=row.dtype))
