"""The curves of solutions that singular poses of the TITAN 4 have: which values of the free angle the arm can reach.

The intervals have a closed form, so that no scan is needed (poses: [1, ch. 3, app. A to C]). With K the wrist
point seen from the shoulder axis, the elbow triangle closes where |a2 - a3| <= |K - a4 (cos psi, sin psi)| <= a2 + a3,
which bounds cos(psi - angle of K) from both sides.
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
    """Values of psi for which the arm reaches a wrist point: centre - high .. centre - low and centre + low .. + high.

    Args:
        g: Lengths of the arm.
        radius: Of the wrist point in the arm plane, from the azimuth axis [m].
        height: Above the shoulder axis [m], same shape.

    Returns:
        ``centre, low, high`` [rad], 0 <= low <= high <= pi, and whether there is any such psi.
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
    """The reachable psi nearest to the wanted one, and whether any is reachable; shapes as given."""
    centre, low, high, exists = psi_interval(g, radius, height)
    away = wrapped(wanted - centre)
    return centre + np.copysign(np.clip(np.abs(away), low, high), away), exists


def psi_at(g: TitanGeometry, radius: Numbers, height: Numbers, limits: Limits) -> Numbers:
    """Values of psi at which theta2, theta3 or theta4 is at a limit, or the elbow stretched or folded.

    Where a joint is nowhere at its limit, the psi that brings it nearest to it.

    Args:
        g: Lengths of the arm.
        radius: Of the wrist point in the arm plane, from the azimuth axis [m].
        height: Above the shoulder axis [m], same shape.
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
        bent = g.a3 * np.exp(-1j * theta4) + g.a4  # links 3 and 4 as one, seen from link 4
        values.append(_directions(wrist, abs(bent), g.a2) - np.angle(bent))
    return np.concatenate(values)


def _directions(point: NDArray[np.complex128], near: float, far: float) -> Numbers:
    """Both directions of a link of length ``near`` that ends at a point, ``far`` from the origin where it begins.

    Out of reach, the one that comes nearest. Shape (2, ...).
    """
    away = np.abs(point)
    cosine = (away * away + near * near - far * far) / np.maximum(2.0 * near * away, 1e-300)
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    both: Numbers = np.angle(point) + np.stack([turn, -turn])
    return both


def psi_within_rounding(
    g: TitanGeometry, radius: Numbers, height: Numbers, x: Numbers, z: Numbers, room: Numbers
) -> tuple[Numbers, Numbers, NDArray[np.bool_]]:
    """A reachable psi for a gripper axis so nearly normal to the arm plane that rounding decides its psi, atan2(z, x).

    Beside the azimuth axis the arm plane can be turned at hardly any cost to the wrist point: that moves x.

    Args:
        g: Lengths of the arm.
        radius: Of the wrist point in the arm plane [m].
        height: Above the shoulder axis [m].
        x: Part of the gripper axis along the arm plane's horizontal, same shape.
        z: Vertical part.
        room: By how much x may change; z may by ``SINGULAR``.

    Returns:
        psi at an end of its intervals, the x that belongs to it, and whether both changes are allowed.
    """
    centre, low, high, exists = psi_interval(g, radius, height)
    psi = centre + np.stack([low, -low, high, -high])
    c = np.cos(psi)
    s = np.sin(psi)

    # for each psi the length of the axis in the plane that changes x and z least, each by its own measure
    weight = (SINGULAR / room) ** 2
    length = np.maximum((weight * x * c + z * s) / (weight * c * c + s * s), 0.0)
    cost = np.maximum(np.abs(length * c - x) / room, np.abs(length * s - z) / SINGULAR)

    best = np.argmin(cost, axis=0)[None]
    psi, moved, least = (np.take_along_axis(each, best, axis=0)[0] for each in (psi, length * c, cost))
    return psi, moved, exists & (least <= 1.0)


def nearest_azimuth(g: TitanGeometry, w: Matrix, height: Vector, wanted: Numbers) -> Numbers:
    """With the wrist point on the azimuth axis: the theta1 nearest to the wanted one that the arm can reach.

    It is the wanted one, or an end of an interval of reachable psi, or the one that turns the arm plane normal to the
    gripper axis (where psi is free). If none is reachable, the wanted one.

    Args:
        g: Lengths of the arm.
        w: Gripper axis, shape (3, m).
        height: Of the wrist point above the shoulder axis [m], shape (m,).
        wanted: Shape (2, 2, m); the second axis is the way of the wrist, sigma = 1, -1.
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
    """Values of theta1 at which psi is at an end of its intervals, or is free; shape (10, 2, 2, m)."""
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
