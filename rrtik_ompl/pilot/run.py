"""The main loop of a session at its server: it executes commands between any two pictures, and shows the result."""

from __future__ import annotations

import queue
import time as clock
from collections.abc import Callable
from typing import Any, TypeAlias

import cv2
import numpy as np

from rrtik_ompl.base.budget import Stop, no_stop
from rrtik_ompl.files.messages import quoted
from rrtik_ompl.pilot.engine import Engine
from rrtik_ompl.pilot.events import alarm
from rrtik_ompl.pilot.interlock import Sight
from rrtik_ompl.pilot.machine import VERBS
from rrtik_ompl.pilot.web.server import MAX_PAGES, PilotServer

# A little less than the period of a camera, so that none of its pictures is left out.
PERIOD_SECONDS = 1.0 / 32.0
CAMERA = "C"  # kinds of pictures, see `web.server`
OUTSIDE = "O"
MAX_SEQUENCE = 2**53  # the largest number that a page counts to

Sent: TypeAlias = tuple[int, dict[str, Any]]  # number of the page, and the command that it sent


def _renews(after: Sent, before: Sent) -> bool:
    """Check whether a held command only repeats the one before it, so that the earlier one need not be executed."""
    names = quoted(after[1].get("name")), quoted(before[1].get("name"))
    same = after[0] == before[0] and names[0] == names[1] and after[1].get("press") == before[1].get("press")
    return same and names[0] in VERBS and VERBS[names[0]].held


class Loop:
    """Run a session in the thread that made the engine.

    Attributes:
        reported: Time of the last begin of a step, by ``time.monotonic()``.
        fault: Returns why the watchdog has stopped the arm; "" if it has not.
    """

    def __init__(self, engine: Engine, server: PilotServer) -> None:
        """Store the engine, and the server of the page."""
        self._engine = engine
        self._server = server
        self._answered: dict[int, int] = {}
        self._time = 0.0
        self._read_at = clock.monotonic()  # when `time` was evaluated last
        self._audience = 0
        self._pilot = 0  # number of the pilot's page, as the session was told
        self._outside_too = False
        self.reported = self._read_at
        self.fault: Callable[[], str] = str

    @property
    def time(self) -> float:
        """The time of the session [s], which stands still in a pause."""
        now = clock.monotonic()
        if not self._engine.paused:
            self._time += now - self._read_at
        self._read_at = now
        return self._time

    def run(self, until: Stop = no_stop) -> None:
        """Run until Ctrl-C, or until ``until`` returns true."""
        # More threads only cost processor time: pictures of this size are not ready sooner.
        cv2.setNumThreads(1)
        while not until():
            begin = clock.monotonic()
            self._step()
            while not until() and (left := begin + PERIOD_SECONDS - clock.monotonic()) > 0.0:
                self._execute_one(left)

    def _step(self) -> None:
        """Process one picture, and show state and pictures; execute waiting commands between these stages."""
        engine = self._engine
        server = self._server
        self.reported = clock.monotonic()
        engine.update(self.time)
        self._greet_pilot()
        if fault := self.fault():
            engine.session.say(alarm(fault))
        self._show_state()
        self._execute_all()

        audience = self._audience
        self._audience = len(server.clients)
        if not self._audience:
            return

        server.show_frame(CAMERA, engine.session.state.pictures.time, engine.camera_picture())
        self._execute_all()

        self._outside_too = not self._outside_too
        if not self._outside_too and self._audience == audience:
            return  # the outside view is drawn in every second step only

        outside = engine.outside_picture(anew=self._audience != audience)
        if outside is not None:
            server.show_frame(OUTSIDE, self.time, outside)

    def _greet_pilot(self) -> None:
        """Tell the session when another page has become the pilot."""
        pilot = self._server.clients.pilot
        number = 0 if pilot is None else pilot.number
        if number not in (0, self._pilot):
            self._engine.execute({"name": "control"}, self.time, Sight(np.inf, np.inf, number))
        self._pilot = number

    def _show_state(self) -> None:
        if len(self._server.clients):
            state = self._engine.state() | {"stamp": self._engine.session.time, "heard": self._server.heard()}
            self._server.show_state(state, self._answered)

    def _execute_all(self) -> None:
        """Execute the commands that wait now; later ones must wait, so that a slow machine has time for pictures."""
        self._engine.watch(self.time)
        for _ in range(self._server.commands.qsize()):
            self._execute_one(0.0)

    def _execute_one(self, patience: float) -> None:
        """Execute the next command and show its result at once; wait at most ``patience`` for it [s]."""
        commands = self._server.commands
        try:
            client, command = commands.get(block=patience > 0.0, timeout=patience or None)
        except queue.Empty:  # a stop has removed the commands that waited
            return

        with commands.mutex:
            after = commands.queue[0] if commands.queue else None
        if after is not None and _renews(after, (client, command)):
            return

        sequence = command.pop("seq", None)
        sight = Sight(self._age(command.pop("seen", None)), self._age(command.pop("picture", None)), client)
        try:
            self._engine.execute(command, self.time, sight)
        except Exception as error:  # no input of a page may end the session
            self._engine.session.stand_still()
            what = f"'{quoted(command.get('name'))}' broke: {quoted(error) or type(error).__name__}"
            self._engine.session.say(alarm(f"{what}; the arm was stopped"))

        if isinstance(sequence, int) and sequence is not True and 0 <= sequence <= MAX_SEQUENCE:
            self._answered[client] = sequence
            while len(self._answered) > MAX_PAGES:  # forget pages that have left
                del self._answered[min(self._answered)]
        self._show_state()

    def _age(self, stamp: object) -> float:
        """Return the age of what a page has shown, by the server's own time stamp [s]; inf if the stamp is invalid."""
        now = self.time
        if isinstance(stamp, bool) or not isinstance(stamp, int | float) or not 0.0 <= stamp <= now:
            return np.inf
        return now - stamp
