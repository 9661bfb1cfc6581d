"""Inverse kinematics of the TITAN 4 in closed form: eight branches, and a representative of every singular family.

Source: [1, ch. 3, app. A to C]. Axes 2, 3, 4 are parallel, axes 5 and 6 meet in the wrist point
P = E - d6 w. The azimuth follows from P (front or back), the wrist yaw and the sum psi of the three pitch angles from
w (two ways), and what is left is a triangle (elbow up or down). Arrays are kept as (shoulder, wrist, elbow, m).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.fast.ik.branch_layout import NORMAL, ROUNDING, SINGULAR, UNSURE
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver, Branches, two_links, wrapped
from rrtik_robots.titan4.families import nearest_azimuth, nearest_psi, psi_within_rounding
from rrtik_robots.titan4.geometry import TitanGeometry
from rrtik_robots.titan4.singularities import nearness

FAMILIES = ("wrist", "shoulder")
BRANCHES = tuple(" ".join(tag) for tag in product(("front", "back"), ("near", "far"), ("up", "down")))
MAX_SHIFT = 0.5  # of the part of the gripper axis in the arm plane: how far rounding may move it at most
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


def closed_form(geometry: TitanGeometry) -> AnalyticSolver:
    """The arm's own inverse kinematics for frame ``grip_point``.

    Where the gripper axis is normal to the arm plane (family ``wrist``) psi is free, and where P lies on the azimuth
    axis (family ``shoulder``) theta1 is: the representatives have the nearest values that the arm can reach.
    """
    solve, near = partial(titan_branches, geometry), partial(nearness, geometry)
    numbers = (geometry.a1, geometry.a2, geometry.a3, geometry.a4, geometry.d6)
    return AnalyticSolver(
        "grip_point", "pose", BRANCHES, FAMILIES, (0, 1), solve, near, kernel="parallel_axes", numbers=numbers
    )


def titan_branches(
    g: TitanGeometry, poses: NDArray[np.float64], near: Matrix | None = None, slack: float = 0.0
) -> Branches:
    """All eight branches for T_base_E, shape (m, 4, 4), labelled as in ``BRANCHES``; angles are physical ones.

    Args:
        g: Lengths of the arm.
        poses: Targets.
        near: Configurations, shape (m, 6), that say which member of a singular family is wanted; zeros if None.
        slack: How near to singular counts as singular [m, sine], if more than rounding.
    """
    numbers = np.ascontiguousarray(poses.transpose(1, 2, 0))
    w = numbers[:3, 2]
    target = Target(numbers[:3, 0], w, numbers[:3, 3] - g.d6 * w)
    distance = np.hypot(target.p[0], target.p[1])
    on_axis = distance < max(SINGULAR, slack)
    c1, s1 = target.p[:2] / np.where(on_axis, 1.0, distance)
    x, h = _in_plane(target, c1, s1)
    normal = h < np.maximum(np.minimum(SINGULAR + ROUNDING / np.maximum(distance, SINGULAR), NORMAL), slack)
    direction = SIGMA * np.stack([x, w[2]])[:, None] / np.where(normal, 1.0, h)  # cosine and sine of psi, (2, 2, m)
    cosines, sines = np.stack([direction[0], -direction[0]]), np.stack([direction[1], direction[1]])
    front = np.arctan2(target.p[1], target.p[0])
    theta1 = np.stack([front, np.where(front > 0.0, front - np.pi, front + np.pi)])[:, None]
    turn = np.stack([np.stack([c1, -c1]), np.stack([s1, -s1])])[:, :, None]
    q, real = _completed(g, target, theta1, turn, cosines, sines)
    odd = np.flatnonzero(on_axis | normal | ((h < UNSURE) & ~real.all(axis=(0, 1, 2))))
    horizontal = np.abs(w[2]) < max(SINGULAR, slack)  # then the arm plane can be turned normal to the gripper axis
    singular = ((normal | (on_axis & horizontal)) * np.uint8(1) + on_axis * np.uint8(2)).astype(np.uint8)
    if len(odd):
        wanted = np.zeros((len(odd), 6)) if near is None else near[odd]
        q[..., odd], real[..., odd] = _representatives(g, target.rows(odd), on_axis[odd], normal[odd], wanted)
    count = len(poses)
    return Branches(q.reshape(6, 8, count).transpose(2, 1, 0), real.reshape(8, count).T, singular)


def _in_plane(target: Target, c1: NDArray[np.float64], s1: NDArray[np.float64]) -> tuple[Vector, Vector]:
    """Of the gripper axis: its part along the arm in the arm plane, and the length of its part in that plane."""
    x = target.w[0] * c1 + target.w[1] * s1
    return x, np.hypot(x, target.w[2])


def _completed(
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
        theta1: Shape (2, 1 or 2, m).
        turn: Cosine and sine of theta1, shape (2, 2, 1 or 2, m).
        cosines: Of psi, shape (2, 2, m).
        sines: Of psi, shape (2, 2, m).

    Returns:
        Joint values, shape (6, 2, 2, 2, m), and whether each branch is real, shape (2, 2, 2, m).
    """
    (ux, uy, uz), (px, py, pz), (c1, s1) = target.u, target.p, turn
    s5 = target.w[1] * c1 - target.w[0] * s1
    c5 = SIGMA * _in_plane(target, c1, s1)[1]
    shoulder, elbow, real = two_links(g.a2, g.a3, px * c1 + py * s1 - g.a1 - g.a4 * cosines, pz - g.a4 * sines)
    along, across = ux * c1 + uy * s1, uy * c1 - ux * s1
    q = np.empty((6, 2, 2, 2, theta1.shape[-1]))
    q[0] = theta1[:, :, None]
    q[1], q[2] = np.moveaxis(shoulder, 0, 2), np.moveaxis(elbow, 0, 2)
    q[3] = wrapped(np.arctan2(sines, cosines)[:, :, None] - q[1] - q[2])
    q[4] = np.arctan2(s5, c5)[:, :, None]
    roll = np.arctan2(s5 * (along * cosines + uz * sines) - c5 * across, uz * cosines - along * sines)
    q[5] = roll[:, :, None]
    return q, np.repeat(real[:, :, None], 2, axis=2)


