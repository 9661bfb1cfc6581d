"""What scripts read from problems."""

from __future__ import annotations

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.world.problem import Problem


def goal_joints(problem: Problem) -> Vector:
    """The goal of a problem whose goal is one configuration."""
    assert isinstance(problem.goal, JointGoal)
    return problem.goal.q
