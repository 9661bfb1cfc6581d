"""What `plan()` is asked for, and what it returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ImproveStrategy, PathObjective, ProofMode
from rrtik_ompl.base.copies import as_value, in_notebook, in_one_line
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.route_check import as_it_stands

RESTARTS = 20


@dataclass(frozen=True, slots=True)
class NamedPlanner:
    """A planner, and the name by which messages call it."""

    name: str
    factory: PlannerFactory


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """What `plan()` is asked for beside the problem and the planner; every value has been checked.

    Attributes:
        budget: Time, iterations of each planner, about, and the seed of everything random.
        restarts: Further attempts at most.
        parameters: Options of the planner.
        proof: Whether motions are to be proven.
        clearance: To be kept from obstacles [m], or None.
    """

    budget: Budget
    restarts: int = RESTARTS
    parameters: Mapping[str, Any] = field(default_factory=dict)
    proof: ProofMode = "preferred"
    clearance: float | None = None


@dataclass(frozen=True, slots=True)
class Improvement:
    """How a path is to be improved.

    Attributes:
        seconds: How much longer it may take [s].
        objective: What is to be made small.
        strategy: Whether further plans are made, or the first path alone is shortened.
    """

    seconds: float
    objective: PathObjective = "length"
    strategy: ImproveStrategy = "restart-shorten"


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The outcome of planning.

    Attributes:
        found: Whether there is a path.
        path: The path, or None.
        reason: A line that says why there is no path or, where not all of it is proven free, which two bodies are not
            proven apart, where, and how far they are apart there (where obstacles move: as they stand at time 0); else
            "".
        seconds: Wall time of everything: planning, restarts and re-checks [s]; without what it took to count how
            large an OMPL planner's graph has become.
        planner: Name of the planner; with "auto" of the one that found the path, or that tried last.
        seed: The seed that repeats this plan.
        statistics: Plain counts, added up over all attempts: attempts, rejected paths, and the planner's own. Those
            that describe the path (``path_statistics`` of the planner's class) are the last attempt's. With
            ``improve=`` also the course of the length.
        member: Of a goal set, the number of the member that the path reaches, from 0; None for other goals.
        problem: What was solved; None in a plan from another process, which is sent without it.

    Example:
        >>> plan = rrtik.plan(rrtik.load_problem("planar3_boxes"), seed=1)
        >>> plan.found, plan.proven, plan.path.violations(rrtik.load_problem("planar3_boxes").world)
        (True, True, ())
    """

    found: bool
    path: JointPath | None
    reason: str
    seconds: float
    planner: str
    seed: int
    statistics: Mapping[str, Any]
    member: int | None = None
    problem: Problem | None = field(default=None, repr=False)

    __repr__ = in_one_line
    _repr_html_ = in_notebook

    def __post_init__(self) -> None:
        if self.path is not None:
            gaps = () if self.path.proof is None else self.path.proof.unproven
            said = f"not proven free: {gaps[0]}" if gaps else ""
            if self.problem is not None and gaps:
                said += as_it_stands(self.problem.world.scene)
            if self.problem is not None or not (gaps and self.reason.startswith(said)):  # a copy knows no scene
                object.__setattr__(self, "reason", said)

    def __reduce__(self) -> tuple[Any, ...]:
        return as_value(replace(self, problem=None))

    @property
    def proven(self) -> bool | None:
        """Whether every motion of the path is proven free for its whole length; None without a path or a proof."""
        return None if self.path is None or self.path.proof is None else self.path.proof.proven
