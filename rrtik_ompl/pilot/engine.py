"""The loop behind the page: a picture comes, the session learns from it, two pictures and a state go out.

A step is cut in stages, so that a command never waits for more than one of them.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.pilot.arguments import LONGEST, number
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.camera_feed import ENDED
from rrtik_ompl.pilot.devices.perception import Eyes
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.state import state_document
from rrtik_ompl.pilot.views import PRESETS, CameraView, OutsideView

JPEG_QUALITY = 80
VIEW_COMMANDS = {"turn": ("right", "up"), "zoom": ("factor",), "preset": ("view",), "play": ("share",)}


class Engine:
    """Ties session, eyes and pictures together. For one thread."""

    def __init__(self, session: Session, eyes: Eyes, *, simulated: SimulatedArm | None = None) -> None:
        """Take the parts.

        Args:
            session: Who decides.
            eyes: Who looks.
            simulated: An arm that has to be told that time passes.
        """
        self.session, self.eyes, self._simulated = session, eyes, simulated
        self._camera_view = CameraView(eyes.camera, session)
        self.outside = OutsideView(session)
        self._advanced = 0.0
        self._drawn: tuple[Any, ...] = ()

    def obey(self, command: dict[str, Any], time: float) -> None:
        """Do what the pilot wants.

        Args:
            command: A ``name`` and its arguments; those of `VIEW_COMMANDS` concern the outside view alone.
            time: Now [s].
        """
        self._advance(time)
        arguments = dict(command)
        name = str(arguments.pop("name", ""))
        if name not in VIEW_COMMANDS:
            self.session.command(name, time, **arguments)
            return
        try:
            self._look_from_elsewhere(name, arguments)
        except InputError as error:
            self.session.message = str(error)

    def look(self, time: float) -> None:
        """Let time pass and look once."""
        self._advance(time)
        self.eyes.look(self.session, time)

    def state(self) -> dict[str, Any]:
        """What there is to be shown beside the pictures."""
        lost = self.eyes.lost
        shown = {"camera_lost": lost, "pictures_ended": lost == ENDED, "hint": self.eyes.hint}
        shown["playing"] = self.outside.share
        return state_document(self.session) | shown

    def camera_picture(self) -> bytes:
        """What the camera sees, with what is known drawn over it; JPEG."""
        if self.eyes.T_base_camera is None:
            return _jpeg(self.eyes.picture)
        return _jpeg(self._camera_view.draw(self.eyes.picture, self.eyes.T_base_camera, self.eyes.arm_in_picture))

    def outside_picture(self, anew: bool = False) -> bytes | None:
        """The view from outside, JPEG; None if it would be the same as last time, unless wanted ``anew``."""
        key = self.outside.key()
        if key == self._drawn and not anew:
            return None
        self._drawn = key
        return _jpeg(self.outside.draw())

    def _advance(self, time: float) -> None:
        if self._simulated is not None:
            self._simulated.advance(max(time - self._advanced, 0.0))
        self._advanced = max(time, self._advanced)
        self.session.tick(time)

    def _look_from_elsewhere(self, name: str, given: dict[str, Any]) -> None:
        wanted = VIEW_COMMANDS[name]
        if set(given) != set(wanted):
            raise InputError(f"{name} takes {', '.join(wanted)}")
        if name == "turn":
            self.outside.turn(number(given["right"], "right"), number(given["up"], "up"))
        elif name == "zoom":
            self.outside.zoom(number(given["factor"], "factor"))
        elif name == "preset":
            view = str(given["view"])[:LONGEST]
            if view not in PRESETS:
                raise UnknownNameError("view", view, PRESETS)
            self.outside.preset(view)
        else:
            self.outside.share = None if given["share"] is None else number(given["share"], "share")


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(data)
