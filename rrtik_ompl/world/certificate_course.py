"""How joints and obstacles go in the motions of a certificate, and bounds of their speeds and accelerations.

Points 5.1, 5.2 and 5.5 of ``docs/science/certificate.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import comb, factorial

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.poses import joint_motions
from rrtik_ompl.geometry.collision.elements import NamedBody
from rrtik_ompl.model.certificate import Route
from rrtik_ompl.model.robot import Chain
from rrtik_ompl.world.certificate_intervals import Numbers
from rrtik_ompl.world.certificate_parts import Parts

LARGEST_VALUE = 1e3  # [rad] or [m], joint values up to which rounding is allowed for
SAME = 1e-9  # up to which numbers of two models are equal
STILL = 1e-12  # up to which two rotation matrices are the same
LARGEST_TURN = 3.1  # [rad] of an obstacle in one motion: below pi the shortest rotation is beyond doubt
Stack = NDArray[np.float64]  # matrices of shape (n, 3, 3) or (n, 4, 4)


class Course:
    """How joints and obstacles move over the motions of a certificate (points 5.1, 5.2 and 5.5).

    Attributes:
        count: Number of motions.
        parents: Number of the joint that carries each joint, then each track, -1 for the world, which is the first.
        rates, pushes: Bounds of the speeds and accelerations of joint values over a motion, which takes time 1, shape
            (count, joints).
        strokes: Largest size of the joint values in each motion, shape (count, joints).
        fault: Where a timed motion jumps, goes too far or turns too far; "" if it does not.

    Args:
        chain: The joints of the robot.
        route: The motions.
        tracks: Poses of obstacles that move, at the times of the waypoints, shape (tracks, k, 4, 4); None for none.
    """

    def __init__(self, chain: Chain, route: Route, tracks: Stack | None = None) -> None:
        self._chain = chain
        rows = route.waypoints
        # A single waypoint counts as a motion that stands still.
        rows = np.repeat(rows, 2, axis=0) if len(rows) == 1 else rows
        self.count = len(rows) - 1
        self._starts = rows[:-1]

        # How far the origin of each joint is from that of the next one inwards, and from its axis.
        origins = chain.placement[:, :3, 3]
        self._offsets = np.linalg.norm(origins, axis=1)
        self._off_axes = np.linalg.norm(np.cross(origins, chain.axis[chain.parent]), axis=1)
        values = np.abs(chain.joint_values(rows))
        self.fault = ""
        self._powers = powers_of(route)
        with np.errstate(over="ignore", invalid="ignore"):
            slopes = [k * power @ chain.gain.T for k, power in enumerate(self._powers, 1)]
            bends = [k * slope for k, slope in enumerate(slopes[1:], 1)]
            self.rates = _largest(slopes)
            self.pushes = _largest(bends) if bends else np.zeros_like(self.rates)
            self.strokes = np.maximum(values[:-1], values[1:])
            if route.times is not None:
                self.strokes = self.strokes + self.rates
                jumps = np.abs(self._starts + sum(self._powers) - rows[1:]).max(axis=1)
                if not (jumps <= SAME).all():
                    number = int(np.argmax(~(jumps <= SAME))) + 1
                    self.fault = f"motion {number} does not end where the next one begins"
                elif not (self.strokes <= LARGEST_VALUE).all():
                    self.fault = f"a motion goes beyond {LARGEST_VALUE:g}"

        tracks = np.zeros((0, self.count + 1, 4, 4)) if tracks is None else tracks
        self.parents = np.concatenate([[-1], chain.parent + 1, np.zeros(len(tracks), dtype=np.int64)])
        self._stations = tracks[:, :-1]
        self._shifts = np.diff(tracks[:, :, :3, 3], axis=1)
        pieces = [list(pairwise(track[:, :3, :3])) for track in tracks]
        turns = [[_turn_between(a, b) for a, b in own] for own in pieces]
        self._turns = np.array(turns).reshape(len(tracks), self.count, 3)
        if (np.linalg.norm(self._turns, axis=2) > LARGEST_TURN).any():
            self.fault = f"an obstacle turns by more than {LARGEST_TURN:g} in one motion"

    def bounds_on_track(self, joint: int, reach: Vector | float) -> Matrix:
        """Bound speed and acceleration of an obstacle that moves, as :meth:`Motions._bounds`.

        Args:
            joint: The number of its track, behind those of the joints.
            reach: Distance of its farthest point from the origin of the track's frame [m].
        """
        k = joint - len(self._chain.parent) - 1
        turn = np.linalg.norm(self._turns[k], axis=1)
        around = np.where(turn > 0.0, reach, 0.0)  # what does not turn may be endless
        shift = np.linalg.norm(self._shifts[k], axis=1)
        return np.array([shift + turn * around, turn**2 * around, np.zeros_like(turn)])

    def bounds_on_joint(self, joint: int, reach: Vector | float, off_axis: Vector | float) -> dict[int, Matrix]:
        """Bound speed and acceleration of points that a joint carries, as seen from each frame inwards (point 5.4).

        Args:
            joint: The number of the joint.
            reach: Largest distance of the points from the origin of the joint's frame [m].
            off_axis: Their largest distance from the joint's axis [m].

        Returns:
            For the joint and each one inwards, 0 for the world: bounds of speed and acceleration in each motion, which
            takes time 1, and what joints' accelerations add to the latter, shape (3, motions) [m].
        """
        chain = self._chain
        velocity, acceleration, pushed = np.zeros((3, self.count))
        bounds = {joint: np.array([velocity, acceleration, pushed])}

        # A revolute joint adds centripetal and Coriolis terms, a prismatic joint none; both add their own acceleration.
        while joint != 0:
            k = joint - 1
            rate = self.rates[:, k]
            push = self.pushes[:, k]
            slides = bool(chain.prismatic[k])
            if slides:
                acceleration = acceleration + push
                velocity = velocity + rate
                pushed = pushed + push
            else:
                acceleration = acceleration + rate * (2.0 * velocity + rate * off_axis) + push * off_axis
                velocity = velocity + rate * off_axis
                pushed = pushed + push * off_axis
            joint = int(chain.parent[k]) + 1
            bounds[joint] = np.array([velocity, acceleration, pushed])

            # Bound the distances of the points from the axis and the origin of the next joint inwards.
            stroke = self.strokes[:, k] if slides else 0.0
            off_axis = self._off_axes[k] + stroke + reach
            reach = reach + self._offsets[k] + stroke

        return bounds

    def bends_of_point(self, joint: int, point: Vector) -> Vector:
        """Bound the acceleration of a point that a joint carries, as seen from the world, shape (motions,) [m].

        Args:
            joint: The number of the joint, 0 for the world.
            point: The point in the joint's frame [m], shape (3,).
        """
        axis = self._chain.axis[joint - 1] if joint else np.zeros(3)
        off_axis = float(np.linalg.norm(np.cross(point, axis)))
        return np.asarray(self.bounds_on_joint(joint, float(np.linalg.norm(point)), off_axis)[0][1])

    def turns_of_joint(self, joint: int) -> Matrix:
        """Bound how fast a joint's frame turns, and what joints' accelerations add to it, shape (2, motions) [rad]."""
        turn, push = np.zeros((2, self.count))
        while joint != 0:
            k = joint - 1
            if not self._chain.prismatic[k]:
                turn = turn + self.rates[:, k]
                push = push + self.pushes[:, k]
            joint = int(self._chain.parent[k]) + 1
        return np.array([turn, push])

    @property
    def joints(self) -> int:
        """Number of joints; tracks have greater numbers."""
        return len(self._chain.parent)

    def travels(self, named: Sequence[NamedBody], trees: Sequence[Parts]) -> Matrix:
        """Return how far points of each body go at most with its obstacle in each motion, shape (bodies, motions)."""
        found = np.zeros((len(named), self.count))
        for k, (each, tree) in enumerate(zip(named, trees, strict=True)):
            if each.body.joint > self.joints:
                reach, _ = tree.reaches(each.body.placement.homogeneous, np.zeros(3))
                found[k] = self.bounds_on_track(each.body.joint, reach)[0]
        return found

    def positions(self, motion: Numbers, share: Vector) -> Matrix:
        """Return the configurations at places of motions, shape (n, dof)."""
        rows = self._starts[motion]
        for k, power in enumerate(self._powers, 1):
            rows = rows + (share**k)[:, None] * power[motion]
        return rows

    def frames(self, motion: Numbers, share: Vector) -> NDArray[np.float64]:
        """Compute the frames of all joints, then of tracks, the world first, at places of motions.

        Returns:
            Shape (n, 1 + joints + tracks, 4, 4).
        """
        chain = self._chain
        moved = joint_motions(chain.axis, chain.prismatic, chain.joint_values(self.positions(motion, share)))
        frames = np.empty((len(motion), len(self.parents), 4, 4))
        frames[:, 0] = np.eye(4)
        for k, parent in enumerate(chain.parent.tolist()):
            frames[:, k + 1] = frames[:, parent + 1] @ chain.placement[k] @ moved[:, k]
        for k, stations in enumerate(self._stations):
            pose = stations[motion]
            pose[:, :3, :3] = pose[:, :3, :3] @ _turned(self._turns[k][motion] * share[:, None])
            pose[:, :3, 3] += self._shifts[k][motion] * share[:, None]
            frames[:, 1 + len(chain.parent) + k] = pose
        return frames


def powers_of(route: Route) -> list[Matrix]:
    """Return the coefficients of the powers 1, 2, ... of the share of each motion, shape (motions, dof) each."""
    if route.times is None or route.rates is None:
        rows = route.waypoints
        return [np.diff(np.repeat(rows, 2, axis=0) if len(rows) == 1 else rows, axis=0)]
    h = np.diff(route.times)[:, None]
    with np.errstate(over="ignore", invalid="ignore"):
        return [h**k / factorial(k) * route.rates[:, k - 1] for k in range(1, route.rates.shape[1] + 1)]


def _largest(powers: Sequence[Matrix]) -> Matrix:
    """Return bounds of polynomials' sizes for shares from 0 to 1: their coefficients in Bernstein's form.

    Args:
        powers: Coefficients of the powers from 0, an array of one shape for each.
    """
    degree = len(powers) - 1
    shares = np.array([[comb(i, k) / comb(degree, k) for k in range(degree + 1)] for i in range(degree + 1)])
    return np.asarray(np.abs(np.einsum("ik,kmj->imj", shares, np.array(powers))).max(axis=0))


def _turn_between(first: Matrix, second: Matrix) -> Vector:
    """Return axis times angle of the shortest rotation from one rotation matrix to another, shape (3,)."""
    turn = first.T @ second
    return np.zeros(3) if np.abs(turn - np.eye(3)).max() <= STILL else np.asarray(pin.log3(turn))


def _turned(vectors: Matrix) -> Stack:
    """Return the rotations about vectors by their lengths, (n, 3) -> (n, 3, 3)."""
    x, y, z = vectors.T
    cross = np.stack([0 * x, -z, y, z, 0 * x, -x, -y, x, 0 * x], axis=1).reshape(-1, 3, 3)
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    # sin(t) / t and (1 - cos(t)) / t^2
    turns: Stack = (
        np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * (cross @ cross)
    )
    return turns
