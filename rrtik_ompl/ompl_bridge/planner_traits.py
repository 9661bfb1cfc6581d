"""Traits of planner classes, which `plan()` reads, and the table of the traits of OMPL's own planners.

Any class states its traits as attributes of these names (:class:`~rrtik_ompl.ompl_bridge.SafePlanner` lists them with
their defaults). No other part of the library refers to planners by name, but for
``SEARCHED_AS`` in `planning/short_path.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cache, lru_cache
from typing import Any, TypeAlias

from rrtik_ompl.description import catalog
from rrtik_ompl.ompl_bridge.bindings import ob, og

# A planner's class, or a function that makes a planner from a SpaceInformation.
PlannerFactory: TypeAlias = Callable[..., ob.Planner]


@dataclass(frozen=True, slots=True)
class PlannerTraits:
    """Traits of a planner's class.

    Attributes:
        anytime: The planner improves its path until the time is up. An optimal path touches the obstacles that it goes
            round, so its motions are checked as densely as by the second check.
        leaves_room: It keeps a clearance itself, if that does not worsen its objective; its option ``clearance`` gives
            the amount [m].
        one_goal: It gets the first goal configuration alone.
        finds_goals: It only needs a goal of the tip, given as the option ``goal``: `plan()` computes no goal
            configurations. ``needs_goals()`` of a SafePlanner says the same of a planner object, to ``solve``.
        straight_first: The straight motion to the nearest goal is tried before the planner.
        has_graph: Its trees can be counted afterwards.
        supports_iteration_limit: A short attempt can be useful that is ended by a number of iterations (the option
            ``max_iterations`` of a SafePlanner) or of checked motions (any other planner).
        path_statistics: Names of its statistics that describe the path, not the work, so that they are not added up.
        kernels: Names of the kernel libraries that it may use.
        one_joint: Its paths move one joint at a time.
        brief_options: Options with which it stops at the first good path, without improving it; empty if it has no such
            options. The pilot's routes are planned by the first ``one_joint`` planner that has some.
        proof_iterations: Its ``max_iterations`` when it has to prove that a generated problem has a solution; 0 if it
            is not used for that. The paths that it finds decide which problems a seed gives.
        keeps_constraints: It keeps the path constraints of a problem; any other planner is refused for such a problem.
        reseeded: A SafePlanner that searches like a new one after its seed was changed, so that one object serves many
            queries (:func:`rrtik_ompl.plan_many`): only ``rng`` depends on the seed.
    """

    anytime: bool = False
    leaves_room: bool = False
    one_goal: bool = False
    finds_goals: bool = False
    straight_first: bool = False
    has_graph: bool = True
    supports_iteration_limit: bool = True
    path_statistics: tuple[str, ...] = ()
    kernels: tuple[str, ...] = ()
    one_joint: bool = False
    brief_options: Mapping[str, Any] = field(default_factory=dict)
    proof_iterations: int = 0
    reseeded: bool = False
    keeps_constraints: bool = False


ANYTIME = PlannerTraits(anytime=True, supports_iteration_limit=False)

# Planners that are not listed have the default traits.
# - PRM and PRMstar collect further goals in a second thread. This thread has motions checked by Python under a lock of
#   the roadmap, for which the first thread waits while it holds Python's lock: with more than one goal they hang.
# - AORRTC [15] gives up when it is led from one goal to another: with 16 goals of a UR5 its paths were three times as
#   long as with one. If a straight motion from the start to the goal is free, it returns a path from the goal to the
#   goal. Its graph is empty.
# - SORRTstar finds a free straight motion, then samples the empty set of shorter paths, and does not check the time
#   meanwhile.
# - BFMT puts every goal in its queue and then marks all but the last as unvisited, so that a goal can be put there
#   again and taken out of it twice: one run in a hundred with several goals ended in a crash.
# - BITstar's graph is never freed (60 kB per run).
_LISTED = {
    "AORRTC": PlannerTraits(
        anytime=True, one_goal=True, straight_first=True, has_graph=False, supports_iteration_limit=False
    ),
    "BFMT": PlannerTraits(one_goal=True),
    "BITstar": PlannerTraits(anytime=True, has_graph=False, supports_iteration_limit=False),
    "InformedRRTstar": ANYTIME,
    "PRM": PlannerTraits(one_goal=True),
    "PRMstar": PlannerTraits(anytime=True, one_goal=True, supports_iteration_limit=False),
    "RRTstar": ANYTIME,
    "SORRTstar": PlannerTraits(anytime=True, straight_first=True, supports_iteration_limit=False),
}

# Geometric planners of OMPL 2.0.1 that its wheel has.
BOUND = (
    "AORRTC BFMT BITstar BKPIECE1 FMT InformedRRTstar KPIECE1 LBKPIECE1 PRM PRMstar RRT RRTConnect RRTstar SORRTstar"
)

# Geometric planners of OMPL 2.0.1 that its wheel lacks. Those that a later wheel offers are left out.
_UNBOUND = (
    "ABITstar AITstar AOXRRTConnect ATRRT AnytimePathShortening BLITstar BiEST BiRLRT BiTRRT CForest EIRMstar EITstar "
    "EST LBTRRT LazyLBTRRT LazyPRM LazyPRMstar LazyRRT PDST ProjEST QMP QMPStar QRRT QRRTStar RLRT RRTXstatic RRTsharp "
    "SBL SPARS SPARStwo SST STRIDE STRRTstar TRRT TRRTstar TSRRT VFRRT XXL pRRT pSBL"
)


@cache
def ompl_planners() -> dict[str, type[ob.Planner]]:
    """Return the geometric planners of the installed OMPL wheel by their names."""
    found = {key: value for key, value in vars(og).items() if isinstance(value, type) and issubclass(value, ob.Planner)}
    return {key: value for key, value in found.items() if value is not ob.Planner}


def unbound_planners() -> tuple[str, ...]:
    """Return the names of OMPL's geometric planners that the installed wheel lacks."""
    offered = ompl_planners()
    return tuple(name for name in _UNBOUND.split() if name not in offered)


OMPL_TRAITS = {planner: _LISTED.get(name, PlannerTraits()) for name, planner in ompl_planners().items()}


@lru_cache(maxsize=64)
def traits_of(factory: PlannerFactory) -> PlannerTraits:
    """Return the traits of a planner: from the table for OMPL's planners, else from the attributes of the class."""
    if isinstance(factory, type) and factory in OMPL_TRAITS:
        return OMPL_TRAITS[factory]
    stated = {each.name: getattr(factory, each.name) for each in fields(PlannerTraits) if hasattr(factory, each.name)}
    return PlannerTraits(**stated)


def planners_with(condition: Callable[[PlannerTraits], object]) -> dict[str, PlannerTraits]:
    """Return the planners of packages whose traits meet a condition, by name, sorted; OMPL's are left out."""
    offered: dict[str, PlannerFactory] = {name: catalog.find_planner(name) for name in catalog.list_planners()}
    stated = {name: traits_of(factory) for name, factory in offered.items()}
    return {name: traits for name, traits in stated.items() if condition(traits)}
