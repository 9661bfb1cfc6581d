"""The two fingers of a hand, of which one may stand still: how they move, and how they close on an object.

A finger moves along a screw as the gripper opens: it slides along an axis, or turns about one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.geometry.collision.bodies import Body, link_bodies
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.tasks.setting import with_gripper
from rrtik_ompl.tasks.stages import Gripper

FLAT = 5e-4  # [m] how far a finger may be from the point that it presses on
ROUNDING = 1e-5  # [m] of distances
SAME = 1e-6  # [m] or [1] difference of two places, or axes, that counts as none
ALIGNED = 1e-4  # [1] likewise, of an axis of the tip, whose place a file has with few digits
PAD = 0.01  # [m] distance of the points that are pressed from the ends of fingers that do not reach the tip
OPENINGS = 17  # openings of a jaw that turns at which it is measured
HALVINGS = 20  # to find the point midway between two fingers,
FARTHEST = 0.2  # [m] at most so far from the tip
POINT = 1e-7  # [m] radius of a ball that stands for a point
STEPS = 8  # in which a hand settles where both fingers touch
MOST_SHIFT = 0.02  # [m] of the hand in such a step
UNSURE = 0.02  # [rad] of the direction in which a finger presses, as it is measured


@dataclass(frozen=True, slots=True, eq=False)
class Finger:
    """One of the fingers, in the frame of the joint behind the hand.

    Attributes:
        bodies: Its bodies with the gripper closed.
        twist: The screw of its way from closed to open; zero if it stands still.
    """

    bodies: tuple[Body, ...]
    twist: pin.Motion

    @property
    def stands(self) -> bool:
        """Whether it stands still."""
        return not self.twist.vector.any()

    def at(self, share: float) -> list[Body]:
        """Return its bodies with the gripper open by a share, 0 to 1."""
        moved = pin.exp6(share * self.twist)
        return [replace(body, placement=moved * body.placement) for body in self.bodies]

    def velocity(self, point: Vector) -> Vector:
        """Return how fast a point of it moves as the gripper opens [m for the whole way], both of shape (3,)."""
        return np.array(self.twist.linear + np.cross(self.twist.angular, point))


@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """A hand that is closed on an object.

    Attributes:
        pose: Pose of the tip.
        points: The points of the object on which the fingers press, in the world [m], shape (2, 3).
        width: Distance between the fingers [m].
        opening: How far the gripper is open, 0 to 1.
    """

    pose: pin.SE3
    points: Matrix
    width: float
    opening: float


class TwoFingers:
    """The two fingers of a robot's hand, the first of which stands still if one does.

    Args:
        robot: The robot.
        opened: How far the gripper is open before it takes something, above 0 to 1.

    Attributes:
        robot: The robot with its gripper open so far.
        opened: How far it is open.
        forward: The way along the fingers, in the axes of the tip, shape (3,).
        gap: Greatest distance between the fingers [m].

    Raises:
        InputError: If it has no such hand.
    """

    def __init__(self, robot: Robot, opened: float = 1.0) -> None:
        if robot.gripper is None:
            raise InputError(f"robot '{robot.name}' has no gripper joints, so that there are no grasps by two fingers")
        self.robot = with_gripper(robot, Gripper("open", opening=opened))
        self.opened = opened
        tip = robot.model.frames[robot.model.getFrameId(robot.tip)]
        self._joint = tip.parentJoint
        self._T_joint_tip = tip.placement
        self._no_frames = np.tile(np.eye(4), (robot.model.njoints, 1, 1))
        self._fingers, palm = _fingers_of(robot, self._joint)

        moving = self._fingers[1]
        hinge = moving.twist.angular
        self._turns = bool(np.linalg.norm(hinge) > SAME)
        axis = np.array(hinge if self._turns else moving.twist.linear)
        axis = axis / np.linalg.norm(axis)
        forward = self._forward(axis, palm)
        across = np.cross(forward, axis) if self._turns else axis

        ends = np.concatenate([_corners(body) for finger in self._fingers for body in finger.bodies]) @ forward
        point = np.array(tip.placement.translation)
        if not ends.min() <= point @ forward <= ends.max():
            point += (ends.max() - PAD - point @ forward) * forward
        across *= np.sign(across @ (moving.velocity(point) - self._fingers[0].velocity(point)))

        self.forward = self._T_joint_tip.rotation.T @ forward
        self._shares, self._chords = self._measured(point, across)
        self._widths = np.linalg.norm(self._chords[:, 1] - self._chords[:, 0], axis=1)
        self.gap = float(self._widths[-1])

    @property
    def standing(self) -> str:
        """Name of the link of the finger that stands still, "" if none does."""
        return self._fingers[0].bodies[0].name if self._fingers[0].stands else ""

    def opening(self, width: float) -> float:
        """Return how far the gripper is open, 0 to 1, with its fingers a width [m] apart."""
        return float(np.clip(np.interp(width, self._widths, self._shares), 0.0, 1.0))

    def poses(self, points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Return poses of the tip with the fingers on pairs of points, (k, 2, 3) -> (k, 4, 4), turned at random."""
        ways = points[:, 1] - points[:, 0]
        widths = np.linalg.norm(ways, axis=1)
        ways = ways / widths[:, None]
        sides = rng.normal(size=ways.shape)
        sides -= np.einsum("ij,ij->i", sides, ways)[:, None] * ways
        sides /= np.linalg.norm(sides, axis=1)[:, None]
        poses = np.tile(np.eye(4), (len(points), 1, 1))
        for k, width in enumerate(widths):
            chord = self._chord(self.opening(width))
            own = _frame(chord, self._T_joint_tip.rotation @ self.forward)
            R = np.column_stack([ways[k], sides[k], np.cross(ways[k], sides[k])]) @ own.T
            poses[k, :3, :3] = R
            poses[k, :3, 3] = points[k].mean(axis=0) - R @ chord.mean(axis=0)
        return np.asarray(poses @ self._T_joint_tip.homogeneous)

    def closed_on(self, parts: Sequence[Body], pose: pin.SE3, points: Matrix, cone: float) -> Hold | None:
        """Close the hand on an object, and return how it holds it; None if not by two points and their friction.

        The hand is shifted along the line of the points until both fingers touch. They press on the two points if they
        reach them, and otherwise where they come first: with an edge, or on one of the object's.

        Args:
            parts: The bodies of the object.
            pose: Pose of the tip, about.
            points: Two points of the object whose line is in the friction cones of both, shape (2, 3).
            cone: Cosine of half the angle of the friction cone.
        """
        way = points[1] - points[0]
        width = float(np.linalg.norm(way))
        line = way / width
        share = self.opening(width + FLAT)
        if not width + FLAT <= self.gap:
            return None

        place = pose * self._T_joint_tip.inverse()
        for _ in range(STEPS):
            contacts = self._touching(parts, place, share)
            gaps = np.array([contact.distance for contact in contacts])
            if gaps.min() >= 0.25 * FLAT and gaps.max() <= FLAT + ROUNDING:
                break
            rates = self._rates(contacts, place, line)
            if rates.sum() <= SAME:
                return None
            less = (gaps.sum() - FLAT) / rates.sum()
            shift = gaps[0] - 0.5 * FLAT - rates[0] * less
            share -= less
            if not 0.0 <= share <= self.opened or abs(shift) > MOST_SHIFT:
                return None
            place = pin.SE3(place.rotation, place.translation + shift * line)
        else:
            return None

        pressed = self._pressed(parts, place, share, contacts, points, cone)
        if pressed is None:
            return None
        rates = self._rates(contacts, place, line)
        share = max(share - float((gaps[rates > SAME] / rates[rates > SAME]).min()), 0.0)
        chord = self._chord(share)
        return Hold(place * self._T_joint_tip, frozen(pressed), float(np.linalg.norm(chord[1] - chord[0])), share)

    def _forward(self, axis: Vector, palm: Sequence[Body]) -> Vector:
        """Return the way from palm to fingers, shape (3,): an axis of the tip if one is at right angles to theirs."""
        moving = [body for finger in self._fingers if not finger.stands for body in finger.bodies]
        way = _centre(moving) - (_centre(palm) if palm else np.zeros(3))
        way -= (way @ axis) * axis
        axes = np.concatenate([self._T_joint_tip.rotation.T, -self._T_joint_tip.rotation.T])
        across = axes[np.abs(axes @ axis) < ALIGNED]
        chosen = np.array(across[np.argmax(across @ way)]) if len(across) else way
        chosen = chosen - (chosen @ axis) * axis
        return np.asarray(chosen / np.linalg.norm(chosen))

    def _measured(self, point: Vector, across: Vector) -> tuple[Vector, NDArray[np.float64]]:
        """Measure the fingers at several openings.

        Args:
            point: A point between them, near their ends, in the frame of the joint, shape (3,).
            across: The way from the first finger to the second one, shape (3,).

        Returns:
            The openings, shape (k,), and for each the two points where a ball that is midway between the fingers
            touches them, shape (k, 2, 3); the distance of these points grows with the opening.

        Raises:
            InputError: If the fingers do not part.
        """
        if self._turns:
            shares = np.linspace(0.0, self.opened, OPENINGS)
            chords = np.array([self._chord_at(share, point, across) for share in shares])
            widths = np.linalg.norm(chords[:, 1] - chords[:, 0], axis=1)
            apart = np.flatnonzero((chords[:, 1] - chords[:, 0]) @ across > SAME)
        else:
            # Fingers that slide are measured when they have hardly parted; from there on they stay parallel.
            slightly = 0.1 * self.opened
            ends = self._chord_at(slightly, point, across)
            width = float(np.linalg.norm(ends[1] - ends[0]))
            speeds = np.array([finger.velocity(point) @ across for finger in self._fingers])
            shut = max(slightly - width / (speeds[1] - speeds[0]), 0.0)
            shares = np.array([shut, self.opened])
            along = (shares - slightly)[:, None] * speeds + 0.5 * width * np.array([-1.0, 1.0])
            chords = ends.mean(axis=0) + along[:, :, None] * across
            widths = along[:, 1] - along[:, 0]
            apart = np.arange(2)

        more = [k for k in apart if k == apart[0] or widths[k] > widths[apart[apart < k]].max() + SAME]
        if len(more) < 2:
            raise InputError(f"robot '{self.robot.name}': its fingers do not part where they would hold something")
        return shares[more], chords[more]

    def _chord_at(self, share: float, point: Vector, across: Vector) -> Matrix:
        """Return where a ball touches both fingers whose centre is beside a point, at an opening, shape (2, 3)."""
        ball = Body("", self._joint, pin.SE3.Identity(), coal.Sphere(POINT), "obstacle")
        sides = [finger.at(share) for finger in self._fingers]

        def nearest(shift: float) -> list[Contact]:
            there = replace(ball, placement=pin.SE3(np.eye(3), point + shift * across))
            return [_nearest(side, [there], self._no_frames) for side in sides]

        low = -FARTHEST
        high = FARTHEST
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            first, second = nearest(middle)
            if first.distance < second.distance:
                low = middle
            else:
                high = middle
        return np.array([contact.point_first for contact in nearest(0.5 * (low + high))])

    def _chord(self, share: float) -> Matrix:
        """Return the two points between which the fingers hold something at an opening, shape (2, 3)."""
        columns = self._chords.reshape(len(self._shares), 6).T
        return np.array([np.interp(share, self._shares, column) for column in columns]).reshape(2, 3)

    def _touching(self, parts: Sequence[Body], place: pin.SE3, share: float) -> list[Contact]:
        """Return where each finger is nearest to an object, the joint at a place and the gripper open by a share."""
        frames = self._no_frames.copy()
        frames[self._joint] = place.homogeneous
        return [_nearest(finger.at(share), parts, frames) for finger in self._fingers]

    def _rates(self, contacts: Sequence[Contact], place: pin.SE3, line: Vector) -> Vector:
        """Return by how much each finger moves outwards along a line as the gripper opens [m for the whole way]."""
        u = place.rotation.T @ line
        ends = [place.actInv(np.asarray(contact.point_first)) for contact in contacts]
        speeds = [finger.velocity(end) @ u for finger, end in zip(self._fingers, ends, strict=True)]
        return np.array([-speeds[0], speeds[1]])

    def _pressed(
        self,
        parts: Sequence[Body],
        place: pin.SE3,
        share: float,
        contacts: Sequence[Contact],
        points: Matrix,
        cone: float,
    ) -> Matrix | None:
        """Return two points of an object, shape (2, 3), on which the fingers press within the cones of friction.

        Args:
            parts: The bodies of the object.
            place: Pose of the joint behind the hand.
            share: How far the gripper is open.
            contacts: Where the fingers are nearest to the object.
            points: The points that they are to press on, shape (2, 3).
            cone: Cosine of half the angle of the friction cone.
        """
        frames = self._no_frames.copy()
        frames[self._joint] = place.homogeneous
        sides = [finger.at(share) for finger in self._fingers]
        reached = [_nearest(side, [_ball(point)], frames) for side, point in zip(sides, points, strict=True)]
        if max(contact.distance for contact in reached) <= FLAT + ROUNDING:
            return points

        # Where the fingers come first; and where a finger lies flat, the place that is opposite to the other one's.
        first = [_Press(contact.point_second, contact.point_first) for contact in contacts]
        opposite = [_opposite(sides[k], parts, first[1 - k].point, frames) for k in (0, 1)]
        sure = float(np.cos(np.arccos(cone) - UNSURE))
        for pair in ((first[0], first[1]), (opposite[0], first[1]), (first[0], opposite[1])):
            if pair[0] is not None and pair[1] is not None and _holds(pair[0], pair[1], sure):
                return np.array([pair[0].point, pair[1].point])
        return None


