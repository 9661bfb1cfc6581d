"""Numeric inverse kinematics of any arm: Levenberg-Marquardt from a posture and then from seeds near the goal."""

from __future__ import annotations

import time

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Matrix
from rrtik_ompl.goal import GoalRegion, PoseGoal, PositionGoal
from rrtik_ompl.ik.descent import PATIENCE, STEPS, Search, walk
from rrtik_ompl.ik.goal_rows import goal_rows
from rrtik_ompl.ik.question import Answer, Question
from rrtik_ompl.ik.restarts import ROUNDS, STARTS, nearest_posture
from rrtik_ompl.robot import Robot


def numeric_ik(
    robot: Robot, goal: PoseGoal | PositionGoal | GoalRegion, starts: Matrix, *, iterations: int = STEPS
) -> Matrix:
    """Move configurations towards a goal, each from its own start, inside the joint limits.

    Args:
        robot: The arm.
        goal: A pose, a position with any orientation, or a region; its members take turns.
        starts: Shape (m, dof).
        iterations: Steps at most.

    Returns:
        The rows that satisfy the goal, in the order of their starts, shape (k, dof), k <= m.
    """
    aims = goal_rows(goal)
    if len(aims) > 1:
        aims = aims[np.arange(len(starts)) % len(aims)]
    Q, _, _ = walk(robot, aims, starts, steps=iterations, patience=PATIENCE)
    return Q[goal.satisfied(robot, Q)]


def numeric(question: Question) -> Answer:
    """The method of `solve_ik`: solutions of all members of the goal side by side until one will do."""
    if question.all:
        return _many(question)
    aims = goal_rows(question.goal)
    search, going = Search(question.robot, aims, question.near), np.arange(len(aims))
    found = np.zeros((0, question.robot.dof))
    while True:
        going = going[search.advance(going)]
        found = np.vstack([found, search.q[going]])
        timed_out = time.monotonic() > question.deadline
        if len(going) == 0 or timed_out or question.accept(search.q[going]).any():
            break
    return _answered(question, found, search.steps, timed_out)


def _many(question: Question) -> Answer:
    """Solutions from many random starts, as different as they come."""
    robot, steps, timed_out = question.robot, 0, False
    found = [np.zeros((0, robot.dof))]
    aims = goal_rows(question.goal)
    for number in range(ROUNDS):
        Q = question.rng.uniform(*robot.finite_range(), (STARTS, robot.dof))
        if number == 0:
            Q[0] = question.near
        Q, reached, taken = walk(robot, aims[np.arange(STARTS) % len(aims)], Q, patience=PATIENCE)
        found.append(Q[reached])
        steps, timed_out = steps + taken, time.monotonic() > question.deadline
        if timed_out:
            break
    return _answered(question, np.vstack(found), steps, timed_out)


def _answered(question: Question, found: Matrix, steps: int, timed_out: bool) -> Answer:
    if len(found):
        return Answer(found, question.near, question.targets[0], steps, timed_out)
    return Answer(found, *nearest_posture(question, steps), timed_out=timed_out)


def targets(
    goal: PoseGoal | PositionGoal | GoalRegion, most: int, rng: np.random.Generator
) -> list[PoseGoal | PositionGoal]:
    """Goals without freedom: the goal itself, or up to ``most`` draws from a region."""
    if not isinstance(goal, GoalRegion):
        return [goal]
    free = goal.free_rotation_axis is not None or bool(goal.box.any())
    count = most if free else min(most, len(goal.members))
    return [_drawn(goal, goal.members[k % len(goal.members)], rng) for k in range(count)]


def _drawn(region: GoalRegion, member: PoseGoal | PositionGoal, rng: np.random.Generator) -> PoseGoal | PositionGoal:
    if isinstance(member, PositionGoal):
        return member
    turn = np.eye(3)
    if region.free_rotation_axis is not None:
        axis = np.eye(3)["xyz".index(region.free_rotation_axis)]
        turn = pin.exp3(rng.uniform(-np.pi, np.pi) * axis)
    shift = pin.SE3(turn, rng.uniform(-0.5, 0.5, 3) * region.box)
    return PoseGoal(member.T_world_tip * shift, member.position_tolerance, member.orientation_tolerance)
