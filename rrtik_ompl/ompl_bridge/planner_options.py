"""Options of planners: their names, and the construction of planners with them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Any, TypeGuard

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.description.joint_weights import weights_as_costs
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner, keyword_parameters
from rrtik_ompl.world.problem import Problem


def is_safe(factory: PlannerFactory) -> TypeGuard[type[SafePlanner]]:
    """Check whether a planner is a class derived from SafePlanner."""
    return isinstance(factory, type) and issubclass(factory, SafePlanner)


@lru_cache(maxsize=64)
def planner_options(factory: PlannerFactory) -> tuple[str, ...]:
    """Return the sorted names of the options of a planner; those of OMPL's planners in snake case."""
    if is_safe(factory):
        return tuple(sorted(factory.default_options()))
    setters = {s for s in dir(factory) if s.startswith("set") and not hasattr(ob.Planner, s)}
    return tuple(sorted(map(_snake, setters)))


def check_options(factory: PlannerFactory, name: str, keys: Iterable[str]) -> None:
    """Raise an error if a planner does not have one of the given options.

    Raises:
        UnknownNameError: It carries the name of the option.
    """
    options = planner_options(factory)
    for key in keys:
        if key not in options:
            raise UnknownNameError(f"parameter of planner {name}", key, options)


def _snake(setter: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", setter.removeprefix("set")).lower()


def safe_planner(
    factory: type[SafePlanner],
    name: str,
    si: ob.SpaceInformation,
    problem: Problem,
    seed: int,
    options: Mapping[str, Any],
) -> SafePlanner:
    """Make a planner derived from SafePlanner for a problem.

    Raises:
        UnknownNameError: If it has no option of that name.
        InputError: If it refuses an option.
    """
    if options:
        check_options(factory, name, options)

    taken = keyword_parameters(factory)
    goal: dict[str, Any] = {"goal": problem.goal} if "goal" in taken else {}
    if "joint_costs" in taken:
        options = weights_as_costs(problem.robot) | dict(options)

    try:
        return factory(si, world=problem.world, seed=seed, **goal, **options)
    except TypeError as error:
        raise InputError(f"planner {name}: {error}") from None


def other_planner(
    factory: PlannerFactory,
    name: str,
    si: ob.SpaceInformation,
    definition: ob.ProblemDefinition,
    options: Mapping[str, Any],
) -> ob.Planner:
    """Make a planner of OMPL or a third-party one, whose options are set by setters: ``goal_bias`` by ``setGoalBias``.

    Args:
        factory: Makes the planner.
        name: Name of the planner in messages.
        si: Its SpaceInformation.
        definition: The problem; only needed to destroy a planner safely that refuses an option.
        options: Options by name.

    Raises:
        UnknownNameError: If it has no option of that name.
        InputError: If it cannot be made, or refuses an option.
    """
    try:
        planner = factory(si)
    except TypeError as error:
        raise InputError(f"planner {name}: {_why_not_made(factory, error)}") from None

    require(planner, ob.Planner, f"what planner '{name}' makes of a SpaceInformation")
    try:
        for key, value in options.items():
            check_options(type(planner), name, (key,))
            _set(planner, name, key, value)
    except InputError:
        planner.setProblemDefinition(definition)  # AORRTC ends the process if it is destroyed before it was set up
        with suppress(RuntimeError):  # setup may raise, too
            planner.setup()
        raise

    return planner


def _why_not_made(factory: PlannerFactory, error: TypeError) -> str:
    """Return why a planner cannot be made from a SpaceInformation, in one line."""
    if ".control" in str(getattr(factory, "__module__", "")):
        return "it plans with controls, which the configurations of an arm have none of; use one of ompl.geometric"
    return f"it cannot be made from an ompl.base.SpaceInformation: {str(error).splitlines()[0]}"


def _set(planner: ob.Planner, name: str, key: str, value: object) -> None:
    """Calls the setter of an option, and turns the errors of the bindings into an InputError."""
    setter = next(s for s in dir(planner) if s.startswith("set") and _snake(s) == key)
    if isinstance(value, float):
        finite_array(value, (), f"planner {name}: parameter {key}")

    try:
        getattr(planner, setter)(value)
    except TypeError:
        raise InputError(f"planner {name}: parameter {key} cannot be {value!r}") from None
    except (RuntimeError, ValueError, OverflowError) as error:  # raised by C++ for a number out of range
        raise InputError(f"planner {name}: parameter {key} cannot be {value!r}: {error}") from None
