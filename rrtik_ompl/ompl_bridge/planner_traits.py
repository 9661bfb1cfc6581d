"""What `plan()` has to know of a planner: traits of its class; and the table of the traits of OMPL's own planners.

A class of anybody states its traits as attributes of these names (:class:`~rrtik_ompl.ompl_bridge.SafePlanner` lists
them with their defaults). Nothing else in the library knows a planner by its name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TypeAlias

from ompl import base as ob
from ompl import geometric as og

PlannerFactory: TypeAlias = Callable[..., ob.Planner]  # a planner's class, or what makes one from a SpaceInformation


@dataclass(frozen=True, slots=True)
class PlannerTraits:
    """Traits of a planner's class.

    Attributes:
        anytime: It goes on improving its path until the time is up. An optimal path touches what it goes round, so its
            motions are checked as densely as by the second check.
        one_goal: It gets the first goal configuration alone.
        finds_goals: A goal of the tip, given as the option ``goal``, is enough for it.
        straight_first: The straight motion to the nearest goal is tried before it.
        has_graph: Its trees can be counted afterwards.
        supports_iteration_limit: A short attempt, ended by a number of iterations (the option ``max_iterations`` of a
            SafePlanner) or of checked motions (any other), can be of use.
        path_statistics: Names of its statistics that describe the path, not the work: they are not added up.
        kernels: Names of the kernel libraries that it may use.
    """

    anytime: bool = False
    one_goal: bool = False
    finds_goals: bool = False
    straight_first: bool = False
    has_graph: bool = True
    supports_iteration_limit: bool = True
    path_statistics: tuple[str, ...] = ()
    kernels: tuple[str, ...] = ()


ANYTIME = PlannerTraits(anytime=True, supports_iteration_limit=False)

# What is not listed has the default traits.
# - PRM and PRMstar take up further goals in a second thread. It has motions checked by Python under a lock of the
#   roadmap, for which the first thread waits while it holds Python's lock: with more than one goal they hang.
# - AORRTC [15] gives up when it is led from one goal to another: with 16 goals of a UR5 its paths were thrice as long
#   as with one. If a straight motion from the start to the goal is free it returns a path from the goal to the goal.
#   Its graph is empty.
# - SORRTstar finds a free straight motion, then draws from what could be shorter, which is nothing, and does not check
#   its time meanwhile.
# - BITstar's graph is never freed again (60 kB a run).
_LISTED = {
    "AORRTC": PlannerTraits(
        anytime=True, one_goal=True, straight_first=True, has_graph=False, supports_iteration_limit=False
    ),
    "BITstar": PlannerTraits(anytime=True, has_graph=False, supports_iteration_limit=False),
    "InformedRRTstar": ANYTIME,
    "PRM": PlannerTraits(one_goal=True),
    "PRMstar": PlannerTraits(anytime=True, one_goal=True, supports_iteration_limit=False),
    "RRTstar": ANYTIME,
    "SORRTstar": PlannerTraits(anytime=True, straight_first=True, supports_iteration_limit=False),
}


def ompl_planners() -> dict[str, type[ob.Planner]]:
    """OMPL's geometric planners of the installed wheel by their names."""
    found = {key: value for key, value in vars(og).items() if isinstance(value, type) and issubclass(value, ob.Planner)}
    return {key: value for key, value in found.items() if value is not ob.Planner}


OMPL_TRAITS = {planner: _LISTED.get(name, PlannerTraits()) for name, planner in ompl_planners().items()}


def traits_of(factory: PlannerFactory) -> PlannerTraits:
    """The traits of a planner: of OMPL's from the table, else the attributes of the class, as far as it has them."""
    if isinstance(factory, type) and factory in OMPL_TRAITS:
        return OMPL_TRAITS[factory]
    stated = {each.name: getattr(factory, each.name) for each in fields(PlannerTraits) if hasattr(factory, each.name)}
    return PlannerTraits(**stated)
