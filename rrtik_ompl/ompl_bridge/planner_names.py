"""Planners by name: ours, those of other packages, OMPL's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

from rrtik_ompl.base.errors import InputError, UnknownNameError, require
from rrtik_ompl.description import catalog
from rrtik_ompl.ompl_bridge.planner_files import is_planner_file, planner_of_file
from rrtik_ompl.ompl_bridge.planner_options import planner_options
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, ompl_planners

AUTO = "auto"  # a portfolio of planners, which `plan()` runs where none is named

_OMPL_PREFIX, _MOVEIT_SUFFIX = "geometric::", "kConfigDefault"  # as in ompl_planning.yaml


def list_planners() -> tuple[str, ...]:
    """Names of all planners: "auto", ours and those of other packages in lower case, OMPL's as OMPL writes them.

    Example:
        >>> rrtik.list_planners()[:3]
        ('auto', 'bicrdt', 'cbirrt')
    """
    return (AUTO, *catalog.list_planners(), *sorted(ompl_planners()))


def is_auto(name: str) -> bool:
    """Whether a name means the portfolio, which is no class.

    Raises:
        InputError: If it is no name.
    """
    require(name, str, "name of a planner", "see list_planners()")
    return name.lower() == AUTO


def refuse_options(given: Iterable[str]) -> None:
    """Refuse options of the portfolio, which takes none.

    Raises:
        InputError: If there are any.
    """
    if named := ", ".join(given):
        raise InputError(f"planner '{AUTO}' takes no options, got {named}; name the planner that they are for")


def options_of(name: str) -> tuple[str, ...]:
    """Names of the options that a planner takes; the portfolio takes none.

    Raises:
        UnknownNameError: If there is no such planner; carries all names.
    """
    return () if is_auto(name) else tuple(planner_options(find_planner(name)))


def find_planner(name: str) -> PlannerFactory:
    """The planner class of a name, in upper or lower case; MoveIt's way of writing OMPL's names is understood too.

    ``file.py:Class`` is a class in anybody's file, which is run for that.

    Raises:
        InputError: If there is no such file, or it cannot be run.
        UnknownNameError: If there is none, as of "auto"; carries all names.
    """
    if is_planner_file(name):
        return planner_of_file(name)

    bare = name.removeprefix(_OMPL_PREFIX).removesuffix(_MOVEIT_SUFFIX).lower()
    if bare in _wheel():
        return _wheel()[bare]
    if bare in catalog.list_planners():
        return catalog.find_planner(bare)
    raise UnknownNameError("planner", name, list_planners())


@cache
def _wheel() -> Mapping[str, PlannerFactory]:
    """OMPL's planners by their names in lower case."""
    return {name.lower(): planner for name, planner in ompl_planners().items()}
