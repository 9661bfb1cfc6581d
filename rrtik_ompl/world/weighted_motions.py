"""Motions in weighted coordinates: joint values are multiplied by weights, so Euclidean lengths are weighted lengths.

Searches that have no notion of weights run in these coordinates, and their results are divided by the weights again.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen
from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.motion_queries import MotionQueries, is_conservative, keeps_constraints, kernel_tables

if TYPE_CHECKING:
    from rrtik_ompl.world.world import World


class WeightedMotions(MotionQueries):
    """The motions of a world in weighted coordinates.

    Attributes:
        robot: The arm with limits and joint values in these coordinates.
        fast, motions: The tables for kernels; None where the world has none.
        constraints, free_motions: See :class:`rrtik_ompl.World`; None where there are none.
        weights, motion_resolution, accuracy: See :class:`rrtik_ompl.World`.

    Args:
        world: A world, or a stand-in that checks motions of its robot.
        weights: Weights of the joints, shape (dof,).
    """

    def __init__(self, world: World, weights: Vector) -> None:
        robot: Robot = world.robot
        self._world = world
        self._scale = weights

        # Joint values of the chain stay the same if the gain is divided by the weights.
        chain = replace(robot.chain, gain=frozen(robot.chain.gain / weights))
        lower = frozen(robot.lower * weights)
        upper = frozen(robot.upper * weights)
        self.robot = replace(robot, chain=chain, lower=lower, upper=upper, joint_weights=MappingProxyType({}))

        motions: FastMotions | None = getattr(world, "motions", None)
        self.motions = None if motions is None else motions.scaled(weights)
        self.fast: FastWorld | None = None if motions is None else kernel_tables(world)

        self.constraints: HeldRegions | None = None
        self.free_motions: FastMotions | None = None
        if keeps_constraints(world):
            self.constraints = world.constraints.of_robot(self.robot)
            free = world.free_motions
            self.free_motions = None if free is None else free.scaled(weights)

        self.weights: Vector = world.weights / weights
        self.motion_resolution = float(world.motion_resolution)
        self.accuracy: Accuracy = "conservative" if is_conservative(world) else "exact"

    def valid_batch(self, Q: Matrix) -> Mask:
        """Return which configurations Q, shape (m, n), are free, shape (m,)."""
        return np.asarray(self._world.valid_batch(self._unweighted(Q)))

    def motion_valid_batch(self, A: Matrix, B: Matrix) -> Mask:
        """Return which straight motions A[k] -> B[k], shapes (m, n), are free, shape (m,)."""
        return np.asarray(self._world.motion_valid_batch(self._unweighted(A), self._unweighted(B)))

    def weighted_rows(self, rows: Matrix) -> Matrix:
        """Return configurations in weighted coordinates, shape (..., n)."""
        return np.asarray(rows * self._scale)

    def joint_rows(self, rows: Matrix, known: Matrix) -> Matrix:
        """Return weighted rows as configurations of the arm, shape (m, n).

        Values of ``known`` configurations, shape (k, n), are restored bit for bit.
        """
        unweighted = self._unweighted(rows)
        for row in known:
            unweighted = np.where(rows == row * self._scale, row, unweighted)
        return np.asarray(unweighted)

    def _unweighted(self, Q: Matrix) -> Matrix:
        """Convert configurations in weighted coordinates to joint values of the world, shape (m, n)."""
        return np.asarray(Q / self._scale)
