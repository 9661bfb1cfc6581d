"""Further cameras, whose pictures are shown as they are: a second one on the vehicle, one at the wrist."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.pilot.devices.arm import Arm, SimulatedArm
from rrtik_ompl.pilot.devices.camera_feed import PictureSource
from rrtik_ompl.pilot.devices.simulation import SimulatedCamera


class Mount(NamedTuple):
    """Where a further camera of a simulated vehicle is.

    Attributes:
        name: For the pilot.
        at_tip: It is carried by the arm's last link; else by the vehicle.
        pose: In the frame of the tip, or of the arm's base.
    """

    name: str
    at_tip: bool
    pose: pin.SE3


class FurtherCamera(Protocol):
    """A camera that is shown beside the first one."""

    def picture(self) -> NDArray[np.uint8] | None:
        """The newest picture, shape (height, width, 3); None if there is none yet."""

    def close(self) -> None:
        """Release the camera."""


class LiveCamera:
    """A camera, or a film."""

    def __init__(self, source: PictureSource) -> None:
        self._source = source
        self._last: NDArray[np.uint8] | None = None

    def picture(self) -> NDArray[np.uint8] | None:
        """The newest picture, darkened where the camera is lost; None if there was none yet."""
        try:
            taken = self._source.latest()
        except RrtikError:
            return None if self._last is None else np.asarray(self._last // 3, dtype=np.uint8)

        if taken is not None:
            grey = taken.pixels.ndim == 2
            self._last = np.repeat(taken.pixels[..., None], 3, axis=2) if grey else taken.pixels
        return self._last

    def close(self) -> None:
        """Release the camera."""
        self._source.close()


class SimulatedFurtherCamera:
    """A camera of a simulated vehicle."""

    def __init__(self, mount: Mount, camera: SimulatedCamera, first: SimulatedCamera, arm: Arm) -> None:
        """Take what it sees.

        Args:
            mount: Where it is.
            camera: Makes its pictures.
            first: The vehicle's first camera: things are where that has them.
            arm: The arm.
        """
        self._mount = mount
        self._camera = camera
        self._first = first
        self._arm = arm
        self._count = 0

    def picture(self) -> NDArray[np.uint8]:
        """The picture of now."""
        camera = self._camera
        arm = self._arm
        q = arm.links() if isinstance(arm, SimulatedArm) else arm.read()
        carried = camera.robot.fk(q) if self._mount.at_tip else pin.SE3.Identity()
        camera.T_base_camera = carried * self._mount.pose

        camera.places = self._first.places
        camera.T_start_base = self._first.T_start_base
        self._count += 1
        return camera.picture(q, float(self._count)).pixels

    def close(self) -> None:
        """Nothing to release."""
