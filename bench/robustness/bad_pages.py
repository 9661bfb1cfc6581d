"""Bad pages at the pilot's server, while a session runs behind it: what rules were not kept."""

from __future__ import annotations

import json
import socket
import struct
import threading
import time
from contextlib import suppress
from typing import Any

import numpy as np

from bench.robustness.messages import HUGE_BYTES, Witness, comes_true, drain, leave, mutated, silence
from rrtik_ompl.pilot.engine import Engine
from rrtik_ompl.pilot.interlock import Sight
from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_ompl.world.problem import Problem

COMMANDS = (
    '{"name": "jog", "direction": 0.5, "press": 2, "seq": 3}',
    '{"name": "jog", "direction": -1, "press": 3, "seq": 4}',
    '{"name": "select", "joint": 3, "seq": 5}',
    '{"name": "move", "target": 0.2}',
    '{"name": "go", "press": 4}',
    '{"name": "next", "press": 5}',
    '{"name": "together"}',
    '{"name": "servo", "press": 6}',
    '{"name": "lead", "press": 7}',
    '{"name": "speed", "share": 0.7}',
    '{"name": "object", "name": "valve"}',
    '{"name": "grasp", "type": "front", "level": 0}',
    '{"name": "turn", "right": 0.1, "up": 0.2}',
    '{"name": "zoom", "factor": 1.1}',
    '{"name": "preset", "view": "top"}',
    '{"name": "play", "share": 0.5}',
    '{"name": "release"}',
    '{"name": "reject"}',
    '{"name": "back"}',
    '{"name": "accept"}',
    '{"name": "stop", "seq": 9}',
    '{"shown": "frame"}',
    '{"shown": "state"}',
)
ROLES = ('{"name": "take"}', '{"name": "hand_over"}')
TEXT, MASKED, LAST = 1, 0x80, 0x80
A_PICTURE = b"\xff\xd8 no picture is drawn here \xff\xd9"
ON_A_PAGE = 60  # messages of a page before it goes
STILL_SECONDS = 1.0  # after the last command of a pilot; twice the time that a press lasts


class UndrawnEngine(Engine):
    """The engine of a session whose pictures are not drawn: they cost most of the time, and no message changes that.

    It drives for pages that do not say what they show, too: else none of these would move the arm.
    """

    def execute(self, command: dict[str, Any], time: float, sight: Sight | None = None) -> None:
        """Execute a command as if it came from no page."""
        super().execute(command, time)

    def camera_picture(self) -> bytes:
        """In place of the camera's picture."""
        return A_PICTURE

    def outside_picture(self, anew: bool = False) -> bytes | None:
        """In place of the view from outside."""
        return A_PICTURE if anew else None


class RawPage:
    """A page without a browser, whose frames may be anything."""

    def __init__(self, port: int, name: str) -> None:
        self.line = socket.create_connection(("127.0.0.1", port), timeout=30.0)
        self.line.sendall(
            f"GET /ws?page={name} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'x' * 22}==\r\n\r\n".encode()
        )
        self._heard = b""
        while b"\r\n\r\n" not in self._heard:
            more = self.line.recv(4096)
            if not more:
                raise ConnectionError("no WebSocket")
            self._heard += more

    def role(self) -> str:
        """The newest role that the server has told."""
        self._heard = (self._heard + drain(self.line))[-200_000:]
        at = self._heard.rfind(b'"role": "')
        return self._heard[at + 9 : at + 17].split(b'"')[0].decode("ascii", errors="replace") if at >= 0 else ""

    def say(self, data: bytes, opcode: int = LAST | TEXT) -> bool:
        """Send a frame; whether the server is still there."""
        size = len(data)
        head = struct.pack("!BB", opcode, MASKED | size) if size < 126 else b""
        head = head or struct.pack("!BBQ", opcode, MASKED | 127, size)
        try:
            self.line.sendall(head + b"\0\0\0\0" + data)
        except OSError:
            return False
        return True


