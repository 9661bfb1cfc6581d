"""The request and the result of `plan()`: `Request`, `Improvement` and `Plan`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import ImproveStrategy, PathObjective, ProofMode
from rrtik_ompl.base.copies import as_value, in_notebook, in_one_line, in_print
from rrtik_ompl.base.errors import require
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.result import required
from rrtik_ompl.model.search_tree import SearchTree
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.route_check import as_it_stands

if TYPE_CHECKING:
    from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory

RESTARTS = 20
FEW_JOINTS = 3  # of robots whose paths, once pulled, get their bends at corners


@dataclass(frozen=True, slots=True)
class NamedPlanner:
    """A planner class and the name by which messages call it."""

    name: str
    factory: PlannerFactory


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """Arguments of `plan()` other than the problem and the planner; every value has been checked.

    Attributes:
        budget: Time limit, approximate number of iterations of each planner, and the seed of all random numbers.
        restarts: The largest number of further attempts.
        parameters: Options of the planner.
        proof: Whether motions have to be proven free.
        clearance: Clearance to keep from obstacles [m], or None.
        tree: Whether to keep the tree of the search.
        among_many: Whether it is one of many, so that Ctrl-C ends all of them and not its shortening alone.
    """

    budget: Budget
    restarts: int = RESTARTS
    parameters: Mapping[str, Any] = field(default_factory=dict)
    proof: ProofMode = "preferred"
    clearance: float | None = None
    tree: bool = False
    among_many: bool = False

    @property
    def survived(self) -> tuple[type[BaseException], ...]:
        """What may end the work on a path that is found, and leaves the path."""
        return () if self.among_many else (KeyboardInterrupt,)


@dataclass(frozen=True, slots=True)
class Improvement:
    """How a path is to be improved after it was found.

    Attributes:
        seconds: Limit of the additional time [s].
        objective: The cost that is minimized.
        strategy: Whether the problem is planned again, or the first path alone is shortened.
    """

    seconds: float
    objective: PathObjective = "length"
    strategy: ImproveStrategy = "restart-shorten"


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The result of planning.

    Attributes:
        found: Whether there is a path.
        path: The path, or None.
        reason: One line. Without a path it says why there is none. If the path is not proven free everywhere, it names
            the first two bodies that are not proven apart, the place, and their distance there (moving obstacles as
            they stand at time 0). Otherwise "".
        seconds: Wall time of planning, restarts, re-checks and shortening [s], without the time it took to count the
            vertices and edges of an OMPL planner's graph.
        planner: Name of the planner; with "auto" of the one that found the path, or that tried last.
        seed: The seed that repeats this plan.
        statistics: Counts added up over all attempts: attempts, rejected paths, and the planner's own. Statistics that
            describe the path (``path_statistics`` of the planner's class) are those of the last attempt. If the path
            was shortened also ``shortening_seconds``, and with ``improve=`` the cost over time.
        member: For a goal set, the index of the member that the path reaches, from 0; None for other goals.
        unshortened: The planner's own path, if ``path`` was shortened from it; None otherwise.
        tree: What the planner has grown, where ``plan(tree=True)`` asked for it; None otherwise, and from planners that
            keep no tree.
        problem: The problem that was solved; None in a plan that comes from another process, which is sent without it.

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
    unshortened: JointPath | None = None
    tree: SearchTree | None = field(default=None, repr=False)
    problem: Problem | None = field(default=None, repr=False)

    __repr__ = in_one_line
    _repr_html_ = in_notebook
    _repr_png_ = in_print

    def __post_init__(self) -> None:
        require(self.path, JointPath | None, "path of a plan")
        if self.path is not None:
            gaps = () if self.path.proof is None else self.path.proof.unproven
            said = f"not proven free: {gaps[0]}" if gaps else ""
            if self.problem is not None and gaps:
                said += as_it_stands(self.problem.world.scene)
            # A copy has no scene to look at, so it keeps the reason of its original.
            if self.problem is not None or not (gaps and self.reason.startswith(said)):
                object.__setattr__(self, "reason", said)

    def __reduce__(self) -> tuple[Any, ...]:
        return as_value(replace(self, problem=None))

    def require(self) -> JointPath:
        """Return the path.

        Raises:
            NotFoundError: If there is none; the message is one line with the reason.
        """
        return required(self.path, "no path", self.reason)

    @property
    def proven(self) -> bool | None:
        """Whether all motions of the path are proven free for their whole length; None without a path or a proof."""
        return None if self.path is None or self.path.proof is None else self.path.proof.proven
