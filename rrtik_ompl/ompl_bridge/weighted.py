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
        self._start = problem.start

        asked: Any = problem.world if motions is None else motions  # it has the parts of a world that are needed
        self._weighted = weighted = WeightedMotions(asked, weights_of(problem.robot))

        settings = changed(problem.settings, robot=weighted.robot)
        start = frozen(weighted.weighted_rows(problem.start))
        self.problem = changed(problem, settings=settings, start=start, world=weighted)

    def weighted_rows(self, rows: Matrix) -> Matrix:
        """Return configurations in weighted coordinates, shape (m, dof)."""
        return self._weighted.weighted_rows(rows)

    def joint_rows(self, rows: Matrix, known: Matrix) -> Matrix:
        """Return weighted rows as configurations of the arm; see :meth:`WeightedMotions.joint_rows`."""
        return self._weighted.joint_rows(rows, known)

    def joint_path(self, rows: Matrix | None, goals: Matrix) -> Matrix | None:
        """Return a weighted path to one of some goals as a path of the arm, shape (k, dof), or None."""
        return None if rows is None else self.joint_rows(rows, np.vstack([self._start, goals]))


def has_weights(problem: Problem) -> bool:
    """Check whether the robot has joint weights, so that lengths are weighted."""
    return bool(problem.robot.joint_weights)
