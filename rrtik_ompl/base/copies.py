"""Copies of objects and views of them: values with other fields, copies for other threads and processes, lines."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import frozen

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Thing = TypeVar("Thing")
Kind = TypeVar("Kind")
Kept = TypeVar("Kept", bound="ForThread")
MOST_SHOWN = 8  # numbers of an array, or items of a tuple, in one line
MOST_CHANGES = 32  # of items, until all are written anew
LONGEST_TEXT = 100  # letters of an item in one line


def itself(thing: Thing, memo: object) -> Thing:
    """What ``copy.deepcopy`` makes of an object that never changes; for ``__deepcopy__`` of its class."""
    del memo
    return thing


class Once(Generic[Kind]):
    """What a function makes, once it is asked for; cheaper to set up than ``functools.cache``.

    Example:
        >>> made = Once(list, "ab")
        >>> made() is made()
        True
    """

    __slots__ = ("_given", "_made", "_make")

    def __init__(self, make: Callable[..., Kind], *given: object) -> None:
        self._make = make
        self._given = given

    def __call__(self) -> Kind:
        """What the function has made; it is called if nobody has asked before."""
        if not hasattr(self, "_made"):
            self._made = self._make(*self._given)
        return self._made


class Items(Sequence[Kind]):
    """Items of which single ones are exchanged; what that costs does not grow with their number.

    Args:
        items: All of them.
        changes: Others in the place of some, by their numbers.

    Example:
        >>> tuple(Items((1, 2, 3)).with_(1, 5))
        (1, 5, 3)
    """

    def __init__(self, items: tuple[Kind, ...], changes: Mapping[int, Kind] = MappingProxyType({})) -> None:
        self._items = items
        self._changes = changes

    @property
    def as_tuple(self) -> tuple[Kind, ...]:
        """All of them."""
        if self._changes:
            every = list(self._items)
            for number, item in self._changes.items():
                every[number] = item
            self._items = tuple(every)
            self._changes = {}
        return self._items

    def with_(self, number: int, item: Kind) -> Items[Kind]:
        """Return the same items but for one."""
        known = self._items if len(self._changes) < MOST_CHANGES else self.as_tuple
        return Items(known, {**self._changes, number: item})

    @overload
    def __getitem__(self, number: int) -> Kind: ...
    @overload
    def __getitem__(self, number: slice) -> tuple[Kind, ...]: ...
    def __getitem__(self, number: int | slice) -> Kind | tuple[Kind, ...]:
        if isinstance(number, slice):
            return self.as_tuple[number]
        return self._changes[number] if number in self._changes else self._items[number]

    def __len__(self) -> int:
        return len(self._items)

    def __iter__(self) -> Iterator[Kind]:
        return iter(self.as_tuple)


def as_value(thing: object) -> tuple[Any, ...]:
    """``__reduce__`` of a frozen dataclass, or of any object without slots.

    What is read-only in it stays so in a deep copy and when unpickled.

    Example:
        >>> @dataclass(frozen=True, slots=True)
        ... class Point:
        ...     place: Vector
        ...     __reduce__ = as_value
    """
    names = [field.name for field in fields(thing)] if is_dataclass(thing) else list(vars(thing))
    return restored, (type(thing), {name: packed(getattr(thing, name)) for name in names})


def restored(kind: type[Thing], state: dict[str, Any]) -> Thing:
    """Return the object that :func:`as_value` took apart; nothing is checked again.

    This is the only place where a value is made without its constructor.
    """
    thing = object.__new__(kind)
    for name, value in state.items():
        object.__setattr__(thing, name, unpacked(value))
    return thing


def changed(thing: Thing, **values: object) -> Thing:
    """A frozen dataclass with other values in some of its fields; unlike ``dataclasses.replace`` it checks nothing.

    Example:
        >>> @dataclass(frozen=True, slots=True)
        ... class Point:
        ...     place: Vector
        ...     name: str = ""
        >>> changed(Point(np.zeros(2)), name="origin")
        Point(place=array([0., 0.]), name='origin')
    """
    same = {each.name: getattr(thing, each.name) for each in fields(thing)}  # type: ignore[arg-type]
    return restored(type(thing), same | values)


class _ReadOnlyArray(NamedTuple):
    values: NDArray[Any]


class _ReadOnlyMapping(NamedTuple):
    values: dict[Any, Any]


def packed(value: object) -> object:
    """Return a value in which what pickle cannot take, or would make writable, is marked."""
    if isinstance(value, MappingProxyType):
        return _ReadOnlyMapping({key: packed(item) for key, item in value.items()})
    if isinstance(value, np.ndarray) and not value.flags.writeable:
        return _ReadOnlyArray(value)
    return value


def unpacked(value: object) -> object:
    """Return the value that :func:`packed` marked."""
    if isinstance(value, _ReadOnlyMapping):
        return MappingProxyType({key: unpacked(item) for key, item in value.values.items()})
    return frozen(value.values, value.values.dtype) if isinstance(value, _ReadOnlyArray) else value


def in_one_line(thing: DataclassInstance) -> str:
    """``__repr__`` of a dataclass: long arrays by their shape, long tuples by their number of items.

    Example:
        >>> @dataclass(frozen=True, slots=True)
        ... class Points:
        ...     places: Matrix
        ...     __repr__ = in_one_line
    """
    shown = (f"{field.name}={_short(getattr(thing, field.name))}" for field in fields(thing) if field.repr)
    return f"{type(thing).__name__}({', '.join(shown)})"


def _short(value: object) -> str:
    """Return a value in some ten words."""
    if isinstance(value, np.ndarray):
        if value.size > MOST_SHOWN:
            return f"<array of shape {value.shape}>"
        return np.array2string(value, precision=6, separator=", ", max_line_width=1000).replace("\n", "")

    if isinstance(value, (tuple, list)):
        if len(value) > MOST_SHOWN:
            return f"<{len(value)} of {type(value[0]).__name__}>"
        inside = ", ".join(map(_short, value))
        return f"({inside}{',' * (len(value) == 1)})" if isinstance(value, tuple) else f"[{inside}]"

    text = repr(value)
    short = "\n" not in text and len(text) <= LONGEST_TEXT
    if short or isinstance(value, (str, int, float)):
        return text
    sized = f" of {len(value)}" if hasattr(value, "__len__") else ""
    return f"<{type(value).__name__}{sized}>"


def in_notebook(thing: object) -> str | None:
    """``_repr_html_`` of what a notebook shows as a 3-D page.

    The page stands above all values; the package itself knows where.
    """
    package: Any = sys.modules["rrtik_ompl"]
    drawn: str | None = package.html_of(thing)
    return drawn


class ForThread(Protocol):
    """What is not for two threads at a time, but can be had again."""

    def for_thread(self) -> object:
        """Return the same for another thread."""


class _Cell(threading.local):
    """A value of the thread that has made it, and what other threads have in its place once they ask."""

    def __init__(self, value: ForThread, maker: int) -> None:
        self.value: Any = value if threading.get_ident() == maker else value.for_thread()


class ThreadOwn(Generic[Kept]):
    """An attribute of what several threads may use: the value that was set, or in other threads its like for them.

    Example:
        >>> class World:
        ...     checks: ThreadOwn[Checks] = ThreadOwn()
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, thing: None, kind: type) -> ThreadOwn[Kept]: ...
    @overload
    def __get__(self, thing: object, kind: type) -> Kept: ...
    def __get__(self, thing: object, kind: type) -> object:
        """Return the value of this thread; it ends with the thread."""
        return self if thing is None else vars(thing)[self._name].value

    def __set__(self, thing: object, value: Kept) -> None:
        vars(thing)[self._name] = _Cell(value, threading.get_ident())
