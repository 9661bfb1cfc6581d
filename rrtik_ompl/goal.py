"""What a plan has to reach: joint values, an end-effector pose, a position, or any of a region's poses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Mask, Vector, finite_array, frozen
from rrtik_ompl.errors import InputError
from rrtik_ompl.robot import Robot

JOINT_TOLERANCE = 1e-6  # [rad] or [m]
LAST_ROW = frozen([0.0, 0.0, 0.0, 1.0])  # of every pose
LAST_ROW_TOLERANCE = 1e-8
NO_BOX = frozen([0.0, 0.0, 0.0])


def joint_difference(robot: Robot, Q: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """``Q - q`` per joint, continuous joints the short way round (into [-pi, pi]). Shape of Q."""
    difference = np.asarray(Q, dtype=np.float64) - np.asarray(q, dtype=np.float64)
    turned = (difference + np.pi) % (2.0 * np.pi) - np.pi
    shortest: NDArray[np.float64] = np.where(robot.continuous, turned, difference)
    return shortest


@dataclass(frozen=True, slots=True, eq=False)
class JointGoal:
    """Reach this configuration. ``q``: shape (dof,), rad or m."""

    q: Vector
    tolerance: float = JOINT_TOLERANCE

    def __init__(self, q: ArrayLike, tolerance: float = JOINT_TOLERANCE) -> None:
        object.__setattr__(self, "q", frozen(finite_array(q, (None,), "goal joints")))
        object.__setattr__(self, "tolerance", _tolerance(tolerance, "goal tolerance"))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Largest joint error of each row of Q, shape (m,) [rad or m]."""
        errors: Vector = np.abs(joint_difference(robot, np.atleast_2d(Q), self.q)).max(axis=1)
        return errors

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at the goal, shape (m,)."""
        return self.distance(robot, Q) <= self.tolerance


@dataclass(frozen=True, slots=True, eq=False)
class PositionGoal:
    """Bring the tip to a point of the world [m], orientation free. ``tolerance`` [m]."""

    position: Vector
    tolerance: float = 1e-3

    def __init__(self, position: ArrayLike, tolerance: float = 1e-3) -> None:
        object.__setattr__(self, "position", frozen(finite_array(position, (3,), "goal position")))
        object.__setattr__(self, "tolerance", _tolerance(tolerance, "goal tolerance"))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Distance of the tip from the point for each row of Q, shape (m,) [m]."""
        tips = robot.fk_batch(np.atleast_2d(Q))[:, :3, 3]
        distances: Vector = np.linalg.norm(tips - self.position, axis=1)
        return distances

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at the goal, shape (m,)."""
        return self.distance(robot, Q) <= self.tolerance


@dataclass(frozen=True, slots=True, eq=False)
class PoseGoal:
    """Bring the tip frame to T_world_tip, within ``position_tolerance`` [m] and ``orientation_tolerance`` [rad]."""

    T_world_tip: Any
    position_tolerance: float = 1e-3
    orientation_tolerance: float = 1e-2

    def __post_init__(self) -> None:
        if not isinstance(self.T_world_tip, pin.SE3):
            matrix = finite_array(self.T_world_tip, (4, 4), "goal pose")
            if np.abs(matrix[3] - LAST_ROW).max() > LAST_ROW_TOLERANCE:
                raise InputError(f"goal pose: the last row must be 0 0 0 1, got {matrix[3].tolist()}")
            object.__setattr__(self, "T_world_tip", pin.SE3(matrix))
        _check_rigid(finite_array(self.T_world_tip.homogeneous, (4, 4), "goal pose")[:3, :3])
        _tolerance(self.position_tolerance, "goal position_tolerance")
        _tolerance(self.orientation_tolerance, "goal orientation_tolerance")

    def errors(self, robot: Robot, Q: ArrayLike) -> tuple[Vector, Vector]:
        """Position error [m] and rotation angle [rad] of each row of Q, shapes (m,)."""
        tips = robot.fk_batch(np.atleast_2d(Q))
        return pose_errors(tips, self.T_world_tip)

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Errors in units of their tolerances, added; at most 1 each at the goal. Shape (m,)."""
        position, angle = self.errors(robot, Q)
        scaled: Vector = position / self.position_tolerance + angle / self.orientation_tolerance
        return scaled

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at the goal, shape (m,)."""
        position, angle = self.errors(robot, Q)
        return (position <= self.position_tolerance) & (angle <= self.orientation_tolerance)


@dataclass(frozen=True, slots=True, eq=False)
class GoalRegion:
    """Any of several goals, each of which may leave freedom: a free rotation about an axis, a box of positions.

    Attributes:
        members: Goals of which one is enough.
        free_rotation_axis: "x", "y" or "z" of the goal frame about which members may be turned, or None.
        box: Full side lengths [m], in the goal frame, within which the position is free, shape (3,).
    """

    members: tuple[PoseGoal | PositionGoal, ...]
    free_rotation_axis: str | None = None
    box: Vector = field(default_factory=lambda: NO_BOX)

    def __init__(
        self,
        members: Iterable[PoseGoal | PositionGoal],
        free_rotation_axis: str | None = None,
        box: ArrayLike = NO_BOX,
    ) -> None:
        goals = tuple(members)
        if not goals or not all(isinstance(goal, PoseGoal | PositionGoal) for goal in goals):
            raise InputError("goal: a region needs at least one pose or position, and nothing else")
        if free_rotation_axis not in (None, "x", "y", "z"):
            raise InputError(f"goal free_rotation_axis must be x, y or z, got {free_rotation_axis!r}")
        sides = finite_array(box, (3,), "goal box")
        if (sides < 0.0).any():
            raise InputError(f"goal box must not have negative sides, got {sides.tolist()}")
        object.__setattr__(self, "members", goals)
        object.__setattr__(self, "free_rotation_axis", free_rotation_axis)
        object.__setattr__(self, "box", frozen(sides))

    def distance(self, robot: Robot, Q: ArrayLike) -> Vector:
        """Distance to the nearest member in its own units, shape (m,)."""
        return np.min([self._member_distance(robot, goal, Q) for goal in self.members], axis=0)  # type: ignore[no-any-return]

    def satisfied(self, robot: Robot, Q: ArrayLike) -> Mask:
        """Which rows of Q are at one of the members, shape (m,)."""
        rows = np.atleast_2d(Q)
        inside = np.zeros(len(rows), dtype=bool)
        for goal in self.members:
            if isinstance(goal, PositionGoal):
                inside |= goal.satisfied(robot, rows)
            else:
                position, angle = self._region_errors(robot, goal, rows)
                inside |= (position <= goal.position_tolerance) & (angle <= goal.orientation_tolerance)
        return inside

    def member_errors(self, robot: Robot, Q: ArrayLike) -> NDArray[np.float64]:
        """Distance [m] and angle [rad] (0 for a position) of each row of Q from each member, shape (k, m, 2).

        Of what lies inside the box, and of what the free rotation can remove, nothing counts.
        """
        rows = np.atleast_2d(Q)
        each = [
            (goal.distance(robot, rows), np.zeros(len(rows)))
            if isinstance(goal, PositionGoal)
            else self._region_errors(robot, goal, rows)
            for goal in self.members
        ]
        return np.array(each).transpose(0, 2, 1)

    def _member_distance(self, robot: Robot, goal: PoseGoal | PositionGoal, Q: ArrayLike) -> Vector:
        if isinstance(goal, PositionGoal):
            return goal.distance(robot, Q)
        position, angle = self._region_errors(robot, goal, np.atleast_2d(Q))
        return position / goal.position_tolerance + angle / goal.orientation_tolerance

    def _region_errors(self, robot: Robot, goal: PoseGoal, Q: ArrayLike) -> tuple[Vector, Vector]:
        """Position outside the box [m] and angle that the free rotation cannot remove [rad], shapes (m,)."""
        T_goal_tip = np.linalg.inv(goal.T_world_tip.homogeneous) @ robot.fk_batch(Q)
        outside = np.maximum(np.abs(T_goal_tip[:, :3, 3]) - 0.5 * self.box, 0.0)
        rotations = T_goal_tip[:, :3, :3]
        if self.free_rotation_axis is None:
            angle = _rotation_angle(rotations)
        else:  # the angle between the axis of the goal and that of the tip is what no turn about it can remove
            k = "xyz".index(self.free_rotation_axis)
            angle = np.arctan2(np.linalg.norm(np.delete(rotations[:, :, k], k, axis=1), axis=1), rotations[:, k, k])
        return np.linalg.norm(outside, axis=1), angle


Goal: TypeAlias = JointGoal | PoseGoal | PositionGoal | GoalRegion


def pose_errors(tips: NDArray[np.float64], target: Any) -> tuple[Vector, Vector]:
    """Distance [m] and rotation angle [rad] between poses, shape (m, 4, 4), and one target pose."""
    away = tips[:, :3, 3] - target.translation
    position: Vector = np.sqrt(np.einsum("mi,mi->m", away, away))
    return position, _rotation_angle(target.rotation.T @ tips[:, :3, :3])


def _rotation_angle(rotations: NDArray[np.float64]) -> Vector:
    """Angle of rotations, shape (m, 3, 3): atan2(|R - R^T| / (2 sqrt 2), (tr R - 1) / 2), accurate near 0 and pi."""
    skew = rotations - np.swapaxes(rotations, 1, 2)
    sine = np.sqrt(np.einsum("mij,mij->m", skew, skew) / 8.0)
    angle: Vector = np.arctan2(sine, 0.5 * (np.einsum("mii->m", rotations) - 1.0))
    return angle


def _check_rigid(rotation: NDArray[np.float64]) -> None:
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if off > 1e-3:
        raise InputError(
            f"goal pose: its upper left 3 x 3 part is no rotation: {off:.3g} away from orthonormal (at most 0.001); "
            "make it orthonormal"
        )
    x, y, z = rotation.tolist()
    if x[0] * (y[1] * z[2] - y[2] * z[1]) < x[1] * (y[0] * z[2] - y[2] * z[0]) - x[2] * (y[0] * z[1] - y[1] * z[0]):
        raise InputError("goal pose: its upper left 3 x 3 part mirrors (determinant -1); a rotation is right-handed")


def _tolerance(value: float, what: str) -> float:
    if type(value) is float and 0.0 < value < np.inf:
        return value
    number = float(finite_array(value, (), what))
    if number <= 0.0:
        raise InputError(f"{what} must be greater than 0, got {number:g}")
    return number
