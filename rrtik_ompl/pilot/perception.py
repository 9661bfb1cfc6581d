"""The perception of a session: a camera and a sensor, live or simulated."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.pilot.devices.camera_feed import ENDED, Feed, PictureSource
from rrtik_ompl.pilot.devices.watchdog import Report
from rrtik_ompl.pilot.interlock import STALE_SECONDS
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture
from rrtik_ompl.sensing.scene_from_view import base_from_camera, tip_seen
from rrtik_ompl.sensing.sensor import Sensor, View

REPEATS = "the camera repeats its last picture"
EXPLANATION_SECONDS = 5.0  # least time between two searches for unknown markers, which are slow


class Perception(Protocol):
    """The camera and its sensor, as the engine uses them.

    Attributes:
        camera: Model of the camera.
        picture: The last picture, shape (height, width, 3).
        T_base_camera: Pose of the camera; None if it is not known yet.
        arm_in_picture: Whether the arm itself is in the picture.
        lost: Why there are no more pictures; "" while there are.
        hint: Why no object can be located in the last picture; "" if one can.
    """

    camera: Camera
    picture: NDArray[np.uint8]
    T_base_camera: pin.SE3 | None
    arm_in_picture: bool
    lost: str
    hint: str

    def update(self, session: Session, time: float) -> None:
        """Process the newest picture, and give the objects in it to the session."""

    def close(self) -> None:
        """Release the camera."""


class LivePerception:
    """A camera, and the sensor that evaluates its pictures.

    Attributes:
        source: Source of the pictures.
        others: The last pictures of the other cameras of a rig, shape (height, width, 3) each.
    """

    def __init__(self, sensor: Sensor, source: PictureSource, *, arm_in_picture: bool = False) -> None:
        """Store the parts; see `Perception`."""
        self.camera = sensor.camera
        self.arm_in_picture = arm_in_picture
        self.picture = np.zeros((self.camera.height, self.camera.width, 3), dtype=np.uint8)
        self.T_base_camera: pin.SE3 | None = sensor.marker_map.T_base_camera
        self.others: tuple[NDArray[np.uint8], ...] = ()
        self.lost = self.hint = ""
        self._next_explanation_time = -np.inf
        self._last_picture: Picture | None = None
        self._sensor = sensor
        self.source = source

    def update(self, session: Session, time: float) -> None:
        """Evaluate the newest picture, and pass the objects in it to the session.

        A picture that repeats the last one bit for bit is dropped: a frozen camera must become stale. The pose of the
        camera is updated whenever it can be computed.
        """
        try:
            picture = self.source.latest()
            if picture is None:
                return
            if self._frozen(picture) and not session.means.past:
                self.lost = REPEATS if session.time - session.state.pictures.time > STALE_SECONDS else self.lost
                return
            other_pictures = [Picture(each.pixels, each.name, time) for each in picture.others]
            view = self._sensor.view(Picture(picture.pixels, picture.name, time), *other_pictures)
        except RrtikError as error:
            self.lost = str(error)
            if self.lost != ENDED:  # the end of a film does not make its last picture unusable
                session.see_unusable(self.lost)
            return

        self.lost = ""
        self.picture = picture.pixels
        self.others = tuple(each.pixels for each in picture.others)
        session.see(view.placed, time)

        if tip := tip_seen(self._sensor.marker_map, view.seen):
            session.see_arm(*tip, time)

        self.hint = self._why_nothing(view, time, known=bool(session.surroundings.seen))
        if not view.why_not_placed:
            self.T_base_camera, _ = base_from_camera(self._sensor.marker_map, view.seen)

    def _frozen(self, picture: Picture) -> bool:
        """Check whether a picture, or that of another camera of the rig, is identical to the previous one."""
        last_picture = self._last_picture
        self._last_picture = picture
        if last_picture is None or len(last_picture.others) != len(picture.others):
            return False

        pictures = (picture, *picture.others)
        last_pictures = (last_picture, *last_picture.others)
        return any(each.repeats(last) for each, last in zip(pictures, last_pictures, strict=True))

    def close(self) -> None:
        """Release the camera."""
        self.source.close()

    def reports(self) -> dict[str, Report]:
        """Return, by name, functions that give the time of the camera thread's last report; empty without a thread."""
        source = self.source
        return {"the camera": lambda: source.reported} if isinstance(source, Feed) else {}

    def _why_nothing(self, view: View, time: float, known: bool) -> str:
        """Return why no object has a pose, "" if one has.

        The search for unknown markers is slow: it runs only while no object was ever seen, every `EXPLANATION_SECONDS`.
        """
        if view.placed:
            return ""
        if view.seen:
            for sighting in view.seen:
                if sighting.refused:
                    return f"{sighting.object.name}: {sighting.refused}"
            return view.why_not_placed
        if known:
            return "no marker in view"
        if time >= self._next_explanation_time:
            self._next_explanation_time = time + EXPLANATION_SECONDS
            return self._sensor.why_nothing("camera")
        return self.hint


class CameraOfRig:
    """The second camera of a rig, whose pictures are evaluated together with those of the first."""

    def __init__(self, perception: LivePerception) -> None:
        self._perception = perception

    def picture(self) -> NDArray[np.uint8] | None:
        """Return the picture that was evaluated last; None if there is none yet."""
        return self._perception.others[0] if self._perception.others else None

    def close(self) -> None:
        """Do nothing: the perception owns the camera."""
