"""How the base of a simulated arm moves: a vehicle drifts and sways, and what stands on the ground does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy

MIN_PERIOD = 0.2  # [s]
MAX_SPEED = 2.0  # [m/s]
MAX_AMPLITUDE = 2.0  # [m]


@dataclass(frozen=True, slots=True, eq=False)
class BaseMotion:
    """Drift at a constant velocity, and sway as a sine; both are zero at the beginning.

    Attributes:
        drift: Velocity, shape (3,) [m/s].
        sway: Amplitude, shape (3,) [m].
        tilt: Amplitude of roll, pitch and yaw, shape (3,) [rad].
        period: Of the sway [s].

    Raises:
        InputError: If one is not finite, the period is shorter than 0.2 s, or the motion is no vehicle's.

    Example:
        >>> BaseMotion(drift=[0.01, 0.0, 0.0]).at(2.0).translation.tolist()
        [0.02, 0.0, 0.0]
    """

    drift: Vector
    sway: Vector
    tilt: Vector
    period: float

    def __init__(
        self,
        drift: ArrayLike = (0.0, 0.0, 0.0),
        sway: ArrayLike = (0.0, 0.0, 0.0),
        tilt: ArrayLike = (0.0, 0.0, 0.0),
        period: float = 5.0,
    ) -> None:
        for name, given, most in (("drift", drift, MAX_SPEED), ("sway", sway, MAX_AMPLITUDE), ("tilt", tilt, np.pi)):
            value = frozen(finite_array(given, (3,), f"{name} of the base"))
            if np.abs(value).max() > most:
                raise InputError(f"{name} of the base must be at most {most:.3g}, got {np.abs(value).max():.3g}")
            object.__setattr__(self, name, value)
        seconds = float(finite_array(period, (), "period of the base's sway"))
        if seconds < MIN_PERIOD:
            raise InputError(f"period of the base's sway must be {MIN_PERIOD} s or more, got {seconds:g}")
        object.__setattr__(self, "period", seconds)

    def at(self, time: float) -> pin.SE3:
        """Where the base is at a time [s], in its own frame at time 0: ``T_start_base``."""
        phase = float(np.sin(2.0 * np.pi * time / self.period))
        return pose_from_rpy(self.drift * time + phase * self.sway, phase * self.tilt)
