"""Poses in files: position [m] and an orientation in one of three forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from rrtik_ompl.base.poses import orientation_data, placed
from rrtik_ompl.files.sections import Section, Vector3, Vector4


class PoseEntry(Section):
    """A pose: position [m], and the orientation as a quaternion or as fixed-axis roll, pitch, yaw."""

    xyz: Vector3 = Field(description="position [m]")
    quat_xyzw: Vector4 | None = Field(None, description="unit quaternion x, y, z, w; no rotation if absent")
    quat_wxyz: Vector4 | None = Field(None, description="the same in the order w, x, y, z")
    rpy_deg: Vector3 | None = Field(None, description="roll, pitch, yaw about the fixed x, y, z axes [deg]")

    @model_validator(mode="after")
    def _one_orientation(self) -> PoseEntry:
        if sum(each is not None for each in (self.quat_xyzw, self.quat_wxyz, self.rpy_deg)) > 1:
            raise PydanticCustomError("two_orientations", "give one of quat_xyzw, quat_wxyz and rpy_deg")
        return self

    def build(self, what: str = "pose") -> pin.SE3:
        """Return the pose as ``pinocchio.SE3``; ``what`` names it in messages."""
        rpy = None if self.rpy_deg is None else np.radians(self.rpy_deg)
        return placed(self.xyz, what, quat_xyzw=self.quat_xyzw, quat_wxyz=self.quat_wxyz, rpy=rpy)


def pose_data(placement: pin.SE3) -> dict[str, Any]:
    """Return the entry of a pose; the orientation is left out if it is the identity."""
    data: dict[str, Any] = {"xyz": placement.translation.tolist()}
    if not np.array_equal(placement.rotation, np.eye(3)):
        data |= orientation_data(placement)
    return data
