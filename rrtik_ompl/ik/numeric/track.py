"""Numeric tracking of a trajectory, from several solutions of its first point side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.ik.method_interface import different_rows
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.ik.numeric.restarts import STARTS
from rrtik_ompl.model.goal import TipGoal, joint_difference
from rrtik_ompl.model.robot import Robot

ROUNDS_PER_POINT = 4  # rounds of random starts at a point to which no motion leads
CARRIED = 8  # number of solutions that are followed side by side, those nearest to the previous configuration


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """Follows one trajectory numerically.

    Attributes:
        robot: The arm.
        targets: Goals of the points: poses, positions, or poses with a free rotation axis.
        accept: Checks which configurations, shape (k, dof), are acceptable; returns shape (k,).
        jump: Motion of one joint between two points [rad or m] above which it counts as a jump.
        rng: Source of random numbers.
        budget: Time limit.
    """

    robot: Robot
    targets: Sequence[TipGoal]
    accept: Callable[[Matrix], Mask]
    jump: float
    rng: np.random.Generator
    budget: Budget

    def follow(self, near: Vector | None) -> tuple[Matrix, int]:
        """Follow the trajectory.

        Solutions of the first point are continued side by side. Of those that come farthest, the one with the least
        motion is taken. Where none can go on, the next point is solved from random starts again.

        Args:
            near: Configuration before the first point, shape (dof,), or None.

        Returns:
            Configurations of all points, shape (k, dof), NaN where none was found, and the number of steps taken.
        """
        q = np.full((len(self.targets), self.robot.dof), np.nan)
        point = 0
        last = near
        steps = 0
        while point < len(q) and not self.budget.over():
            first_solutions, taken = self.fresh(self.targets[point], last)
            steps += taken
            if len(first_solutions) == 0:
                point += 1
                continue

            tracks, taken = self.carry(first_solutions, point)
            steps += taken
            travel = np.abs(joint_difference(self.robot, tracks[1:], tracks[:-1])).sum(axis=(0, 2))
            if last is not None:
                travel += np.abs(joint_difference(self.robot, tracks[0], last)).sum(axis=1)
            best = tracks[:, int(np.argmin(travel))]

            q[point : point + len(best)] = best
            point += len(best)
            last = best[-1]
        return q, steps

    def fresh(self, target: TipGoal, last: Vector | None) -> tuple[Matrix, int]:
        """Solve one point from random starts.

        Args:
            target: Goal of the point.
            last: Configuration before it, shape (dof,), or None.

        Returns:
            At most `CARRIED` different solutions, nearest to ``last`` first, shape (k, dof), and the number of steps.
        """
        steps = 0
        for number in range(ROUNDS_PER_POINT):
            starts = self.rng.uniform(*self.robot.finite_range(), (STARTS, self.robot.dof))
            if number == 0 and last is not None:
                starts[0] = last
            Q, taken = descend(self.robot, target, starts)
            steps += taken
            Q = self.usable_rows(target, Q)
            if len(Q) or self.budget.over():
                break

        distance = np.zeros(len(Q)) if last is None else np.linalg.norm(joint_difference(self.robot, Q, last), axis=1)
        different = different_rows(Q, np.argsort(distance, kind="stable"))[:CARRIED]
        return Q[different], steps

    def carry(self, begun: Matrix, point: int) -> tuple[NDArray[np.float64], int]:
        """Follow the trajectory from solutions of a point until none can go on without a jump.

        Each descent starts from the linear extrapolation of the last two configurations.

        Args:
            begun: Solutions of the point, shape (k, dof).
            point: Index of the point.

        Returns:
            The tracks that came farthest, shape (points, tracks, dof), and the number of steps.
        """
        tracks = begun[None]
        steps = 0
        for target in self.targets[point + 1 :]:
            if self.budget.over():
                break
            current = tracks[-1]
            guess = 2.0 * current - tracks[-2] if len(tracks) > 1 else current
            Q, taken = descend(self.robot, target, guess)
            steps += taken
            moved = np.abs(joint_difference(self.robot, Q, current)).max(axis=1)
            goes_on = target.satisfied(self.robot, Q) & (moved <= self.jump)
            goes_on[goes_on] = self.accept(Q[goes_on])
            if not goes_on.any():
                break

            tracks = np.concatenate([tracks[:, goes_on], Q[None, goes_on]])
        return tracks, steps

    def usable_rows(self, target: TipGoal, Q: Matrix) -> Matrix:
        """Return the rows of Q, shape (m, dof), that are at the target and accepted."""
        Q = Q[target.satisfied(self.robot, Q)]
        usable: Matrix = Q[self.accept(Q)]
        return usable
