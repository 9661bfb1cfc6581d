"""MB-RRT as a method of inverse kinematics."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.ik.mb_rrt.axes import misfit
from rrtik_ompl.ik.mb_rrt.search import ROUNDS, search
from rrtik_ompl.ik.method_interface import Answer, Question, Target
from rrtik_ompl.ik.numeric.restarts import nearest_posture
from rrtik_ompl.robot import Robot

ALL_ROUNDS = 8  # of the workspace tree where every solution is wanted


def mb_rrt_misfit(robot: Robot, target: Target) -> str:
    """Why the tree cannot stand for a robot's links; "" if it can."""
    del target
    return misfit(robot)


def mb_rrt(question: Question) -> Answer:
    """A tree in the workspace for one target after the other, until a solution will do."""
    robot, count = question.robot, len(question.targets)
    rows, passes = np.zeros((0, robot.dof)), 0
    for target in question.targets:
        found = search(
            robot,
            target,
            near=question.near,
            accept=question.accept,
            rng=question.rng,
            deadline=question.deadline,
            world=question.world,
            all=question.all,
            rounds=max(1, (ALL_ROUNDS if question.all else ROUNDS) // count),
        )
        rows, passes = np.vstack([rows, found.q]), passes + found.passes
        if found.timed_out or (question.accept(found.q).any() and not question.all):
            break
    return Answer(rows, question.near if len(rows) else nearest_posture(question), passes, found.timed_out)
