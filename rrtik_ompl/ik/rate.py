"""Joint rates for a wanted motion of the tip, also near and in singular postures, where the exact answer has no bound.

Sources: Nakamura and Hanafusa [25]; the damping of the smallest singular value alone, Maciejewski and Klein [26].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array, frozen
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot

DAMPED_BELOW = 0.05  # singular values below this are damped; metres count in units of the arm's reach
LOST = 1e-12  # singular values below this are 0
DAMPING = 0.05  # at a singular value of 0


@dataclass(frozen=True, slots=True, eq=False)
class Rate:
    """An answer of rate control.

    Attributes:
        qdot: Joint rates [rad/s or m/s], shape (dof,).
        twist: What the tip does at these rates, (linear; angular), shape (6,) [m/s, rad/s].
        smallest: Smallest singular value of the scaled Jacobian: how near the posture is to a singular one.
        scale: Share of the wanted speed that the joints' velocity limits leave.
        stopped: Joints at a limit that the motion would push further, and that were held for that.
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
    """Joint rates that move the tip with a twist as well as the posture allows.

    Args:
        robot: Any arm.
        q: Configuration, shape (dof,).
        twist: Velocity of the tip in world axes, (linear [m/s]; angular [rad/s]), shape (6,).
        bias: Rates wanted where they do not disturb the tip (null space), shape (dof,); zeros if None. In a singular
            posture the null space is what carries the arm out of it.
        damping: Largest damping, in the same unit as ``near``.
        near: Singular value below which damping sets in, growing smoothly from 0.

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
    while True:  # each round holds at least one joint more; held joints do not move, so it ends
        qdot, smallest = _damped(jacobian * units[:, None] * free, wanted * units, extra * free, damping, near)
        blocked = free & ((low & (qdot < 0.0)) | (high & (qdot > 0.0)))
        if not blocked.any():
            break
        free &= ~blocked

    scale = 1.0 / max(1.0, float(np.max(np.abs(qdot) / robot.velocity)))
    names = tuple(name for name, is_free in zip(robot.joint_names, free, strict=True) if not is_free)
    return Rate(frozen(qdot * scale), frozen(jacobian @ (qdot * scale)), smallest, scale, names)


def _damped(J: Matrix, twist: Vector, bias: Vector, damping: float, near: float) -> tuple[Vector, float]:
    """Singular directions are followed by s / (s^2 + l^2); what that leaves of the joint space follows the bias."""
    U, s, Vt = np.linalg.svd(J)
    square = np.where(s < near, (1.0 - (s / near) ** 2) * damping**2, 0.0)
    inverse = np.divide(s, s * s + square, out=np.zeros_like(s), where=s > LOST)

    share_taken = np.zeros(len(Vt))
    share_taken[: len(s)] = s * inverse  # share of each direction that the twist has taken
    V = Vt.T
    qdot: Vector = V[:, : len(s)] @ (inverse * (U.T @ twist)[: len(s)]) + V @ ((1.0 - share_taken) * (Vt @ bias))
    return qdot, float(s[-1])
