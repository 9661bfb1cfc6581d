"""The loop behind the page: a picture updates the session; two pictures and a state are sent to the page.

A step is cut in stages, so that a command never waits for more than one of them.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

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
RECORD = "this is a record: it can be watched, paused and viewed from all sides"


class Simulated(Protocol):
    """What has a simulated time."""

    def advance(self, seconds: float) -> None:
        """Let so much of it pass [s]."""


class Engine:
    """Connects session, perception and pictures. For one thread.

    Attributes:
        paused: A record stands still; who gives the engine its times keeps to that.
    """

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
        self.paused = False

    def execute(self, command: dict[str, Any], time: float, sight: Sight | None = None) -> None:
        """Execute a command of the pilot.

        Args:
            command: A ``name`` and its arguments; those of `VIEW_VERBS` concern what is shown alone.
            time: Now [s].
            sight: What the pilot's page had shown; None without a page.
        """
        arguments = dict(command)
        name = quoted(arguments.pop("name", ""))
        if "object" in arguments:  # which one, for "name" is that of the command
            arguments["name"] = arguments.pop("object")

        recorded = self.session.means.recorded
        view = VIEW_VERBS.get(name)
        if recorded and view is None:
            if name != "halt":
                self.session.say(refused(RECORD))
            return

        self._advance(time)
        if view is None or (view.of_a_record and not recorded):
            self.session.command(name, time, sight, **arguments)
            self._return_to_now()
            return

        try:
            view.execute(self, name, arguments)
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
        shown |= {"paused": self.paused, "replay": self.session.means.recorded}
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

    # --- commands that concern what is shown ----------------------------------------------------------------------

    def turn(self, right: object, up: object) -> None:
        """Turn the view from outside by angles [rad]."""
        self.outside.turn(number(right, "right"), number(up, "up"))

    def zoom(self, factor: object) -> None:
        """Change the distance of the view from outside by a factor."""
        self.outside.zoom(number(factor, "factor"))

    def preset(self, view: object) -> None:
        """Look from one of the usual viewpoints, or through a further camera."""
        name = quoted(view)
        if name not in (*PRESETS, *self._further):
            raise UnknownNameError("view", name, (*PRESETS, *self._further))
        self._through = name if name in self._further else ""
        self._drawn = ()
        self.outside.preset(name)

    def play(self, share: object) -> None:
        """Show the arm at a share of the route that is proposed; None shows it as it is."""
        shown = None if share is None else number(share, "share")
        proposed = self.session.mode == PROPOSED
        self.outside.share = shown if proposed else None
        if shown is not None and not proposed:
            raise InputError("there is no route to preview: 'plan' proposes one")

    def pause(self) -> None:
        """Let a record stand still, or go on."""
        self.paused = not self.paused

    # --------------------------------------------------------------------------------------------------------------

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


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(data)


class ViewVerb(NamedTuple):
    """A command that concerns what is shown, and moves nothing.

    Attributes:
        act: A method of `Engine`; it takes the command's arguments as they came.
        of_a_record: Only a record has it.
    """

    act: Callable[..., None]
    of_a_record: bool = False

    def execute(self, engine: Engine, name: str, arguments: Mapping[str, object]) -> None:
        """Execute it.

        Raises:
            InputError: If the arguments are not those that it takes, or of no use.
        """
        _, *wanted = inspect.signature(self.act).parameters
        if set(arguments) != set(wanted):
            raise InputError(f"{name} takes {', '.join(wanted)}")
        self.act(engine, **arguments)


VIEW_VERBS = {
    "turn": ViewVerb(Engine.turn),
    "zoom": ViewVerb(Engine.zoom),
    "preset": ViewVerb(Engine.preset),
    "play": ViewVerb(Engine.play),
    "pause": ViewVerb(Engine.pause, of_a_record=True),
}
