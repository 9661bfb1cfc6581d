"""How far configurations are from the goal: of the tip in the workspace, or in joint space where the goal is there.

Source: [1, ch. 5.1], whose metric of a pose is the root of (mu times the distance)^2 plus the square of the angle
between the unit quaternions, which is half the rotation angle. Its absolute value is missing in print.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.ik.residual import twist
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot, poses

REACH_PER_TURN = 1.0  # a full turn of the tip counts as far as so many times the reach, unless given
JOINT_RADIUS = 1e-3  # [rad] from a goal configuration, which is then reached exactly
INSIDE = 0.99  # of the tolerances, or what is just inside in the metric would be outside after rounding
NEAREST_START = 0.1  # of the reach: mu does not grow further when the tip starts nearer to the goal


class Metric(Protocol):
    """A distance from the goal, and how many configurations it was computed for.

    Attributes:
        evaluations: Configurations so far.
        radius: Distance within which the goal counts as reached, whichever way the error lies.
    """

    evaluations: int
    radius: float

    def distance(self, Q: Matrix) -> Vector:
        """Of each row of Q, shape (m, n), from the goal; shape (m,)."""


class TipMetric:
    """Distance of the tip from the nearest of some targets: ``unit * hypot(position, metres_per_radian * angle)``.

    Attributes:
        robot: The arm.
        targets: Poses and positions; one of them is enough.
        metres_per_radian: Weight of the rotation angle; 0 where the targets are positions.
        unit: What a metre counts; 1 makes it a distance in metres.
        evaluations: Forward kinematics so far.
        radius: See :class:`Metric`; from the tolerances of the targets.
        scale: What a metre and a radian count in the metric, shape (6,).
    """

    def __init__(
        self, robot: Robot, targets: list[Target], *, metres_per_radian: float | None = None, unit: float = 1.0
    ) -> None:
        self.robot = robot
        self.targets = targets
        self.unit = unit
        self.metres_per_radian = reach(robot) / TAU * REACH_PER_TURN
        if metres_per_radian is not None:
            self.metres_per_radian = metres_per_radian
        self.scale = unit * np.array([1.0] * 3 + [self.metres_per_radian] * 3)
        self.radius = INSIDE * unit * min(_radius(target, self.metres_per_radian) for target in targets)
        self.evaluations = 0

    @classmethod
    def published(cls, robot: Robot, targets: list[Target], start: Vector, mu: float | None = None) -> TipMetric:
        """The published metric: metres for positions; for poses the quaternion angle [rad] and ``mu`` [1/m].

        If ``mu`` is None, the first distance counts as much as the largest angle.
        """
        if not any(target.oriented for target in targets):
            return cls(robot, targets, metres_per_radian=0.0)
        if mu is None:
            tip = poses(robot, start[None])
            first_distance = min(float(target.tip_errors(tip)[0][0]) for target in targets)
            mu = 0.5 * np.pi / max(first_distance, NEAREST_START * reach(robot))
        return cls(robot, targets, metres_per_radian=0.5 / mu, unit=mu)

    def distance(self, Q: Matrix) -> Vector:
        """Of the tip at each row of Q, shape (m, n), from the nearest target; shape (m,)."""
        self.evaluations += len(Q)
        return self._each(poses(self.robot, Q)).min(axis=0)  # type: ignore[no-any-return]

    def pull(self, tips: NDArray[np.float64]) -> tuple[Matrix, Vector]:
        """Where tips, shape (m, 4, 4), would have to go, and how far.

        Returns:
            The twist to the nearest target in units of the metric, shape (m, 6), and its length, which is the distance
            of the tip from that target in the metric, shape (m,).
        """
        twists = np.array([twist(target, tips) for target in self.targets]) * self.scale
        lengths = np.linalg.norm(twists, axis=2)
        nearest = lengths.argmin(axis=0), np.arange(len(tips))
        return twists[nearest], lengths[nearest]

    def errors(self, q: Vector) -> Vector:
        """Distance [m] and angle [rad] of the tip at q, shape (n,), from the nearest target; shape (2,)."""
        tip = poses(self.robot, q[None])
        nearest = self.targets[int(self._each(tip)[:, 0].argmin())]
        return np.array(nearest.tip_errors(tip))[:, 0]

    def _each(self, tips: NDArray[np.float64]) -> Matrix:
        """Distance of each tip, shape (m, 4, 4), from each target in units of the metric, shape (targets, m)."""
        pairs = (target.tip_errors(tips) for target in self.targets)
        return self.unit * np.array([np.hypot(away, self.metres_per_radian * angle) for away, angle in pairs])


class ConfigurationMetric:
    """Euclidean distance in joint space from the nearest of some configurations.

    Args:
        goals: Shape (k, n).
        radius: See :class:`Metric`.
    """

    def __init__(self, goals: Matrix, radius: float = JOINT_RADIUS) -> None:
        self.goals = goals
        self.evaluations = 0
        self.radius = radius

    def distance(self, Q: Matrix) -> Vector:
        """See :class:`Metric`."""
        self.evaluations += len(Q)
        distances: Vector = np.linalg.norm(Q[:, None] - self.goals, axis=2).min(axis=1)
        return distances


def reach(robot: Robot) -> float:
    """Sum of the lengths between the joints that move the tip, and from the last one to it [m]; 1 if there are none."""
    return float(np.linalg.norm(tip_columns(robot).fixed[1:, :3, 3], axis=1).sum()) or 1.0


def _radius(target: Target, metres_per_radian: float) -> float:
    """Distance within which a target counts as reached [m]."""
    max_distance, max_angle = target.tolerances
    return min(max_distance, metres_per_radian * max_angle) if target.oriented else max_distance
