"""Objects that are made once for equal arguments and shared as long as any user keeps them alive."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from threading import RLock
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary, WeakValueDictionary

Part = TypeVar("Part")

PLAIN = {str, int, float, bool, type(None)}


class Shared(Generic[Part]):
    """A cache of objects ("parts") by the arguments they are made of; a part stays as long as somebody refers to it.

    Arguments are equal if they are the same object, equal numbers or texts, tuples of equal members, or objects whose
    attributes ``made_of`` are equal. A part with a
    method ``for_thread`` serves one thread at a time: every other thread gets its own copy, made by that method.

    Args:
        make: Makes a part from the arguments of :meth:`of`.

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
        self._pending: dict[Hashable, RLock] = {}  # what is being made
        # Objects are identified by their addresses, so they must live as long as the parts that are made of them.
        self._values: WeakKeyDictionary[Any, tuple[object, ...]] = WeakKeyDictionary()

    def of(self, *values: object) -> Part:
        """Return the part for some values for the current thread; make it if there is none."""
        key = _key(values)
        thread = threading.get_ident()
        known: Part | None = self._parts.get((thread, key))
        if known is not None:
            return known

        found: Any = self._parts.get(key)
        if found is None:
            with self._pending.setdefault(key, RLock()):
                found = self._parts.get(key)  # another thread may have made it meanwhile
                if found is None:
                    try:
                        return self.keep(self._make(*values), *values)
                    finally:
                        self._pending.pop(key, None)
        if not hasattr(found, "for_thread"):
            return found  # type: ignore[no-any-return]

        own: Part = found.for_thread()
        self._values[own] = values
        self._parts[thread, key] = own
        return own

    def keep(self, part: Part, *values: object) -> Part:
        """Store a part that was made elsewhere as the part for some values, and return it."""
        key = _key(values)
        self._values[part] = values
        self._parts[key] = part
        self._parts[threading.get_ident(), key] = part
        return part


def _key(value: object) -> Hashable:
    """Return a hashable key that is equal for equal values."""
    kind = type(value)
    if kind is tuple:
        return tuple([_key(member) for member in value])  # type: ignore[attr-defined]
    if kind in PLAIN:
        return (kind, value)
    return getattr(value, "made_of", None) or id(value)
