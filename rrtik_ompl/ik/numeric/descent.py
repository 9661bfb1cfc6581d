"""Levenberg-Marquardt from many starts to many goals: in kernels, or in numpy where there are none."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.ik.kernel_tables import SEEDS, KernelCall, limb_of, seeded_limb_of, seeds_of, spare_calls
from rrtik_ompl.ik.targets import goal_rows
from rrtik_ompl.kernels.ik.ik_layout import KERNELS, LimbTable
from rrtik_ompl.kernels.reference.descent import farness, walk_plainly
from rrtik_ompl.kernels.simd.library import Library, library
from rrtik_ompl.model.goal import TipGoal
from rrtik_ompl.model.robot import Robot

STEPS = 60  # largest number of steps of one start
AT_A_TIME = 4096  # goals in one call of a kernel, which cannot be interrupted
PATIENCE = 5  # number of steps after which a start that has come no nearer is given up


def walk(
    robot: Robot, aims: Matrix, starts: Matrix, *, steps: int = STEPS, patience: int | None = None
) -> tuple[Matrix, Mask, int]:
    """Descend from each start towards its goal inside the joint limits.

    Args:
        robot: The arm.
        aims: Goals, one for each start or one for all, shape (m, 18) or (1, 18), see `rrtik_ompl.ik.targets`.
        starts: Configurations to start from, shape (m, dof).
        steps: Largest number of steps.
        patience: Number of steps after which a start that has come no nearer is given up; never if None.

    Returns:
        The last configuration of each start, shape (m, dof), whether it is at its goal, shape (m,), and the largest
        number of steps that a start has taken.
    """
    patience = steps + 1 if patience is None else patience
    kernels = library(KERNELS)
    limb = limb_of(robot)
    if kernels is None or limb is None:
        return walk_plainly(robot, aims, starts, steps, patience)

    call = KernelCall(limb, aims, np.clip(starts, robot.lower, robot.upper), steps, patience)
    most_steps = kernels.walk(limb.address, call.address)
    return call.q, call.reached, most_steps


def descend(robot: Robot, goal: TipGoal, starts: Matrix, *, iterations: int = STEPS) -> tuple[Matrix, int]:
    """Descend from each start towards a goal that has one member, such as a pose with a free rotation axis.

    Returns:
        The last configuration of each start, at the goal or not, shape (m, dof), and the number of steps taken.
    """
    Q, _, taken = walk(robot, goal_rows(goal), starts, steps=iterations)
    return Q, taken


class SearchOfOne:
    """`Search` for a single goal, by kernels, in memory that is kept between searches.

    Args:
        kernels: The library of kernels.
        limb: The table of the arm with seeds, see `rrtik_ompl.ik.kernel_tables`.
        aim: The goal, shape (1, 18).
        near: Configuration inside the limits to start from, shape (dof,).

    Attributes:
        steps: Number of steps taken by all starts together.
    """

    def __init__(self, kernels: Library, limb: LimbTable, aim: Matrix, near: Vector) -> None:
        self._kernels = kernels
        self._limb = limb
        self.steps = 0
        try:
            self._call = spare_calls(limb).pop()
        except IndexError:  # There is no spare call: none was made yet, or all are in use.
            self._call = KernelCall(limb, aim, near[None], STEPS, PATIENCE, near[None], np.zeros(1, dtype=np.int64))
        else:
            self._call.begin(aim, near)

    def advance(self) -> Matrix:
        """Return the next solution, shape (1, dof), or shape (0, dof) if no starts are left."""
        solved = self._kernels.solve(self._limb.address, self._call.address)
        self.steps += self._call.steps
        return self._call.q[:solved].copy()

    def close(self) -> None:
        """End this search and leave its memory to the next one."""
        spare_calls(self._limb).append(self._call)


class Search:
    """A search for solutions of many goals side by side, one solution after the other for each goal.

    Each goal is tried from the given configuration first, then from the seeds whose tips are nearest to the goal. The
    solutions depend only on the arguments, not on the order in which goals are solved.

    Args:
        robot: The arm.
        aims: Goals, shape (m, 18), see `rrtik_ompl.ik.targets`.
        near: Configuration to start from, shape (dof,), or one for each goal, shape (m, dof).

    Attributes:
        q: The last solution of each goal, shape (m, dof).
        steps: Number of steps taken by all starts together.
    """

    def __init__(self, robot: Robot, aims: Matrix, near: ArrayLike) -> None:
        self._robot = robot
        self._aims = aims
        self._near = np.empty((len(aims), robot.dof))
        self._near[:] = robot.clamp(np.asarray(near))
        self._num_starts = np.zeros(len(aims), dtype=np.int64)  # number of starts that each goal has tried
        self.q: Matrix = self._near.copy()
        self.steps = 0

    def advance(self, rows: NDArray[np.int64]) -> Mask:
        """Find the next solution of some goals and write it to ``q``.

        Args:
            rows: Indices of the goals, shape (k,).

        Returns:
            Whether each of them has another solution, shape (k,). A goal without one has tried all of its 513 starts.
        """
        if len(rows) <= AT_A_TIME:
            return self._advance(rows)
        return np.concatenate([self._advance(rows[k : k + AT_A_TIME]) for k in range(0, len(rows), AT_A_TIME)])

    def _advance(self, rows: NDArray[np.int64]) -> Mask:
        """Find the next solution of some goals as :meth:`advance` does, in one call of the kernel."""
        kernels = library(KERNELS)
        limb = seeded_limb_of(self._robot)
        if kernels is None or limb is None:
            return self._advance_plainly(rows)

        call = KernelCall(
            limb, self._aims[rows], self.q[rows], STEPS, PATIENCE, self._near[rows], self._num_starts[rows]
        )
        kernels.solve(limb.address, call.address)
        self.steps += call.steps
        self.q[rows] = call.q
        self._num_starts[rows] = call.next
        return call.reached

    def _advance_plainly(self, rows: NDArray[np.int64]) -> Mask:
        """Find the next solution of some goals as :meth:`advance` does, in numpy."""
        seeds = seeds_of(self._robot)
        reached = np.zeros(len(rows), dtype=bool)
        order = np.argsort(farness(self._robot, self._aims[rows], seeds.tips), axis=1, kind="stable")

        while True:
            open_rows = np.flatnonzero(~reached & (self._num_starts[rows] <= SEEDS))
            if len(open_rows) == 0:
                return reached

            going = rows[open_rows]
            start_number = self._num_starts[going]
            nearest_seeds = seeds.q[order[open_rows, np.maximum(start_number, 1) - 1]]
            starts = np.where((start_number == 0)[:, None], self._near[going], nearest_seeds)

            q, at_goal, taken = walk_plainly(self._robot, self._aims[going], starts, STEPS, PATIENCE)
            self.q[going] = q
            reached[open_rows] = at_goal
            self._num_starts[going] += 1
            self.steps += taken
