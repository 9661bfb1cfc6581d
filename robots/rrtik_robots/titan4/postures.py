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
    """Poses of the grip point E, column by column; all arrays have shape (3, m).

    Attributes:
        u: First column of the rotation.
        w: Third column of the rotation, the gripper axis.
        p: Wrist point [m].
    """

    u: Matrix
    w: Matrix
    p: Matrix

    def rows(self, which: NDArray[np.int64]) -> Target:
        """Return the targets with these indices."""
        return Target(self.u[:, which], self.w[:, which], self.p[:, which])


def in_plane(target: Target, c1: NDArray[np.float64], s1: NDArray[np.float64]) -> tuple[Vector, Vector]:
    """Return two components of the gripper axis for arm planes with the given cosine and sine of theta1.

    Returns:
        The component along the arm plane's horizontal, and the length of the projection onto the arm plane.
    """
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
    """Compute the other five joints from theta1 and psi, the sum of the three pitch angles.

    Args:
        g: Lengths of the arm.
        target: m poses.
        theta1: Azimuths [rad], shape (k, 1 or 2, m); the second axis is the wrist's branch.
        turn: Cosine and sine of theta1, shape (2, k, 1 or 2, m).
        cosines: Cosines of psi, shape (k, 2, m).
        sines: Sines of psi, shape (k, 2, m).

    Returns:
        Joint angles [rad], shape (6, k, 2, 2, m), with elbow up and down in the last axis but one, and whether each
        posture reaches its pose, shape (k, 2, 2, m).
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
