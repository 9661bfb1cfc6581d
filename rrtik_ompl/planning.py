"""`plan()`: from a problem to a path that has been checked twice, or to the reason why there is none."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from rrtik_ompl import catalog
from rrtik_ompl.arrays import Matrix, positive, whole_number
from rrtik_ompl.choices import Accuracy
from rrtik_ompl.errors import InputError, UnknownNameError, require
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.goal import JointGoal
from rrtik_ompl.ik.goal_configurations import GoalSearch
from rrtik_ompl.ik.methods import load_kernels
from rrtik_ompl.ompl_bridge.attempt import Attempt, attempt
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory, ompl_planners, traits_of
from rrtik_ompl.path import JointPath
from rrtik_ompl.problem import Problem, densely_checked
from rrtik_ompl.world.proof import PROOF_KERNELS

RESTARTS = 20
MAX_RESTARTS = 1_000_000
SHORTEST = 1e-3  # [s] that an attempt gets at least
MAX_SECONDS = 1e9  # thirty years; OMPL's clock overflows at about nine times as much
_OMPL_PREFIX, _MOVEIT_SUFFIX = "geometric::", "kConfigDefault"  # as in ompl_planning.yaml


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The outcome of planning.

    Attributes:
        found: Whether there is a path.
        path: The path, or None.
        reason: "" if found, else a line that says why not.
        seconds: Wall time of everything: planning, restarts and re-checks [s]; without what it took to count how
            large an OMPL planner's graph has become.
        planner: Name of the planner.
        seed: The seed that repeats this plan.
        statistics: Plain counts, added up over all attempts: attempts, rejected paths, and the planner's own. Those
            that describe the path (``path_statistics`` of the planner's class) are the last attempt's.
    """

    found: bool
    path: JointPath | None
    reason: str
    seconds: float
    planner: str
    seed: int
    statistics: Mapping[str, int | float]

    @property
    def proven(self) -> bool | None:
        """Whether every motion of the path is proven free for its whole length; None without a path."""
        return None if self.path is None or self.path.proof is None else self.path.proof.proven


def plan(
    problem: Problem,
    planner: str | PlannerFactory | None = None,
    *,
    seconds: float = 5.0,
    seed: int | None = None,
    restarts: int = RESTARTS,
    parameters: Mapping[str, Any] | None = None,
    accuracy: Accuracy | None = None,
) -> Plan:
    """Find a collision-free path from the start to the goal of a problem.

    A goal of the tip is first turned into free configurations by inverse kinematics, unless the planner finds them
    itself. If it does not get to them with some effort, more are drawn and it is started anew with twice the effort
    (see :class:`GoalSearch`).

    The planner first relies on what the kernels can prove without coal, for a short while; where that finds no path its
    motions are checked exactly. Either way a path is returned only if a second check agrees
    (:meth:`JointPath.violations`): motions are proven free for their whole length, or else checked twice as densely.

    If a planner gives up before its time it is started anew with another random stream; if the second check rejects its
    path, it is started anew and its motions are checked as densely as by the second check.

    Args:
        problem: What to solve.
        planner: Name of one of :func:`list_planners` (``geometric::`` may stand before OMPL's names), or a planner
            class that is built from a SpaceInformation alone. None: the default of the installed packages,
            :func:`rrtik_ompl.catalog.default_planner`.
        seconds: Time limit for all attempts together [s].
        seed: The same seed gives the same path, as long as the time limit does not cut in; drawn if None. PRM and
            PRMstar work by the clock, so theirs may differ.
        restarts: Further attempts at most.
        parameters: Options of the planner; of OMPL's planners in snake case, such as ``range`` or ``goal_bias``.
        accuracy: "exact", or "conservative" to leave it at what can be proven without coal: faster, and blind to narrow
            passages. None: that of the problem's world.

    Raises:
        UnknownNameError: If there is no planner or no accuracy of that name.
        InputError: If a number or a parameter makes no sense.
        PlannerError: If the planner broke.
    """
    require(problem, Problem, "problem to plan", "use Problem(world, start, goal) or load_problem(name)")
    planner = catalog.default_planner() if planner is None else planner
    require(planner, str | Callable, "planner", "use a name of list_planners() or a planner class")
    limit = positive(seconds, "seconds")
    if limit > MAX_SECONDS:
        raise InputError(f"seconds must be {MAX_SECONDS:g} or less, got {limit:g}")
    if isinstance(restarts, bool) or not isinstance(restarts, int) or not 0 <= restarts <= MAX_RESTARTS:
        raise InputError(f"restarts must be a whole number from 0 to {MAX_RESTARTS}, got {restarts!r}")
    name, factory = (planner, find_planner(planner)) if isinstance(planner, str) else (planner.__name__, planner)
    used = int(np.random.default_rng().integers(2**31)) if seed is None else whole_number(seed, "seed")
    problem = problem if accuracy is None else problem.with_accuracy(accuracy)
    seeds = [int(child) for child in np.random.SeedSequence(used).generate_state(restarts + 1, np.uint32)]
    _load_kernels(problem, factory)
    begin = time.perf_counter()
    search = _Search(problem, factory, name, begin + limit, seeds, parameters or {})
    if _nothing_to_do(problem):  # some planners return a detour, others crash
        path: JointPath | None = JointPath.of(problem.robot, problem.start[None]).proved(problem.world)
    else:
        path = search.run()
    elapsed, reason = time.perf_counter() - begin - search.counting, search.reason
    if path is None and elapsed >= limit:
        attempts = search.totals["attempts"]
        tried = f"{attempts} attempt{'s' * (attempts != 1)}"
        reason = f"no path within {limit:g} s ({tried}; the last one: {reason or 'out of time'})"
    return Plan(path is not None, path, reason, elapsed, name, used, MappingProxyType(search.totals))