def pilot_server(first: int, count: int) -> list[str]:
    """Messages of bad pages at a :class:`PilotServer` with a session behind it; the rules that were not kept.

    Who watches moves nothing; the arm of a pilot is always where an arm can be and touches nothing; it stands still
    when the pilot is silent and when the pilot has gone; the session goes on; nothing is printed.
    """
    opened, faults = open_session(SessionOptions("titan4_sdu")), list[str]()
    problem, perception = opened.engine.session.means.problem, opened.engine.perception
    arm = Witness(problem.robot, problem.start)
    session = Session(problem, arm, seed=first)
    engine, done = UndrawnEngine(session, perception, simulated=(arm,)), threading.Event()
    with silence(faults), PilotServer() as server:
        loop = Loop(engine, server)
        client = threading.Thread(target=_attack, args=(first, count, server, arm, faults, done), daemon=True)
        client.start()
        try:
            loop.run(lambda: done.is_set() or _judged(problem, arm, faults))
        except Exception as error:
            faults.append(f"the session ended: {type(error).__name__}: {error}")
        done.set()
        client.join()
    opened.close()
    return faults


def _judged(problem: Problem, arm: Witness, faults: list[str]) -> bool:
    """Note where the arm may not be; True, which ends the session, once there is anything."""
    fault = arm.fault()
    if not fault and not problem.world.valid(arm.read()):
        fault = f"the arm touches something: {problem.world.explain(arm.read())}"
    if fault:
        faults.append(fault)
    return bool(fault)


def _attack(
    first: int, count: int, server: PilotServer, arm: Witness, faults: list[str], done: threading.Event
) -> None:
    try:
        for seed in range(first, first + count, ON_A_PAGE):
            messages = min(ON_A_PAGE, first + count - seed)
            wrong = _as_watcher(seed, messages // 2, server, arm) or _as_pilot(seed, messages // 2, server, arm)
            if wrong:
                faults.append(f"{seed}: {wrong}")
            if done.is_set():
                return
    except Exception as error:  # of the client itself: nothing was measured then
        faults.append(f"the client broke: {type(error).__name__}: {error}")
    finally:
        done.set()


def _as_watcher(seed: int, messages: int, server: PilotServer, arm: Witness) -> str:
    """Watch beside a silent pilot, and send what a watcher must not."""
    pilot, rng = RawPage(server.port, "pilot"), np.random.default_rng(seed)
    if not comes_true(lambda: pilot.role() == "pilot"):
        return "the first page is not the pilot"
    watcher, before = RawPage(server.port, "watcher"), arm.sent
    for _ in range(messages):
        if not _say(rng, watcher, (*COMMANDS, ROLES[0])):
            watcher = RawPage(server.port, "watcher")
    leave(rng, watcher.line)
    there = server.clients.pilot is not None and server.clients.pilot.name == "pilot"  # else it may have taken over
    wrong = "a watcher has moved the arm" if arm.sent != before and there else ""
    leave(rng, pilot.line)
    return wrong or _gone(server, arm)


def _as_pilot(seed: int, messages: int, server: PilotServer, arm: Witness) -> str:
    """Be the pilot, say anything, fall silent, and leave in the middle of a drive."""
    rng = np.random.default_rng([seed, 1])
    page = RawPage(server.port, "wild")
    if not comes_true(lambda: page.role() == "pilot"):
        return "the only page is not the pilot"
    for _ in range(messages):
        if not _say(rng, page, (*COMMANDS, *ROLES)):
            if wrong := _gone(server, arm):
                return wrong
            page = RawPage(server.port, "wild")
        if rng.random() < 0.3:
            drain(page.line)
    if rng.random() < 0.5:
        if not comes_true(lambda: server.commands.empty()):
            return "commands wait for ever"
        time.sleep(STILL_SECONDS)
        if not comes_true(lambda: arm.stands or arm.moving is None):
            return "the arm moves though its pilot is silent"
    leave(rng, page.line)
    return _gone(server, arm)


def _gone(server: PilotServer, arm: Witness) -> str:
    """All pages have left: the arm must stand still, and the place be free."""
    if not comes_true(lambda: len(server.clients) == 0 and server.commands.empty()):
        return "a page that has left is still there"
    return "" if comes_true(lambda: arm.stands or arm.moving is None) else "the arm goes on without a pilot"


def _say(rng: np.random.Generator, page: RawPage, good: tuple[str, ...]) -> bool:
    kind = rng.random()
    if kind < 0.9:
        return page.say(mutated(rng, good, ""))
    if kind < 0.95:
        return page.say(mutated(rng, good, ""), int(rng.integers(256)))  # any kind of frame
    if kind < 0.97:
        return page.say(json.dumps({"name": "x" * HUGE_BYTES}).encode())
    with suppress(OSError):
        page.line.sendall(rng.bytes(int(rng.integers(1, 100))))  # no frame
    return True
