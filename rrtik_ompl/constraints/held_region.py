"""One task-space region that is held along a path: how far configurations are from it, how far motions may leave it.

Each region is a convex set of a few smooth functions of the configuration ("measures"), so that a straight motion in
configuration space leaves it by no more than its ends do and a second-order term: where ``f`` is such a function,
``|f(t) - (1 - t) f(0) - t f(1)| <= t (1 - t) max |f''| / 2``. The second derivatives are bounded by the ways of the
joints, after the geometric Jacobian: those of a frame's origin by levers, those of its axes and of its quaternion by
angles alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.base.poses import rpy_matrices, turned_z
from rrtik_ompl.geometry.collision.motion_bound import joint_weights
from rrtik_ompl.model.goal_kind import TaskRegion, into_range, roll_pitch_yaw
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene

LARGEST_PITCH = np.radians(75.0)  # of ranges of roll, pitch and yaw: beyond, roll and yaw run away
STEEPEST_PITCH = np.radians(89.0)  # that a frame may come to on its way, with the tolerance
KEPT_SHARE = 0.95  # of a tolerance, less the inset, up to which configurations are left where they are
AIMED_SHARE = 0.8  # of a tolerance, less the inset, to which others are moved
ANYWHERE = 1000.0  # [m]; bounds of a position from here on are none: farther than any arm reaches
BEHIND = 2.0  # measure of an axis that points more than a quarter turn away; more than any that is allowed


class Turning(IntEnum):
    """What a region says of the orientation."""

    FREE = 0
    AXIS = 1  # an axis of the frame keeps a direction within a cone
    BALL = 2  # one orientation, within an angle
    RANGES = 3  # of roll, pitch and yaw


@dataclass(frozen=True, slots=True, eq=False)
class HeldRegion:
    """A region of a frame, prepared for a robot.

    Attributes:
        robot: The arm.
        region: In the world, not ``from_start``.
        label: Of the region, for messages.
        link: Frame of the robot on which it is.
        joint: Number of the joint that carries it, 0 for the world.
        T_joint_d: Frame of the displacement in that of the joint, shape (4, 4); turned so that for AXIS its z axis
            is the one that is kept, and for BALL it is the world's frame w where the orientation is the right one.
        T_w_world: World seen from the region's frame, shape (4, 4).
        turning: What is said of the orientation.
        direction: Of AXIS, where z has to point in w, shape (3,).
        levers: Largest distance of the frame's origin from the axis of each joint that turns it, 1 for one that slides
            it, shape (joints,); all 0 where the region says nothing of the position.
        turns: Which joints turn the frame, 1 or 0, shape (joints,).
        inset: How much deeper inside the tolerances configurations are sought, so that motions between them have room
            to bend [m; rad], shape (2,).
    """

    robot: Robot
    region: TaskRegion
    label: str
    link: str
    joint: int
    T_joint_d: NDArray[np.float64]
    T_w_world: NDArray[np.float64]
    turning: Turning
    direction: Vector
    levers: Vector
    turns: Vector
    inset: Vector

    @property
    def T_world_w(self) -> NDArray[np.float64]:
        """Frame of the region, shape (4, 4)."""
        placed: NDArray[np.float64] = self.region.T_world_w.homogeneous
        return placed

    @property
    def rows(self) -> list[int]:
        """Rows of the chain's joints that move the frame, base first."""
        return _rows_to(self.robot, self.joint)

    @property
    def frame(self) -> str:
        """Name of the frame."""
        return self.robot.tip if self.region.frame is None else self.region.frame

    def displacements(self, Q: Matrix) -> NDArray[np.float64]:
        """Return the frame as seen from the region's frame for configurations, shape (m, dof): (m, 4, 4)."""
        return self.T_w_world @ self.robot.chain.joint_frames(Q)[:, self.joint] @ self.T_joint_d

    def measures(self, Q: Matrix) -> Matrix:
        """Return how far configurations, shape (m, dof), are from the region, without its tolerances, shape (m, 2).

        Metres, and for the orientation what `limits` makes of an angle.
        """
        D = self.displacements(Q)
        away = D[:, :3, 3] - np.clip(D[:, :3, 3], *self.region.bounds[:3].T)
        return np.column_stack([np.linalg.norm(away, axis=1), self._turned(D[:, :3, :3])])

    @property
    def tolerances(self) -> Vector:
        """Of the position and of the orientation at stored configurations [m; rad], shape (2,)."""
        return np.array([self.region.position_tolerance, self.region.orientation_tolerance])

    @property
    def allowances(self) -> Vector:
        """How far motions between stored configurations may go beyond the tolerances [m; rad], shape (2,)."""
        return np.array([self.region.position_allowance, self.region.orientation_allowance])

    def limits(self, *, between: bool = False) -> Vector:
        """Return the largest measures allowed: at stored configurations, or between them; shape (2,)."""
        return self.measured(self.tolerances + self.allowances if between else self.tolerances)

    def measured(self, amounts: Vector) -> Vector:
        """Return the measures of a distance [m] and an angle [rad], shape (2,)."""
        metres, angle = amounts
        angle = min(angle, 0.5 * np.pi)
        if self.turning == Turning.AXIS:
            angle = np.sin(angle)
        elif self.turning == Turning.BALL:
            angle = np.sin(0.5 * angle)
        return np.array([metres, angle])

    def angle_of(self, measure: float) -> float:
        """Return the angle [rad] that a small measure of the orientation stands for."""
        if self.turning == Turning.AXIS:
            return float(np.arcsin(min(measure, 1.0)))
        if self.turning == Turning.BALL:
            return float(2.0 * np.arcsin(min(measure, 1.0)))
        return float(measure)

    @property
    def accepted(self) -> Vector:
        """Measures up to which a search leaves configurations where they are, shape (2,)."""
        within: Vector = KEPT_SHARE * self.limits() - self.measured(self.inset)
        return within

    @property
    def aimed(self) -> Vector:
        """How near to a region a search moves others [m; rad], shape (2,)."""
        near: Vector = AIMED_SHARE * self.tolerances - self.inset
        return near

    def deviations(self, A: Matrix, B: Matrix) -> Matrix:
        """How far the measures of motions A[k] -> B[k], shapes (m, dof), exceed those of their ends, shape (m, 2)."""
        ways = np.abs((B - A) @ self.robot.chain.gain.T)
        turned = ways * self.turns
        before = np.cumsum(turned, axis=1) - turned  # of the joints nearer to the base, which come first
        origin = (ways * self.levers * (turned + 2.0 * before)).sum(axis=1)
        angle = turned.sum(axis=1)
        return np.column_stack([origin, self.curvature * angle * angle]) / 8.0

    @property
    def curvature(self) -> float:
        """Second derivative of the orientation's measure for joint speeds whose sum is 1 rad."""
        if self.turning == Turning.RANGES:
            tolerance = float(self.limits(between=True)[1])
            pitch = float(np.abs(self.region.bounds[4]).max()) + tolerance
            # a motion that is bounded turns by sqrt(8 tolerance / curvature) at most, its pitch by half of that
            return _curvature(pitch + np.sqrt(2.0 * tolerance / _curvature(pitch)))
        return {Turning.FREE: 0.0, Turning.AXIS: 1.0, Turning.BALL: 0.25}[self.turning]

    def outside(self, q: Vector) -> tuple[float, float]:
        """By how much a configuration, shape (dof,), is outside the tolerances [m; rad]."""
        metres, angle = self.measures(q[None])[0]

        if self.turning == Turning.AXIS:
            z = self.displacements(q[None])[0, :3, 2]
            angle = np.arctan2(np.linalg.norm(np.cross(z, self.direction)), z @ self.direction)
        elif self.turning == Turning.BALL:
            angle = 2.0 * np.arcsin(min(angle, 1.0))

        region = self.region
        return max(metres - region.position_tolerance, 0.0), max(float(angle) - region.orientation_tolerance, 0.0)

    def _turned(self, R: NDArray[np.float64]) -> Vector:
        if self.turning == Turning.AXIS:
            z = R[:, :, 2]
            sine = np.linalg.norm(np.cross(z, self.direction), axis=1)
            away: Vector = np.where(z @ self.direction > 0.0, sine, BEHIND)
            return away

        if self.turning == Turning.BALL:
            half: Vector = np.linalg.norm(R - np.eye(3), axis=(1, 2)) / np.sqrt(8.0)  # sine of half the angle
            return half

        if self.turning == Turning.RANGES:
            angles = roll_pitch_yaw(R)
            excess = np.abs(angles - into_range(angles, *self.region.bounds[3:].T))
            total: Vector = np.minimum(excess, TAU - excess).sum(axis=1)
            return total

        return np.zeros(len(R))


