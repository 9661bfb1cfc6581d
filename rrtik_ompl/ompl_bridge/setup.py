"""A problem as OMPL objects: a bounded space, checks of states and motions by the world, start and goal."""

from __future__ import annotations

import atexit
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.ompl_bridge.unrolled import near_image
from rrtik_ompl.world.motion_queries import MotionFree, MotionQueries, MotionsFree
from rrtik_ompl.world.problem import Problem, planning_bounds
from rrtik_ompl.world.proven_edges import ProvenEdges
from rrtik_ompl.world.world import World


@dataclass(slots=True, eq=False)
class ValidityCallback:
    """Checks states and motions for a C++ planner, counts the checks, and keeps the first error.

    An error must not be raised inside OMPL. After the ``deadline`` [s, of ``time.monotonic``] every answer is False,
    because some planners make hundreds of checks between two readings of their clock. After ``most_motions`` checks of
    motions every answer is False, too, and the planner is stopped. ``seen``, if it is a dict, notes which configuration
    was checked first, second, and so on, by its bytes.
    """

    world: MotionQueries
    states: int = 0
    motions: int = 0
    free_motions: int = 0
    error: Exception | None = None
    stop: Callable[[], object] | None = None  # ends the planner
    deadline: float = np.inf
    most_motions: float = np.inf
    seen: dict[bytes, int] | None = None

    @property
    def late(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() > self.deadline

    def valid(self, q: Vector) -> bool:
        """Check whether q, shape (n,), is free; False from the first error on."""
        self.states += 1
        return self._checked(self.world.valid, q)

    def motion_valid(self, a: Vector, b: Vector) -> bool:
        """Check whether the motion from a to b, shapes (n,), is free; False from the first error on."""
        self.motions += 1
        if self.motions > self.most_motions:
            if self.stop is not None:
                self.stop()
            return False

        free = self._checked(self.world.motion_valid, a, b)
        self.free_motions += free
        return free

    def counts(self) -> dict[str, int]:
        """Return the numbers of checks, and of the motions that were found free."""
        return {"checked_states": self.states, "checked_motions": self.motions, "free_motions": self.free_motions}

    def _checked(self, check: Callable[..., bool], *arguments: Vector) -> bool:
        """Return the answer of a check; False after an error or the deadline, or if the check raises an error."""
        if self.error is not None or self.late:
            return False
        if self.seen is not None:
            for q in arguments:
                self.seen.setdefault(q.tobytes(), len(self.seen))

        try:
            return bool(check(*arguments))
        except Exception as error:  # an exception that leaves a callback ends the process under some planners
            self.error = error.with_traceback(None)
            if self.stop is not None:
                self.stop()
            return False


def one_by_one(world: MotionQueries) -> MotionQueries:
    """Return the checks of a world for callers that ask for one motion at a time.

    Where only proven motions count as free, or undecided ones as blocked, a proof alone is sooner than steps.
    """
    if isinstance(world, World) and (world.settings.proving is not None or world.accuracy == "conservative"):
        return ProvenEdges(world)
    return world


class CheckedMotions(ob.MotionValidator):  # type: ignore[misc]  # OMPL has no types
    """Checks motions by a world.

    It must not hold the SpaceInformation, which holds it; otherwise neither is ever freed.

    Attributes:
        together: Checks many straight motions in one call, for planners of ours; None if it cannot.
    """

    def __init__(self, si: ob.SpaceInformation, motion_valid: MotionFree, together: MotionsFree | None = None) -> None:
        super().__init__(si)
        self._motion_valid = motion_valid
        self.together = together
        self._states = StateIO(si)

    def checkMotion(self, first: ob.State, second: ob.State, *_: object) -> bool:
        """Check whether the motion between two states is free; angles of SO(2) turn the short way."""
        a = self._states.read(first)
        b = self._states.read(second)
        return self._motion_valid(a, near_image(b, a, self._states.turning) if self._states.turns else b)


def space_information(problem: Problem, goals: Matrix, validity: ValidityCallback) -> ob.SpaceInformation:
    """Return a set-up ``ompl.base.SpaceInformation`` of a RealVectorStateSpace with the checks of a world.

    Args:
        problem: The problem, which gives the bounds.
        goals: Goal configurations, shape (k, n).
        validity: Checks states and motions.
    """
    si = bounded_space(*planning_bounds(problem, goals))
    states = StateIO(si)
    si.setStateValidityChecker(lambda state: validity.valid(states.read(state)))
    si.setMotionValidator(CheckedMotions(si, validity.motion_valid))
    si.setup()
    return si


def problem_definition(problem: Problem, goals: Matrix, si: ob.SpaceInformation) -> ob.ProblemDefinition:
    """Return an ``ompl.base.ProblemDefinition`` with the start of the problem and goal configurations, shape (k, n)."""
    states = StateIO(si)
    state = si.allocState()
    definition = ob.ProblemDefinition(si)

    states.write(state, problem.start)
    definition.addStartState(state)

    goal = ob.GoalStates(si)
    for row in goals:
        states.write(state, row)
        goal.addState(state)
    definition.setGoal(goal)

    return definition


def exact_path(definition: ob.ProblemDefinition, si: ob.SpaceInformation) -> Matrix | None:
    """Return the best exact solution of a problem definition as rows, shape (k, n), or None."""
    if not definition.hasExactSolution():
        return None
    found = definition.getSolutionPath()  # ownership is shared, so it is safe to copy from
    return StateIO(si).rows(found)


def shared_space(lower: Vector, upper: Vector) -> ob.SpaceInformation:
    """Return :func:`unchecked_space`; the same object for the same bounds, shapes (n,)."""
    return _kept_space(lower.tobytes(), upper.tobytes())


@lru_cache(maxsize=8)
def _kept_space(lower: bytes, upper: bytes) -> ob.SpaceInformation:
    return unchecked_space(np.frombuffer(lower), np.frombuffer(upper))


atexit.register(_kept_space.cache_clear)  # the bindings complain of objects that outlive the interpreter


def unchecked_space(lower: Vector, upper: Vector) -> ob.SpaceInformation:
    """Return a SpaceInformation that checks nothing, for planners that use the world themselves.

    OMPL checks each start and goal that it hands out, and one call of Python takes longer than some searches.
    """
    si = bounded_space(lower, upper)
    si.setStateValidityChecker(ob.AllValidStateValidityChecker(si))
    si.setup()
    return si


class PythonsStates(ob.SpaceInformation):  # type: ignore[misc]  # OMPL has no types
    """A SpaceInformation that also works for planners written in Python."""

    def freeState(self, state: ob.State) -> None:
        """Do nothing: the bindings free a state of ``allocState`` once Python does not use it any more."""


def bounded_space(lower: Vector, upper: Vector) -> ob.SpaceInformation:
    """Return a SpaceInformation of a RealVectorStateSpace with bounds, shapes (n,)."""
    return PythonsStates(_real_space(lower, upper))


def circular_space(lower: Vector, upper: Vector, turning: Mask) -> ob.SpaceInformation:
    """Return a SpaceInformation of a compound: an SO2StateSpace for each coordinate that turns, the others bounded.

    Args:
        lower: Lower bounds, shape (n,); ignored where a coordinate turns.
        upper: Upper bounds, shape (n,); ignored where a coordinate turns.
        turning: Which coordinates turn, shape (n,).
    """
    space = ob.CompoundStateSpace()
    begin = 0
    for turns, run in groupby(turning.tolist()):
        end = begin + len(list(run))
        parts = (
            [ob.SO2StateSpace() for _ in range(begin, end)]
            if turns
            else [_real_space(lower[begin:end], upper[begin:end])]
        )
        for part in parts:
            space.addSubspace(part, 1.0)
        begin = end
    return PythonsStates(space)


def _real_space(lower: Vector, upper: Vector) -> ob.RealVectorStateSpace:
    """Return a RealVectorStateSpace with bounds, shapes (n,)."""
    space = ob.RealVectorStateSpace(len(lower))
    bounds = ob.RealVectorBounds(len(lower))
    for k in range(len(lower)):
        bounds.setLow(k, float(lower[k]))
        bounds.setHigh(k, float(upper[k]))
    space.setBounds(bounds)
    return space
