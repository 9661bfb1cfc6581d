"""Copies of objects: variants of them that share all but a few attributes, and copies for other processes."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import frozen

Thing = TypeVar("Thing")


def shallow_copy(thing: Thing) -> Thing:
    """What ``copy.copy`` makes of an object without slots, in a tenth of the time; for ``__copy__`` of its class.

    Example:
        >>> class Box:
        ...     __copy__ = shallow_copy
    """
    other: Thing = object.__new__(type(thing))
    vars(other).update(vars(thing))
    return other


def itself(thing: Thing, memo: object) -> Thing:
    """What ``copy.deepcopy`` makes of an object that never changes; for ``__deepcopy__`` of its class."""
    del memo
    return thing


class _ReadOnlyArray(NamedTuple):
    values: NDArray[Any]


class _ReadOnlyMapping(NamedTuple):
    values: dict[Any, Any]


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
    """The object that :func:`as_value` took apart; nothing is checked again."""
    thing = object.__new__(kind)
    for name, value in state.items():
        object.__setattr__(thing, name, unpacked(value))
    return thing


def packed(value: object) -> object:
    """A value in which what pickle cannot take, or would make writable, is marked."""
    if isinstance(value, MappingProxyType):
        return _ReadOnlyMapping({key: packed(item) for key, item in value.items()})
    if isinstance(value, np.ndarray) and not value.flags.writeable:
        return _ReadOnlyArray(value)
    return value


def unpacked(value: object) -> object:
    """The value that :func:`packed` marked."""
    if isinstance(value, _ReadOnlyMapping):
        return MappingProxyType({key: unpacked(item) for key, item in value.values.items()})
    return frozen(value.values, value.values.dtype) if isinstance(value, _ReadOnlyArray) else value