def _curvature(pitch: float) -> float:
    """Second derivative of the sum of roll, pitch and yaw up to a pitch [rad], for joint speeds whose sum is 1 rad."""
    steep = 1.0 / np.cos(min(pitch, STEEPEST_PITCH))
    return float(3.0 * (0.5 * steep + 2.0 * steep * steep))


def held_region(robot: Robot, scene: Scene, region: TaskRegion, label: str) -> HeldRegion:
    """Return a region prepared for a robot in a scene.

    Raises:
        InputError: If its ranges of angles cannot be held: pitch too near to a quarter turn.
        UnknownNameError: If its frame is neither a link nor an attached object.
    """
    link, joint, T_joint_frame = frame_place(robot, scene, region.frame, label)
    turning, before, after = _turning(region, label)
    T_joint_d = (T_joint_frame * region.T_w_tip.inverse()).homogeneous.copy()
    T_joint_d[:3, :3] = T_joint_d[:3, :3] @ after

    carried = [(joint, T_joint_d[:3, 3], 0.0)]
    somewhere = bool((np.abs(region.bounds[:3]) < ANYWHERE).any())
    levers = joint_weights(robot, carried) if joint and somewhere else np.zeros(len(robot.chain.parent))

    turns = np.zeros(len(robot.chain.parent))
    rows = _rows_to(robot, joint)
    turns[rows] = ~robot.chain.prismatic[rows]

    T_w_world = region.T_world_w.inverse().homogeneous
    none = np.zeros(2)
    return HeldRegion(robot, region, label, link, joint, T_joint_d, T_w_world, turning, before, levers, turns, none)


