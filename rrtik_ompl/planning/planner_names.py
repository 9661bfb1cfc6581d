"""Planners by name: ours, those of other packages, OMPL's."""

from __future__ import annotations

from rrtik_ompl import catalog
from rrtik_ompl.errors import UnknownNameError
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, ompl_planners

_OMPL_PREFIX, _MOVEIT_SUFFIX = "geometric::", "kConfigDefault"  # as in ompl_planning.yaml


def list_planners() -> tuple[str, ...]:
    """Names of all planners: ours and those of other packages in lower case, OMPL's as OMPL writes them."""
    return (*catalog.list_planners(), *sorted(ompl_planners()))


def find_planner(name: str) -> PlannerFactory:
    """The planner class of a name, in upper or lower case; MoveIt's way of writing OMPL's names is understood too.

    Raises:
        UnknownNameError: If there is none; carries all names.
    """
    bare = name.removeprefix(_OMPL_PREFIX).removesuffix(_MOVEIT_SUFFIX).lower()
    wheel = {key.lower(): value for key, value in ompl_planners().items()}
    if bare in wheel:
        found: PlannerFactory = wheel[bare]
        return found
    if bare in catalog.list_planners():
        return catalog.find_planner(bare)  # type: ignore[no-any-return]
    raise UnknownNameError("planner", name, list_planners())
