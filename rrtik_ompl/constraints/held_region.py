"""A task-space region held along a path: measures of how far configurations are from it, and bounds for motions.

A region is described by a few smooth functions of the configuration ("measures") and is a convex set of their values.
So on a straight motion in configuration space a measure exceeds its values at the ends by no more than a second-order
term: ``|f(t) - (1 - t) f(0) - t f(1)| <= t (1 - t) max |f''| / 2`` for such a function ``f``. The second derivatives
are bounded by the displacements of the joints, after the geometric Jacobian: those of a frame's origin by lever arms,
those of its axes and of its quaternion by angles alone.
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

# [rad] Largest pitch of a region with ranges of roll, pitch and yaw: near a quarter turn roll and yaw are singular.
LARGEST_PITCH = np.radians(75.0)
STEEPEST_PITCH = np.radians(89.0)  # [rad] largest pitch that a frame may reach including the tolerances
# Projection leaves a configuration where it is if it is within this share of the tolerance minus the inset,
KEPT_SHARE = 0.95
# and moves others to this share of it.
AIMED_SHARE = 0.8
ANYWHERE = 1000.0  # [m]; position bounds of this size or more count as none, being out of reach of any arm
BEHIND = 2.0  # measure of an axis that is more than a quarter turn off; larger than any allowed measure


class Turning(IntEnum):
    """How a region constrains the orientation of its frame."""

    FREE = 0
    AXIS = 1  # an axis of the frame stays within a cone about a direction
    BALL = 2  # the orientation stays within an angle of a given one
    RANGES = 3  # roll, pitch and yaw stay within ranges


@dataclass(frozen=True, slots=True, eq=False)
class HeldRegion:
    """A region of a frame, prepared for a robot. Poses are matrices; w is the frame of the region.

    Attributes:
        robot: The arm.
        region: The region, placed in the world (not ``from_start``).
        label: Name of the region in messages.
        link: Frame of the robot that carries the region's frame.
        joint: Index of the joint that carries it, 0 for the world.
        T_joint_frame: Pose of the constrained frame in the joint's frame, shape (4, 4).
        T_joint_d: Pose of the displacement's frame d in the joint's frame, shape (4, 4). For AXIS it is turned so that
            the constrained axis is its z axis; for BALL so that d coincides with w at the right orientation.
        T_w_world: Pose of the world in w, shape (4, 4).
        turning: How the orientation is constrained.
        direction: For AXIS the direction in w to which the z axis of d has to point, shape (3,).
        levers: For each joint that rotates the frame the largest distance of the frame's origin from its axis [m], 1
            for each prismatic joint that moves it, shape (joints,). All 0 if the position is free.
        turns: 1 for each joint that rotates the frame, 0 for others, shape (joints,).
        inset: How much deeper than the tolerances configurations are projected, so that motions between them have room
            to bend [m; rad], shape (2,).
    """

    robot: Robot
    region: TaskRegion
    label: str
    link: str
    joint: int
    T_joint_frame: NDArray[np.float64]
    T_joint_d: NDArray[np.float64]
    T_w_world: NDArray[np.float64]
    turning: Turning
    direction: Vector
    levers: Vector
    turns: Vector
    inset: Vector

    @property
    def T_world_w(self) -> NDArray[np.float64]:
        """Pose of the region's frame w in the world, shape (4, 4)."""
        placed: NDArray[np.float64] = self.region.T_world_w.homogeneous
        return placed

    @property
    def rows(self) -> list[int]:
        """Indices of the chain's joints that move the frame, base first."""
        return _rows_to(self.robot, self.joint)

    @property
    def frame(self) -> str:
        """Name of the constrained frame."""
        return self.robot.tip if self.region.frame is None else self.region.frame

    def displacements(self, Q: Matrix) -> NDArray[np.float64]:
        """Compute the poses of frame d in w for configurations, (m, dof) -> (m, 4, 4)."""
        return self.T_w_world @ self.robot.chain.joint_frames(Q)[:, self.joint] @ self.T_joint_d

    def measures(self, Q: Matrix) -> Matrix:
        """Compute the position and orientation measures of configurations, (m, dof) -> (m, 2).

        The first is the distance from the position bounds [m]. The second is 0 for the right orientation and grows with
        the angle as :meth:`measured` says. Tolerances are not subtracted.
        """
        D = self.displacements(Q)
        away = D[:, :3, 3] - np.clip(D[:, :3, 3], *self.region.bounds[:3].T)
        return np.column_stack([np.linalg.norm(away, axis=1), self._turned(D[:, :3, :3])])

    @property
    def tolerances(self) -> Vector:
        """Tolerances of position and orientation at waypoints [m; rad], shape (2,)."""
        return np.array([self.region.position_tolerance, self.region.orientation_tolerance])

    @property
    def allowances(self) -> Vector:
        """By how much motions between waypoints may exceed the tolerances [m; rad], shape (2,)."""
        return np.array([self.region.position_allowance, self.region.orientation_allowance])

    def limits(self, *, between: bool = False) -> Vector:
        """Return the largest measures allowed at waypoints, or ``between`` them, shape (2,)."""
        return self.measured(self.tolerances + self.allowances if between else self.tolerances)

    def measured(self, amounts: Vector) -> Vector:
        """Convert a distance [m] and an angle [rad] to measures, shape (2,).

        The measure of an angle is its sine for AXIS, the sine of its half for BALL, and the angle itself for RANGES.
        """
        metres, angle = amounts
        angle = min(angle, 0.5 * np.pi)
        if self.turning == Turning.AXIS:
            angle = np.sin(angle)
        elif self.turning == Turning.BALL:
            angle = np.sin(0.5 * angle)
        return np.array([metres, angle])

    def angle_of(self, measure: float) -> float:
        """Convert a measure of the orientation to the angle [rad], the inverse of :meth:`measured`."""
        if self.turning == Turning.AXIS:
            return float(np.arcsin(min(measure, 1.0)))
        if self.turning == Turning.BALL:
            return float(2.0 * np.arcsin(min(measure, 1.0)))
        return float(measure)

    @property
    def accepted(self) -> Vector:
        """Measures up to which a projection leaves configurations where they are, shape (2,)."""
        within: Vector = KEPT_SHARE * self.limits() - self.measured(self.inset)
        return within

    @property
    def aimed(self) -> Vector:
        """Distance and angle from the region to which a projection moves other configurations [m; rad], shape (2,)."""
        near: Vector = AIMED_SHARE * self.tolerances - self.inset
        return near

    def deviations(self, A: Matrix, B: Matrix) -> Matrix:
        """Bound by how much the measures on motions exceed the interpolation of those at the ends.

        This is max |f''| / 8 of the module's inequality, at the middle of the motion. Velocities of the joints are
        bounded by their displacements, as a motion takes time 1.

        Args:
            A: Start configurations, shape (m, dof).
            B: End configurations, shape (m, dof).

        Returns:
            Bounds for position and orientation, shape (m, 2).
        """
        ways = np.abs((B - A) @ self.robot.chain.gain.T)
        turned = ways * self.turns
        before = np.cumsum(turned, axis=1) - turned  # sum over the joints nearer to the base, which come first
        origin = (ways * self.levers * (turned + 2.0 * before)).sum(axis=1)
        angle = turned.sum(axis=1)
        return np.column_stack([origin, self.curvature * angle * angle]) / 8.0

    @property
    def curvature(self) -> float:
        """Bound of the second derivative of the orientation's measure for joint speeds whose sum is 1 rad."""
        if self.turning == Turning.RANGES:
            return _curvature(self._largest_pitch)
        return {Turning.FREE: 0.0, Turning.AXIS: 1.0, Turning.BALL: 0.25}[self.turning]

    @property
    def _largest_pitch(self) -> float:
        """Largest pitch on motions within the bound [rad], for RANGES."""
        tolerance = float(self.limits(between=True)[1])
        pitch = float(np.abs(self.region.bounds[4]).max()) + tolerance
        # A motion within the bound turns by at most sqrt(8 tolerance / curvature), its pitch by half of that.
        return pitch + float(np.sqrt(2.0 * tolerance / _curvature(pitch)))

    @property
    def passage(self) -> float:
        """How far roll or yaw have to turn at least to pass what their ranges leave out of a turn [rad]; for RANGES."""
        widths = np.diff(self.region.bounds[[3, 5]], axis=1)
        left_out = TAU - widths[widths < TAU - 1e-9]
        return float(left_out.min(initial=TAU) - 2.0 * self.limits(between=True)[1])

    def least_parts(self, A: Matrix, B: Matrix) -> Vector:
        """Return into how many equal parts motions are divided at least, so that none passes a range from end to end.

        As angles on a circle both ends may be in a range, and what is between them out of it.

        Args:
            A: Start configurations, shape (m, dof).
            B: End configurations, shape (m, dof).

        Returns:
            Numbers, more than which are needed, shape (m,).
        """
        if self.turning != Turning.RANGES:
            return np.zeros(len(A))
        turned = (np.abs((B - A) @ self.robot.chain.gain.T) * self.turns).sum(axis=1)
        return np.asarray(turned / np.cos(min(self._largest_pitch, STEEPEST_PITCH)) / self.passage)

    def outside(self, q: Vector) -> tuple[float, float]:
        """Return by how much a configuration, shape (dof,), exceeds the tolerances: position [m], orientation [rad]."""
        metres, angle = self.measures(q[None])[0]

        if self.turning == Turning.AXIS:
            z = self.displacements(q[None])[0, :3, 2]
            angle = np.arctan2(np.linalg.norm(np.cross(z, self.direction)), z @ self.direction)
        elif self.turning == Turning.BALL:
            angle = 2.0 * np.arcsin(min(angle, 1.0))

        region = self.region
        return max(metres - region.position_tolerance, 0.0), max(float(angle) - region.orientation_tolerance, 0.0)

    def _turned(self, R: NDArray[np.float64]) -> Vector:
        """The measure of the orientation for rotations of shape (m, 3, 3), shape (m,); see measures."""
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
    """Bound the second derivative of roll + pitch + yaw up to a pitch [rad], for joint speeds whose sum is 1 rad."""
    steep = 1.0 / np.cos(min(pitch, STEEPEST_PITCH))
    return float(3.0 * (0.5 * steep + 2.0 * steep * steep))


