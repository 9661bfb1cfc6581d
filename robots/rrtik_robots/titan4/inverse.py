"""Inverse kinematics of the TITAN 4 in closed form: eight branches, and representatives of every singular family.

Source: [1, ch. 3, app. A to C]. Axes 2, 3 and 4 are parallel, axes 5 and 6 meet in the wrist point P = E - d6 w, where
E is the grip point and w the gripper axis. The azimuth follows from P (front or back); the wrist yaw and the sum psi of
the three pitch angles follow from w (two ways); the rest is a triangle (elbow up or down). Arrays have the axes
(shoulder, wrist, elbow, m).
"""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver, Branches, Limits, wrapped
from rrtik_ompl.kernels.ik.branch_layout import NORMAL, ROUNDING, SINGULAR, UNSURE
from rrtik_robots.titan4.families import nearest_azimuth, nearest_psi, psi_within_rounding
from rrtik_robots.titan4.geometry import TitanGeometry
from rrtik_robots.titan4.members import Singular, moved_inside
from rrtik_robots.titan4.postures import SIGMA, Target, completed, in_plane
from rrtik_robots.titan4.singularities import nearness

FAMILIES = ("wrist", "shoulder")
BRANCHES = tuple(" ".join(tag) for tag in product(("front", "back"), ("near", "far"), ("up", "down")))
MAX_SHIFT = 0.5  # largest change that rounding may cause in the component of the gripper axis in the arm plane


def closed_form(geometry: TitanGeometry) -> AnalyticSolver:
    """Return the closed form of the arm for the frame ``grip_point``.

    Where the gripper axis is normal to the arm plane (family ``wrist``), psi is free; where P lies on the azimuth axis
    (family ``shoulder``), theta1 is free. The representatives have the nearest values that the arm can reach, inside
    its limits wherever that is possible.
    """
    solve = partial(titan_branches, geometry)
    near = partial(nearness, geometry)
    numbers = (geometry.a1, geometry.a2, geometry.a3, geometry.a4, geometry.d6)
    return AnalyticSolver(
        "grip_point", "pose", BRANCHES, FAMILIES, (0, 1), solve, near, kernel="parallel_axes", numbers=numbers
    )


def titan_branches(
    g: TitanGeometry,
    poses: NDArray[np.float64],
    near: Matrix | None = None,
    slack: float = 0.0,
    limits: Limits | None = None,
) -> Branches:
    """Return all eight branches, labelled as in ``BRANCHES``, with the physical joint angles.

    Args:
        g: Lengths of the arm.
        poses: Targets T_base_E, shape (m, 4, 4).
        near: Configurations near which members of a singular family are wanted, shape (m, 6); zeros if None.
        slack: How near to a singular pose a pose counts as singular [m, sine], if that is more than rounding.
        limits: Joint limits; representatives outside are replaced by members inside, if there are any.
    """
    numbers = np.ascontiguousarray(poses.transpose(1, 2, 0))
    w = numbers[:3, 2]
    target = Target(numbers[:3, 0], w, numbers[:3, 3] - g.d6 * w)

    distance = np.hypot(target.p[0], target.p[1])
    on_axis = distance < max(SINGULAR, slack)
    c1, s1 = target.p[:2] / np.where(on_axis, 1.0, distance)
    x, h = in_plane(target, c1, s1)
    normal = h < np.maximum(np.minimum(SINGULAR + ROUNDING / np.maximum(distance, SINGULAR), NORMAL), slack)

    # Cosine and sine of psi for both ways of the wrist, shape (2, 2, m).
    direction = SIGMA * np.stack([x, w[2]])[:, None] / np.where(normal, 1.0, h)
    cosines = np.stack([direction[0], -direction[0]])
    sines = np.stack([direction[1], direction[1]])
    front = np.arctan2(target.p[1], target.p[0])
    theta1 = np.stack([front, np.where(front > 0.0, front - np.pi, front + np.pi)])[:, None]
    turn = np.stack([np.stack([c1, -c1]), np.stack([s1, -s1])])[:, :, None]
    q, real = completed(g, target, theta1, turn, cosines, sines)
    odd = np.flatnonzero(on_axis | normal | ((h < UNSURE) & ~real.all(axis=(0, 1, 2))))
    # If the gripper axis is horizontal too, the arm plane can be turned normal to it, where psi is free.
    horizontal = np.abs(w[2]) < max(SINGULAR, slack)
    any_psi = normal | (on_axis & horizontal)
    singular = (any_psi * np.uint8(1) + on_axis * np.uint8(2)).astype(np.uint8)

    if len(odd):
        wanted = np.zeros((len(odd), 6)) if near is None else near[odd]
        q[..., odd], real[..., odd] = _representatives(g, target.rows(odd), on_axis[odd], normal[odd], wanted)
        if limits is not None:
            where = Singular(on_axis[odd], any_psi[odd], wanted)
            q[..., odd], real[..., odd] = moved_inside(g, target.rows(odd), where, limits, q[..., odd], real[..., odd])

    count = len(poses)
    return Branches(q.reshape(6, 8, count).transpose(2, 1, 0), real.reshape(8, count).T, singular)


