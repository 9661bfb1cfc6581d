"""Poses over time: the right one of two is chosen, outliers are left out, noise is smoothed without lag.

Smoothing is the one-euro filter (Casiez, Roussel and Vogel, 2012 [53]): the faster an object moves, the less it is
smoothed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import TAU, Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.sensing.markers.corner_pose import ALIGNED_SIGMA, CornerPose, turn_between
from rrtik_ompl.sensing.sight import Sighting

OUTLIER_LIMIT = 5.0  # standard deviations
MAX_SPEED = 1.0  # [m/s]: a motion below it between two pictures is no outlier
MAX_TURN_RATE = 2.0  # [rad/s]
BRANCH_TURN_RATE = 0.5  # [rad/s]: poses of one branch in two pictures differ by that, and by twice their uncertainty
MAX_OUTLIERS = 3  # in a row; after as many the new pose is taken
BELIEF_MEMORY = 0.75  # share of the logarithm of the belief that is kept from picture to picture
MAX_ODDS = 3.0  # that a single doubtful picture gives to one of two poses
SWITCH_BELIEF = 0.8  # that the other pose needs to be taken; more than one picture gives, starting from even odds
CERTAIN_BELIEF = 0.99  # more than any number of doubtful pictures gives: errors of lens and blur repeat themselves


@dataclass(slots=True)
class OneEuro:
    """A low-pass filter whose cut-off grows with speed.

    Attributes:
        cutoff: At rest [Hz].
        gain: Further cut-off per speed [Hz / (unit/s)].
        speed_cutoff: Of the speed's own filter [Hz].
    """

    cutoff: float
    gain: float
    speed_cutoff: float = 1.0
    _value: Vector | None = None
    _speed: Vector | None = None

    def __call__(self, value: Vector, seconds: float) -> Vector:
        """The smoothed value, ``seconds`` after the one before."""
        if self._value is None or self._speed is None:
            self._value, self._speed = value.copy(), np.zeros_like(value)
            return self._value
        speed = (value - self._value) / seconds
        self._speed = self._speed + _share(self.speed_cutoff, seconds) * (speed - self._speed)
        cutoff = self.cutoff + self.gain * float(np.linalg.norm(self._speed))
        self._value = self._value + _share(cutoff, seconds) * (value - self._value)
        return self._value

    @property
    def value(self) -> Vector:
        """The smoothed value; only after the first call."""
        if self._value is None:
            raise RuntimeError("nothing was smoothed yet")
        return self._value

    def restart(self) -> None:
        """Forget everything."""
        self._value = self._speed = None


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """A tracked pose.

    Attributes:
        T_camera_object: The smoothed pose; that of before if the sighting was an outlier.
        outlier: The sighting was left out.
        other_branch: Of the two poses of the sighting the second one was taken, which explains its picture less well.
        sure: This picture, or those before it, leave no doubt which of two poses is the right one.
    """

    T_camera_object: pin.SE3
    outlier: bool
    other_branch: bool
    sure: bool


class PoseTracker:
    """Tracks one object through pictures with times.

    Where a picture fits two poses, both are followed. Each has a share of belief, which passes from the poses of one
    picture to the nearest ones of the next and grows for the pose that has less error, as in a hidden Markov model
    with two states; what was believed long ago is forgotten. A pose is given up for the other one only if the
    other has most of the belief, which no single doubtful picture can give it.
    """

    def __init__(self, cutoff: float = 0.5, gain: float = 5.0) -> None:
        """Begin without a pose.

        Args:
            cutoff: Of the one-euro filters at rest [Hz].
            gain: Further cut-off per metre (or radian) a second.
        """
        self._place, self._turn = OneEuro(cutoff, gain), OneEuro(cutoff, gain)
        self._time = -np.inf
        self._branches: list[pin.SE3] = []  # poses of the last sighting, not smoothed
        self._belief: Vector = np.ones(0)  # in each of them
        self._last: pin.SE3 | None = None  # the one of them that is followed
        self._origin: pin.SE3 | None = None  # rotations are smoothed as vectors about this one
        self._strays = 0

    def update(self, sight: Sighting, time: float) -> Tracked:
        """Update by a sighting at a time [s].

        Raises:
            InputError: If times do not increase.
        """
        if not time > self._time:
            raise InputError(f"times of pictures must increase, got {time:g} s after {self._time:g} s")
        seconds, pose = time - self._time, sight.pose
        branches = [pose.T_camera_object, pose.other] if pose.ambiguous else [pose.T_camera_object]
        belief = self._believed(branches, np.array([pose.error, pose.other_error])[: len(branches)], pose, seconds)
        taken, switched = self._taken(branches, belief)
        settled = not self._sure(self._belief) and self._sure(belief)  # a wrong pose may have been tracked until now
        outlier = not switched and self._is_outlier(branches[taken], sight, seconds)
        self._strays = self._strays + 1 if outlier else 0
        if outlier and not settled and self._strays < MAX_OUTLIERS:
            return Tracked(self._smooth_pose(), True, taken == 1, self._sure(self._belief))
        if outlier or switched:
            self._place.restart()
            self._turn.restart()
        self._time, self._branches, self._belief, self._last = time, branches, belief, branches[taken]
        return Tracked(self._smoothed(branches[taken], seconds), False, taken == 1, self._sure(belief))

    def _believed(self, branches: list[pin.SE3], errors: Vector, pose: CornerPose, seconds: float) -> Vector:
        """Belief that each pose of a new sighting is the true one; sums to 1."""
        prior = np.ones(len(branches))
        if self._branches:
            reach = np.hypot(2.0 * pose.rotation_sigma, BRANCH_TURN_RATE * seconds)
            apart = np.array([[turn_between(before, now) for now in branches] for before in self._branches])
            passed = 1.0 / (1.0 + (apart / reach) ** 2)  # a much larger change is rare, not impossible
            before = self._belief**BELIEF_MEMORY
            prior = before / before.sum() @ (passed / passed.sum(axis=1, keepdims=True))
        squares = errors**2 + ALIGNED_SIGMA**2
        belief = prior / np.minimum(squares / squares.min(), MAX_ODDS)
        return np.asarray(belief / belief.sum())

    def _taken(self, branches: list[pin.SE3], belief: Vector) -> tuple[int, bool]:
        """Which pose is followed, and whether it does not go on from the one that was followed until now."""
        best = int(belief.argmax())
        if self._last is None:
            return best, False
        next_one = int(np.argmin([turn_between(self._last, each) for each in branches]))
        switched = best != next_one and belief[best] > SWITCH_BELIEF
        return (best if switched else next_one), switched

    @staticmethod
    def _sure(belief: Vector) -> bool:
        return len(belief) > 0 and bool(belief.max() >= CERTAIN_BELIEF)

    def _is_outlier(self, pose: pin.SE3, sight: Sighting, seconds: float) -> bool:
        if self._last is None:
            return False
        shift = float(np.linalg.norm(pose.translation - self._last.translation))
        turn = turn_between(self._last, pose)
        return (
            shift > OUTLIER_LIMIT * sight.pose.position_sigma + MAX_SPEED * seconds
            or turn > OUTLIER_LIMIT * sight.pose.rotation_sigma + MAX_TURN_RATE * seconds
        )

    def _smoothed(self, pose: pin.SE3, seconds: float) -> pin.SE3:
        if self._origin is None or np.linalg.norm(pin.log3(self._origin.T @ pose.rotation)) > 1.0:
            self._origin = pose.rotation.copy()
            self._turn.restart()
        self._place(pose.translation, seconds)
        self._turn(pin.log3(self._origin.T @ pose.rotation), seconds)
        return self._smooth_pose()

    def _smooth_pose(self) -> pin.SE3:
        origin = np.eye(3) if self._origin is None else self._origin
        return pin.SE3(origin @ pin.exp3(self._turn.value), self._place.value.copy())


def _share(cutoff: float, seconds: float) -> float:
    """Of a new value, in a first-order low-pass filter."""
    return 1.0 / (1.0 + 1.0 / (TAU * cutoff * seconds))
