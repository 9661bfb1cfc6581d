"""Where a thing is that stands still or moves: a Kalman filter for each, and how likely each of them is.

The interacting multiple model filter of Blom and Bar-Shalom, 1988 [53], with two models of nearly constant velocity
that differ in how much velocities change: hardly at all, or as a vehicle's in a swell.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector

STILL, MOVING = (1e-4, 1e-3), (0.25, 0.7)  # change of velocity within a second [m/s], [rad/s]
FIRST_SPEED = 0.3, 0.6  # standard deviation of what is not known yet [m/s], [rad/s]
STAY = 1.0  # how long a thing usually stays still, or in motion [s]
LEAST_LIKELY = 1e-4  # no model is ever given up
_MEASURED, _RATES = slice(0, 6), slice(6, 12)


class MotionFilter:
    """Position, small rotation from a reference, and their rates, by both models. Begin with `restart`."""

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
