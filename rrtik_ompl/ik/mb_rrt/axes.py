"""A real arm as the workspace tree models it: joints with one axis each, and the reach that is left after each.

A node holds the frame of a joint, and an edge is a rotation about its axis, so the joint angles need no extra inverse
kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.ik.mb_rrt.links import ROUNDING, smallest_spans
from rrtik_ompl.ik.tip_columns import tip_columns
from rrtik_ompl.model.robot import Robot

REWEIGHTINGS = 60  # number of reweighted least-squares rounds to find the shortest polygon through the axes


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """The chain of turning joints that moves the aimed point, base first.

    Each joint k has a point on its axis, chosen such that the polygon through all points up to the aimed point is
    short. A rotation of joint k moves the point of joint k + 1 on a circle, and the aimed point is never farther from
    that point than the rest of the polygon is long. For a pose the aimed point is that of the last joint, which the
    pose determines; for a position it is the tip.

    Attributes:
        joints: Index of the entry of q for each joint, shape (n,).
        offset: Offset of each joint [rad], whose angle is q + offset; shape (n,).
        lower, upper: Limits of the angles [rad], shape (n,); a full turn where there are none.
        fixed: Fixed transform before each rotation about z, and one to the tip after the last, shape (n + 1, 4, 4).
        first: Point of the first joint in its frame [m], shape (3,).
        points: The next point after each joint, in the joint's turned frame [m], shape (n, 3).
        max_span: Largest distance from that point to the aimed point [m], shape (n,).
        min_span: Least distance from that point to the aimed point [m], shape (n,).
        reach: Largest and least distance from the first joint's point to the aimed point [m].
        aim: The aimed point in the frame of the tip [m], shape (3,).
        idle: Whether each joint, like all after it, leaves a position where it is, shape (n,); all False for a pose.
        exact: Whether all axes are parallel, so that the distances are sufficient conditions too.
    """

    joints: NDArray[np.int64]
    offset: Vector
    lower: Vector
    upper: Vector
    fixed: NDArray[np.float64]
    first: Vector
    points: Matrix
    max_span: Vector
    min_span: Vector
    reach: tuple[float, float]
    aim: Vector
    idle: Mask
    exact: bool

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.joints)

    def nearest_in_reach(self, point: Vector) -> Vector:
        """Return the point nearest to a given one [m], shape (3,), that is not certainly out of reach."""
        base = self.fixed[0][:3, :3] @ self.first + self.fixed[0][:3, 3]
        offset = point - base
        if self.exact:  # Only the component in the plane of the arm counts.
            axis = self.fixed[0][:3, 2]
            offset = offset - (axis @ offset) * axis
        distance = float(np.linalg.norm(offset))
        towards = offset / distance if distance > 0.0 else self.fixed[0][:3, 0]
        nearest: Vector = base + min(max(distance, self.reach[1]), self.reach[0]) * towards
        return nearest

    def shortfall(self, point: Vector) -> float:
        """Return how far a point [m], shape (3,), is certainly out of reach [m]; 0 if it may be in reach."""
        outside = float(np.linalg.norm(self.nearest_in_reach(point) - point))
        return outside if outside > ROUNDING * self.reach[0] else 0.0


def misfit(robot: Robot) -> str:
    """Return why the tree cannot model an arm, as a line; "" if it can."""
    tip = tip_columns(robot)
    if tip.prismatic.any():
        return "its edges are links, and a joint of the robot slides"
    one_each = (np.abs(tip.gain).sum(axis=1) == 1.0) & (tip.gain.max(axis=1) == 1.0)
    if not one_each.all() or (tip.gain.sum(axis=0) > 1.0).any() or len(tip.gain) == 0:
        return "its edges are links, and joints of the robot are coupled or do not move the tip"
    return ""


@kept_with
def axes_of(robot: Robot, oriented: bool) -> Axes:
    """Return the axes of an arm that `misfit` accepts, for positions or, if ``oriented``, for poses."""
    tip = tip_columns(robot)
    joints = np.argmax(tip.gain, axis=1)

    heights = _heights(tip.fixed, oriented)
    first = np.array([0.0, 0.0, heights[0]])
    points = _points(tip.fixed, heights)
    starts = np.column_stack([np.zeros((len(joints), 2)), heights[: len(joints)]])
    aim = np.zeros(3)
    if oriented:
        points[-1] = starts[-1]
        aim = np.asarray(np.linalg.inv(tip.fixed[-1]) @ np.append(starts[-1], 1.0))[:3]

    lengths = np.linalg.norm(points - starts, axis=1)
    max_span = np.append(np.cumsum(lengths[::-1])[::-1], 0.0)
    min_span = smallest_spans(lengths, max_span)
    low, high = (end[joints] + tip.offset for end in robot.finite_range())

    parallel = np.abs(np.abs(tip.fixed[1:-1, 2, 2]) - 1.0).max(initial=0.0) < ROUNDING
    flat = np.abs((points - starts)[:, 2]).max() < ROUNDING
    leaves_point = (np.hypot(points[:, 0], points[:, 1]) < ROUNDING) & (max_span[1:] < ROUNDING)
    idle = leaves_point & (not oriented)
    exact = bool(parallel and flat)

    return Axes(
        joints, tip.offset, low, high, tip.fixed, first, points, max_span[1:], min_span[1:],
        (float(max_span[0]), float(min_span[0])), aim, idle, exact,
    )  # fmt: skip


def _heights(fixed: NDArray[np.float64], oriented: bool) -> Vector:
    """Return the height of each joint's point on its axis that makes the polygon through the points shortest [m].

    Each side is the length of a vector that is linear in the heights, so the sum of lengths is minimised by least
    squares that are repeatedly reweighted by the inverse lengths.

    Args:
        fixed: Transforms of the chain, shape (n + 1, 4, 4).
        oriented: Whether the target is a pose, for which the polygon ends at the last joint.

    Returns:
        Shape (n + 1,); the last entry belongs to the tip and is 0.
    """
    count = len(fixed) - 1
    sides = count - 1 if oriented else count
    if sides == 0:
        return np.zeros(count + 1)
    matrix = np.zeros((sides, 3, count))
    shift = fixed[1 : sides + 1, :3, 3]
    for side in range(sides):
        matrix[side, 2, side] = -1.0
        if side + 1 < count:
            matrix[side, :, side + 1] = fixed[side + 1, :3, 2]

    heights: Vector = np.zeros(count)
    weight: Vector = np.ones(sides)

    for _ in range(REWEIGHTINGS):
        scaled = np.sqrt(weight)[:, None]
        rows = (scaled[:, :, None] * matrix).reshape(-1, count)
        heights = np.asarray(np.linalg.lstsq(rows, -(scaled * shift).ravel(), rcond=1e-10)[0], dtype=np.float64)
        length = np.linalg.norm(matrix @ heights + shift, axis=1)
        weight = 1.0 / np.maximum(length, 1e-9 * max(float(length.max()), 1e-300))
    return np.append(heights, 0.0)


def _points(fixed: NDArray[np.float64], heights: Vector) -> Matrix:
    """Return the point after each joint in its turned frame [m], shape (n, 3)."""
    points: Matrix = fixed[1:, :3, 3] + heights[1:, None] * fixed[1:, :3, 2]
    return points
