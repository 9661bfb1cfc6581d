"""Python's ``dataclass``, made in less than half of the time: a first plan makes more than a hundred classes by it.

``dataclasses`` compiles up to eight methods a class. Here only ``__init__`` is compiled, the others are closures.
What the classes do is the same, and ``fields``, ``replace``, ``asdict`` and ``match`` know them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

_FACTORY = object()  # stands for an argument that is not given

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(kind: type | None = None, /, **options: bool) -> Any:  # noqa: ANN401 - a class, or what makes one
        """Return a class as ``dataclasses.dataclass`` does, of whose options it takes those of :func:`_made`.

        Example:
            >>> @dataclass(frozen=True, slots=True)
            ... class Ball:
            ...     radius: float
            ...     margin: float = 0.0
            >>> Ball(0.1)
            Ball(radius=0.1, margin=0.0)
        """
        if kind is None:
            return lambda later: _made(later, **options)
        return _made(kind, **options)


def _made(
    kind: type,
    *,
    frozen: bool = False,
    slots: bool = False,
    eq: bool = True,
    repr: bool = True,
    kw_only: bool = False,
) -> Any:  # noqa: ANN401 - the class with its fields
    if any(map(dataclasses.is_dataclass, kind.__mro__[1:])):  # of inherited fields there are rules of their own
        return dataclasses.dataclass(kind, frozen=frozen, slots=slots, eq=eq, repr=repr, kw_only=kw_only)

    own = dict(vars(kind))
    with_fields: Any = dataclasses.dataclass(kind, init=False, repr=False, eq=False, slots=slots, kw_only=kw_only)
    params = with_fields.__dataclass_params__
    params.frozen, params.init, params.repr, params.eq = frozen, True, repr, eq
    fields = dataclasses.fields(with_fields)

    methods: dict[str, Any] = {"__init__": _init(with_fields, fields, frozen=frozen)}
    if repr:
        methods["__repr__"] = _repr([each.name for each in fields if each.repr])
    if eq:
        methods |= _comparison([each.name for each in fields if each.compare], frozen=frozen)
    if frozen:
        methods |= _frozen(with_fields, {each.name for each in fields})
        methods |= _pickled([each.name for each in fields]) if slots else {}
    if own.get("__hash__") is None and "__eq__" in own:
        own.pop("__hash__")  # which Python has put there, not the class
    for name, method in methods.items():
        if name not in own:
            setattr(with_fields, name, method)
    return with_fields


def _init(kind: type, fields: tuple[dataclasses.Field[Any], ...], *, frozen: bool) -> Callable[..., None]:
    """Compile ``__init__``."""
    known: dict[str, Any] = {"_FACTORY": _FACTORY, "_set": object.__setattr__}
    arguments: list[str] = []
    by_name: list[str] = []
    lines: list[str] = []
    for k, each in enumerate(fields):
        name = each.name
        has_factory = each.default_factory is not dataclasses.MISSING
        has_default = each.default is not dataclasses.MISSING
        if not each.init and not has_factory and not has_default:
            continue

        known[f"_made{k}"] = each.default_factory
        known[f"_default{k}"] = each.default
        value = name if each.init else f"_made{k}()" if has_factory else f"_default{k}"
        if each.init:
            default = "=_FACTORY" if has_factory else f"=_default{k}" if has_default else ""
            (by_name if each.kw_only else arguments).append(name + default)
            if has_factory:
                value = f"_made{k}() if {name} is _FACTORY else {name}"
        lines.append(f"_set(self, '{name}', {value})" if frozen else f"self.{name} = {value}")

    if hasattr(kind, "__post_init__"):
        lines.append("self.__post_init__()")
    head = ", ".join(["self", *arguments, *(["*", *by_name] if by_name else [])])
    exec(f"def __init__({head}):\n " + "\n ".join(lines or ["pass"]), known)

    made: Any = known["__init__"]
    made.__qualname__ = f"{kind.__qualname__}.__init__"
    made.__module__ = kind.__module__
    made.__annotations__ = {each.name: each.type for each in fields if each.init} | {"return": None}
    return made  # type: ignore[no-any-return]


def _repr(names: list[str]) -> Callable[[Any], str]:
    @recursive_repr("...")
    def __repr__(self: Any) -> str:  # noqa: ANN401 - any such value; it is the method of that name
        shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__qualname__}({shown})"

    return __repr__


def _comparison(names: list[str], *, frozen: bool) -> dict[str, Any]:
    values: Callable[[Any], object] = attrgetter(*names) if names else lambda _: ()

    def __eq__(self: Any, other: object) -> bool:  # noqa: ANN401
        return values(self) == values(other) if type(other) is type(self) else NotImplemented

    def __hash__(self: Any) -> int:  # noqa: ANN401
        return hash(values(self))

    return {"__eq__": __eq__, "__hash__": __hash__ if frozen else None}


def _frozen(kind: Any, names: set[str]) -> dict[str, Any]:  # noqa: ANN401 - a class
    def __setattr__(self: Any, name: str, value: object) -> None:  # noqa: ANN401
        if type(self) is kind or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(kind, self).__setattr__(name, value)

    def __delattr__(self: Any, name: str) -> None:  # noqa: ANN401
        if type(self) is kind or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(kind, self).__delattr__(name)

    return {"__setattr__": __setattr__, "__delattr__": __delattr__}


def _pickled(names: list[str]) -> dict[str, Any]:
    """Return how a value without a dictionary is pickled, whose attributes cannot be set."""

    def __getstate__(self: Any) -> list[object]:  # noqa: ANN401
        return [getattr(self, name) for name in names]

    def __setstate__(self: Any, state: list[object]) -> None:  # noqa: ANN401
        for name, value in zip(names, state, strict=True):
            object.__setattr__(self, name, value)

    return {"__getstate__": __getstate__, "__setstate__": __setstate__}
