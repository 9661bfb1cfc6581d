"""Starts and goals of an OMPL problem definition as arrays, without those that are invalid."""

from __future__ import annotations

import time
from collections.abc import Callable
from numbers import Real

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler
from rrtik_ompl.ompl_bridge.results import IllPosed
from rrtik_ompl.ompl_bridge.states import StateIO

GOAL_SAMPLES = 32  # how often a goal that can give any number of configurations is sampled
WAIT_FOR_GOAL = 0.002  # [s] between two samples of a goal that is still computing its first sample
NONE_USABLE = "none is given, or all are in collision or outside the bounds"


def starts_and_goals(
    inputs: ob.PlannerInputStates, definition: ob.ProblemDefinition, io: StateIO, stop: Stop, *, aimless: bool
) -> tuple[Matrix, Matrix]:
    """Return the starts of a problem definition and, unless ``aimless``, its goals, without repetition.

    Args:
        inputs: Gives the starts and goals.
        definition: The problem definition.
        io: Reads states.
        stop: Returns True when it is time to stop.
        aimless: Whether the planner needs no goals.

    Returns:
        Starts, shape (s, n), and goals, shape (g, n).

    Raises:
        IllPosed: If there is no valid start, or the goal cannot be sampled.
        InputError: If goal or objective are of a space with another number of coordinates.
    """
    _refuse_other_spaces(definition, io.dof)
    inputs.restart()
    starts = _starts(inputs, io)
    if not starts:
        raise IllPosed(ob.PlannerStatus.INVALID_START, f"no valid start: {NONE_USABLE}")

    goals: list[Vector] = []
    if not aimless:
        goal = definition.getGoal()
        if goal is not None and not isinstance(goal, ob.GoalSampleableRegion):
            text = "the goal cannot be sampled; use a GoalState, GoalStates or a GoalSampleableRegion"
            raise IllPosed(ob.PlannerStatus.UNRECOGNIZED_GOAL_TYPE, text)
        goals = _goals(inputs, io, goal, stop)

    return np.array(starts), np.array(goals).reshape(-1, io.dof)


def _refuse_other_spaces(definition: ob.ProblemDefinition, dof: int) -> None:
    """Raise an InputError if goal or objective are of another space, whose states would be accessed out of bounds."""
    for what, part in (("goal", definition.getGoal()), ("objective", definition.getOptimizationObjective())):
        count = dof if part is None else part.getSpaceInformation().getStateDimension()
        if count != dof:
            raise InputError(f"{what}: is of another space, of {count} coordinates; that of the problem has {dof}")


def _starts(inputs: ob.PlannerInputStates, io: StateIO) -> list[Vector]:
    """Return all valid starts without repetition, shapes (n,)."""
    rows = []
    while inputs.haveMoreStartStates():
        state = inputs.nextStart()  # borrowed; None if invalid
        if state is not None:
            rows.append(io.read(state))
        del state
    return _different(rows)


def _goals(inputs: ob.PlannerInputStates, io: StateIO, goal: ob.Goal, stop: Stop) -> list[Vector]:
    """Return goal configurations without repetition, shapes (n,).

    A finite goal gives all of its states, and a :class:`GoalSampler` those that it has. Any other goal is sampled a
    number of times, and then until one sample is found.
    """
    limit = GOAL_SAMPLES
    if isinstance(goal, GoalSampler):
        limit = len(goal.rows)
    elif isinstance(goal, ob.GoalStates):
        limit = max(limit, goal.getStateCount())
    lazy = isinstance(goal, ob.GoalLazySamples)

    rows: list[Vector] = []
    sampled = 0

    if stop():
        raise IllPosed(ob.PlannerStatus.TIMEOUT, "the time was up before a goal configuration was asked for")

    while (sampled < limit or not rows) and not stop():
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


def _different(rows: list[Vector]) -> list[Vector]:
    """Return the rows in their order, without repetition."""
    if len(rows) < 2:
        return rows
    return list({row.tobytes(): row for row in rows}.values())


def usable(starts: Matrix, goals: Matrix | None, free: Mask) -> tuple[Matrix, Matrix]:
    """Return the free starts and goals, at least one of each; no goals if none are needed.

    Args:
        starts: Shape (s, n).
        goals: Shape (g, n), or None.
        free: Which of both are free, shape (s + g,) or (s,).

    Returns:
        Free starts and free goals, shapes (k, n) and (m, n).

    Raises:
        IllPosed: If there is no free start, or no free goal.
    """
    free_starts = starts[free[: len(starts)]]
    if len(free_starts) == 0:
        raise IllPosed(ob.PlannerStatus.INVALID_START, f"no valid start: {NONE_USABLE}")
    if goals is None:
        return free_starts, starts[:0]
    free_goals = goals[free[len(starts) :]]
    if len(free_goals) == 0:
        raise IllPosed(ob.PlannerStatus.INVALID_GOAL, f"no valid goal: {NONE_USABLE}")
    return free_starts, free_goals


def condition_of(ptc: ob.PlannerTerminationCondition | Callable[[], object] | float) -> Stop:
    """Return a termination condition as a function, from any argument that ``solve`` accepts.

    Raises:
        InputError: If the argument is neither a number nor callable.
    """
    if isinstance(ptc, Real):  # numbers of NumPy too
        condition: Stop = ob.timedPlannerTerminationCondition(float(ptc))
        return condition
    if not callable(ptc):
        raise InputError(f"solve: expected seconds or a termination condition, got {type(ptc).__name__}")
    return ptc
