"""Update the session with each picture of the camera, and draw the two pictures and the state that the page shows.

The work is divided into short stages, so that a command never waits for more than one of them.
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
    """A device that runs in simulated time."""

    def advance(self, seconds: float) -> None:
        """Advance the simulated time by an interval [s]."""


class Engine:
    """Connect a session, its perception and the pictures of the page. All methods must be called from one thread.

    Attributes:
        paused: Whether a replayed record is paused. The caller, who supplies the times, must then stop the clock.
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
        """Store the parts.

        Args:
            session: The session.
            perception: Camera and sensor of the session.
            simulated: Devices whose simulated time has to be advanced: an arm, a vehicle.
            further: Cameras, by name, whose pictures can replace the view from outside.
            pictures: Where the camera's pictures are recorded; None to record none.
        """
        self.session = session
        self.perception = perception
        self._simulated = simulated
        self._camera_view = CameraView(perception.camera, session)
        self.outside = OutsideView(session)
        self._further = dict(further or {})
        self._through = ""  # name of the further camera that is shown; "" for the view from outside
        self._pictures = pictures
        self._advanced = 0.0
        self._drawn: tuple[Hashable, ...] = ()
        self.paused = False

    def execute(self, command: dict[str, Any], time: float, sight: Sight | None = None) -> None:
        """Execute a command of the pilot.

        Commands in `VIEW_VERBS` change only the pictures and are executed here; all others go to the session. During a
        replay only view commands are executed, for the record decides what the arm does.

        Args:
            command: The ``name`` of the command, and its arguments.
            time: Current time [s].
            sight: What the pilot's page had shown; None without a page.
        """
        arguments = dict(command)
        name = quoted(arguments.pop("name", ""))
        if "object" in arguments:  # the object's name is sent as "object", because "name" is the command
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
        """Read the arm between two stages of a step, and stop it if that is necessary."""
        self._advance(time)

    def state(self) -> dict[str, Any]:
        """Return all that the page shows beside the pictures."""
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
        """Return the camera's picture as JPEG, with the arm, the route and the chosen grasp drawn over it.

        While the pose of the camera is unknown, the picture is returned as it is.
        """
        seen = self.perception
        if seen.T_base_camera is None:
            return _jpeg(seen.picture)
        return _jpeg(self._camera_view.draw(seen.picture, seen.T_base_camera, seen.arm_in_picture))

    def outside_picture(self, anew: bool = False) -> bytes | None:
        """Return the view from outside, or the picture of the selected further camera, as JPEG.

        Args:
            anew: Draw the view even if nothing has changed since the last call.

        Returns:
            None if the view has not changed and ``anew`` is false, or if the further camera has no picture yet.
        """
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
        """Turn the view from outside by two angles [rad]."""
        self.outside.turn(number(right, "right"), number(up, "up"))

    def zoom(self, factor: object) -> None:
        """Multiply the distance of the view from outside by a factor."""
        self.outside.zoom(number(factor, "factor"))

    def preset(self, view: object) -> None:
        """Look from one of the standard viewpoints, or through a further camera."""
        name = quoted(view)
        if name not in (*PRESETS, *self._further):
            raise UnknownNameError("view", name, (*PRESETS, *self._further))
        self._through = name if name in self._further else ""
        self._drawn = ()
        self.outside.preset(name)

    def play(self, share: object) -> None:
        """Show the arm at a share of the proposed route, from 0 to 1; None shows it at its present configuration."""
        shown = None if share is None else number(share, "share")
        proposed = self.session.mode == PROPOSED
        self.outside.share = shown if proposed else None
        if shown is not None and not proposed:
            raise InputError("there is no route to preview: 'plan' proposes one")

    def pause(self) -> None:
        """Pause a replayed record, or resume it."""
        self.paused = not self.paused

    # --------------------------------------------------------------------------------------------------------------

    def _return_to_now(self) -> None:
        """End the preview of a route unless a proposed route is still displayed and the arm stands still."""
        if self.session.mode != PROPOSED or self.session.driving:
            self.outside.share = None

    def _advance(self, time: float) -> None:
        """Advance the simulated devices to a time [s] and update the session; time never runs backwards."""
        for each in self._simulated:
            each.advance(max(time - self._advanced, 0.0))

        self._advanced = max(time, self._advanced)
        self.session.tick(time)
        self._return_to_now()


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return bytes(data)


class ViewVerb(NamedTuple):
    """A command that changes what is shown, and never moves the arm.

    Attributes:
        act: A method of `Engine`, called with the command's arguments unchecked.
        of_a_record: Whether the command is available only while a record is replayed.
    """

    act: Callable[..., None]
    of_a_record: bool = False

    def execute(self, engine: Engine, name: str, arguments: Mapping[str, object]) -> None:
        """Execute the command on an engine.

        Raises:
            InputError: If the arguments are not those that the command takes, or have unusable values.
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
