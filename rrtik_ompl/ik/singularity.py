"""Singular configurations: a report on what the arm can do there, and joint rates that stay bounded near them.

Sources: Nakamura and Hanafusa [25]; damping of only the small singular values, Maciejewski and Klein [26].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, finite_array, frozen
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.ik.analytic.closed_form import form_of, has_closed_form
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot

RANK_TOLERANCE = 1e-9  # Singular values below this (metres and radians mixed) count as 0.
DAMPED_BELOW = 0.05  # Singular values below this are damped; metres count in units of the arm's reach.
LOST = 1e-12  # Singular values below this are 0.
DAMPING = 0.05  # damping at a singular value of 0


@dataclass(frozen=True, slots=True, eq=False)
class SingularityReport:
    """How singular a configuration is, and which motions its limits leave.

    Attributes:
        singular_values: Singular values of the Jacobian at the tip, largest first, shape (min(6, dof),); metres and
            radians mixed.
        rank: Number of singular values that are not 0. (Counting vanishing factors of the determinant instead would
            overstate the loss.)
        manipulability: Product of the singular values, sqrt(det(J J^T)) [31].
        nearness: For each singular case that the robot names, a sine or a length [m] that is 0 at the singularity.
        active: Names of the cases in which the configuration is singular.
        at_limits: Names of the joints at a limit.
        rank_inside_limits: Rank without the joints at a limit: the motion that is left when these are stopped.
    """

    singular_values: Vector
    rank: int
    manipulability: float
    nearness: Mapping[str, float]
    active: tuple[str, ...]
    at_limits: tuple[str, ...]
    rank_inside_limits: int

    __reduce__ = as_value


def singularity_report(robot: Robot, q: ArrayLike, *, tolerance: float = RANK_TOLERANCE) -> SingularityReport:
    """Report how singular a configuration is.

    Args:
        robot: Any arm; there are no named cases if it brings no closed form.
        q: Configuration, shape (dof,).
        tolerance: Singular values and nearness values up to this count as 0.

    Raises:
        InputError: If q does not fit the robot.
    """
    posture = robot.configuration(q)
    jacobian = robot.jacobian_batch(posture[None])[0]
    values = np.linalg.svd(jacobian, compute_uv=False)
    stopped = limit_active(robot, posture)
    named = form_of(robot).nearness(posture[None]) if has_closed_form(robot) else {}
    near = {case: float(value[0]) for case, value in named.items()}

    return SingularityReport(
        singular_values=frozen(values),
        rank=_rank(values, tolerance),
        manipulability=float(np.prod(values)),
        nearness=MappingProxyType(near),
        active=tuple(case for case, value in near.items() if value <= tolerance),
        at_limits=tuple(name for name, stop in zip(robot.joint_names, stopped, strict=True) if stop),
        rank_inside_limits=_rank(np.linalg.svd(jacobian[:, ~stopped], compute_uv=False), tolerance),
    )


def manipulability(robot: Robot, Q: ArrayLike) -> Vector:
    """Return the product of the Jacobian's singular values for each row of Q, shape (m, dof); shape (m,)."""
    product: Vector = np.prod(np.linalg.svd(robot.jacobian_batch(Q), compute_uv=False), axis=1)
    return product


def limit_active(robot: Robot, q: ArrayLike, tolerance: float = LIMIT_TOLERANCE) -> Mask:
    """Check which joints of a configuration are at a limit, within ``tolerance`` [rad or m]; shape (dof,)."""
    values = robot.configuration(q)
    stopped: Mask = (values <= robot.lower + tolerance) | (values >= robot.upper - tolerance)
    return stopped


def _rank(values: Vector, tolerance: float) -> int:
    return int((values > tolerance).sum())


