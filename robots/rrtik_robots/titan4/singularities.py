"""How near the TITAN 4 is to its singularities: three families and the three published cases of self-motion.

Source: [1, ch. 3, app. A to C]. The determinant of the Jacobian is -a2 a3 r sin(theta3) cos(theta5), where r is the
signed distance of the wrist point from the azimuth axis.
"""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_robots.titan4.geometry import TitanGeometry


def nearness(g: TitanGeometry, Q: Matrix) -> dict[str, Vector]:
    """Return for each singular case a value that is 0 at the singularity, for Q, shape (m, 6); shape (m,) each.

    The values are sines and cosines, and metres for ``shoulder``. ``elbow``: the elbow is stretched or folded, at the
    border of the workspace. ``wrist`` and ``case 3``: the gripper axis is normal to the arm plane. ``shoulder``: the
    wrist point is on the azimuth axis. ``case 1``: axis 5 is on axis 1. ``case 2``: axis 6 is on axis 1.
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
    """Return the signed distance of the wrist point from the azimuth axis in the arm plane [m], shape (m,)."""
    shoulder = Q[:, 1]
    elbow = Q[:, 1] + Q[:, 2]
    psi = Q[:, 1:4].sum(axis=1)
    radius: Vector = g.a1 + g.a2 * np.cos(shoulder) + g.a3 * np.cos(elbow) + g.a4 * np.cos(psi)
    return radius


def determinant(g: TitanGeometry, Q: Matrix) -> Vector:
    """Return the determinant of the Jacobian, with rows (angular; linear), for Q, shape (m, 6); shape (m,)."""
    value: Vector = -g.a2 * g.a3 * wrist_radius(g, Q) * np.sin(Q[:, 2]) * np.cos(Q[:, 4])
    return value
