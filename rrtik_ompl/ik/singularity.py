"""How near an arm is to a singular posture: rank and manipulability of its Jacobian, and the cases its robot names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Vector, frozen
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.ik.analytic.closed_form import form_of, has_closed_form
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot

RANK_TOLERANCE = 1e-9  # singular values below this share of 1 (metres and radians as they are) count as 0


@dataclass(frozen=True, slots=True, eq=False)
class SingularityReport:
    """What a posture can and cannot do.

    Attributes:
        singular_values: Of the Jacobian at the tip, largest first, shape (min(6, dof),); metres and radians mixed.
        rank: How many of them are not 0: never the count of vanishing factors, which overstates the loss.
        manipulability: Their product, sqrt(det(J J^T)) [31].
        nearness: The singular cases that the robot names, 0 at the singularity: sines, or metres.
        active: The cases at which it is.
        at_limits: Joints that are at a limit.
        rank_inside_limits: Rank without the joints at their limits: what is left of the motion when they are stopped.
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
    """Report on one posture.

    Args:
        robot: Any arm; the named cases are empty if it brings no closed form.
        q: Configuration, shape (dof,).
        tolerance: Below this a singular value, or the nearness of a case, counts as 0.

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
    """Product of the singular values of the Jacobian for each row of Q, shape (m, dof). Shape (m,)."""
    product: Vector = np.prod(np.linalg.svd(robot.jacobian_batch(Q), compute_uv=False), axis=1)
    return product


def limit_active(robot: Robot, q: ArrayLike, tolerance: float = LIMIT_TOLERANCE) -> Mask:
    """Which joints of a configuration are at a limit, within ``tolerance`` [rad or m]. Shape (dof,)."""
    values = robot.configuration(q)
    stopped: Mask = (values <= robot.lower + tolerance) | (values >= robot.upper - tolerance)
    return stopped


def _rank(values: Vector, tolerance: float) -> int:
    return int((values > tolerance).sum())
