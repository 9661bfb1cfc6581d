"""A problem of an arm with joint weights, in coordinates in which distances are weighted."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix, frozen
from rrtik_ompl.base.copies import changed
from rrtik_ompl.description.joint_weights import weights_of
from rrtik_ompl.world.motion_queries import MotionQueries
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.weighted_motions import WeightedMotions


class WeightedProblem:
    """A problem whose configurations are multiplied by the weights of their joints.

    Attributes:
        problem: Its start and motions are in weighted coordinates; its goal is unchanged.

    Args:
        problem: A problem of a robot with joint weights.
        motions: Checks which motions are free; None for the problem's world.
    """

    def __init__(self, problem: Problem, motions: MotionQueries | None = None) -> None:
        self._scale = weights_of(problem.robot)
        self._start = problem.start

        asked: Any = problem.world if motions is None else motions  # it has the parts of a world that are needed
        weighted = WeightedMotions(asked, self._scale)

        settings = changed(problem.settings, robot=weighted.robot)
        start = frozen(problem.start * self._scale)
        self.problem = changed(problem, settings=settings, start=start, world=weighted)

    def weighted_rows(self, rows: Matrix) -> Matrix:
        """Return configurations in weighted coordinates, shape (m, dof)."""
        return np.asarray(rows * self._scale)

    def joint_rows(self, rows: Matrix, known: Matrix) -> Matrix:
        """Return weighted rows as configurations of the arm, shape (m, dof).

        Values of ``known`` configurations, shape (k, dof), are restored bit for bit.
        """
        unweighted = rows / self._scale
        for row in known:
            unweighted = np.where(rows == row * self._scale, row, unweighted)
        return np.asarray(unweighted)

    def joint_path(self, rows: Matrix | None, goals: Matrix) -> Matrix | None:
        """Return a weighted path to one of some goals as a path of the arm, shape (k, dof), or None."""
        return None if rows is None else self.joint_rows(rows, np.vstack([self._start, goals]))


def has_weights(problem: Problem) -> bool:
    """Check whether the robot has joint weights, so that lengths are weighted."""
    return bool(problem.robot.joint_weights)