def held_region(robot: Robot, scene: Scene, region: TaskRegion, label: str) -> HeldRegion:
    """Prepare a region for a robot in a scene.

    Args:
        robot: The arm.
        scene: The scene, whose attached objects may carry the frame.
        region: The region, placed in the world.
        label: Name of the region in messages.

    Raises:
        InputError: If its ranges of angles cannot be held because the pitch comes too near to a quarter turn.
        UnknownNameError: If its frame is neither a link nor an attached object.
    """
    link, joint, T_joint_frame = frame_place(robot, scene, region.frame, label)
    turning, before, after = _turning(region, label)
    T_joint_d = (T_joint_frame * region.T_w_tip.inverse()).homogeneous.copy()
    T_joint_d[:3, :3] = T_joint_d[:3, :3] @ after

    somewhere = bool((np.abs(region.bounds[:3]) < ANYWHERE).any())
    levers = np.zeros(len(robot.chain.parent))
    if joint and somewhere:
        levers = joint_weights(robot, joint, T_joint_d[:3, 3], 0.0)

    turns = np.zeros(len(robot.chain.parent))
    rows = _rows_to(robot, joint)
    turns[rows] = ~robot.chain.prismatic[rows]

    T_w_world = region.T_world_w.inverse().homogeneous
    placed = link, joint, T_joint_frame.homogeneous, T_joint_d, T_w_world
    return HeldRegion(robot, region, label, *placed, turning, before, levers, turns, np.zeros(2))


