"""Methods that walk from a start towards a goal, made into methods of `solve_ik`: many starts, round after round."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.ik.descent import descend
from rrtik_ompl.ik.question import Answer, Question, Target, errors
from rrtik_ompl.robot import Robot

STARTS = 32  # in one round
ROUNDS = 16  # after which it gives up

# From (robot, goal, starts of shape (m, dof)) to where each start has led to, shape (m, dof), and the steps taken.
Walk: TypeAlias = Callable[[Robot, Target, Matrix], tuple[Matrix, int]]


def restarted(walk: Walk, question: Question, *, starts: int = STARTS, rounds: int = ROUNDS) -> Answer:
    """Walk from the posture and from random ones, round after round until a solution will do.

    Args:
        walk: The method; what it leads to outside the joint limits is left out.
        question: What is asked.
        starts: In one round.
        rounds: At most; the targets take turns.
    """
    robot = question.robot
    found, steps = np.zeros((0, robot.dof)), 0
    for number in range(rounds):
        target = question.targets[number % len(question.targets)]
        Q = question.rng.uniform(*robot.finite_range(), (starts, robot.dof))
        if number < len(question.targets):
            Q[0] = question.near
        Q, taken = walk(robot, target, Q)
        good = target.satisfied(robot, Q) & robot.within_limits(Q)
        found, steps = np.vstack([found, Q[good]]), steps + taken
        if question.accept(found).any() and not question.all:
            break
        if time.monotonic() > question.deadline:
            return Answer(found, *nearest_posture(question, steps), timed_out=True)
    if len(found):
        return Answer(found, question.near, target, steps)
    return Answer(found, *nearest_posture(question, steps))


def nearest_posture(question: Question, steps: int = 0) -> tuple[Vector, Target, int]:
    """The posture that comes nearest to the first target, for the reason of a failure.

    It is one inside the limits if such a one reaches the target; otherwise the joints may turn without limits.

    Returns:
        The posture, shape (dof,), the target, and ``steps`` more than were given.
    """
    robot, target = question.robot, question.targets[0]
    turning = ~robot.prismatic
    free = replace(
        robot,
        lower=np.where(turning, -2.0 * np.pi, robot.lower),
        upper=np.where(turning, 2.0 * np.pi, robot.upper),
    )
    starts = question.rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
    inside, taken = descend(robot, target, starts)
    at_goal = inside[target.satisfied(robot, inside)]
    if len(at_goal):
        return at_goal[0], target, steps + taken
    anywhere, more = descend(free, target, starts)
    return anywhere[int(np.argmin(errors(robot, target, anywhere).sum(axis=1)))], target, steps + taken + more
