"""The curves of solutions at singular poses of the TITAN 4: the values of the free angle that the arm can reach.

These are intervals in closed form, so no scan is needed (poses: [1, ch. 3, app. A to C]). Let psi be the sum of the
three pitch angles and K the wrist point seen from the shoulder axis, in the arm plane. The elbow triangle closes where
|a2 - a3| <= |K - a4 (cos psi, sin psi)| <= a2 + a3, which bounds cos(psi - angle of K) from both sides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.analytic.analytic_solver import Limits, wrapped
from rrtik_ompl.kernels.ik.branch_layout import REACH_TOLERANCE, SINGULAR
from rrtik_robots.titan4.geometry import TitanGeometry

Numbers = NDArray[np.float64]


def psi_interval(
    g: TitanGeometry, radius: Numbers, height: Numbers
) -> tuple[Numbers, Numbers, Numbers, NDArray[np.bool_]]:
    """Return the values of psi for which the arm reaches a wrist point.

    They are the two intervals centre - high .. centre - low and centre + low .. centre + high.

    Args:
        g: Lengths of the arm.
        radius: Distance of the wrist point from the azimuth axis in the arm plane [m], any shape.
        height: Its height above the shoulder axis [m], same shape.

    Returns:
        ``centre, low, high`` [rad], where 0 <= low <= high <= pi, and whether there is any such psi; same shape.
    """
    x = radius - g.a1
    square = x * x + height * height
    scale = np.maximum(2.0 * g.a4 * np.sqrt(square), 1e-300)
    most = (square + g.a4**2 - (g.a2 - g.a3) ** 2) / scale
    least = (square + g.a4**2 - (g.a2 + g.a3) ** 2) / scale

    exists = (least <= 1.0 + REACH_TOLERANCE) & (most >= -1.0 - REACH_TOLERANCE)
    low = np.arccos(np.clip(most, -1.0, 1.0))
    high = np.arccos(np.clip(least, -1.0, 1.0))
    return np.arctan2(height, x), low, high, exists


def nearest_psi(
    g: TitanGeometry, radius: Numbers, height: Numbers, wanted: Numbers
) -> tuple[Numbers, NDArray[np.bool_]]:
    """Return the reachable psi nearest to the wanted one [rad], and whether any is reachable; shapes as given."""
    centre, low, high, exists = psi_interval(g, radius, height)
    away = wrapped(wanted - centre)
    return centre + np.copysign(np.clip(np.abs(away), low, high), away), exists


def psi_at(g: TitanGeometry, radius: Numbers, height: Numbers, limits: Limits) -> Numbers:
    """Return the values of psi at which theta2, theta3 or theta4 is at a limit, or the elbow is stretched or folded.

    If a joint reaches its limit nowhere, the value is the psi that brings it nearest to that limit.

    Args:
        g: Lengths of the arm.
        radius: Distance of the wrist point from the azimuth axis in the arm plane [m].
        height: Its height above the shoulder axis [m], same shape.
        limits: Lowest and highest joint values [rad], shape (6,) each.

    Returns:
        Angles [rad], shape (16, ...).
    """
    wrist = radius - g.a1 + 1j * height
    low, high = limits
    values = []
    for theta2 in (low[1], high[1]):
        values.append(_directions(wrist - g.a2 * np.exp(1j * theta2), g.a4, g.a3))
    for theta3 in (low[2], high[2], 0.0, np.pi):
        values.append(_directions(wrist, g.a4, abs(g.a2 + g.a3 * np.exp(1j * theta3))))
    for theta4 in (low[3], high[3]):
        bent = g.a3 * np.exp(-1j * theta4) + g.a4  # links 3 and 4 as one rigid link, in the frame of link 4
        values.append(_directions(wrist, abs(bent), g.a2) - np.angle(bent))
    return np.concatenate(values)


def _directions(point: NDArray[np.complex128], near: float, far: float) -> Numbers:
    """Return both directions of a link that ends at a point and begins at a given distance from the origin.

    If the point is out of reach, both are the direction that comes nearest.

    Args:
        point: End of the link in the complex plane [m], any shape.
        near: Length of the link [m].
        far: Distance of its begin from the origin [m].

    Returns:
        Angles [rad], shape (2, ...).
    """
    away = np.abs(point)
    cosine = (away * away + near * near - far * far) / np.maximum(2.0 * near * away, 1e-300)
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    both: Numbers = np.angle(point) + np.stack([turn, -turn])
    return both


def psi_within_rounding(
    g: TitanGeometry, radius: Numbers, height: Numbers, x: Numbers, z: Numbers, room: Numbers
) -> tuple[Numbers, Numbers, NDArray[np.bool_]]:
    """Find a reachable psi for a gripper axis so nearly normal to the arm plane that rounding decides atan2(z, x).

    The axis is changed as little as possible: z within rounding, and x by turning the arm plane, which hardly moves a
    wrist point near the azimuth axis.

    Args:
        g: Lengths of the arm.
        radius: Distance of the wrist point from the azimuth axis in the arm plane [m].
        height: Its height above the shoulder axis [m].
        x: Component of the gripper axis along the arm plane's horizontal, same shape.
        z: Its vertical component.
        room: Largest change of x; z may change by ``SINGULAR``.

    Returns:
        psi at an end of its intervals [rad], the x that belongs to it, and whether both changes are allowed.
    """
    centre, low, high, exists = psi_interval(g, radius, height)
    psi = centre + np.stack([low, -low, high, -high])
    c = np.cos(psi)
    s = np.sin(psi)

    # For each psi, the length of the axis in the plane that changes x and z least, each in units of its allowed change.
    weight = (SINGULAR / room) ** 2
    length = np.maximum((weight * x * c + z * s) / (weight * c * c + s * s), 0.0)
    cost = np.maximum(np.abs(length * c - x) / room, np.abs(length * s - z) / SINGULAR)

    best = np.argmin(cost, axis=0)[None]
    psi, moved, least = (np.take_along_axis(each, best, axis=0)[0] for each in (psi, length * c, cost))
    return psi, moved, exists & (least <= 1.0)


def nearest_azimuth(g: TitanGeometry, w: Matrix, height: Vector, wanted: Numbers) -> Numbers:
    """Return the reachable theta1 nearest to the wanted one, for a wrist point on the azimuth axis.

    It is the wanted one, or the one at an end of an interval of reachable psi, or the one that turns the arm plane
    normal to the gripper axis (where psi is free). If none of these is reachable, it is the wanted one.

    Args:
        g: Lengths of the arm.
        w: Gripper axis, shape (3, m).
        height: Height of the wrist point above the shoulder axis [m], shape (m,).
        wanted: Wanted theta1 [rad], shape (2, 2, m); the second axis is the wrist's branch, sigma = 1, -1.
    """
    sigma = np.array([1.0, -1.0])[:, None]
    choices = np.concatenate([wanted[None], _ends(g, w, height, wanted.shape)])
    x = w[0] * np.cos(choices) + w[1] * np.sin(choices)
    psi = np.arctan2(sigma * w[2], sigma * x)
    reached, exists = nearest_psi(g, np.zeros_like(x), np.broadcast_to(height, x.shape), psi)
    fits = exists & ((np.hypot(x, w[2]) < SINGULAR) | (np.abs(wrapped(reached - psi)) < 1e-9))
    distance = np.where(fits, np.abs(wrapped(choices - wanted)), np.inf)
    best = np.argmin(distance, axis=0)
    nearest: Numbers = np.take_along_axis(choices, best[None], axis=0)[0]
    return nearest


def _ends(g: TitanGeometry, w: Matrix, height: Vector, shape: tuple[int, ...]) -> Numbers:
    """Return the values of theta1 [rad] at which psi is at an end of its intervals, or is free; shape (10, 2, 2, m)."""
    centre, low, high, _ = psi_interval(g, np.zeros_like(height), height)
    psi = centre + np.stack([low, -low, high, -high])
    flat = np.hypot(w[0], w[1])
    heading = np.arctan2(w[1], w[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.arccos(np.clip(w[2] / (np.tan(psi) * flat), -1.0, 1.0))
    away = np.where(np.isfinite(away), away, 0.0)
    right = np.full_like(away[:1], np.pi / 2)
    ends = heading + np.concatenate([away, -away, right, -right])
    return np.broadcast_to(ends[:, None, None], (len(ends), *shape))