def frame_place(robot: Robot, scene: Scene, frame: str | None, label: str) -> tuple[str, int, Any]:
    """Locate a frame on the robot.

    Args:
        robot: The arm.
        scene: The scene, whose attached objects may carry the frame.
        frame: Name of a link or an attached object; None for the tip.
        label: Name of the region in messages.

    Returns:
        Name of the robot's frame that carries it, index of the joint that carries that, and the pose of the frame in
        the joint's frame, a ``pinocchio.SE3``.

    Raises:
        UnknownNameError: If the frame is neither a link nor an attached object.
    """
    held = next((each for each in scene.attached if each.name == frame), None)
    name = robot.tip if frame is None else frame if held is None else held.link
    if not name.isprintable() or not robot.model.existFrame(name):
        names = [*robot.link_names, *(each.name for each in scene.attached)]
        raise UnknownNameError(f"frame of {label}", name, names)
    target = robot.model.frames[robot.model.getFrameId(name)]
    return name, int(target.parentJoint), target.placement * (pin.SE3.Identity() if held is None else held.pose)


def _turning(region: TaskRegion, label: str) -> tuple[Turning, Vector, NDArray[np.float64]]:
    """Classify how a region constrains the orientation.

    Returns:
        The kind; for AXIS the direction in w to which the z axis has to point, shape (3,), zeros otherwise; the
        rotation by which the region's frame is turned so that :attr:`HeldRegion.T_joint_d` is as described, shape (3,
        3).
    """
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
        # R = Rz Ry Rx, of which one factor is free: split R into the factors before and behind it.
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
    """Return the chain's indices of the joints from the base to a joint, given by its number; none for the world, 0."""
    rows = list[int]()
    row = joint - 1
    while row >= 0:
        rows.insert(0, row)
        row = int(robot.chain.parent[row])
    return rows
