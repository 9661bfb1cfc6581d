"""What is made once of the same values, and shared by all that needs it while any of them lives."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary, WeakValueDictionary

Part = TypeVar("Part")

PLAIN = {str, int, float, bool, type(None)}


class Shared(Generic[Part]):
    """Parts made of values: of the same values the same part, as long as somebody holds it.

    Objects are the same if they are one; numbers and texts if they are equal; tuples if their members are the same. A
    part with a method ``for_thread`` is for one thread at a time: every other thread is given its own, made by that.

    Args:
        make: Makes a part of values.

    Example:
        >>> class Grid:
        ...     def __init__(self, cells):
        ...         self.cells = cells
        >>> grids = Shared(Grid)
        >>> first = grids.of(3)
        >>> grids.of(3) is first, grids.of(4) is first
        (True, False)
    """

    def __init__(self, make: Callable[..., Part]) -> None:
        self._make = make
        self._parts: WeakValueDictionary[Hashable, Any] = WeakValueDictionary()
        # Objects are told apart by their addresses, so they live as long as the parts that are made of them.
        self._values: WeakKeyDictionary[Any, tuple[object, ...]] = WeakKeyDictionary()

    def of(self, *values: object) -> Part:
        """Return the part of some values, made if there is none."""
        key = _key(values)
        thread = threading.get_ident()
        known: Part | None = self._parts.get((thread, key))
        if known is not None:
            return known

        found: Any = self._parts.get(key)
        if found is None:
            return self.keep(self._make(*values), *values)
        if not hasattr(found, "for_thread"):
            return found  # type: ignore[no-any-return]

        own: Part = found.for_thread()
        self._values[own] = values
        self._parts[thread, key] = own
        return own

    def keep(self, part: Part, *values: object) -> Part:
        """Take a part that somebody has made as that of some values; returns it."""
        key = _key(values)
        self._values[part] = values
        self._parts[key] = part
        self._parts[threading.get_ident(), key] = part
        return part


def _key(value: object) -> Hashable:
    """Equal for the same values."""
    kind = type(value)
    if kind is tuple:
        return tuple([_key(member) for member in value])  # type: ignore[attr-defined]
    return (kind, value) if kind in PLAIN else id(value)
