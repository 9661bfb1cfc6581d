"""The base of every planner of ours: it handles OMPL's objects so that a planner only sees arrays.

OMPL's Python bindings hand out borrowed C++ objects that must not outlive their owner, and an exception that leaves
``solve`` ends a whole benchmark. Hence the rules kept here: C++ objects live in local variables, states are copied to
arrays at once, and ``solve`` always returns a status.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from ompl import base as ob
from ompl import util as ou

from rrtik_ompl.arrays import Mask, Matrix, Vector, frozen, whole_number
from rrtik_ompl.errors import PlannerError
from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler
from rrtik_ompl.ompl_bridge.motion_checker import MotionChecker, SpaceChecker, WorldChecker
from rrtik_ompl.ompl_bridge.results import Failure, IllPosed, SearchResult, explained, failure_of
from rrtik_ompl.ompl_bridge.states import StateIO, real_vector_space, space_bounds
from rrtik_ompl.world.motion_queries import MotionQueries, Stop

GOAL_SAMPLES = 32  # how often a goal that can give any number of configurations is sampled
WAIT_FOR_GOAL = 0.002  # [s] between two samples of a goal that is still computing its first sample
GIVEN_OPTIONS = ("world", "seed", "goal")  # that `plan()` fills in
NONE_USABLE = "none is given, or all are in collision or outside the bounds"


class SafePlanner(ob.Planner):  # type: ignore[misc]  # OMPL has no types
    """Base class: a subclass implements :meth:`search` on arrays and is a complete ``ompl.base.Planner``.

    Every ``solve`` is a new attempt from the starts and goals of the problem definition; nothing is kept from an
    earlier one except the state of the random generator. ``solve`` never raises an Exception: it returns ``CRASH`` and
    keeps the text in :attr:`error`. KeyboardInterrupt and SystemExit pass.

    A planner refuses options by an InputError, from its constructor or, if it depends on starts and goals, from
    :meth:`search`. The options are the keyword parameters of the constructor; ``world``, ``seed`` and, for planners
    that want the goal of the tip, ``goal`` are filled in by `plan()`.

    Traits of the class, for `plan()`; see :class:`~rrtik_ompl.ompl_bridge.planner_traits.PlannerTraits`:
    ``anytime``, ``one_goal``, ``finds_goals``, ``straight_first``, ``supports_iteration_limit`` (such a planner has the
    option ``max_iterations``), ``path_statistics``, ``kernels``, ``one_joint``, ``brief_options`` and
    ``proof_iterations``.

    Attributes:
        seed: The seed in use; given, or drawn from OMPL's, so that ``ompl.util.RNG.setSeed`` fixes it too.
        rng: The generator for :meth:`search`.
        statistics: Counts of the last ``solve``, plain ints and floats.
        error: Why the last ``solve`` could not be done, with the traceback if it broke off, or None.
        failure: Why the last ``solve`` broke off, or None.
        reason: Why the last ``solve`` was done in vain, if the search could say it.
    """

    anytime: ClassVar[bool] = False
    one_goal: ClassVar[bool] = False
    finds_goals: ClassVar[bool] = False
    straight_first: ClassVar[bool] = False
    supports_iteration_limit: ClassVar[bool] = False
    path_statistics: ClassVar[tuple[str, ...]] = ()
    kernels: ClassVar[tuple[str, ...]] = ()
    one_joint: ClassVar[bool] = False
    brief_options: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    proof_iterations: ClassVar[int] = 0
    portfolio_turn: ClassVar[int] = 0

    def __init__(
        self, si: ob.SpaceInformation, name: str, *, world: MotionQueries | None = None, seed: int | None = None
    ) -> None:
        """Make a planner.

        Args:
            si: ``ompl.base.SpaceInformation`` of a RealVectorStateSpace.
            name: Name for OMPL's reports.
            world: Checks configurations and motions instead of ``si``, if given.
            seed: At least 0.

        Raises:
            InputError: If the space is of another kind or the seed is no such number.
        """
        real_vector_space(si)
        used = _seed(seed)
        super().__init__(si, name)
        self.seed = used
        self.rng = np.random.default_rng(self.seed)
        self.statistics: dict[str, int | float] = {}
        self.error: str | None = None
        self.failure: Failure | None = None
        self.reason = ""
        self._world = world
        self._io = StateIO(si)  # holds the space, which knows nothing of planners, so both can be freed
        self._known_bounds: tuple[Any, Any] = ((), ())  # numbers of the space, and the arrays made from them

    @classmethod
    def default_options(cls) -> dict[str, Any]:
        """The options that the planner takes, with their defaults."""
        parameters = list(inspect.signature(cls).parameters.values())[1:]  # the first one is the space information
        return {each.name: each.default for each in parameters if each.name not in GIVEN_OPTIONS}

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """Look for a path from any start to any goal until ``ptc()`` is true. For subclasses.

        Args:
            starts: Free configurations, shape (s, n), s at least 1.
            goals: Free configurations, shape (g, n), g at least 1, or 0 if :meth:`needs_goals` says so.
            checker: Checks configurations and motions.
            ptc: Call it: true when it is time to stop.
        """
        raise NotImplementedError(f"{type(self).__name__} has no search()")

    def needs_goals(self) -> bool:
        """Whether this planner's search needs goal configurations. For subclasses that can do without.

        ``solve`` asks it of a planner that was made, which may depend on its options. The trait ``finds_goals`` is of
        the class: `plan()` reads it before there is a planner.
        """
        return True

    def solve(self, ptc: ob.PlannerTerminationCondition | float) -> ob.PlannerStatus:
        """Solve the problem of the problem definition; called by OMPL.

        Args:
            ptc: ``PlannerTerminationCondition`` or a time in seconds.

        Returns:
            ``ompl.base.PlannerStatus``.
        """
        self._forget()
        try:
            status = self._solve(_condition(ptc))
        except IllPosed as refused:
            status, self.error = refused.status, refused.reason
        except Exception as error:
            self.failure, self.error = failure_of(error), explained(error)
            status = ob.PlannerStatus.CRASH
        return ob.PlannerStatus(status)

    def clear(self) -> None:
        """Forget the last attempt; called by OMPL."""
        super().clear()
        self._forget()

    def ends_free(self, rows: Matrix, checker: MotionChecker) -> Mask:
        """Which starts and goals, shape (m, n), are free, shape (m,). For subclasses that know a faster way to tell."""
        return checker.valid_batch(rows)

    def bounds(self) -> tuple[Vector, Vector]:
        """Lower and upper bounds of the space, shapes (n,), as they were when ``solve`` was last called.

        They are the same read-only arrays as long as they do not change.
        """
        return self._known_bounds[1] or self._read_bounds()

    def _forget(self) -> None:
        self.statistics, self.error, self.failure, self.reason = {}, None, None, ""

    def _read_bounds(self) -> tuple[Vector, Vector]:
        numbers = self._io.bounds()
        if numbers != self._known_bounds[0]:
            lower, upper = space_bounds(self.getSpaceInformation())
            self._known_bounds = numbers, (frozen(lower), frozen(upper))
        known: tuple[Vector, Vector] = self._known_bounds[1]
        return known

    def _solve(self, ptc: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        si, pdef = self.getSpaceInformation(), self.getProblemDefinition()
        if pdef is None:
            raise PlannerError(f"{self.getName()}: no problem definition; use SimpleSetup or setProblemDefinition()")
        self._read_bounds()  # refuses missing ones in clearer words than OMPL
        checker: MotionChecker = SpaceChecker(si) if self._world is None else WorldChecker(self._world)
        starts, goals = self._inputs(checker, ptc)
        result = self.search(starts, goals, checker, ptc)
        if result.path is None and isinstance(pdef.getGoal(), GoalSampler):
            pdef.getGoal().more()  # for the next attempt
        self.statistics = {
            **result.statistics,
            "checked_states": checker.checked_states,
            "checked_motions": checker.checked_motions,
        }
        self.reason = result.reason
        return self._report(result)

    def _inputs(self, checker: MotionChecker, ptc: Stop) -> tuple[Matrix, Matrix]:
        """Starts and, if needed, goals of the problem definition, shapes (s, n) and (g, n), at least one each."""
        inputs, io = self.getPlannerInputStates(), self._io
        inputs.restart()
        starts = self._starts(inputs, io)
        if not starts:
            raise IllPosed(ob.PlannerStatus.INVALID_START, f"no valid start: {NONE_USABLE}")
        if not self.needs_goals():
            rows = np.array(starts)
            rows = rows[checker.valid_batch(rows)]
            if len(rows) == 0:
                raise IllPosed(ob.PlannerStatus.INVALID_START, f"no valid start: {NONE_USABLE}")
            return rows, rows[:0]
        goal = self.getProblemDefinition().getGoal()
        if goal is not None and not isinstance(goal, ob.GoalSampleableRegion):
            text = "the goal cannot be sampled; use a GoalState, GoalStates or a GoalSampleableRegion"
            raise IllPosed(ob.PlannerStatus.UNRECOGNIZED_GOAL_TYPE, text)
        goals = self._goals(inputs, io, goal, ptc)
        rows, split = np.array([*starts, *goals]), len(starts)
        free = self.ends_free(rows, checker).tolist()  # all at once: a call costs more than a check
        if goals and all(free):
            return rows[:split], rows[split:]
        if not any(free[:split]):
            raise IllPosed(ob.PlannerStatus.INVALID_START, f"no valid start: {NONE_USABLE}")
        if not any(free[split:]):
            raise IllPosed(ob.PlannerStatus.INVALID_GOAL, f"no valid goal: {NONE_USABLE}")
        return rows[:split][free[:split]], rows[split:][free[split:]]

    def _starts(self, inputs: ob.PlannerInputStates, io: StateIO) -> list[Vector]:
        rows = []
        while inputs.haveMoreStartStates():
            state = inputs.nextStart()  # borrowed; None if invalid
            if state is not None:
                rows.append(io.read(state))
            del state
        return _different(rows)

    def _goals(self, inputs: ob.PlannerInputStates, io: StateIO, goal: ob.Goal, ptc: Stop) -> list[Vector]:
        """Goal configurations: all of a finite goal; else a number of samples, or as many as it takes to find one.

        Of a :class:`GoalSampler` those that it has.
        """
        limit = max(GOAL_SAMPLES, goal.getStateCount() if isinstance(goal, ob.GoalStates) else 0)
        limit = len(goal.rows) if isinstance(goal, GoalSampler) else limit
        lazy = isinstance(goal, ob.GoalLazySamples)
        rows: list[Vector] = []
        sampled = 0
        while (sampled < limit or not rows) and not ptc():
            if inputs.haveMoreGoalStates():
                sampled += 1
                state = inputs.nextGoal()  # borrowed, one buffer for all; None if invalid
                if state is not None:
                    rows.append(io.read(state))
                del state
            elif lazy and not rows and goal.isSampling():
                time.sleep(WAIT_FOR_GOAL)  # lets the thread of the goal have the interpreter
            else:
                break
        return _different(rows)

    def _report(self, result: SearchResult) -> ob.PlannerStatus:
        """Hand the path to OMPL; returns the status."""
        if result.path is None:
            return ob.PlannerStatus.TIMEOUT
        path = self._io.path(self.getSpaceInformation(), result.path)
        approximate = result.difference > 0.0
        self.getProblemDefinition().addSolutionPath(path, approximate, float(result.difference), self.getName())
        return ob.PlannerStatus.APPROXIMATE_SOLUTION if approximate else ob.PlannerStatus.EXACT_SOLUTION


def _different(rows: list[Vector]) -> list[Vector]:
    """The rows in their order, each once."""
    return rows if len(rows) < 2 else list({row.tobytes(): row for row in rows}.values())


def _condition(ptc: ob.PlannerTerminationCondition | float) -> ob.PlannerTerminationCondition:
    """A termination condition from what OMPL or a person hands to solve."""
    return ob.timedPlannerTerminationCondition(float(ptc)) if isinstance(ptc, (int, float)) else ptc


def _seed(seed: int | None) -> int:
    return int(ou.RNG().uniformInt(0, 2**31 - 1)) if seed is None else whole_number(seed, "seed")
