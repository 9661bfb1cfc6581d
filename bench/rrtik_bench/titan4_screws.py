"""TITAN-4 by screws [1, ch. 3, equations 3.5 and 3.37]: kinematics, the Jacobian at P, coincidences of rank 4."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import Bar, Row, judged, small
from rrtik_bench.tables import Table
from rrtik_bench.titan4 import A1, A2, A3, A4, D6, RANK_TOLERANCE, RIGHT
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.model.robot import Robot

SOURCE = "[1, ch. 3, equations 3.5 and 3.37]"
SCREWS = (  # direction of each axis and a point on it [m], all joints at zero
    ((0.0, 0.0, 1.0), 0.0),
    ((0.0, -1.0, 0.0), A1),
    ((0.0, -1.0, 0.0), A1 + A2),
    ((0.0, -1.0, 0.0), A1 + A2 + A3),
    ((0.0, 0.0, 1.0), A1 + A2 + A3 + A4),
    ((1.0, 0.0, 0.0), 0.0),
)
REFERENCE = np.array([[0.0, 0, 1, A1 + A2 + A3 + A4 + D6], [0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
STRAIGHT = np.array([0.0, np.pi])


def screw_poses(Q: Matrix) -> NDArray[np.float64]:
    """The product of six screw displacements and the reference pose, shoulder frame, shape (m, 4, 4)."""
    poses = np.empty((len(Q), 4, 4))
    for row, q in enumerate(Q):
        T = np.eye(4)
        for angle, (direction, along) in zip(q, SCREWS, strict=True):
            turn, point = pin.exp3(angle * np.array(direction)), np.array([along, 0.0, 0.0])
            step = np.eye(4)
            step[:3, :3], step[:3, 3] = turn, point - turn @ point
            T = T @ step
        poses[row] = T @ REFERENCE
    return poses


def screw_jacobian(Q: Matrix) -> NDArray[np.float64]:
    """(3.37): rows (omega; v) of P in the axes of link 4, physical angles, shape (m, 6, 6)."""
    s34, c34 = np.sin(Q[:, 2] + Q[:, 3]), np.cos(Q[:, 2] + Q[:, 3])
    s4, c4, psi = np.sin(Q[:, 3]), np.cos(Q[:, 3]), Q[:, 1:4].sum(axis=1)
    J = np.zeros((len(Q), 6, 6))
    J[:, 0, 0], J[:, 2, 0] = np.sin(psi), np.cos(psi)
    J[:, 1, 1:4] = -1.0
    J[:, 2, 4] = 1.0
    J[:, 0, 5], J[:, 1, 5] = np.cos(Q[:, 4]), np.sin(Q[:, 4])
    J[:, 3, 1], J[:, 3, 2] = A3 * s4 + A2 * s34, A3 * s4
    J[:, 4, 0] = A1 + A2 * np.cos(Q[:, 1]) + A3 * np.cos(Q[:, 1] + Q[:, 2]) + A4 * np.cos(psi)
    J[:, 5, 1], J[:, 5, 2], J[:, 5, 3] = A4 + A3 * c4 + A2 * c34, A4 + A3 * c4, A4
    return J


def jacobian_at_p(robot: Robot, Q: Matrix) -> NDArray[np.float64]:
    """The robot's own Jacobian, moved from the tip to P and into the axes of link 4, in the same order of rows."""
    J, tips, psi = robot.jacobian_batch(Q), robot.fk_batch(Q), Q[:, 1:4].sum(axis=1)
    moved = np.empty_like(J)
    for k in range(len(Q)):
        axes = pin.exp3(np.array([0.0, 0.0, Q[k, 0]])) @ pin.exp3(np.array([0.0, -psi[k], 0.0]))
        linear = J[k, :3] - np.cross(J[k, 3:].T, D6 * tips[k, :3, 2]).T
        moved[k] = np.vstack([axes.T @ J[k, 3:], axes.T @ linear])
    return moved


def coincidences(rng: np.random.Generator, count: int) -> dict[str, Matrix]:
    """Two families at once with a further coincidence, shape (count, 6) each."""
    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    collinear, level, straight = Q.copy(), Q.copy(), Q.copy()
    collinear[:, 2:4], collinear[:, 4] = rng.choice(STRAIGHT, (count, 2)), rng.choice([-RIGHT, RIGHT], count)
    level[:, 4] = rng.choice([-RIGHT, RIGHT], count)
    straight[:, 2], straight[:, 4] = rng.choice(STRAIGHT, count), rng.choice(STRAIGHT, count)
    for rows, elbow in ((level, False), (straight, True)):
        for q in rows:
            _onto_axis_1(q, rng, elbow)
    return {
        "elbow and wrist, A, B, C and P on a line": collinear,
        "shoulder and wrist, link 4 level": level,
        "elbow and shoulder, wrist straight": straight,
    }


def _onto_axis_1(q: Matrix, rng: np.random.Generator, elbow: bool) -> None:
    """P to axis 1: by theta2 and theta3 with link 4 level, or by theta4 where the elbow is straight."""
    while True:
        q[1] = rng.uniform(-np.pi, np.pi)
        rest = A1 + A2 * np.cos(q[1]) + (A3 * np.cos(q[1] + q[2]) if elbow else A4)
        cosine = -rest / (A4 if elbow else A3)
        if abs(cosine) < 1.0:
            break
    if elbow:
        q[3] = np.arccos(cosine) - q[1] - q[2]
    else:
        q[2] = np.arccos(cosine) - q[1]
        q[3] = -q[1] - q[2]


def screws(quick: bool) -> list[Row]:
    """Formulas by screws, and where the rank falls to 4."""
    robot, count = rrtik.load_robot("titan4"), 100 if quick else 2_000
    rng = np.random.default_rng(6)
    Q = rng.uniform(-np.pi, np.pi, (count, 6))
    shoulder = robot.fk_batch(np.zeros((1, 6)), robot.link_names[0])[0, :3, 3]
    tips = robot.fk_batch(Q)
    tips[:, :3, 3] -= shoulder
    off = float(np.abs(screw_poses(Q) - tips).max())
    bent = float(np.abs(screw_jacobian(Q) - jacobian_at_p(robot, Q)).max())
    rows = [
        judged("product of six screws and the reference pose", "equation 3.5", f"off {off:.0e}", off, small(1e-12)),
        judged(
            "screw Jacobian at P",
            "equation 3.37",
            f"off {bent:.0e}",
            bent,
            small(1e-12),
            "theta5 physical: the print has its sine and cosine for those of the DH angle",
        ),
    ]
    for name, postures in coincidences(rng, count).items():
        values = np.linalg.svd(robot.jacobian_batch(postures), compute_uv=False)
        found = sorted(set((values > RANK_TOLERANCE).sum(axis=1).tolist()))
        one = found[0] if len(found) == 1 else np.nan
        rows.append(
            judged(
                f"rank, {name}",
                "4 for any two families",
                ", ".join(map(str, found)),
                one,
                Bar((0.0, 6.0), held=(4.0, 4.0)),
                "two families alone leave 5: see titan4-singularities",
            )
        )
    return rows


TABLES = (
    Table(
        "titan4-screws",
        "Screws: kinematics, Jacobian, rank 4",
        SOURCE,
        screws,
        2,
        1,
        bars="equations and ranks of the source; the tolerance of 1e-12 ours",
    ),
)
