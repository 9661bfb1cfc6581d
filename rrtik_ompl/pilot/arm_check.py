"""The camera against the joints: a marker on the gripper shows whether the arm is where its encoders say."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector

STILL_SECONDS = 0.5  # an arm that stands for so long is where its last reading says: pictures and joints are not of now
TOLERANCE = 0.005  # [m] of the arm's model and of the marker on it
SIGMAS = 3.0
MIN_CHANGE = 1e-4  # [rad or m]; less is noise


class ArmCheck:
    """Compares poses of the tip that are seen with those that joints give.

    Attributes:
        off: How far they differ, in words, if that is more than may be; "" if not, or if the tip was never seen.
    """

    def __init__(self) -> None:
        """Begin without a sighting."""
        self.off = ""
        self._q: Vector = np.zeros(0)
        self._since = 0.0

    def read(self, q: Vector, time: float) -> None:
        """The joints at a time [s]."""
        if len(q) != len(self._q) or np.abs(q - self._q).max() > MIN_CHANGE:
            self._q, self._since = q.copy(), time

    def see(self, T_base_tip: pin.SE3, covariance: Matrix, expected: pin.SE3, time: float) -> None:
        """The tip as a picture of a time shows it, with its covariance (6, 6), and where joints say that it is.

        Of an arm that moves nothing is said: the last word holds.
        """
        if time - self._since < STILL_SECONDS:
            return
        away = float(np.linalg.norm(T_base_tip.translation - expected.translation))
        sigma = float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
        far = away > TOLERANCE + SIGMAS * sigma
        self.off = (
            f"the camera sees the gripper {1e3 * away:.0f} mm from where the joints say; check both" if far else ""
        )
