"""A trajectory followed by numeric steps, from several solutions of its first point at once."""

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

ROUNDS_PER_POINT = 4  # of random starts at a point that no motion leads to
CARRIED = 8  # solutions that are followed side by side, those nearest to the posture before


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """One trajectory as numeric trackers get it.

    Attributes:
        robot: The arm.
        targets: Of the points: poses, positions, or poses whose turn about an axis is free.
        accept: Which of some configurations, shape (k, dof), will do.
        jump: Motion of one joint between two points [rad or m] from which on it counts as a jump.
        rng: Random numbers.
        budget: How long it may take.
    """

    robot: Robot
    targets: Sequence[TipGoal]
    accept: Callable[[Matrix], Mask]
    jump: float
    rng: np.random.Generator
    budget: Budget

    def follow(self, near: Vector | None) -> tuple[Matrix, int]:
        """Configurations of all points, shape (k, dof), NaN where none was found, and the steps taken.

        Solutions of the first point are carried on side by side; the one that comes farthest, with the least motion,
        is taken. Where none can go on, the next point is solved afresh.
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
        """Different solutions of one point, at most `CARRIED`, nearest to the posture before first, and the steps."""
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
        """Follow the trajectory from solutions of a point until none can go on; shape (points, survivors, dof)."""
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
        """The rows that are at the target and will do."""
        Q = Q[target.satisfied(self.robot, Q)]
        usable: Matrix = Q[self.accept(Q)]
        return usable
