"""Results that live as long as the object that they were made of: robots keep what was derived from them.

A cache of a module would keep the objects alive that it has results of, and all that belongs to them. Here the object
keeps the results; once nobody else holds it, the garbage collector frees both.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from threading import RLock
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])
MOST_KEPT = 512  # results of an object; the oldest ones go then


class Keeper:
    """Base of a class whose objects keep results, which are no fields: copies have none, pickles neither."""

    __slots__ = ("__weakref__", "kept_results")

    kept_results: dict[object, Any]


class _Pending:
    """Stands for a result that a thread is making: others that want it wait."""

    __slots__ = ("lock",)

    def __init__(self) -> None:
        self.lock = RLock()


def kept_with(function: Function) -> Function:
    """Have a function's results kept by its first argument, a :class:`Keeper`; further arguments must be hashable.

    Several threads that ask for the same result make it once. Objects of other classes keep nothing.

    Example:
        >>> class Arm(Keeper):
        ...     pass
        >>> table_of = kept_with(lambda arm: [0.0])
        >>> arm = Arm()
        >>> table_of(arm) is table_of(arm), table_of(arm) is table_of(Arm())
        (True, False)
    """

    @wraps(function)
    def known(owner: Keeper, *args: object, **options: object) -> object:
        key = (function, args, tuple(options.items())) if args or options else function
        try:
            return owner.kept_results[key][0]
        except (AttributeError, KeyError, TypeError):  # there are no results, or not this one, or it is pending
            return _made(owner, key, lambda: function(owner, *args, **options))

    @wraps(function)
    def known_alone(owner: Keeper) -> object:  # half a microsecond less
        try:
            return owner.kept_results[function][0]
        except (AttributeError, KeyError, TypeError):
            return _made(owner, function, lambda: function(owner))

    return known_alone if function.__code__.co_argcount == 1 else known  # type: ignore[return-value]


def _made(owner: Keeper, key: object, make: Callable[[], object]) -> object:
    """Return a result that is made and kept now, unless another thread is quicker."""
    if not isinstance(owner, Keeper):
        return make()
    if not hasattr(owner, "kept_results"):
        object.__setattr__(owner, "kept_results", {})
    kept = owner.kept_results

    pending = kept.setdefault(key, _Pending())
    if isinstance(pending, _Pending):
        with pending.lock:
            if kept.get(key) is pending:
                kept[key] = (make(),)
    found: object = kept[key][0]
    if len(kept) > MOST_KEPT:
        del kept[next(iter(kept))]
    return found
