"""A camera with a zoom lens on a pan-tilt head; its pose and intrinsics follow from the readings of encoders.

Source: [1, ch. 4.6.2] (two rotations before the camera, intrinsics that depend on the zoom).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, finite_array, finite_number, frozen
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.sensing.cameras.camera import Camera


class Encoder(NamedTuple):
    """Conversion of the counts of an encoder to an angle.

    Attributes:
        zero: Count at the angle 0.
        per_count: Angle of a count [rad]; negative if the encoder counts in the opposite direction.
    """

    zero: float = 0.0
    per_count: float = 1.0

    def angle(self, count: float) -> float:
        """Return the angle of a count [rad]."""
        return (finite_number(count, "count of an encoder") - self.zero) * self.per_count


class PanTiltZoom:
    """A pan-tilt head with a zoom lens.

    Args:
        cameras: The lens, calibrated at one or more zooms, with the same picture size.
        zooms: Increasing counts of the zoom's encoder, one for each camera, shape (k,); one for a lens without zoom.
        T_base_head: Pose of the head in the base frame of the arm at pan 0. It pans about its z axis, then tilts about
            the panned y axis.
        T_head_camera: Pose of the camera in the panned and tilted frame.
        pan: Encoder of the pan; by default its counts are radians.
        tilt: Encoder of the tilt; by default its counts are radians.

    Raises:
        InputError: If there is no camera, sizes differ, or zooms do not increase.

    Example:
        >>> lens = rrtik.sensing.Camera([[880.0, 0.0, 320.0], [0.0, 880.0, 240.0], [0.0, 0.0, 1.0]], 640, 480)
        >>> head = rrtik.sensing.PanTiltZoom([lens], [0.0], rrtik.pose(), rrtik.pose())
        >>> head.pose(np.pi / 2, 0.0).rotation.round(6)[:, 0].tolist()
        [0.0, 1.0, 0.0]
    """

    def __init__(
        self,
        cameras: Sequence[Camera],
        zooms: ArrayLike,
        T_base_head: ArrayLike | pin.SE3,
        T_head_camera: ArrayLike | pin.SE3,
        *,
        pan: Encoder = Encoder(),  # noqa: B008 - frozen
        tilt: Encoder = Encoder(),  # noqa: B008
    ) -> None:
        self.cameras = listed(cameras, "cameras of a zoom lens")
        for camera in self.cameras:
            require(camera, Camera, "camera of a zoom lens", "use Camera.load(file)")
        self.zooms: Vector = frozen(finite_array(zooms, (len(self.cameras),), "zooms"))
        if not self.cameras or (np.diff(self.zooms) <= 0.0).any():
            raise InputError("a zoom lens needs a camera for each of its zooms, which increase")
        if len({(each.width, each.height) for each in self.cameras}) > 1:
            raise InputError("cameras of one zoom lens have one size of pictures")
        if len({each.lens for each in self.cameras}) > 1:
            raise InputError("cameras of one zoom lens have one lens model")

        self.T_base_head = rigid(T_base_head, "pose of the head")
        self.T_head_camera = rigid(T_head_camera, "pose of the camera on its head")
        self._pan = pan
        self._tilt = tilt

    def pose(self, pan: float, tilt: float) -> pin.SE3:
        """Return ``T_base_camera`` for counts of pan and tilt."""
        turned = pin.utils.rotate("z", self._pan.angle(pan)) @ pin.utils.rotate("y", self._tilt.angle(tilt))
        return self.T_base_head * pin.SE3(turned, np.zeros(3)) * self.T_head_camera

    def camera(self, zoom: float) -> Camera:
        """Return the intrinsics at a count of the zoom, interpolated between the calibrated ones.

        Focal lengths are interpolated geometrically, all other numbers linearly. Each standard deviation is the larger
        one of the two neighbours.

        Raises:
            InputError: If the count is outside the calibrated range.
        """
        at = finite_number(zoom, "zoom")
        if not self.zooms[0] <= at <= self.zooms[-1]:
            raise InputError(
                f"zoom {at:g} lies outside of what was calibrated, {self.zooms[0]:g} to {self.zooms[-1]:g}"
            )

        low = int(np.clip(np.searchsorted(self.zooms, at, side="right") - 1, 0, max(len(self.zooms) - 2, 0)))
        high = min(low + 1, len(self.zooms) - 1)
        share = (at - self.zooms[low]) / (self.zooms[high] - self.zooms[low]) if high > low else 0.0

        first = self.cameras[low]
        second = self.cameras[high]

        matrix = (1.0 - share) * first.matrix + share * second.matrix
        for k in range(2):
            matrix[k, k] = first.matrix[k, k] ** (1.0 - share) * second.matrix[k, k] ** share

        lens = (1.0 - share) * first.distortion + share * second.distortion
        sigmas = np.maximum(first.sigmas, second.sigmas)
        tone = first.tone if first.tone == second.tone else None
        changed: Camera = replace(first, matrix=matrix, distortion=lens, sigmas=sigmas, tone=tone)
        return changed
