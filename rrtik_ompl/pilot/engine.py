"""The loop behind the page: a picture updates the session; two pictures and a state are sent to the page.

A step is cut in stages, so that a command never waits for more than one of them.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.files.messages import quoted
from rrtik_ompl.pilot.devices.camera_feed import ENDED, FurtherCamera
from rrtik_ompl.pilot.document import state_document
from rrtik_ompl.pilot.events import alarm, refused
from rrtik_ompl.pilot.interlock import PROPOSED, Sight, number
from rrtik_ompl.pilot.perception import Perception
from rrtik_ompl.pilot.record import PictureRecord
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.views import PRESETS, CameraView, OutsideView

JPEG_QUALITY = 80
VIEW_COMMANDS = {"turn": ("right", "up"), "zoom": ("factor",), "preset": ("view",), "play": ("share",)}


class Simulated(Protocol):
    """What has a simulated time."""

    def advance(self, seconds: float) -> None:
        """Let so much of it pass [s]."""


class Engine:
    """Connects session, perception and pictures. For one thread."""

    def __init__(
        self,
        session: Session,
        perception: Perception,
        *,
        simulated: Sequence[Simulated] = (),
        further: Mapping[str, FurtherCamera] | None = None,
        pictures: PictureRecord | None = None,
    ) -> None:
        """Take the parts.

        Args:
            session: The session.
            perception: Camera and sensor.
            simulated: What has a simulated time that has to advance: an arm, a vehicle.
            further: Cameras that may be looked through in place of the view from outside, by name.
            pictures: Where the pictures are recorded.
        """
        self.session = session
        self.perception = perception
        self._simulated = simulated
        self._camera_view = CameraView(perception.camera, session)
        self.outside = OutsideView(session)
        self._further = dict(further or {})
        self._through = ""  # the one of them that is looked through
        self._pictures = pictures
        self._advanced = 0.0
        self._drawn: tuple[Hashable, ...] = ()

    def execute(self, command: dict[str, Any], time: float, sight: Sight | None = None) -> None:
        """Execute a command of the pilot.

        Args:
            command: A ``name`` and its arguments; those of `VIEW_COMMANDS` concern the outside view alone.
            time: Now [s].
            sight: What the pilot's page had shown; None without a page.
        """
        self._advance(time)

        arguments = dict(command)
        name = quoted(arguments.pop("name", ""))
        if "object" in arguments:  # which one, for "name" is that of the command
            arguments["name"] = arguments.pop("object")

        if name not in VIEW_COMMANDS:
            self.session.command(name, time, sight, **arguments)
            self._return_to_now()
            return

        try:
            self._change_view(name, arguments)
        except InputError as error:
            self.session.say(refused(str(error)))

    def update(self, time: float) -> None:
        """Advance to a time [s] and process one picture."""
        self._advance(time)
        self.perception.update(self.session, time)
        if self._pictures is not None:
            self._pictures.add(self.perception.picture, time)
            if ended := self._pictures.news():
                self.session.say(alarm(ended))

    def watch(self, time: float) -> None:
        """Between two stages of a step: read the arm, and stop it where that is due."""
        self._advance(time)

    def state(self) -> dict[str, Any]:
        """What the page shows beside the pictures."""
        lost = self.perception.lost
        shown = {"camera_lost": lost, "pictures_ended": lost == ENDED, "hint": self.perception.hint}
        shown |= {"playing": self.outside.share, "aids": self._camera_view.aids.document()}
        shown |= {"views": [*PRESETS, *self._further], "view": self._through}
        return state_document(self.session) | shown

    def close(self) -> None:
        """Release further cameras, and end the record of pictures."""
        for each in self._further.values():
            each.close()
        if self._pictures is not None:
            self._pictures.close()

    def camera_picture(self) -> bytes:
        """The picture of the camera with the arm, the route and the chosen grasp drawn over it; JPEG."""
        seen = self.perception
        if seen.T_base_camera is None:
            return _jpeg(seen.picture)
        return _jpeg(self._camera_view.draw(seen.picture, seen.T_base_camera, seen.arm_in_picture))

    def outside_picture(self, anew: bool = False) -> bytes | None:
        """The view from outside, JPEG; None if it would be the same as last time and ``anew`` is false."""
        if self._through:
            picture = self._further[self._through].picture()
            return None if picture is None else _jpeg(picture)

        key = self.outside.key()
        if key == self._drawn and not anew:
            return None

        self._drawn = key
        return _jpeg(self.outside.draw())

    def _return_to_now(self) -> None:
        """A preview shows a route that is proposed; whatever comes after is shown as it is."""
        if self.session.mode != PROPOSED or self.session.driving:
            self.outside.share = None

    def _advance(self, time: float) -> None:
        for each in self._simulated:
            each.advance(max(time - self._advanced, 0.0))

        self._advanced = max(time, self._advanced)
        self.session.tick(time)
        self._return_to_now()

    def _change_view(self, name: str, given: dict[str, Any]) -> None:
        wanted = VIEW_COMMANDS[name]
        if set(given) != set(wanted):
            raise InputError(f"{name} takes {', '.join(wanted)}")

        if name == "turn":
            self.outside.turn(number(given["right"], "right"), number(given["up"], "up"))
        elif name == "zoom":
            self.outside.zoom(number(given["factor"], "factor"))
        elif name == "preset":
            view = quoted(given["view"])
            if view not in (*PRESETS, *self._further):
                raise UnknownNameError("view", view, (*PRESETS, *self._further))
            self._through = view if view in self._further else ""
            self._drawn = ()
            self.outside.preset(view)
        else:
            share = None if given["share"] is None else number(given["share"], "share")
            proposed = self.session.mode == PROPOSED
            self.outside.share = share if proposed else None
            if share is not None and not proposed:
                raise InputError("there is no route to preview: 'plan' proposes one")


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(data)
