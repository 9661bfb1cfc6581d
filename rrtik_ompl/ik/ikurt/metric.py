"""Distance of configurations from the goal: of the tip in the workspace, or in joint space for goal configurations.

Source: [1, ch. 5.1], whose metric of a pose is the root of (mu times the distance)^2 plus the square of the angle
between the unit quaternions, which is half the rotation angle. (The absolute value in that angle is missing in print.)
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

REACH_PER_TURN = 1.0  # default weight of rotation: a full turn of the tip counts as so many times the reach
JOINT_RADIUS = 1e-3  # [rad]: this near to a goal configuration it can be reached exactly
INSIDE = 0.99  # Share of the tolerances that is used, so that rounding cannot lead outside them.
NEAREST_START = 0.1  # share of the reach; mu does not grow further if the tip starts nearer to the goal


class Metric(Protocol):
    """A distance from the goal that counts for how many configurations it was computed.

    Attributes:
        evaluations: Number of configurations so far.
        radius: Distance within which the goal counts as reached, in whichever direction the error lies.
    """

    evaluations: int
    radius: float

    def distance(self, Q: Matrix) -> Vector:
        """Return the distance of each row of Q, shape (m, n), from the goal; shape (m,)."""


class TipMetric:
    """Distance of the tip from the nearest of some targets: ``unit * hypot(position, metres_per_radian * angle)``.

    Attributes:
        robot: The arm.
        targets: Poses and positions; reaching one of them is enough.
        metres_per_radian: Weight of the rotation angle [m/rad]; 0 if the targets are positions.
        unit: Weight of a metre; with 1 the metric is in metres.
        evaluations: Number of forward kinematics so far.
        radius: See :class:`Metric`; follows from the tolerances of the targets.
        scale: Weight of each entry of a twist (linear; angular) in the metric, shape (6,).
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
        """Make the published metric: metres for positions; for poses the quaternion angle [rad] and ``mu`` [1/m].

        Args:
            robot: The arm.
            targets: Poses and positions.
            start: Configuration at the start, shape (n,).
            mu: Weight of the distance; if None, the distance at the start counts as much as the largest angle.
        """
        if not any(target.oriented for target in targets):
            return cls(robot, targets, metres_per_radian=0.0)
        if mu is None:
            tip = poses(robot, start[None])
            first_distance = min(float(target.tip_errors(tip)[0][0]) for target in targets)
            mu = 0.5 * np.pi / max(first_distance, NEAREST_START * reach(robot))
        return cls(robot, targets, metres_per_radian=0.5 / mu, unit=mu)

    def distance(self, Q: Matrix) -> Vector:
        """Return the distance of the tip from the nearest target for each row of Q, shape (m, n); shape (m,)."""
        self.evaluations += len(Q)
        return self._each(poses(self.robot, Q)).min(axis=0)  # type: ignore[no-any-return]

    def pull(self, tips: NDArray[np.float64]) -> tuple[Matrix, Vector]:
        """Return the twists that lead tips, shape (m, 4, 4), to their nearest targets.

        Returns:
            The twist to the nearest target in units of the metric, shape (m, 6), and its length, which is the distance
            of the tip from that target in the metric, shape (m,).
        """
        twists = np.array([twist(target, tips) for target in self.targets]) * self.scale
        lengths = np.linalg.norm(twists, axis=2)
        nearest = lengths.argmin(axis=0), np.arange(len(tips))
        return twists[nearest], lengths[nearest]

    def errors(self, q: Vector) -> Vector:
        """Return distance [m] and angle [rad] of the tip at q, shape (n,), from the nearest target; shape (2,)."""
        tip = poses(self.robot, q[None])
        nearest = self.targets[int(self._each(tip)[:, 0].argmin())]
        return np.array(nearest.tip_errors(tip))[:, 0]

    def _each(self, tips: NDArray[np.float64]) -> Matrix:
        """Return the distance of each tip, shape (m, 4, 4), from each target in the metric; shape (targets, m)."""
        pairs = (target.tip_errors(tips) for target in self.targets)
        return self.unit * np.array([np.hypot(away, self.metres_per_radian * angle) for away, angle in pairs])


class ConfigurationMetric:
    """Euclidean distance in joint space from the nearest of several goal configurations.

    Args:
        goals: Goal configurations, shape (k, n).
        radius: See :class:`Metric`.
    """

    def __init__(self, goals: Matrix, radius: float = JOINT_RADIUS) -> None:
        self.goals = goals
        self.evaluations = 0
        self.radius = radius

    def distance(self, Q: Matrix) -> Vector:
        """Return the distance of each row of Q, shape (m, n), from the nearest goal; shape (m,)."""
        self.evaluations += len(Q)
        distances: Vector = np.linalg.norm(Q[:, None] - self.goals, axis=2).min(axis=1)
        return distances


def reach(robot: Robot) -> float:
    """Return the sum of the lengths from joint to joint along the chain, up to the tip [m]; 1 if it is 0."""
    return float(np.linalg.norm(tip_columns(robot).fixed[1:, :3, 3], axis=1).sum()) or 1.0


def _radius(target: Target, metres_per_radian: float) -> float:
    """Return the distance within which a target counts as reached [m], for any direction of the error."""
    max_distance, max_angle = target.tolerances
    return min(max_distance, metres_per_radian * max_angle) if target.oriented else max_distance