@dataclass(frozen=True, slots=True, eq=False)
class Rate:
    """Joint rates for a wanted twist of the tip.

    Attributes:
        qdot: Joint rates [rad/s or m/s], shape (dof,).
        twist: Twist of the tip at these rates, (linear; angular), shape (6,) [m/s, rad/s].
        smallest: Smallest singular value of the scaled Jacobian; it is 0 in a singular configuration.
        scale: Share of the wanted speed that the joints' velocity limits allow.
        stopped: Names of joints at a limit that were stopped because the motion would push them further.
    """

    qdot: Vector
    twist: Vector
    smallest: float
    scale: float
    stopped: tuple[str, ...]


def rate(
    robot: Robot,
    q: ArrayLike,
    twist: ArrayLike,
    *,
    bias: ArrayLike | None = None,
    damping: float = DAMPING,
    near: float = DAMPED_BELOW,
) -> Rate:
    """Return joint rates that move the tip with a twist, as well as the configuration allows.

    The rates are a damped pseudo-inverse of the twist. Joints at a limit that would be pushed further are stopped, and
    the rates are computed again without them. Finally all rates are scaled to the joints' velocity limits.

    Args:
        robot: Any arm.
        q: Configuration, shape (dof,).
        twist: Velocity of the tip in world axes, (linear [m/s]; angular [rad/s]), shape (6,).
        bias: Wanted joint rates in the null space, where they do not disturb the tip, shape (dof,); zeros if None. In a
            singular configuration the null space leads the arm out of it.
        damping: Largest damping, in the same unit as ``near``.
        near: Singular value below which damping sets in; it grows smoothly from 0.

    Raises:
        InputError: If an array does not fit the robot.
    """
    values = robot.configuration(q)
    wanted = finite_array(twist, (6,), "twist")
    extra = np.zeros(robot.dof) if bias is None else robot.configuration(bias, "bias")

    jacobian = robot.jacobian_batch(values[None])[0]
    reach = float(np.linalg.norm(robot.chain.placement[1:, :3, 3], axis=1).sum()) or 1.0
    units = np.array([1.0 / reach] * 3 + [1.0] * 3)

    low = values <= robot.lower + LIMIT_TOLERANCE
    high = values >= robot.upper - LIMIT_TOLERANCE
    free = np.ones(robot.dof, dtype=bool)
    # Each round stops at least one more joint, and stopped joints do not move, so the loop ends.
    while True:
        qdot, smallest = _damped(jacobian * units[:, None] * free, wanted * units, extra * free, damping, near)
        blocked = free & ((low & (qdot < 0.0)) | (high & (qdot > 0.0)))
        if not blocked.any():
            break
        free &= ~blocked

    scale = 1.0 / max(1.0, float(np.max(np.abs(qdot) / robot.velocity)))
    names = tuple(name for name, is_free in zip(robot.joint_names, free, strict=True) if not is_free)
    return Rate(frozen(qdot * scale), frozen(jacobian @ (qdot * scale)), smallest, scale, names)


def _damped(J: Matrix, twist: Vector, bias: Vector, damping: float, near: float) -> tuple[Vector, float]:
    """Solve J qdot = twist by damped least squares, with a bias in the rest of the joint space.

    Along each singular direction the inverse of the singular value s is s / (s^2 + l^2), where the damping l is 0 from
    ``near`` on. The share of a direction that the twist does not take follows the bias.

    Args:
        J: Jacobian, shape (6, dof).
        twist: Wanted twist in the same units, shape (6,).
        bias: Wanted joint rates, shape (dof,).
        damping: Damping at a singular value of 0.
        near: Singular value below which there is damping.

    Returns:
        Joint rates, shape (dof,), and the smallest singular value.
    """
    U, s, Vt = np.linalg.svd(J)
    square = np.where(s < near, (1.0 - (s / near) ** 2) * damping**2, 0.0)
    inverse = np.divide(s, s * s + square, out=np.zeros_like(s), where=s > LOST)

    share_taken = np.zeros(len(Vt))
    share_taken[: len(s)] = s * inverse  # share of each singular direction that the twist takes
    V = Vt.T
    qdot: Vector = V[:, : len(s)] @ (inverse * (U.T @ twist)[: len(s)]) + V @ ((1.0 - share_taken) * (Vt @ bias))
    return qdot, float(s[-1])
