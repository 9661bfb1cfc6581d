"""The loop behind the page: a picture comes, the session learns from it, two pictures and a state go out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.errors import InputError, RrtikError
from rrtik_ompl.pilot.arm import SimulatedArm
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.state import state_document
from rrtik_ompl.pilot.views import CameraView, OutsideView
from rrtik_ompl.sensing.frames import base_from_camera
from rrtik_ompl.sensing.pictures import Picture
from rrtik_ompl.sensing.sensor import Sensor

JPEG_QUALITY = 80
VIEW_COMMANDS = ("turn", "zoom", "preset", "play")  # they concern the picture from outside, not the session


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """What goes to the page: two JPEG pictures and the state."""

    camera: bytes
    outside: bytes
    state: dict[str, Any]


class Engine:
    """Ties camera, session and pictures together; one step a picture."""

    def __init__(
        self,
        session: Session,
        sensor: Sensor,
        pictures: Iterator[Picture],
        *,
        simulated: SimulatedArm | None = None,
        arm_in_picture: bool = False,
    ) -> None:
        """Take the parts.

        Args:
            session: Who decides.
            sensor: Who looks.
            pictures: Where pictures come from.
            simulated: An arm that has to be told that time passes.
            arm_in_picture: The arm itself is to be seen.
        """
        self.session, self.sensor, self._pictures = session, sensor, pictures
        self._simulated, self._arm_in_picture = simulated, arm_in_picture
        self._camera_view = CameraView(sensor.camera, session)
        self.outside = OutsideView(session)
        self._picture: NDArray[np.uint8] = np.zeros((sensor.camera.height, sensor.camera.width, 3), dtype=np.uint8)
        self._T_base_camera: Any | None = sensor.marker_map.T_base_camera
        self.camera_lost = ""

    def step(self, time: float, commands: list[dict[str, Any]]) -> Output:
        """Do what the pilot wants, look once, and draw.

        Args:
            time: Now [s].
            commands: Each has a ``name`` and arguments.
        """
        for command in commands:
            self._command(dict(command), time)
        if self._simulated is not None:
            self._simulated.advance(max(time - self.session.time, 0.0))
        self._look(time)
        self.session.tick(time)
        return self.output()

    def output(self) -> Output:
        """Both pictures and the state as they are now."""
        shown = self._picture
        if self._T_base_camera is not None:
            shown = self._camera_view.draw(self._picture, self._T_base_camera, self._arm_in_picture)
        state = state_document(self.session) | {"camera_lost": self.camera_lost}
        return Output(_jpeg(shown), _jpeg(self.outside.draw()), state)

    def _look(self, time: float) -> None:
        if self.camera_lost:
            return
        try:
            picture = next(self._pictures, None)
            if picture is None:
                self.camera_lost = "no more pictures"
                return
            view = self.sensor.view(Picture(picture.pixels, picture.name, time))
        except RrtikError as error:
            self.camera_lost = str(error)
            return
        self._picture = picture.pixels
        self.session.see(view.placed, time)
        if not view.why_not_placed:
            self._T_base_camera, _ = base_from_camera(self.sensor.marker_map, view.seen)

    def _command(self, command: dict[str, Any], time: float) -> None:
        name = command.pop("name", "")
        if name not in VIEW_COMMANDS:
            self.session.command(str(name), time, **command)
            return
        try:
            self._view_command(name, command)
        except (InputError, KeyError, TypeError, ValueError):
            self.session.message = f"{name}: wrong arguments {sorted(command)}"

    def _view_command(self, name: str, command: dict[str, Any]) -> None:
        if name == "turn":
            self.outside.turn(float(command["right"]), float(command["up"]))
        elif name == "zoom":
            self.outside.zoom(float(command["factor"]))
        elif name == "preset":
            self.outside.preset(str(command["view"]))
        else:
            share = command["share"]
            self.outside.share = None if share is None else float(share)


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(data)
