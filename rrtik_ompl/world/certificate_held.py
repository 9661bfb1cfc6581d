"""Path constraints of certificates: regions that frames do not leave in whole motions.

Points 3.5, 5.6 and 7.5 of ``docs/science/certificate.md``. The origin of a frame, an axis of it, its rotation matrix
and its angles leave what is interpolated between the ends of an interval by C h^2 / 8 at most, if C bounds their second
derivative; a region is a convex set of one of these. So how far a frame is outside of a region exceeds what is
interpolated by that much at most. Intervals are halved until this is sufficient; a certificate has no entries for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.poses import rpy_matrices
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.model.certificate import DEEPEST, ModelConstraint
from rrtik_ompl.world.certificate_course import Course, Stack
from rrtik_ompl.world.certificate_intervals import Numbers

ROUNDING = 1e-8  # [m or rad] that is allowed beyond tolerances
MAKING = 1e-9  # the same where certificates are made, so that verifiers that round otherwise agree
ENDLESS = 1000.0  # [m]; positions are free if all their bounds are of this size or more
FULL = TAU - 1e-9  # [rad]; a range of this size or more leaves its angle free
STEEPEST = 1.55  # [rad] of pitch, beside ranges of angles
AT_ONCE = 20_000  # number of intervals that are computed together, to bound memory


class Some(NamedTuple):
    """Intervals of motions, all of one level.

    Attributes:
        level: Their level.
        motion: Numbers of the motions, shape (n,).
        number: Numbers of the intervals, shape (n,).
    """

    level: int
    motion: Numbers
    number: Numbers

    @property
    def width(self) -> float:
        """Their width, as a share of a motion."""
        return float(0.5**self.level)

    def halves(self) -> Some:
        """Return both halves of each."""
        number = 2 * np.repeat(self.number, 2)
        number[1::2] += 1
        return Some(self.level + 1, np.repeat(self.motion, 2), number)


def model_constraints(constraints: HeldRegions | None) -> tuple[ModelConstraint, ...]:
    """Return what a certificate says of the path constraints of a world."""
    found = []
    for each in () if constraints is None else constraints.regions:
        region = each.region
        within = region.T_w_tip.inverse().homogeneous
        poses = _listed(each.T_joint_frame), _listed(within), _listed(region.T_world_w.homogeneous)
        tolerances = (each.tolerances + each.allowances).tolist()
        found.append(ModelConstraint(each.frame, each.joint, *poses, region.bounds.tolist(), tolerances))
    return tuple(found)


def fault_of_constraints(constraints: Sequence[ModelConstraint], course: Course, rounding: float = ROUNDING) -> str:
    """Return the first constraint that is not shown to be kept in all motions; "" if there is none.

    Args:
        constraints: The constraints.
        course: The motions, which have no fault.
        rounding: By how much tolerances may be exceeded [m or rad].
    """
    for number, each in enumerate(constraints, 1):
        held = _Held(each, course)
        whole = np.arange(course.count)
        stack = [Some(0, own, np.zeros_like(own)) for own in np.split(whole, range(AT_ONCE, len(whole), AT_ONCE))]
        while stack:
            now = stack.pop()
            ends, highest = held.outside(now)
            open_ = np.flatnonzero(~(highest <= held.limits + rounding).all(axis=1))
            if len(open_) == 0:
                continue

            # Further halves cannot help where an end is outside.
            outside = ~(ends[open_] <= held.limits + rounding).all(axis=1)
            if outside.any() or now.level == DEEPEST:
                k = open_[int(np.argmax(outside))]
                begin = now.number[k] * now.width
                what = f"path constraint {number}, of '{each.frame}'"
                place = f"from {begin:g} to {begin + now.width:g} of it"
                return f"motion {now.motion[k] + 1}: {what}, is not shown to be kept {place}"
            parts = Some(now.level, now.motion[open_], now.number[open_]).halves()
            count = len(parts.motion)
            stack += [
                Some(parts.level, parts.motion[k : k + AT_ONCE], parts.number[k : k + AT_ONCE])
                for k in range(0, count, AT_ONCE)
            ]
    return ""


class Turned(NamedTuple):
    """Measures of the orientation over intervals, shape (n,) each.

    Attributes:
        first: What is outside at the begin, or twice the sine of half the angle.
        last: The same at the end, for angles that go on from the begin without turns of 2 pi.
        ends: The larger one of both ends, for angles on a circle.
        curved: Bound of the second derivative, for intervals that take time 1.
    """

    first: Vector
    last: Vector
    ends: Vector
    curved: Vector


class _Held:
    """A constraint, and how far its frame is outside of the region at places of motions, and at most between them.

    Attributes:
        limits: Largest allowed distance from the region, and largest measure of the orientation, shape (2,).
    """

    def __init__(self, constraint: ModelConstraint, course: Course) -> None:
        bounds = np.array(constraint.bounds)
        self._course = course
        self._joint = constraint.joint
        self._place = _matrix(constraint.pose) @ _matrix(constraint.within)
        self._region = _matrix(constraint.region)
        self._low, self._high = bounds[:3].T
        self._free = bool((np.abs(bounds[:3]) >= ENDLESS).all())
        self._bends = course.bends_of_point(self._joint, self._place[:3, 3])
        self._turns, self._pushes = course.turns_of_joint(self._joint)

        # What is said of the orientation: nothing, ranges of angles, or what it turns some directions to.
        self._angles = bounds[3:].T
        ranges = self._angles[1] - self._angles[0]
        self._full = ranges >= FULL
        self._directions: tuple[Matrix, Matrix] | None = None
        if (ranges == 0.0).all():
            self._directions = np.eye(3), rpy_matrices(self._angles[:1])[0]
        elif self._full.sum() == 1 and (ranges == 0.0).sum() == 2:
            self._directions = self._axis(int(np.argmax(self._full)))

        metres, angle = constraint.tolerances
        turned = angle if self._directions is None else 2.0 * np.sin(0.5 * min(angle, np.pi))
        self.limits = np.array([np.inf if self._free else metres, turned])

    def _axis(self, free: int) -> tuple[Matrix, Matrix]:
        """Return the direction in the frame that points the same way whatever the free angle is, and that way."""
        x, y, z = rpy_matrices(np.diag(np.where(self._full, 0.0, self._angles[0])))
        before, after = ((z @ y, np.eye(3)), (z, x), (np.eye(3), y @ x))[free]
        axis = np.eye(3)[:, free : free + 1]
        return after.T @ axis, before @ axis

    def outside(self, some: Some) -> tuple[Matrix, Matrix]:
        """Return how far outside frames are at the worse end, and at most in between, shape (n, 2) each."""
        begin = np.asarray(some.number * some.width)
        first = self._poses(some.motion, begin)
        last = self._poses(some.motion, np.asarray(begin + some.width))
        bend = self._bends[some.motion]
        turn = some.width * self._turns[some.motion]
        push = some.width**2 * self._pushes[some.motion]
        distances = self._distances(first), self._distances(last)
        turned = self._angular(first, last, turn, push)
        ends = np.maximum(*distances), turned.ends
        highest = _highest(*distances, bend * some.width**2), _highest(turned.first, turned.last, turned.curved)
        return np.column_stack(ends), np.column_stack(highest)

    def _poses(self, motion: Numbers, share: Vector) -> Stack:
        """Return the poses of what is bounded as seen from the region at places of motions, shape (n, 4, 4)."""
        poses = self._course.frames(motion, share)[:, self._joint] @ self._place
        poses[:, :3, 3] = (poses[:, :3, 3] - self._region[:3, 3]) @ self._region[:3, :3]
        poses[:, :3, :3] = self._region[:3, :3].T @ poses[:, :3, :3]
        return poses

    def _distances(self, poses: Stack) -> Vector:
        """Return how far positions are from their bounds, shape (n,) [m]."""
        points = poses[:, :3, 3]
        return np.asarray(np.linalg.norm(points - np.clip(points, self._low, self._high), axis=1))

    def _angular(self, first: Stack, last: Stack, turn: Vector, push: Vector) -> Turned:
        """Return the measures of the orientation over intervals.

        Args:
            first: Poses at the begin, shape (n, 4, 4).
            last: Poses at the end, shape (n, 4, 4).
            turn: Bounds of the angles by which frames turn over the intervals, shape (n,) [rad].
            push: Bounds of what joints' accelerations add to that, shape (n,) [rad].
        """
        if self._full.all():
            return Turned(*np.zeros((4, len(turn))))
        curved = turn**2 + push
        if self._directions is not None:
            own, way = self._directions
            size = np.sqrt(2.0 if own.shape[1] == 3 else 1.0)
            one, other = (np.linalg.norm(poses[:, :3, :3] @ own - way, axis=(1, 2)) / size for poses in (first, last))
            return Turned(one, other, np.maximum(one, other), curved)

        # Angles of the first end are those nearest to the ranges, and of the last end those nearest to the first's.
        at_first = self._nearest(_roll_pitch_yaw(first))
        at_last = _roll_pitch_yaw(last)
        ends = np.maximum(self._excess(at_first), self._excess(self._nearest(at_last)))
        at_last = at_first + _wrapped(at_last - at_first)
        pitch = np.maximum(np.abs(at_first[:, 1]), np.abs(at_last[:, 1])) + 0.5 * turn
        steep = 1.0 / np.cos(np.minimum(pitch, STEEPEST))
        sound = (pitch < STEEPEST) & (steep * turn < np.pi)
        curved = 3.0 * (steep * (0.5 * turn**2 + push) + 2.0 * steep**2 * turn**2)
        return Turned(self._excess(at_first), self._excess(at_last), ends, np.where(sound, curved, np.inf))

    def _nearest(self, angles: Matrix) -> Matrix:
        """Return angles, shape (n, 3), less as many whole turns that they are nearest to their ranges [rad]."""
        middle = self._angles.mean(axis=0)
        return np.asarray(middle + _wrapped(angles - middle))

    def _excess(self, angles: Matrix) -> Vector:
        """Return how far angles, shape (n, 3), are outside of their ranges together, shape (n,) [rad]."""
        away = np.abs(angles - np.clip(angles, *self._angles))
        return np.asarray(np.where(self._full, 0.0, away).sum(axis=1))


def _highest(first: Vector, last: Vector, curved: Vector) -> Vector:
    """Bound convex functions on intervals, by a parabola over the line between their values at both ends."""
    bend = 0.125 * curved
    way = last - first
    inner = np.abs(way) < 4.0 * bend
    with np.errstate(invalid="ignore", over="ignore"):
        above = 0.5 * (first + last) + bend + np.where(inner, way * way / np.where(inner, 16.0 * bend, 1.0), 0.0)
    return np.asarray(np.where(inner, above, np.maximum(first, last)))


def _roll_pitch_yaw(poses: Stack) -> Matrix:
    """Return the angles of rotations Rz(yaw) Ry(pitch) Rx(roll), shape (n, 3) [rad]."""
    R = poses[:, :3, :3]
    pitch = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 0, 0], R[:, 1, 0]))
    return np.column_stack([np.arctan2(R[:, 2, 1], R[:, 2, 2]), pitch, np.arctan2(R[:, 1, 0], R[:, 0, 0])])


def _wrapped(angles: Matrix) -> Matrix:
    """Return angles, less as many whole turns that they are half a turn at most."""
    return np.asarray(angles - TAU * np.round(angles / TAU))


def _listed(pose: Matrix) -> list[float]:
    numbers: list[float] = (pose[:3] + 0.0).ravel().tolist()
    return numbers


def _matrix(pose: Sequence[float]) -> Matrix:
    return np.vstack([np.reshape(pose, (3, 4)), [0.0, 0.0, 0.0, 1.0]])