@kept_with
def two_fingers(robot: Robot, opened: float) -> TwoFingers:
    """Return the fingers of a robot, which are measured once; see :class:`TwoFingers`."""
    return TwoFingers(robot, opened)


class _Press:
    """A point of an object, shape (3,), and the outward direction in which the finger is that presses on it."""

    def __init__(self, point: Vector, finger: Vector) -> None:
        self.point = np.asarray(point)
        way = np.asarray(finger) - self.point
        self.outward = way / max(float(np.linalg.norm(way)), POINT)


def _holds(first: _Press, second: _Press, cone: float) -> bool:
    """Check whether the line of two points is in the friction cones of both, given the cosine of half their angle."""
    way = second.point - first.point
    line = way / max(float(np.linalg.norm(way)), POINT)
    return bool(-first.outward @ line >= cone and second.outward @ line >= cone)


def _opposite(
    finger: Sequence[Body], parts: Sequence[Body], point: Vector, frames: NDArray[np.float64]
) -> _Press | None:
    """Return where a finger presses that is opposite to a point, shape (3,); None if it does not touch there."""
    pad = _nearest(finger, [_ball(point)], frames).point_first
    press = _Press(_nearest(parts, [_ball(pad)], frames).point_first, pad)
    return press if np.linalg.norm(press.point - pad) <= FLAT + ROUNDING else None