def frame_place(robot: Robot, scene: Scene, frame: str | None, label: str) -> tuple[str, int, Any]:
    """Return the robot's frame that a frame is on, the joint that carries it, and its pose in the joint's frame."""
    held = next((each for each in scene.attached if each.name == frame), None)
    name = robot.tip if frame is None else frame if held is None else held.link
    if not name.isprintable() or not robot.model.existFrame(name):
        names = [*robot.link_names, *(each.name for each in scene.attached)]
        raise UnknownNameError(f"frame of {label}", name, names)
    target = robot.model.frames[robot.model.getFrameId(name)]
    return name, int(target.parentJoint), target.placement * (pin.SE3.Identity() if held is None else held.pose)


def _turning(region: TaskRegion, label: str) -> tuple[Turning, Vector, NDArray[np.float64]]:
    """What a region says of the orientation, where z has to point, and by what the frame is turned to say it so."""
    low, high = region.bounds[3:].T
    full = high - low >= TAU - 1e-9
    single = low == high
    nowhere = np.zeros(3)

    if full.all():
        return Turning.FREE, nowhere, np.eye(3)
    if single.all():
        return Turning.BALL, nowhere, rpy_matrices(low[None])[0].T

    if full.sum() == 1 and single.sum() == 2:
        k = int(np.flatnonzero(full)[0])
        # R = Rz Ry Rx, and one of the three turns freely: what stands before it, and behind it.
        x, y, z = (rpy_matrices((np.where(full, 0.0, low) * unit)[None])[0] for unit in np.eye(3))
        before, after = ((z @ y, np.eye(3)), (z, x), (np.eye(3), y @ x))[k]
        return Turning.AXIS, before[:, k], after.T @ turned_z(np.eye(3)[k])

    pitch = np.abs(region.bounds[4]).max()
    reached = pitch + region.orientation_tolerance + region.orientation_allowance
    if pitch > LARGEST_PITCH:
        raise InputError(
            f"{label}: pitch may reach {np.degrees(reached):.1f} degrees beside ranges of roll or yaw, more than "
            f"{np.degrees(LARGEST_PITCH):g}; turn the frame of the region, or use two constraints"
        )
    if reached > STEEPEST_PITCH:
        raise InputError(
            f"{label}: with its tolerance pitch may reach {np.degrees(reached):.1f} degrees beside ranges of roll or "
            f"yaw, more than {np.degrees(STEEPEST_PITCH):g}; take a smaller orientation_tolerance"
        )

    return Turning.RANGES, nowhere, np.eye(3)


def _rows_to(robot: Robot, joint: int) -> list[int]:
    """Return rows of the chain from the base to a joint, given by its number; none to the world, 0."""
    rows = list[int]()
    row = joint - 1
    while row >= 0:
        rows.insert(0, row)
        row = int(robot.chain.parent[row])
    return rows
