"""Helpers of value classes: changed and pickled copies, copies for other threads, lazy values, short texts."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
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
MOST_SHOWN = 8  # largest number of numbers or items that are shown in one line
MOST_CHANGES = 32  # number of changes after which all items are copied
LONGEST_TEXT = 100  # largest number of letters of an item in one line


def itself(thing: Thing, memo: object) -> Thing:
    """Return the object itself, as ``__deepcopy__`` of immutable classes."""
    del memo
    return thing


class Once(Generic[Kind]):
    """The result of a function that is called on first use; cheaper to create than ``functools.cache``.

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
        """Return the result; the function is called if this is the first time."""
        if not hasattr(self, "_made"):
            self._made = self._make(*self._given)
        return self._made


class Items(Sequence[Kind]):
    """A sequence in which single items are replaced at a cost that does not depend on its length.

    Args:
        items: All items.
        changes: Replacements of single items, by their indices.

    Example:
        >>> tuple(Items((1, 2, 3)).with_(1, 5))
        (1, 5, 3)
    """

    def __init__(self, items: tuple[Kind, ...], changes: Mapping[int, Kind] = MappingProxyType({})) -> None:
        self._items = items
        self._changes = changes

    @property
    def as_tuple(self) -> tuple[Kind, ...]:
        """All items."""
        if self._changes:
            every = list(self._items)
            for number, item in self._changes.items():
                every[number] = item
            self._items = tuple(every)
            self._changes = {}
        return self._items

    def with_(self, number: int, item: Kind) -> Items[Kind]:
        """Return the same items with one replaced."""
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
    """Pickle a frozen dataclass, or any object without slots, by its fields, as its ``__reduce__``.

    Read-only arrays and mappings stay read-only in deep copies and when unpickled.

    Example:
        >>> @dataclass(frozen=True, slots=True)
        ... class Point:
        ...     place: Vector
        ...     __reduce__ = as_value
    """
    names = [field.name for field in fields(thing)] if is_dataclass(thing) else list(vars(thing))
    return restored, (type(thing), {name: packed(getattr(thing, name)) for name in names})


def restored(kind: type[Thing], state: dict[str, Any]) -> Thing:
    """Create an object from its fields, the inverse of :func:`as_value`, without validation.

    This is the only function that creates values without their constructors.
    """
    return _made(kind, {name: unpacked(value) for name, value in state.items()})


def _made(kind: type[Thing], values: Mapping[str, object]) -> Thing:
    thing = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(thing, name, value)
    return thing


def set_fields(thing: object, **values: object) -> None:
    """Set fields of a frozen dataclass, in its constructor."""
    for name, value in values.items():
        object.__setattr__(thing, name, value)


def changed(thing: Thing, **values: object) -> Thing:
    """Return a frozen dataclass with some fields replaced, without validation, unlike ``dataclasses.replace``.

    Example:
        >>> @dataclass(frozen=True, slots=True)
        ... class Point:
        ...     place: Vector
        ...     name: str = ""
        >>> changed(Point(np.zeros(2)), name="origin")
        Point(place=array([0., 0.]), name='origin')
    """
    same = {name: getattr(thing, name) for name in _field_names(type(thing))}  # type: ignore[arg-type]
    return _made(type(thing), same | values)


@cache
def _field_names(kind: type) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass, which takes as long as to copy it."""
    return tuple([each.name for each in fields(kind)])


class _ReadOnlyArray(NamedTuple):
    values: NDArray[Any]


class _ReadOnlyMapping(NamedTuple):
    values: dict[Any, Any]


def packed(value: object) -> object:
    """Mark values that pickle cannot store, or would make writable: read-only mappings and arrays."""
    if isinstance(value, MappingProxyType):
        return _ReadOnlyMapping({key: packed(item) for key, item in value.items()})
    if isinstance(value, np.ndarray) and not value.flags.writeable:
        return _ReadOnlyArray(value)
    return value


def unpacked(value: object) -> object:
    """Restore a value that :func:`packed` has marked."""
    if isinstance(value, _ReadOnlyMapping):
        return MappingProxyType({key: unpacked(item) for key, item in value.values.items()})
    return frozen(value.values, value.values.dtype) if isinstance(value, _ReadOnlyArray) else value


def in_one_line(thing: DataclassInstance) -> str:
    """Return a dataclass in one line, as its ``__repr__``: long arrays by their shape, long tuples by their length.

    Example:
        >>> @dataclass(frozen=True, slots=True)
        ... class Points:
        ...     places: Matrix
        ...     __repr__ = in_one_line
    """
    shown = (f"{field.name}={_short(getattr(thing, field.name))}" for field in fields(thing) if field.repr)
    return f"{type(thing).__name__}({', '.join(shown)})"


def _short(value: object) -> str:
    """Return a value as a short text."""
    if isinstance(value, np.ndarray):
        if value.size > MOST_SHOWN:
            return f"<array of shape {value.shape}>"
        return np.array2string(value, precision=6, separator=", ", max_line_width=1000).replace("\n", "")

    if isinstance(value, (tuple, list)):
        kind = type(value[0]).__name__ if value else ""
        parts = [_short(each) for each in value[:MOST_SHOWN]]
        if len(value) > MOST_SHOWN or (len(value) > 1 and set(parts) == {f"<{kind}>"}):
            return f"<{len(value)} of {kind}>"
        inside = ", ".join(parts)
        return f"({inside}{',' * (len(value) == 1)})" if isinstance(value, tuple) else f"[{inside}]"

    text = repr(value)
    short = "\n" not in text and len(text) <= LONGEST_TEXT
    if short or isinstance(value, (str, int, float)):
        return text
    sized = f" of {len(value)}" if hasattr(value, "__len__") else ""
    return f"<{type(value).__name__}{sized}>"


def in_notebook(thing: object) -> str | None:
    """Return the 3-D page of a value that a notebook shows, as its ``_repr_html_``.

    The page depends on modules above this one, so it is made by a function of the package.
    """
    package: Any = sys.modules["rrtik_ompl"]
    drawn: str | None = package.html_of(thing)
    return drawn


def in_print(thing: object) -> bytes | None:
    """Return the picture of a value that a printed notebook shows, as its ``_repr_png_``; see :func:`in_notebook`."""
    package: Any = sys.modules["rrtik_ompl"]
    drawn: bytes | None = package.png_of(thing)
    return drawn


class ForThread(Protocol):
    """An object that serves one thread at a time, and can be copied for another."""

    def for_thread(self) -> object:
        """Return a copy for another thread."""


class _Cell(threading.local):
    """A thread-local value: the given one in the thread that made it, a copy in each other thread that reads it."""

    def __init__(self, value: ForThread, maker: int) -> None:
        self.value: Any = value if threading.get_ident() == maker else value.for_thread()


class ThreadOwn(Generic[Kept]):
    """An attribute of objects that several threads use: each thread reads the value set, or its own copy of it.

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
        """Return the value of the current thread; it ends with the thread."""
        return self if thing is None else vars(thing)[self._name].value

    def __set__(self, thing: object, value: Kept) -> None:
        vars(thing)[self._name] = _Cell(value, threading.get_ident())
