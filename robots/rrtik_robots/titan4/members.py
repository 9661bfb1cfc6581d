"""The solution curves of singular poses of the TITAN 4: finding their members inside the joint limits.

A curve enters and leaves the limits only where a joint is at a limit, and all these places have a closed form. Between
two neighbouring places either all members are inside or none is. So it is enough to check the places themselves and one
member between each two of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.ik.analytic.analytic_solver import Limits, wrapped
from rrtik_ompl.kernels.ik.branch_layout import SINGULAR
from rrtik_robots.titan4.families import psi_at
from rrtik_robots.titan4.geometry import TitanGeometry
from rrtik_robots.titan4.postures import SIGMA, Target, completed

Numbers = NDArray[np.float64]
AT_LIMIT = 1e-8  # [rad]: rounding may put a member this far beyond the limit that it was computed for
ROWS = 256  # number of poses whose members fit into the cache
SIDES = np.array([0.0, np.pi])[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class Singular:
    """How each of m poses is singular.

    Attributes:
        on_axis: Whether the wrist point is on the azimuth axis, so that theta1 is free, shape (m,).
        any_psi: Whether the gripper axis is normal to the arm plane, or can be made so by theta1, shape (m,).
        near: Configurations near which members are wanted, shape (m, 6).
    """

    on_axis: Mask
    any_psi: Mask
    near: Matrix

    def rows(self, which: NDArray[np.int64]) -> Singular:
        """Return the rows of the poses with these indices."""
        return Singular(self.on_axis[which], self.any_psi[which], self.near[which])


def moved_inside(
    g: TitanGeometry, target: Target, where: Singular, limits: Limits, q: Numbers, real: Mask
) -> tuple[Numbers, Mask]:
    """Replace representatives outside the limits by the nearest members inside, branch by branch.

    Args:
        g: Lengths of the arm.
        target: m poses.
        where: How they are singular.
        limits: Lowest and highest joint values [rad], shape (6,) each.
        q: Representatives [rad], shape (6, 2, 2, 2, m).
        real: Whether they reach their poses, shape (2, 2, 2, m).

    Returns:
        Copies of q and real, in which representatives are replaced where there are members inside.
    """
    bounds = _turns(limits)
    moved = q.copy()
    reached = real.copy()
    fits = real & _inside(q, bounds)
    todo = np.flatnonzero(~fits.all(axis=(0, 1, 2)) & (where.on_axis | where.any_psi))
    for begin in range(0, len(todo), ROWS):
        rows = todo[begin : begin + ROWS]
        members, found = _nearest(g, target.rows(rows), where.rows(rows), bounds)
        found &= ~fits[..., rows]
        moved[..., rows] = np.where(found, members, moved[..., rows])
        reached[..., rows] |= found
    return moved, reached


def _turns(limits: Limits) -> Limits:
    """Return the limits, replaced by half a turn to both sides for joints that have a full turn or more."""
    low, high = limits
    whole = ~(high - low < TAU)
    return np.where(whole, -np.pi, low), np.where(whole, np.pi, high)


def _inside(q: Numbers, limits: Limits) -> Mask:
    """Check which configurations, shape (6, ...), are inside the limits up to full turns; shape (...)."""
    low, width = (each.reshape(6, *[1] * (q.ndim - 1)) for each in (limits[0] - AT_LIMIT, limits[1] - limits[0]))
    inside: Mask = np.asarray((np.mod(q - low, TAU) <= width + 2.0 * AT_LIMIT).all(axis=0))
    return inside


def _nearest(g: TitanGeometry, target: Target, where: Singular, limits: Limits) -> tuple[Numbers, Mask]:
    """Return the nearest member inside the limits for each branch, shape (6, 2, 2, 2, m), and whether there is any."""
    count = len(where.near)
    q = np.zeros((6, 2, 2, 2, count))
    cost = np.full((2, 2, 2, count), np.inf)
    for rows, curve in (
        (np.flatnonzero(where.on_axis), _turned_members),
        (np.flatnonzero(where.any_psi), _pitched_members),
    ):
        if len(rows) == 0:
            continue

        part = target.rows(rows)
        theta1, psi, distance = curve(g, part, where.rows(rows), limits)
        members, real = completed(g, part, theta1, np.stack([np.cos(theta1), np.sin(theta1)]), np.cos(psi), np.sin(psi))
        inside = real & _inside(members, limits)

        for side in range(2):
            away = np.where(inside, distance[side][:, :, None], np.inf)
            best = np.argmin(away, axis=0)[None]
            least = np.take_along_axis(away, best, axis=0)[0]
            nearest = np.take_along_axis(members, best[None], axis=1)[:, 0]
            nearer = least < cost[side][..., rows]
            q[:, side, :, :, rows] = np.where(nearer, nearest, q[:, side][..., rows]).transpose(3, 0, 1, 2)
            cost[side][..., rows] = np.minimum(least, cost[side][..., rows])
    return q, np.isfinite(cost)


def _turned_members(
    g: TitanGeometry, target: Target, where: Singular, limits: Limits
) -> tuple[Numbers, Numbers, Numbers]:
    """Return members for a wrist point on the azimuth axis, where theta1 is free and psi follows from it.

    Returns:
        theta1 and psi of k members [rad], shape (k, 2, m), where the second axis is the wrist's branch; and their
        distances from the wanted theta1 of the front and the back branch [rad], shape (2, k, 2, m).
    """
    wx, wy, wz = target.w
    height = target.p[2]
    flat = np.maximum(np.hypot(wx, wy), SINGULAR)
    heading = np.arctan2(wy, wx)

    psi = psi_at(g, np.zeros_like(height), height, limits)
    right = np.full((1, len(height)), np.pi / 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        pitched = np.nan_to_num(np.arccos(np.clip(wz / (np.tan(psi) * flat), -1.0, 1.0)))
    yaw = np.arcsin(np.clip(np.sin(_pair(limits, 4)) / flat, -1.0, 1.0))
    axis = _yaw_axes(target, limits)
    rolled = np.arctan2(axis[1], axis[0])
    own = np.broadcast_to(_pair(limits, 0), (2, len(height)))
    away = np.concatenate([pitched, -pitched, -yaw, np.pi + yaw, right, -right])
    theta1 = wrapped(_with_middles(np.concatenate([heading + away, rolled, rolled + np.pi, own])))

    x = wx * np.cos(theta1) + wy * np.sin(theta1)
    follows = np.arctan2(SIGMA * wz, SIGMA * x[:, None])
    both = np.broadcast_to(theta1[:, None], follows.shape)
    distance = np.abs(wrapped(both - (where.near[:, 0] + SIDES)[:, None, None]))
    return both, follows, distance


def _pitched_members(
    g: TitanGeometry, target: Target, where: Singular, limits: Limits
) -> tuple[Numbers, Numbers, Numbers]:
    """Return members for a gripper axis normal to the arm plane, where psi is free and theta1 has two values.

    Returns:
        The same as `_turned_members`; the distances include those from the wanted psi.
    """
    px, py, height = target.p
    wx, wy, _ = target.w
    first = np.where(where.on_axis, np.arctan2(wy, wx) + np.pi / 2, np.arctan2(py, px))
    theta1 = wrapped(first + SIDES)
    c1 = np.cos(theta1)
    s1 = np.sin(theta1)
    axis = _yaw_axes(target, limits)[:, :, None]
    rolled = np.arctan2(-(axis[0] * c1 + axis[1] * s1), np.broadcast_to(axis[2], (2, *c1.shape)))

    wanted = where.near[:, 1:4].sum(axis=1) + SIDES
    stops = psi_at(g, px * c1 + py * s1, np.broadcast_to(height, c1.shape), limits)
    psi = _with_middles(np.concatenate([stops, rolled]))
    psi = np.concatenate([psi, np.broadcast_to(wanted[:, None], (2, *psi.shape[1:]))])

    shape = (psi.shape[0] * 2, 2, psi.shape[-1])
    psi = np.broadcast_to(psi.reshape(shape[0], 1, -1), shape)
    both = np.broadcast_to(np.tile(theta1, (shape[0] // 2, 1))[:, None], shape)

    front = np.where(where.on_axis, where.near[:, 0], first)
    turned = np.abs(wrapped(both - (front + SIDES)[:, None, None]))
    # Off the azimuth axis theta1 is not free, so members with the other value belong to the other branch.
    other_side = ~where.on_axis & (turned > np.pi / 2)
    distance = np.where(other_side, np.inf, turned + np.abs(wrapped(psi - wanted)))
    return both, psi, distance


def _pair(limits: Limits, joint: int) -> Matrix:
    """Return both limits of a joint [rad], shape (2, 1)."""
    return np.array([[limits[0][joint]], [limits[1][joint]]])


def _yaw_axes(target: Target, limits: Limits) -> Numbers:
    """Return the directions of axis 5 with theta6 at either limit, shape (3, 2, m).

    theta6 is the angle of axis 5 from the pose's u column about the gripper axis.
    """
    theta6 = _pair(limits, 5)
    across = np.cross(target.w, target.u, axis=0)
    axis: Numbers = np.cos(theta6) * target.u[:, None] - np.sin(theta6) * across[:, None]
    return axis


def _with_middles(angles: Numbers) -> Numbers:
    """Return k angles in order, then the middle between each and the next one on the circle; shape (2 k, ...)."""
    ordered: Vector = np.sort(wrapped(angles), axis=0)
    after = np.concatenate([ordered[1:], ordered[:1] + TAU])
    return np.concatenate([ordered, 0.5 * (ordered + after)])