def _representatives(
    g: TitanGeometry, target: Target, on_axis: NDArray[np.bool_], normal: NDArray[np.bool_], near: Matrix
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Branches of singular poses: what is free takes the value nearest to that of ``near`` that the arm can reach.

    Where psi is not free but poorly known, it moves into reach if that turns the gripper, or the wrist point about the
    azimuth axis, by no more than rounding.
    """
    front = np.where(on_axis, near[:, 0], np.arctan2(target.p[1], target.p[0]))
    theta1 = np.broadcast_to((front + np.array([0.0, np.pi])[:, None])[:, None], (2, 2, len(near))).copy()
    theta1[..., on_axis] = nearest_azimuth(g, target.w[:, on_axis], target.p[2, on_axis], theta1[..., on_axis])
    theta1 = wrapped(theta1)
    turn = np.stack([np.cos(theta1), np.sin(theta1)])
    x, h = _in_plane(target, *turn)
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
    return _completed(g, target, theta1, np.stack([np.cos(theta1), np.sin(theta1)]), np.cos(psi), np.sin(psi))


def _turned_to(target: Target, theta1: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    """The azimuth nearest to ``theta1`` at which the gripper axis has the part x along the arm plane."""
    flat, heading = np.hypot(*target.w[:2]), np.arctan2(target.w[1], target.w[0])
    away = np.arccos(np.clip(x / np.maximum(flat, SINGULAR), -1.0, 1.0))
    return wrapped(heading + np.copysign(away, wrapped(theta1 - heading)))
