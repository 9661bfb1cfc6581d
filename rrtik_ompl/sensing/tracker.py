"""Poses over time: the right one of two is chosen, outliers are left out, noise is smoothed (`motion_filter`).

The covariance of a smoothed pose is that of its own picture, and how far smoothing has moved it from there: errors of a
picture repeat themselves in the next ones, so that smoothing steadies poses and does not make them more certain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.sensing.markers.corner_pose import ALIGNED_SIGMA, CornerPose, turn_between
from rrtik_ompl.sensing.motion_filter import MotionFilter
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


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """A tracked pose.

    Attributes:
        T_camera_object: The smoothed pose; the expected one if the sighting was an outlier.
        covariance: As of a `CornerPose`, for the smoothed pose. Shape (6, 6).
        outlier: The sighting was left out.
        other_branch: Of the two poses of the sighting the second one was taken, which explains its picture less well.
        sure: This picture, or those before it, leave no doubt which of two poses is the right one.
    """

    T_camera_object: pin.SE3
    covariance: Matrix
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

    def __init__(self) -> None:
        self._filter = MotionFilter()
        self._time = -np.inf
        self._branches: list[pin.SE3] = []  # poses of the last sighting, one or two, not smoothed
        self._belief: Vector = np.ones(0)  # in each of them
        self._followed_pose: pin.SE3 | None = None  # the one of them that is followed
        self._outliers_in_row = 0

    def update(self, sight: Sighting, time: float) -> Tracked:
        """Update by a sighting at a time [s].

        Raises:
            InputError: If times do not increase.
        """
        if not time > self._time:
            raise InputError(f"times of pictures must increase, got {time:g} s after {self._time:g} s")

        seconds = time - self._time
        pose = sight.pose

        branches = [pose.T_camera_object, pose.other] if pose.ambiguous else [pose.T_camera_object]
        belief = self._updated_belief(
            branches, np.array([pose.error, pose.other_error])[: len(branches)], pose, seconds
        )
        chosen, switched = self._chosen_branch(branches, belief)

        # A wrong pose may have been tracked until now.
        became_certain = not self._is_certain(self._belief) and self._is_certain(belief)
        outlier = not switched and self._is_outlier(branches[chosen], sight, seconds)
        self._outliers_in_row = self._outliers_in_row + 1 if outlier else 0

        if outlier and not became_certain and self._outliers_in_row < MAX_OUTLIERS:
            return Tracked(
                self._filter.ahead(seconds), pose.covariance, True, chosen == 1, self._is_certain(self._belief)
            )

        restarts = outlier or switched or self._followed_pose is None
        self._time = time
        self._branches = branches
        self._belief = belief
        self._followed_pose = branches[chosen]

        smoothed = self._smoothed(branches[chosen], pose.covariance, None if restarts else seconds)
        return Tracked(*smoothed, False, chosen == 1, self._is_certain(belief))

    def _smoothed(self, seen: pin.SE3, covariance: Matrix, seconds: float | None) -> tuple[pin.SE3, Matrix]:
        """A pose and its covariance, ``seconds`` after the one before it that it goes on from."""
        if seconds is None:
            self._filter.restart(seen, covariance)
            return seen, covariance

        filtered = self._filter.update(seen, covariance, seconds)
        smoothing_shift = np.concatenate(
            [filtered.translation - seen.translation, pin.log3(filtered.rotation @ seen.rotation.T)]
        )
        return filtered, frozen(covariance + np.outer(smoothing_shift, smoothing_shift))

    def _updated_belief(self, branches: list[pin.SE3], errors: Vector, pose: CornerPose, seconds: float) -> Vector:
        """Belief that each pose of a new sighting is the true one; sums to 1."""
        prior = np.ones(len(branches))
        if self._branches:
            reach = np.hypot(2.0 * pose.rotation_sigma, BRANCH_TURN_RATE * seconds)
            turns = np.array([[turn_between(last, new) for new in branches] for last in self._branches])
            transition = 1.0 / (1.0 + (turns / reach) ** 2)  # a much larger change is rare, not impossible
            remembered = self._belief**BELIEF_MEMORY
            prior = remembered / remembered.sum() @ (transition / transition.sum(axis=1, keepdims=True))

        squares = errors**2 + ALIGNED_SIGMA**2
        belief = prior / np.minimum(squares / squares.min(), MAX_ODDS)
        return np.asarray(belief / belief.sum())

    def _chosen_branch(self, branches: list[pin.SE3], belief: Vector) -> tuple[int, bool]:
        """Which pose is followed, and whether it does not go on from the one that was followed until now."""
        best = int(belief.argmax())
        if self._followed_pose is None:
            return best, False

        nearest = int(np.argmin([turn_between(self._followed_pose, branch) for branch in branches]))
        switched = best != nearest and belief[best] > SWITCH_BELIEF
        return (best if switched else nearest), switched

    @staticmethod
    def _is_certain(belief: Vector) -> bool:
        return len(belief) > 0 and bool(belief.max() >= CERTAIN_BELIEF)

    def _is_outlier(self, pose: pin.SE3, sight: Sighting, seconds: float) -> bool:
        if self._followed_pose is None:
            return False

        shift = float(np.linalg.norm(pose.translation - self._followed_pose.translation))
        turn = turn_between(self._followed_pose, pose)
        return (
            shift > OUTLIER_LIMIT * sight.pose.position_sigma + MAX_SPEED * seconds
            or turn > OUTLIER_LIMIT * sight.pose.rotation_sigma + MAX_TURN_RATE * seconds
        )
