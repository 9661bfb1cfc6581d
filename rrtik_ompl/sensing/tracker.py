"""Poses over time: the right one of two is chosen, outliers are left out, noise is smoothed.

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
STILL, MOVING = (1e-4, 1e-3), (0.25, 0.7)  # change of velocity within a second [m/s], [rad/s]
FIRST_SPEED = 0.3, 0.6  # standard deviation of what is not known yet [m/s], [rad/s]
STAY = 1.0  # how long a thing usually stays still, or in motion [s]
LEAST_LIKELY = 1e-4  # no model is ever given up
_MEASURED, _RATES = slice(0, 6), slice(6, 12)


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


class MotionFilter:
    """Where a thing is that stands still or moves: a Kalman filter for each, and how likely each of them is.

    The interacting multiple model filter of Blom and Bar-Shalom, 1988 [53], with two models of nearly constant velocity
    that differ in how much velocities change: hardly at all, or as a vehicle's in a swell. States are position, small
    rotation from a reference, and their rates. Begin with `restart`.
    """

    def __init__(self) -> None:
        self._reference = np.eye(3)
        self._states = np.zeros((2, 12))
        self._spreads = np.zeros((2, 12, 12))
        self._shares = np.full(2, 0.5)

    def restart(self, pose: pin.SE3, covariance: Matrix) -> None:
        """Forget everything but a pose and its covariance, shape (6, 6)."""
        self._reference = pose.rotation.copy()
        state = np.zeros(12)
        spread = np.zeros((12, 12))
        state[:3] = pose.translation
        spread[_MEASURED, _MEASURED] = covariance
        spread[_RATES, _RATES] = np.diag(np.repeat(np.square(FIRST_SPEED), 3))

        self._states = np.stack([state] * 2)
        self._spreads = np.stack([spread] * 2)
        self._shares = np.full(2, 0.5)

    def update(self, pose: pin.SE3, covariance: Matrix, seconds: float) -> pin.SE3:
        """The pose after a measurement, ``seconds`` after the one before."""
        stay_probability = np.exp(-seconds / STAY)
        transition = np.array([[stay_probability, 1.0 - stay_probability], [1.0 - stay_probability, stay_probability]])
        predicted_shares, mixed_states = self._mixed(transition)

        measurement = np.concatenate([pose.translation, pin.log3(pose.rotation @ self._reference.T)])
        log_likelihoods = np.array([
            self._step(k, *mixed_states[k], measurement, covariance, seconds) for k in range(2)
        ])  # fmt: skip

        shares = predicted_shares * np.exp(log_likelihoods - log_likelihoods.max())
        self._shares = np.maximum(shares / shares.sum(), LEAST_LIKELY)
        self._shares /= self._shares.sum()

        return self._settle()

    def ahead(self, seconds: float) -> pin.SE3:
        """The pose to be expected after a time, if nothing is measured."""
        state = self._shares @ self._states
        state = state[_MEASURED] + seconds * state[_RATES]
        return pin.SE3(pin.exp3(state[3:]) @ self._reference, state[:3])

    def _mixed(self, transition: Matrix) -> tuple[Vector, list[tuple[Vector, Matrix]]]:
        """What each model is likely to be before a measurement, and what it begins with."""
        joint = transition * self._shares[:, None]
        predicted_shares = joint.sum(axis=0)

        mixed_states = []
        for k in range(2):
            weights = joint[:, k] / predicted_shares[k]
            state = weights @ self._states
            deviations = self._states - state
            spread = np.tensordot(weights, self._spreads + deviations[:, :, None] * deviations[:, None, :], 1)
            mixed_states.append((state, spread))

        return predicted_shares, mixed_states

    def _step(self, k: int, state: Vector, spread: Matrix, measurement: Vector, noise: Matrix, seconds: float) -> float:
        """Predict and correct one model; the logarithm of how well the measurement fits it."""
        forward = np.eye(12)
        forward[_MEASURED, _RATES] = seconds * np.eye(6)
        change = np.diag(np.repeat(np.square((STILL, MOVING)[k]), 3))
        growth = np.kron([[seconds**3 / 3.0, seconds**2 / 2.0], [seconds**2 / 2.0, seconds]], change)

        state = forward @ state
        spread = forward @ spread @ forward.T + growth

        innovation = measurement - state[_MEASURED]
        innovation_covariance = spread[_MEASURED, _MEASURED] + noise
        gain = np.linalg.solve(innovation_covariance, spread[_MEASURED]).T
        self._states[k] = state + gain @ innovation

        spread = spread - gain @ spread[_MEASURED]
        self._spreads[k] = 0.5 * (spread + spread.T)  # rounding must not make it lopsided

        return -0.5 * float(
            innovation @ np.linalg.solve(innovation_covariance, innovation)
            + np.linalg.slogdet(innovation_covariance)[1]
        )

    def _settle(self) -> pin.SE3:
        """The pose by both models; rotations are counted from it from now on."""
        state = self._shares @ self._states
        self._reference = pin.exp3(state[3:6]) @ self._reference
        self._states[:, 3:6] -= state[3:6]
        return pin.SE3(self._reference, state[:3])
