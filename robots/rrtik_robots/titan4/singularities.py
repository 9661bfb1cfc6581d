"""How near the TITAN 4 is to its singularities: three families and the three published cases of self-motion.

Source: [1, ch. 3, app. A to C]. The determinant of the Jacobian is
-a2 a3 r sin(theta3) cos(theta5) with r the signed distance of the wrist point from the azimuth axis.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_robots.titan4.geometry import TitanGeometry


def nearness(g: TitanGeometry, Q: Matrix) -> dict[str, Vector]:
    """Zero at the singularity, for Q of shape (m, 6): sines and cosines, for ``shoulder`` metres.

    ``elbow``: stretched or folded, the border of the workspace. ``wrist``: gripper axis normal to the arm plane, which
    is case 3. ``shoulder``: wrist point on the azimuth axis. ``case 1``: axis 5 on axis 1. ``case 2``: axis 6 on it.
    """
    radius = np.abs(wrist_radius(g, Q))
    psi = Q[:, 1:4].sum(axis=1)
    wrist = np.abs(np.cos(Q[:, 4]))
    tilt = np.cos(Q[:, 4]) * np.sin(psi)
    return {
        "elbow": np.abs(np.sin(Q[:, 2])),
        "wrist": wrist,
        "shoulder": radius,
        "case 1": np.hypot(radius, np.sin(psi)),
        "case 2": np.hypot(radius, np.sqrt(np.clip(1.0 - tilt * tilt, 0.0, None))),
        "case 3": wrist,
    }


def wrist_radius(g: TitanGeometry, Q: Matrix) -> Vector:
    """Signed distance of the wrist point from the azimuth axis, in the arm plane [m], shape (m,)."""
    shoulder = Q[:, 1]
    elbow = Q[:, 1] + Q[:, 2]
    psi = Q[:, 1:4].sum(axis=1)
    radius: Vector = g.a1 + g.a2 * np.cos(shoulder) + g.a3 * np.cos(elbow) + g.a4 * np.cos(psi)
    return radius


def determinant(g: TitanGeometry, Q: Matrix) -> Vector:
    """Determinant of the Jacobian, rows (angular; linear), for Q of shape (m, 6). Shape (m,)."""
    value: Vector = -g.a2 * g.a3 * wrist_radius(g, Q) * np.sin(Q[:, 2]) * np.cos(Q[:, 4])
    return value
