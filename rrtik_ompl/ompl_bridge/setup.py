"""A problem as OMPL objects: bounded space, validity and motions judged by the world, start and goal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base as ob

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.goal import JointGoal
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.problem import Problem
from rrtik_ompl.world import World

TURN = 2.0 * np.pi
AT_GOAL = 1e-9  # OMPL asks for a distance below the threshold, not equal to it
UNLIMITED_STROKE = 10.0  # [m] each way from the start for a prismatic joint without limits


@dataclass(slots=True, eq=False)
class Judge:
    """Counts the questions of a C++ planner and remembers the first error, which must not be raised inside OMPL."""

    world: World
    states: int = 0
    motions: int = 0
    error: Exception | None = None
    stop: Callable[[], object] | None = None  # ends the planner

    def valid(self, q: Vector) -> bool:
        """Whether q, shape (n,), is free; False from the first error on."""
        self.states += 1
        return self._ask(self.world.valid, q)

    def motion_valid(self, a: Vector, b: Vector) -> bool:
        """Whether the motion a -> b is free; False from the first error on."""
        self.motions += 1
        return self._ask(self.world.motion_valid, a, b)

    def _ask(self, question: Any, *arguments: Vector) -> bool:
        if self.error is not None:
            return False
        try:
            return bool(question(*arguments))
        except Exception as error:  # an exception that leaves a callback ends the process under some planners
            self.error = error.with_traceback(None)
            if self.stop is not None:
                self.stop()
            return False


class _Motions(ob.MotionValidator):  # type: ignore[misc]  # OMPL has no types
    """Motions judged by the world. It must not hold the SpaceInformation, or neither is ever freed."""

    def __init__(self, si: Any, judge: Judge, states: StateIO) -> None:
        super().__init__(si)
        self._judge, self._states = judge, states

    def checkMotion(self, first: Any, second: Any, *_: Any) -> bool:
        """Whether the motion between two states is free."""
        return self._judge.motion_valid(self._states.read(first), self._states.read(second))


class _Region(ob.GoalRegion):  # type: ignore[misc]
    """A goal in the workspace, for planners that need no goal configuration."""

    def __init__(self, si: Any, problem: Problem, states: StateIO) -> None:
        super().__init__(si)
        self._goal, self._robot, self._states = problem.goal, problem.world.robot, states
        self.setThreshold(AT_GOAL)

    def distanceGoal(self, state: Any) -> float:
        """Zero at the goal, the goal's own distance elsewhere."""
        row = self._states.read(state)[None]
        if self._goal.satisfied(self._robot, row)[0]:
            return 0.0
        return max(float(self._goal.distance(self._robot, row)[0]), 2.0 * AT_GOAL)


def planning_bounds(problem: Problem) -> tuple[Vector, Vector]:
    """Finite bounds to sample in, shapes (n,): the limits; for a continuous joint one turn each way from the start."""
    robot = problem.world.robot
    spread = np.where(robot.prismatic, UNLIMITED_STROKE, TURN)
    goal = problem.goal.q if isinstance(problem.goal, JointGoal) else problem.start
    lower = np.where(np.isfinite(robot.lower), robot.lower, np.minimum(problem.start, goal) - spread)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.maximum(problem.start, goal) + spread)
    return lower, upper


def goal_configurations(problem: Problem, *, all_turns: bool) -> Matrix:
    """The goal configuration; with ``all_turns`` also, for each continuous joint, the goal the other way round."""
    if not isinstance(problem.goal, JointGoal):
        raise InputError(f"goal of {problem.name}: a goal in joint values is needed here")
    rows = [np.asarray(problem.goal.q)]
    for joint in np.flatnonzero(problem.world.robot.continuous) if all_turns else ():
        other = np.array(problem.goal.q)
        other[joint] += -TURN if other[joint] > problem.start[joint] else TURN
        rows.append(other)
    return np.array(rows)


def space_information(problem: Problem, judge: Judge) -> Any:
    """A set-up ``ompl.base.SpaceInformation`` of a RealVectorStateSpace whose checks are the world's."""
    lower, upper = planning_bounds(problem)
    space = ob.RealVectorStateSpace(len(lower))
    bounds = ob.RealVectorBounds(len(lower))
    for k in range(len(lower)):
        bounds.setLow(k, float(lower[k]))
        bounds.setHigh(k, float(upper[k]))
    space.setBounds(bounds)
    si = ob.SpaceInformation(space)
    states = StateIO(si)
    si.setStateValidityChecker(lambda state: judge.valid(states.read(state)))
    si.setMotionValidator(_Motions(si, judge, StateIO(si)))
    si.setup()
    return si


def problem_definition(problem: Problem, si: Any, *, all_turns: bool) -> Any:
    """``ompl.base.ProblemDefinition`` with the start and the goal of the problem."""
    states, state, definition = StateIO(si), si.allocState(), ob.ProblemDefinition(si)
    states.write(state, problem.start)
    definition.addStartState(state)
    if isinstance(problem.goal, JointGoal):
        goal = ob.GoalStates(si)
        for row in goal_configurations(problem, all_turns=all_turns):
            states.write(state, row)
            goal.addState(state)
    else:
        goal = _Region(si, problem, states)
    definition.setGoal(goal)
    return definition


def exact_path(definition: Any, si: Any) -> Matrix | None:
    """The best exact solution of a problem definition as rows, shape (k, n), or None."""
    if not definition.hasExactSolution():
        return None
    found = definition.getSolutionPath()  # shared ownership: safe to keep while it is copied
    states = StateIO(si)
    return np.array([states.read(found.getState(k)) for k in range(found.getStateCount())])
