"""Copies of objects for variants of them that share all but a few attributes."""

from __future__ import annotations

from typing import TypeVar

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
