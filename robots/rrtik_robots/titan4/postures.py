"""Postures of the TITAN 4 for a pose, once the azimuth and the sum psi of the three pitch angles are known.

Source: [1, ch. 3, app. A to C].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.analytic.analytic_solver import two_links, wrapped
from rrtik_robots.titan4.geometry import TitanGeometry

SIGMA = np.array([1.0, -1.0])[:, None]  # the two ways of the wrist: theta5 and pi - theta5


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Poses of E as rows of numbers: columns u and w of the rotation, and the wrist point P; each of shape (3, m)."""

    u: Matrix
    w: Matrix
    p: Matrix

    def rows(self, which: NDArray[np.int64]) -> Target:
        """The targets of these numbers."""
        return Target(self.u[:, which], self.w[:, which], self.p[:, which])


def in_plane(target: Target, c1: NDArray[np.float64], s1: NDArray[np.float64]) -> tuple[Vector, Vector]:
    """Of the gripper axis: its part along the arm in the arm plane, and the length of its part in that plane."""
    x = target.w[0] * c1 + target.w[1] * s1
    return x, np.hypot(x, target.w[2])


def completed(
    g: TitanGeometry,
    target: Target,
    theta1: NDArray[np.float64],
    turn: NDArray[np.float64],
    cosines: NDArray[np.float64],
    sines: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The other five joints, once theta1 and psi are known.

    Args:
        g: Lengths of the arm.
        target: m poses.
        theta1: Shape (k, 1 or 2, m); the second axis is the way of the wrist.
        turn: Cosine and sine of theta1, shape (2, k, 1 or 2, m).
        cosines: Of psi, shape (k, 2, m).
        sines: Of psi, shape (k, 2, m).

    Returns:
        Joint values, shape (6, k, 2, 2, m), elbow up and down in the last axis but one, and whether each is real,
        shape (k, 2, 2, m).
    """
    ux, uy, uz = target.u
    px, py, pz = target.p
    c1, s1 = turn
    s5 = target.w[1] * c1 - target.w[0] * s1
    c5 = SIGMA * in_plane(target, c1, s1)[1]

    shoulder, elbow, real = two_links(g.a2, g.a3, px * c1 + py * s1 - g.a1 - g.a4 * cosines, pz - g.a4 * sines)
    along = ux * c1 + uy * s1
    across = uy * c1 - ux * s1

    q = np.empty((6, len(theta1), 2, 2, theta1.shape[-1]))
    q[0] = theta1[:, :, None]
    q[1] = np.moveaxis(shoulder, 0, 2)
    q[2] = np.moveaxis(elbow, 0, 2)
    q[3] = wrapped(np.arctan2(sines, cosines)[:, :, None] - q[1] - q[2])
    q[4] = np.arctan2(s5, c5)[:, :, None]
    roll = np.arctan2(s5 * (along * cosines + uz * sines) - c5 * across, uz * cosines - along * sines)
    q[5] = roll[:, :, None]
    return q, np.repeat(real[:, :, None], 2, axis=2)
