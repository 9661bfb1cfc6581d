"""Inverse kinematics of the PUMA 560 in closed form: eight branches of the six-joint arm, four of the cut ones.

The wrist centre determines the azimuth (front or back) and a triangle (elbow up or down); the remaining rotation
determines the three wrist angles in two ways. Arrays have the axes (shoulder, elbow, wrist, m).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver, Branches, two_links, wrapped
from rrtik_ompl.kernels.ik.branch_layout import REACH_TOLERANCE, SHOULDER_ROOT, SINGULAR

Numbers = NDArray[np.float64]
MISFIT = 1e-9  # largest sine of the angle between axis 5 and its wanted direction that five joints count as in reach
ARM_BRANCHES = tuple(" ".join(tag) for tag in product(("front", "back"), ("up", "down")))
BRANCHES = tuple(" ".join(tag) for tag in product(("front", "back"), ("up", "down"), ("near", "flip")))


@dataclass(frozen=True, slots=True)
class PumaGeometry:
    """Lengths [m] in the standard Denavit-Hartenberg convention, with z of the shoulder's axis to the right of the arm.

    Attributes:
        base: Height of the shoulder.
        a2: Length of the upper arm.
        a3, d4: Offset across the forearm, and length along it.
        d3: Sideways offset of the arm plane.
    """

    base: float
    a2: float
    a3: float
    d3: float
    d4: float

    @property
    def forearm(self) -> float:
        """Distance from the elbow axis to the wrist centre [m]."""
        return float(np.hypot(self.a3, self.d4))


def pose_form(geometry: PumaGeometry) -> AnalyticSolver:
    """Return the closed form of the six-joint arm; with a straight wrist (family ``wrist``) theta4 is free."""
    solve = partial(puma_branches, geometry)
    near = partial(nearness, geometry)
    numbers = (geometry.base, geometry.a2, geometry.d3, geometry.forearm, float(np.arctan2(geometry.d4, geometry.a3)))
    return AnalyticSolver("tip", "pose", BRANCHES, ("wrist",), (3,), solve, near, kernel="ball_arm", numbers=numbers)


def position_form(geometry: PumaGeometry) -> AnalyticSolver:
    """Return the closed form of the first three joints, modified Denavit-Hartenberg (theta2, theta3 turn downwards)."""
    solve = partial(arm_branches, geometry)
    return AnalyticSolver("tip", "position", ARM_BRANCHES, (), (), solve, partial(nearness, geometry))


def five_joint_form(geometry: PumaGeometry, tool: float) -> AnalyticSolver:
    """Return the closed form of five joints with a segment of length ``tool`` [m] along the last axis, for poses."""
    solve = partial(five_joint_branches, geometry, tool)
    return AnalyticSolver("tip", "pose", ARM_BRANCHES, (), (), solve, partial(nearness, geometry))


def puma_branches(
    g: PumaGeometry, poses: Numbers, near: Matrix | None = None, slack: float = 0.0, *_: object
) -> Branches:
    """Return all eight branches, labelled as in ``BRANCHES``.

    Args:
        g: Lengths of the arm.
        poses: Targets T_base_tip, shape (m, 4, 4); their origin is the wrist centre.
        near: Configurations whose theta4 a straight wrist takes, shape (m, 6); zeros if None.
        slack: Sine of theta5 up to which the wrist counts as straight, if that is more than rounding.
        _: The joint limits, which are not used: theta6 reaches every direction, so any theta4 inside its limits will
            do.
    """
    numbers = np.ascontiguousarray(poses.transpose(1, 2, 0))
    count = len(poses)
    u, v, w, p = numbers[:3].transpose(1, 0, 2)

    arm, real = _arm(g, p[0], p[1], p[2] - g.base)
    q = np.empty((6, 2, 2, 2, count))
    q[:3] = arm[:, :, :, None]

    # The tip's axis w in the frame of the forearm: theta4 turns axis 5 normal to it, and theta5 is its tilt.
    c1 = np.cos(arm[0])
    s1 = np.sin(arm[0])
    c23 = np.cos(arm[1] + arm[2])
    s23 = np.sin(arm[1] + arm[2])
    forward = w[0] * c1 + w[1] * s1
    x = forward * c23 + w[2] * s23
    y = w[1] * c1 - w[0] * s1
    z = w[2] * c23 - forward * s23

    sine = np.hypot(x, y)
    straight = sine < max(SINGULAR, slack)
    theta4 = np.where(straight, 0.0 if near is None else near[:, 3], np.arctan2(-y, -x))
    theta5 = np.arctan2(sine, z)

    # The reversed axis of joint 5 and the tip's u and v determine theta6.
    c4 = np.cos(theta4)
    s4 = np.sin(theta4)
    ax = -s4 * c23 * c1 - c4 * s1
    ay = -s4 * c23 * s1 + c4 * c1
    az = -s4 * s23
    theta6 = np.arctan2(ax * u[0] + ay * u[1] + az * u[2], ax * v[0] + ay * v[1] + az * v[2])

    q[3, :, :, 0] = theta4
    q[4, :, :, 0] = theta5
    q[5, :, :, 0] = theta6
    q[3, :, :, 1] = _opposite(theta4)  # The second way has the wrist flipped.
    q[4, :, :, 1] = -theta5
    q[5, :, :, 1] = _opposite(theta6)

    singular = (straight & real).any(axis=(0, 1)).astype(np.uint8)
    both = np.repeat(real[:, :, None], 2, axis=2)
    return Branches(q.reshape(6, 8, count).transpose(2, 1, 0), both.reshape(8, count).T, singular)


def arm_branches(g: PumaGeometry, poses: Numbers, *_: object) -> Branches:
    """Return all four branches that bring the wrist centre to the origins of poses, shape (m, 4, 4).

    No pose is treated as singular.
    """
    x, y, z = np.ascontiguousarray(poses[:, :3, 3].T)
    q, real = _arm(g, x, y, g.base - z)
    return Branches(
        q.reshape(3, 4, len(poses)).transpose(2, 1, 0), real.reshape(4, -1).T, np.zeros(len(poses), dtype=np.uint8)
    )


def five_joint_branches(g: PumaGeometry, tool: float, poses: Numbers, *_: object) -> Branches:
    """Return all four branches for T_base_tip, shape (m, 4, 4).

    No pose is singular, since the wrist has no second roll joint. Five joints reach only a five-dimensional set of
    poses: a branch whose axis 5 cannot point as the pose demands is not real, and its residual says how far off it is.
    """
    arm = arm_branches(g, poses @ np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, -tool], [0, 0, 0, 1.0]]))
    theta1 = arm.q[..., 0]
    forearm = arm.q[..., 1] + arm.q[..., 2]
    c1 = np.cos(theta1)
    s1 = np.sin(theta1)
    c = np.cos(forearm)
    s = np.sin(forearm)
    (ux, uy, uz), (vx, vy, vz), (wx, wy, wz) = poses[:, :3, :3].transpose(2, 1, 0)[..., None]

    # The columns of the rotation in the frame of the forearm, turned so that they form Rz(theta4) Ry(-theta5).
    v_ahead = vx * c1 + vy * s1
    v_aside = vy * c1 - vx * s1
    u_down, v_down, w_down = (-s * (x * c1 + y * s1) - c * z for x, y, z in ((ux, uy, uz), (vx, vy, vz), (wx, wy, wz)))

    theta4 = np.arctan2(s * vz - c * v_ahead, -v_aside)
    theta5 = np.arctan2(u_down, w_down)
    q = np.concatenate([arm.q, np.stack([theta4, theta5], axis=2)], axis=2)
    return Branches(q, arm.real & (np.abs(v_down) <= MISFIT), arm.singular)


def _arm(g: PumaGeometry, x: Vector, y: Vector, z: Vector) -> tuple[Numbers, NDArray[np.bool_]]:
    """Solve joints 1 to 3 for a wrist centre x, y, z seen from the shoulder [m], shape (m,) each.

    Returns:
        Joint angles [rad], shape (3, 2, 2, m) with the axes (joint, shoulder, elbow, m), and whether the point is in
        reach, shape (2, 2, m).
    """
    square = x * x + y * y - g.d3 * g.d3
    radius = np.sqrt(np.where(square < SHOULDER_ROOT, 0.0, square))
    side = np.arctan2(g.d3, radius)
    heading = np.arctan2(y, x)
    upper, turn, real = two_links(g.a2, g.forearm, np.stack([radius, -radius]), np.stack([z, z]))

    q = np.empty((3, 2, 2, len(x)))
    q[0, 0] = wrapped(heading + side)
    q[0, 1] = wrapped(heading + np.pi - side)
    q[1] = upper.transpose(1, 0, 2)
    q[2] = wrapped(turn.transpose(1, 0, 2) - np.arctan2(g.d4, g.a3))
    clear = square >= -REACH_TOLERANCE
    return q, np.repeat((real & clear)[:, None], 2, axis=1)


def nearness(g: PumaGeometry, Q: Matrix) -> Mapping[str, Vector]:
    """Return for each singular case a value that is 0 at the singularity, for Q, shape (m, dof); shape (m,) each.

    ``elbow``: sine that vanishes if the elbow is stretched or folded. ``shoulder``: distance [m] of the wrist centre
    from the plane through the azimuth axis, above or below the shoulder. ``wrist``: sine that vanishes if axes 4 and 6
    are in line (six joints only). The signs of theta2 and theta3 do not matter here.
    """
    forearm = Q[:, 1] + Q[:, 2]
    radius = g.a2 * np.cos(Q[:, 1]) + g.a3 * np.cos(forearm) - g.d4 * np.sin(forearm)
    found = {"elbow": np.abs(np.sin(Q[:, 2] + np.arctan2(g.d4, g.a3))), "shoulder": np.abs(radius)}
    return found | ({"wrist": np.abs(np.sin(Q[:, 4]))} if Q.shape[1] == 6 else {})


def _opposite(angle: Numbers) -> Numbers:
    """Return the angle half a turn away, in (-pi, pi], for angles in (-pi, pi]."""
    return np.where(angle > 0.0, angle - np.pi, angle + np.pi)
