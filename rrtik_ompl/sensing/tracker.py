"""Track poses over time: choose the correct one of two, reject outliers, and smooth noise.

The covariance of a smoothed pose is that of its own picture, plus the distance by which smoothing has moved it. Errors
repeat from picture to picture, so smoothing makes poses steadier, but not more certain.
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
MAX_SPEED = 1.0  # [m/s]; slower motion between two pictures is no outlier
MAX_TURN_RATE = 2.0  # [rad/s]
# [rad/s]; poses of the same branch in two pictures differ by this, and by twice their uncertainty.
BRANCH_TURN_RATE = 0.5
MAX_OUTLIERS = 3  # after this many outliers in a row the new pose is accepted
BELIEF_MEMORY = 0.75  # share of the log belief that is kept from picture to picture
MAX_ODDS = 3.0  # largest odds that a single ambiguous picture gives to one of two poses
# Belief in the other pose at which tracking switches to it; one picture, from even odds, does not reach it.
SWITCH_BELIEF = 0.8
# More than any number of ambiguous pictures can give, because errors of lens and blur repeat.
CERTAIN_BELIEF = 0.99
# Change of velocity within a second [m/s] and [rad/s] of both motion models.
STILL, MOVING = (1e-4, 1e-3), (0.25, 0.7)
FIRST_SPEED = 0.3, 0.6  # standard deviation of the initial, unknown velocities [m/s], [rad/s]
STAY = 1.0  # mean time for which an object stays at rest, or in motion [s]
LEAST_LIKELY = 1e-4  # least probability of a model, so that none is ever excluded
_MEASURED, _RATES = slice(0, 6), slice(6, 12)


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """A tracked pose.

    Attributes:
        T_camera_object: The smoothed pose; the predicted one if the sighting was an outlier.
        covariance: Of the smoothed pose, as in `CornerPose`, shape (6, 6).
        outlier: Whether the sighting was rejected.
        other_branch: Whether the second pose of the sighting was used, which explains its picture less well.
        sure: Whether this picture, or earlier ones, leave no doubt which of two poses is correct.
    """

    T_camera_object: pin.SE3
    covariance: Matrix
    outlier: bool
    other_branch: bool
    sure: bool


class PoseTracker:
    """Track one object through a sequence of pictures.

    While pictures are ambiguous, both poses are followed. Each has a share of belief, which passes from the poses of
    one picture to the nearest ones of the next, and grows for the pose with less error, as in a hidden Markov model
    with two states; old evidence decays. The tracker switches to the other pose only if that one has most of the
    belief, which no single ambiguous picture can give it.
    """

    def __init__(self) -> None:
        self._filter = MotionFilter()
        self._time = -np.inf
        self._branches: list[pin.SE3] = []  # one or two poses of the last sighting, not smoothed
        self._belief: Vector = np.ones(0)  # belief in each of these branches
        self._followed_pose: pin.SE3 | None = None  # the branch that is followed
        self._outliers_in_row = 0

    def update(self, sight: Sighting, time: float) -> Tracked:
        """Update the track with a sighting at a time [s], and return the tracked pose.

        An outlier is rejected unless it repeats, or the sighting has just resolved an ambiguity. When the branch
        switches, or an outlier is accepted, the filter restarts.

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

        # The pose that was tracked so far may have been the wrong one.
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
        """Return the smoothed pose and its covariance; ``seconds`` is the time since the last pose, None to restart."""
        if seconds is None:
            self._filter.restart(seen, covariance)
            return seen, covariance

        filtered = self._filter.update(seen, covariance, seconds)
        smoothing_shift = np.concatenate(
            [filtered.translation - seen.translation, pin.log3(filtered.rotation @ seen.rotation.T)]
        )
        return filtered, frozen(covariance + np.outer(smoothing_shift, smoothing_shift))

    def _updated_belief(self, branches: list[pin.SE3], errors: Vector, pose: CornerPose, seconds: float) -> Vector:
        """Return the belief in each pose of a new sighting, which sums to 1.

        The belief in the last poses is flattened, passed on to the new poses by their angular distances, and weighted
        by the likelihood of the errors.
        """
        prior = np.ones(len(branches))
        if self._branches:
            reach = np.hypot(2.0 * pose.rotation_sigma, BRANCH_TURN_RATE * seconds)
            turns = np.array([[turn_between(last, new) for new in branches] for last in self._branches])
            transition = 1.0 / (1.0 + (turns / reach) ** 2)  # heavy-tailed: a much larger change is rare, but possible
            remembered = self._belief**BELIEF_MEMORY
            prior = remembered / remembered.sum() @ (transition / transition.sum(axis=1, keepdims=True))

        squares = errors**2 + ALIGNED_SIGMA**2
        belief = prior / np.minimum(squares / squares.min(), MAX_ODDS)
        return np.asarray(belief / belief.sum())

    def _chosen_branch(self, branches: list[pin.SE3], belief: Vector) -> tuple[int, bool]:
        """Return the index of the pose to follow, and whether it is not the continuation of the last one."""
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
    """Filter of a pose that is at rest or moves: two Kalman filters, and the probability of each.

    This is the interacting multiple model filter of Blom and Bar-Shalom, 1988 [53], with two models of nearly constant
    velocity that differ in how much velocities change: hardly at all, or as those of a vehicle in a swell. The state
    holds position, small rotation from a reference, and their rates, shape (12,). Call `restart` first.
    """

    def __init__(self) -> None:
        self._reference = np.eye(3)
        self._states = np.zeros((2, 12))
        self._spreads = np.zeros((2, 12, 12))
        self._shares = np.full(2, 0.5)

    def restart(self, pose: pin.SE3, covariance: Matrix) -> None:
        """Reset the filter to a pose and its covariance, shape (6, 6)."""
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
        """Return the filtered pose after a measurement, ``seconds`` after the last one.

        The steps of the filter are: mix the states of both models, predict and correct each of them, update the
        probabilities of the models, and combine their states.
        """
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
        """Return the predicted pose after a time [s] without a measurement."""
        state = self._shares @ self._states
        state = state[_MEASURED] + seconds * state[_RATES]
        return pin.SE3(pin.exp3(state[3:]) @ self._reference, state[:3])

    def _mixed(self, transition: Matrix) -> tuple[Vector, list[tuple[Vector, Matrix]]]:
        """Return the prior probabilities of both models, shape (2,), and the mixed state and covariance of each."""
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
        """Predict and correct one model in place, and return the log-likelihood of the measurement."""
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
        self._spreads[k] = 0.5 * (spread + spread.T)  # keeps the matrix symmetric despite rounding

        return -0.5 * float(
            innovation @ np.linalg.solve(innovation_covariance, innovation)
            + np.linalg.slogdet(innovation_covariance)[1]
        )

    def _settle(self) -> pin.SE3:
        """Return the combined pose, and make its rotation the new reference."""
        state = self._shares @ self._states
        self._reference = pin.exp3(state[3:6]) @ self._reference
        self._states[:, 3:6] -= state[3:6]
        return pin.SE3(self._reference, state[:3])