def _representatives(
    g: TitanGeometry, target: Target, on_axis: NDArray[np.bool_], normal: NDArray[np.bool_], near: Matrix
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the branches of singular poses, whose free angle takes the reachable value nearest to that in ``near``.

    Where psi is not free but poorly determined, it is moved into reach if that turns the gripper, or the wrist point
    about the azimuth axis, by no more than rounding.

    Args:
        g: Lengths of the arm.
        target: m poses.
        on_axis: Whether the wrist point is on the azimuth axis, shape (m,).
        normal: Whether the gripper axis is normal to the arm plane, shape (m,).
        near: Wanted configurations, shape (m, 6).

    Returns:
        Joint angles [rad], shape (6, 2, 2, 2, m), and whether they reach the pose, shape (2, 2, 2, m).
    """
    front = np.where(on_axis, near[:, 0], np.arctan2(target.p[1], target.p[0]))
    theta1 = np.broadcast_to((front + np.array([0.0, np.pi])[:, None])[:, None], (2, 2, len(near))).copy()
    theta1[..., on_axis] = nearest_azimuth(g, target.w[:, on_axis], target.p[2, on_axis], theta1[..., on_axis])
    theta1 = wrapped(theta1)

    turn = np.stack([np.cos(theta1), np.sin(theta1)])
    x, h = in_plane(target, *turn)
    psi = np.arctan2(SIGMA * target.w[2], SIGMA * x)
    any_psi = np.where(on_axis, h < SINGULAR, normal)
    wanted = np.where(any_psi, near[:, 1:4].sum(axis=1) + np.array([0.0, np.pi])[:, None], psi)

    radius = target.p[0] * turn[0] + target.p[1] * turn[1]
    free, _ = nearest_psi(g, radius, target.p[2], wanted)
    close = any_psi | (np.abs(wrapped(free - psi)) * h < SINGULAR)

    room = np.clip(SINGULAR / np.maximum(np.hypot(*target.p[:2]), SINGULAR), SINGULAR, MAX_SHIFT)
    height = np.broadcast_to(target.p[2], x.shape)
    other, moved, fits = psi_within_rounding(g, radius, height, SIGMA * x, SIGMA * target.w[2], room)
    fits &= ~close & (h < UNSURE)

    theta1 = np.where(fits, _turned_to(target, theta1, SIGMA * moved), theta1)
    psi = np.where(close, free, np.where(fits, other, psi))
    return completed(g, target, theta1, np.stack([np.cos(theta1), np.sin(theta1)]), np.cos(psi), np.sin(psi))


def _turned_to(target: Target, theta1: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the azimuth nearest to ``theta1`` at which the gripper axis has the component x along the arm plane."""
    flat = np.hypot(*target.w[:2])
    heading = np.arctan2(target.w[1], target.w[0])
    away = np.arccos(np.clip(x / np.maximum(flat, SINGULAR), -1.0, 1.0))
    return wrapped(heading + np.copysign(away, wrapped(theta1 - heading)))