def _ball(point: Vector) -> Body:
    """Return a body that stands for a point in the world, shape (3,)."""
    return Body("", 0, pin.SE3(np.eye(3), np.asarray(point)), coal.Sphere(POINT), "obstacle")


def _nearest(bodies: Sequence[Body], others: Sequence[Body], frames: NDArray[np.float64]) -> Contact:
    """Return the contact of the nearest pair of bodies, one of each; frames as of `measured`."""
    pairs = list(product(range(len(bodies)), range(len(bodies), len(bodies) + len(others))))
    return min(measured([*bodies, *others], pairs, frames, near_only=False), key=lambda each: each.distance)


def _fingers_of(robot: Robot, joint: int) -> tuple[tuple[Finger, Finger], list[Body]]:
    """Return the two fingers behind a joint, a standing one first, and the bodies of the palm.

    Raises:
        InputError: If there are not two, or one does not move along a screw.
    """
    shut, half, wide = (
        [body for body in link_bodies(with_gripper(robot, Gripper("close", opening=share))) if body.joint == joint]
        for share in (0.0, 0.5, 1.0)
    )
    palm: list[Body] = []
    twists: list[pin.Motion] = []
    moving: list[list[Body]] = []
    for closed, middle, opened in zip(shut, half, wide, strict=True):
        twist = pin.log6(opened.placement * closed.placement.inverse())
        if np.abs(twist.vector).max() <= SAME:
            palm.append(closed)
            continue
        if not (pin.exp6(0.5 * twist) * closed.placement).isApprox(middle.placement, SAME):
            raise InputError(f"robot '{robot.name}': its fingers have several joints each; say how things are taken")
        alike = [k for k, known in enumerate(twists) if np.allclose(known.vector, twist.vector, atol=SAME)]
        if not alike:
            twists.append(twist)
            moving.append([])
        moving[alike[0] if alike else -1].append(closed)

    fingers = [Finger(tuple(bodies), twist) for bodies, twist in zip(moving, twists, strict=True)]
    if len(fingers) == 1 and palm:
        return (Finger(tuple(palm), pin.Motion.Zero()), fingers[0]), palm
    if len(fingers) != 2 or np.allclose(twists[0].vector, twists[1].vector, atol=SAME):
        raise InputError(f"robot '{robot.name}': its gripper is no pair of fingers that close on each other")
    return (fingers[0], fingers[1]), palm


def _frame(chord: Matrix, forward: Vector) -> Matrix:
    """Return the axes of a hand: from finger to finger, forward, and the third, shape (3, 3)."""
    way = chord[1] - chord[0]
    way = way / np.linalg.norm(way)
    ahead = forward - (forward @ way) * way
    ahead = ahead / np.linalg.norm(ahead)
    return np.column_stack([way, ahead, np.cross(way, ahead)])


def _centre(bodies: Sequence[Body]) -> Vector:
    """Return the middle of the boxes around some bodies, in the frame of their joint, shape (3,) [m]."""
    return np.asarray(np.mean([_corners(body).mean(axis=0) for body in bodies], axis=0))


def _corners(body: Body) -> Matrix:
    """Return the corners of a box around a body, in the frame of its joint, shape (8, 3) [m]."""
    body.geometry.computeLocalAABB()
    box = body.geometry.aabb_local
    local = np.array(list(product(*zip(box.min_, box.max_, strict=True))))
    return np.asarray(local @ body.placement.rotation.T + body.placement.translation)