def _load_kernels(problem: Problem, factory: PlannerFactory) -> None:
    """Load what the search will use: compiling it for the first time is no part of planning."""
    if not isinstance(problem.goal, JointGoal):
        load_kernels(problem.robot)
    if problem.world.fast is not None:
        for name in (*traits_of(factory).kernels, PROOF_KERNELS):
            library(name)


class _Search:
    """Attempt after attempt, one per seed, until the second check accepts a path.

    Attributes:
        totals: The counts of all attempts.
        reason: Why there is no path, in a line; "" if there is one.
        counting: Time that was no planning [s]; the deadline was put off by it.
    """

    def __init__(
        self,
        problem: Problem,
        factory: PlannerFactory,
        name: str,
        deadline: float,
        seeds: list[int],
        parameters: Mapping[str, Any],
    ) -> None:
        self.totals: dict[str, int | float] = {"attempts": 0, "rejected": 0}
        self.reason, self.counting = "", 0.0
        self._problem, self._factory, self._name, self._parameters = problem, factory, name, parameters
        self._deadline, self._seeds = deadline, seeds
        self._goals = GoalSearch(problem, np.random.default_rng(seeds[0]))
        self._traits, joints = traits_of(factory), isinstance(problem.goal, JointGoal)
        self._aimless = self._traits.finds_goals and not joints
        self._long_ways = joints and bool(problem.robot.continuous.any()) and len(seeds) > 1
        # An optimal path touches what it goes round, and an anytime planner has no time left for a second attempt.
        self._asked = densely_checked(problem) if self._traits.anytime else problem

    def run(self) -> JointPath | None:
        """The path, or None and a reason."""
        for number in range(len(self._seeds)):
            if self._left() <= 0.0:
                break
            self.totals["attempts"] += 1
            aims = self._aims(number)
            if len(aims) == 0 and not self._aimless:
                if self._goals.exhausted:
                    break
                continue
            if self._left() <= 0.0:
                break
            path = self._proven_path(aims) if number == 0 else None
            path = self._path(number, aims) if path is None else path
            if path is not None:
                return path
        self.reason = self.reason or self._goals.reason
        return None

    def _left(self) -> float:
        return self._deadline - time.perf_counter()

    def _short_way(self, number: int) -> bool:
        """Whether an attempt goes the short way round alone."""
        return self._long_ways and number == 0

    def _aims(self, number: int) -> Matrix:
        """What an attempt aims at: all that is known, the newest first, for some planners take the first alone."""
        if self._aimless:
            return np.zeros((0, self._problem.robot.dof))
        known = len(self._goals.rows)
        newer = number > 0 and self._goals.more()
        rows = self._goals.first()
        return rows[:1] if self._short_way(number) else np.roll(rows, -known if newer else -number, axis=0)

    def _proven_path(self, aims: Matrix) -> JointPath | None:
        """Of a brief attempt on what the kernels can prove; None where it finds nothing or cannot prove an end."""
        if not self._traits.supports_iteration_limit or self._problem.world.accuracy != "exact":
            return None
        proven = self._problem.with_accuracy("conservative")
        aims = aims[proven.world.valid_batch(aims)]
        if len(aims) == 0 or not proven.world.valid(proven.start):
            return None
        return _verified(self._problem, self._attempt(proven, 0, aims, self._left(), effort=1), self._name).path

    def _path(self, number: int, aims: Matrix) -> JointPath | None:
        """Of an attempt with exact checks; from the first path on that was rejected, as densely as the second check."""
        share = 0.5 if self._short_way(number) else 1.0  # before the long way is tried too
        limited = self._traits.supports_iteration_limit and self._others(number)
        effort = 2**number if limited else None
        seconds = share * max(self._left(), SHORTEST)
        outcome = self._attempt(self._asked, number, aims, seconds, effort)
        path, self.reason = _verified(self._problem, outcome, self._name)
        if path is None and outcome.rows is not None:
            self.totals["rejected"] += 1
            self._asked = densely_checked(self._problem)
        return path

    def _others(self, number: int) -> bool:
        """Whether later attempts would aim at other configurations than this one."""
        if self._aimless or number == len(self._seeds) - 1:
            return False
        return not self._goals.exhausted or (self._traits.one_goal and number + 1 < len(self._goals.rows))

    def _attempt(self, problem: Problem, number: int, aims: Matrix, seconds: float, effort: int | None) -> Attempt:
        """One attempt, counted."""
        outcome = attempt(
            problem,
            self._factory,
            aims,
            seconds=seconds,
            seed=self._seeds[number],
            parameters=self._parameters,
            effort=effort,
        )
        self.counting += outcome.counting
        self._deadline += outcome.counting
        for key, value in outcome.statistics.items():
            self.totals[key] = value if key in self._traits.path_statistics else self.totals.get(key, 0) + value
        return outcome


def _nothing_to_do(problem: Problem) -> bool:
    """Whether the start is the goal, to the bit if that is a configuration; a `Problem` has checked its start."""
    if isinstance(problem.goal, JointGoal):
        return bool((problem.start == problem.goal.q).all())
    return problem.reached(problem.start)


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


class _Verified(NamedTuple):
    """The path of an attempt if the second check accepts it, else None and the reason."""

    path: JointPath | None
    reason: str = ""


def _verified(problem: Problem, outcome: Attempt, name: str) -> _Verified:
    """The second check of what an attempt has found."""
    if outcome.rows is None:
        return _Verified(
            None, f"{name} ended with '{outcome.status}'" + (f": {outcome.reason}" if outcome.reason else "")
        )
    path = JointPath.of(problem.world.robot, outcome.rows).proved(problem.world)
    faults = () if path.proof is not None and path.proof.proven else path.violations(problem.world)
    if faults:
        return _Verified(None, f"the path of {name} was rejected by the second check: {faults[0].reason}")
    if not (path.start == problem.start).all() or not problem.reached(path.end):
        return _Verified(None, f"the path of {name} does not lead from the start to the goal")
    return _Verified(path)
