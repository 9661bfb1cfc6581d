"""The options of a planner of ours by their names: what it was made with, and how one is changed by a text."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping
from functools import lru_cache, wraps
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from rrtik_ompl.base.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from ompl import base as ob

FILLED_IN = ("world", "seed", "goal")  # options that `plan()` fills in
GIVEN = "_given"  # the attribute that keeps the arguments of a planner's constructor


def keyword_parameters(planner: Callable[..., Any]) -> Mapping[str, Any]:
    """The parameters of a planner's class but the first one, which is the space information, and their defaults."""
    return _parameters(planner)  # apart, as lru_cache asks for Hashable, which classes are not to mypy


def remembering(constructor: Callable[..., None]) -> Callable[..., None]:
    """A constructor that keeps the options it is given; of constructors that call each other the outermost does."""

    @wraps(constructor)
    def remember(self: object, *arguments: Any, **options: Any) -> None:
        self.__dict__.setdefault(GIVEN, options)
        constructor(self, *arguments, **options)

    return remember


def options_of(planner: ob.Planner) -> dict[str, Any]:
    """The options of a planner with the values in use."""
    defaults = {name: value for name, value in keyword_parameters(type(planner)).items() if name not in FILLED_IN}
    given = planner.__dict__.get(GIVEN, {})
    return {name: given.get(name, value) for name, value in defaults.items()}


def change(planner: ob.Planner, name: str, value: object) -> None:
    """Change an option of a planner, as its constructor would take it; a text is read as JSON where it is that.

    Raises:
        UnknownNameError: If there is no option of that name.
        InputError: If the planner refuses the value; it is as it was then.
    """
    options = options_of(planner)
    if name not in options:
        raise UnknownNameError(f"parameter of planner {planner.getName()}", name, tuple(options))

    given = {**planner.__dict__[GIVEN], name: _read(value)}
    try:
        made = type(planner)(planner.getSpaceInformation(), **{**given, "seed": planner.seed})
    except TypeError as error:
        raise InputError(f"planner {planner.getName()}: {name}: {error}") from None

    # All that depends on options, but neither how far its numbers are drawn nor what hangs on its space.
    settings = {key: each for key, each in vars(made).items() if key not in ("rng", "_states")}
    planner.__dict__.update(settings)
    planner.__dict__[GIVEN] = given


def _read(value: object) -> object:
    if not isinstance(value, str):
        return value
    words = {"none": None, "true": True, "false": False}
    if value.strip().lower() in words:
        return words[value.strip().lower()]

    try:
        return json.loads(value)
    except ValueError:
        return value


@lru_cache(maxsize=64)
def _parameters(planner: Callable[..., Any]) -> Mapping[str, Any]:
    parameters = list(inspect.signature(planner).parameters.values())[1:]
    return MappingProxyType({each.name: each.default for each in parameters})
