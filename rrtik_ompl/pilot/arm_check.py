"""The camera against the joints: a marker on the gripper shows whether the arm is where its encoders say."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import Matrix, Vector

STILL_SECONDS = 0.5  # an arm that stands for so long is where its last reading says: pictures and joints are not of now
TOLERANCE = 0.005  # [m] of the arm's model and of the marker on it
SIGMAS = 3.0
MIN_CHANGE = 1e-4  # [rad or m]; less is noise


@dataclass(frozen=True, slots=True, eq=False)
class ArmCheck:
    """Compares poses of the tip that are seen with those that joints give, as a value.

    Attributes:
        off: How far they differ, in words, if that is more than may be; "" if not, or if the tip was never seen.
        q: Where the arm has stood since it moved last, shape (dof,); empty before it was read.
        since: When that was [s].
    """

    off: str = ""
    q: Vector = field(default_factory=lambda: np.zeros(0))
    since: float = 0.0

    def read(self, q: Vector, time: float) -> ArmCheck:
        """After a reading of the joints at a time [s]."""
        if len(q) == len(self.q) and np.abs(q - self.q).max() <= MIN_CHANGE:
            return self
        return replace(self, q=q, since=time)

    def see(self, T_base_tip: pin.SE3, covariance: Matrix, expected: pin.SE3, time: float) -> ArmCheck:
        """After a picture.

        Of an arm that moves nothing is said: the last word holds.

        Args:
            T_base_tip: The tip as the picture shows it.
            covariance: Of that, shape (6, 6).
            expected: Where joints say that the tip is.
            time: Of the picture [s].
        """
        if time - self.since < STILL_SECONDS:
            return self

        distance = float(np.linalg.norm(T_base_tip.translation - expected.translation))
        sigma = float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
        if distance <= TOLERANCE + SIGMAS * sigma:
            return replace(self, off="")

        how_far = f"{1e3 * distance:.0f} mm"
        return replace(self, off=f"the camera sees the gripper {how_far} from where the joints say; check both")
