"""Poses over time: the right one of two is kept, outliers are left out, trembling is smoothed without lag.

Smoothing is the one-euro filter (Casiez, Roussel and Vogel, CHI 2012): the faster something moves, the less it is
smoothed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.sensing.sight import Sighting

OUTLIER_LIMIT = 5.0  # standard deviations
MOST_SPEED = 1.0  # [m/s]: what may have moved between two pictures is no outlier
MOST_TURN = 2.0  # [rad/s]
PATIENCE = 3  # as many outliers in a row are the new truth


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
    """What a tracker makes of a sighting: the smoothed pose, and whether the sighting was an outlier."""

    T_camera_object: Any
    outlier: bool
    other_branch: bool


class PoseTracker:
    """Follows one object through pictures with times."""

    def __init__(self, cutoff: float = 0.5, gain: float = 5.0) -> None:
        """Start with nothing seen.

        Args:
            cutoff: Of the one-euro filters at rest [Hz].
            gain: Further cut-off per metre (or radian) a second.
        """
        self._place, self._turn = OneEuro(cutoff, gain), OneEuro(cutoff, gain)
        self._time = -np.inf
        self._last: Any | None = None  # as seen, not smoothed
        self._origin: Any | None = None  # rotations are smoothed as vectors about this one
        self._strays = 0
        self._sure = False  # a sighting was not ambiguous

    def update(self, sight: Sighting, time: float) -> Tracked:
        """Take a sighting at a time [s].

        Raises:
            InputError: If times do not increase.
        """
        if not time > self._time:
            raise InputError(f"times of pictures must increase, got {time:g} s after {self._time:g} s")
        pose, other = self._branch(sight)
        outlier = self._is_outlier(pose, sight, time - self._time)
        self._strays = self._strays + 1 if outlier else 0
        guessed, self._sure = not self._sure, self._sure or not sight.pose.ambiguous
        settled = guessed and self._sure  # what was followed until now may have been the wrong one of two poses
        if outlier and not settled and self._strays < PATIENCE:
            return Tracked(self._smooth_pose(), True, other)
        if outlier:
            self._place.restart()
            self._turn.restart()
        seconds, self._time, self._last = time - self._time, time, pose
        return Tracked(self._smoothed(pose, seconds), False, other)

    def _branch(self, sight: Sighting) -> tuple[Any, bool]:
        """The pose of the two that is nearer to the last one, where the picture does not tell them apart."""
        first, second = sight.pose.T_camera_object, sight.pose.other
        if second is None or self._last is None or not sight.pose.ambiguous:
            return first, False
        away = [np.linalg.norm(pin.log3(self._last.rotation.T @ T.rotation)) for T in (first, second)]
        return (second, True) if away[1] < away[0] else (first, False)

    def _is_outlier(self, pose: Any, sight: Sighting, seconds: float) -> bool:
        if self._last is None:
            return False
        shift = float(np.linalg.norm(pose.translation - self._last.translation))
        turn = float(np.linalg.norm(pin.log3(self._last.rotation.T @ pose.rotation)))
        return (
            shift > OUTLIER_LIMIT * sight.pose.position_sigma + MOST_SPEED * seconds
            or turn > OUTLIER_LIMIT * sight.pose.rotation_sigma + MOST_TURN * seconds
        )

    def _smoothed(self, pose: Any, seconds: float) -> Any:
        if self._origin is None or np.linalg.norm(pin.log3(self._origin.T @ pose.rotation)) > 1.0:
            self._origin = pose.rotation.copy()
            self._turn.restart()
        self._place(pose.translation, seconds)
        self._turn(pin.log3(self._origin.T @ pose.rotation), seconds)
        return self._smooth_pose()

    def _smooth_pose(self) -> Any:
        origin = np.eye(3) if self._origin is None else self._origin
        return pin.SE3(origin @ pin.exp3(self._turn.value), self._place.value.copy())


def _share(cutoff: float, seconds: float) -> float:
    """Of a new value, in a first-order low-pass filter."""
    return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff * seconds))
