"""Formulas of [1] as they are printed, and as they have to read. Joint angles physical, in radians, unless said."""

from __future__ import annotations

from itertools import permutations
from math import factorial

import numpy as np

from rrtik_bench.titan4 import A1, A2, A3, A4, D6, RIGHT
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.analytic.analytic_solver import wrapped


def printed_pose(Q: Matrix, *, roll: float = 0.0, slip: bool = False) -> Matrix:
    """The matrix of appendix B.2, term by term, shape (m, 4, 4).

    Args:
        Q: Physical angles, shape (m, 6).
        roll: What is added to theta6: nothing is printed; a right angle is needed.
        slip: Whether c6 is the cosine of theta5, as printed in the list of abbreviations.
    """
    c1, s1 = np.cos(Q[:, 0]), np.sin(Q[:, 0])
    upper, forearm, last = Q[:, 1], Q[:, 1] + Q[:, 2], Q[:, 1:4].sum(axis=1)
    c, s = np.cos(last), np.sin(last)
    c5, s5 = np.cos(Q[:, 4] + RIGHT), np.sin(Q[:, 4] + RIGHT)
    c6, s6 = np.cos(Q[:, 4] + RIGHT if slip else Q[:, 5] + roll), np.sin(Q[:, 5] + roll)
    radius = A1 + A2 * np.cos(upper) + A3 * np.cos(forearm) + A4 * c
    height = A2 * np.sin(upper) + A3 * np.sin(forearm) + A4 * s
    T = np.zeros((len(Q), 4, 4))
    T[:, 3, 3] = 1.0
    T[:, 0, 0] = -c6 * (s1 * s5 - c1 * c5 * c) - c1 * s6 * s
    T[:, 0, 1] = s6 * (s1 * s5 - c1 * c5 * c) - c1 * c6 * s
    T[:, 0, 2] = c5 * s1 + c1 * c * s5
    T[:, 1, 0] = c6 * (c1 * s5 + c5 * c * s1) - s1 * s6 * s
    T[:, 1, 1] = -s6 * (c1 * s5 + c5 * c * s1) - c6 * s1 * s
    T[:, 1, 2] = c * s1 * s5 - c1 * c5
    T[:, 2, 0] = c * s6 + c5 * c6 * s
    T[:, 2, 1] = c6 * c - c5 * s6 * s
    T[:, 2, 2] = s5 * s
    T[:, :3, 3] = np.stack([radius * c1, radius * s1, height], axis=1) + D6 * T[:, :3, 2]
    return T


def level_link_4(Q: Matrix, *, printed: bool) -> Matrix:
    """Theta2 and theta3 by appendix C with link 4 level, both elbows, from P alone; shape (m, 2, 2).

    Args:
        Q: Postures with the gripper normal to the arm plane and link 4 level, P before axis 1, shape (m, 6).
        printed: Gamma as in (C.8), whose ``a1 c1 + a4 c1`` has to be ``a1 + a4`` beside ``px c1 + py s1``.
    """
    radius = A1 + A2 * np.cos(Q[:, 1]) + A3 * np.cos(Q[:, 1] + Q[:, 2]) + A4
    pz = A2 * np.sin(Q[:, 1]) + A3 * np.sin(Q[:, 1] + Q[:, 2])
    c1, s1 = np.cos(Q[:, 0]), np.sin(Q[:, 0])
    px, py = radius * c1, radius * s1
    along = px - A1 * c1 - A4 * c1 if printed else px * c1 + py * s1 - A1 - A4
    square = (radius - A1 - A4) ** 2 + pz**2
    elbow = np.arccos(np.clip((square - A2**2 - A3**2) / (2.0 * A2 * A3), -1.0, 1.0))
    theta3 = np.stack([elbow, -elbow], axis=1)
    alpha = np.arctan2(A3 * np.sin(theta3), A2 + A3 * np.cos(theta3))
    theta2 = wrapped(np.arctan2(pz, along)[:, None] - alpha)
    return np.stack([theta2, theta3], axis=2)


def by_arc_tangent(branches: Matrix) -> Matrix:
    """Solutions in which theta2 is taken by the arc tangent of a quotient, as printed, and theta4 follows."""
    taken = branches.copy()
    taken[..., 1] = np.arctan(np.tan(branches[..., 1]))
    taken[..., 3] = wrapped(branches[..., 1:4].sum(axis=-1) - taken[..., 1] - taken[..., 2])
    return taken


def printed_routes(joints: int, grid: int, edges: int) -> int:
    """The count of single-joint routes of (6.1)."""
    return int(factorial(edges) * factorial(joints * grid) // factorial(grid) ** joints)


def listed_routes(joints: int, grid: int, edges: int) -> int:
    """The same by listing: the orders of the unit steps of an edge, for each edge, in the order of the edges."""
    orders = set(permutations([joint for joint in range(joints) for _ in range(grid)]))
    return int(len(orders) ** edges)


def undefined(route: Matrix) -> int:
    """Moves of a list, angles in any unit, for whose joint (6.3) gives neither 0 nor 1: changes of at most 1."""
    changes: Vector = np.abs(np.diff(route, axis=0))
    return int(((changes > 0.0) & (changes <= 1.0)).any(axis=1).sum())
