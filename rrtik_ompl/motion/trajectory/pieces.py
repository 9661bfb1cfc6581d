"""Pieces of a motion one after the other, as a timing method makes them; a list of them becomes a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory.motion import Trajectory


class Pieces(NamedTuple):
    """Cubics one after the other, from rest to rest.

    Attributes:
        durations: Of each [s], shape (m,), greater than 0.
        positions: Where each begins, shape (m, n) [rad or m].
        velocities: With which each begins, shape (m, n).
        accelerations: With which each begins, shape (m, n).
    """

    durations: Vector
    positions: Matrix
    velocities: Matrix
    accelerations: Matrix


def joined(runs: Sequence[Pieces], path: JointPath) -> Trajectory:
    """The runs one after the other; the motion ends where ``path`` ends, and takes its names and units."""
    durations, positions, velocities, accelerations = (np.concatenate(rows) for rows in zip(*runs, strict=True))
    rest = np.zeros((1, positions.shape[1]))
    last = -2.0 * velocities[-1:] / durations[-1] - accelerations[-1:]  # of the cubic that comes to rest
    return Trajectory(
        np.concatenate([np.zeros(1), np.cumsum(durations)]),
        np.vstack([positions, path.waypoints[-1:]]),
        np.vstack([velocities, rest]),
        np.vstack([accelerations, last]),
        joint_names=path.joint_names,
        prismatic=path.prismatic,
        robot_name=path.robot_name,
    )
