"""Check the server of an arm: what it promises, what it does when it is driven, and what it does with a hostile client.

Each joint is moved by a degree (2 mm if it slides) and back, where that is free in the problem's scene, while the
`Supervisor` of the pilot's tool looks for the faults that it knows. Then one joint is sent as far as it goes in a
second, again and again: the server is told to stop, gets what a client must never send, or is left alone meanwhile.
"""

from __future__ import annotations

import itertools
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.devices.arm import joint_rates
from rrtik_ompl.pilot.devices.arm_protocol import (
    MAX_LINE_BYTES,
    TIMEOUT_SECONDS,
    VERSION,
    ArmAnswer,
    Greeting,
    Line,
    answer_in,
    greeting_in,
)
from rrtik_ompl.pilot.motion.supervisor import Supervisor, amount, slack_of
from rrtik_ompl.world.problem import Problem

STEP_SECONDS = 0.02  # between two requests while a joint is driven
LEAD_SECONDS = 0.1  # by how much motion a set point is ahead of the joint
REACTION_SECONDS = 0.1  # after which an arm that shall stop stands still
BEAT_SECONDS = 0.05  # validity of a set point after which the client falls silent
WAIT_SECONDS = 0.8  # silence that is longer than a server may bear
FAR_SECONDS = 1.0  # motion that is not over by then
MAX_WORDS = 80  # letters of a server's refusal that are shown
NEAR = 0.2  # share of the slack within which a joint has arrived

NONSENSE: dict[str, bytes] = {
    "what is no JSON": b"{{{\n",
    "what is no UTF-8": b"\xff\xfe\n",
    "a list for an object": b"[1]\n",
    "deep nesting": b"[" * 20_000 + b"\n",
    "an endless line": b"a" * (MAX_LINE_BYTES + 1),
}
WRONG: dict[str, dict[str, object]] = {
    "an unknown request": {"do": "fly"},
    "a joint that it does not have": {"do": "move", "joint": 999, "target": 0.0},
    "a target that is no number": {"do": "move", "joint": 0, "target": float("nan")},
    "a target in words": {"do": "move", "joint": 0, "target": "0"},
    "too few set points": {"do": "follow", "q": [0.0]},
    "a validity below zero": {"do": "move", "joint": 0, "target": 0.0, "seconds": -1.0},
}


@dataclass(frozen=True, slots=True)
class Finding:
    """What was checked, whether it held, and what was measured.

    Attributes:
        what: What the server has to do.
        held: Whether it did.
        measured: What was seen, in words.
    """

    what: str
    held: bool
    measured: str = ""


class Probe:
    """A client that sends what it is told to, and nothing else."""

    def __init__(self, problem: Problem, host: str, port: int) -> None:
        """Connect, and read the greeting.

        Raises:
            OSError: If there is no server, or it greets otherwise.
        """
        self.robot = problem.robot
        self.socket = socket.create_connection((host, port), timeout=TIMEOUT_SECONDS)
        self.line = Line(self.socket)
        self._ids = itertools.count(1)
        self.greeting: Greeting = greeting_in(self.line.receive(), self.robot)

    def ask(self, **words: object) -> tuple[ArmAnswer, dict[str, Any]]:
        """Send a request with the next id; return its answer, checked, and as it came.

        Raises:
            OSError: If no valid answer comes in time.
        """
        number = next(self._ids)
        self.line.send(**words, id=number)
        message = self.line.receive()
        if self.greeting.version >= VERSION and message.get("id") != number:
            raise ConnectionError(f"the answer has the id {message.get('id')}, not {number}")
        return answer_in(message, self.robot, self.greeting.version), message

    def joints(self) -> Vector:
        """Read the joints, shape (dof,) [rad or m].

        Raises:
            OSError: If no valid answer comes in time.
        """
        found, _ = self.ask(do="read")
        if found.q is None:
            raise ConnectionError(found.fault)
        return found.q


class Conformance:
    """Checks of one server, each on a connection of its own."""

    def __init__(self, problem: Problem, host: str, port: int) -> None:
        """Store what is checked: the server, and the problem whose robot and scene it is in."""
        self._problem = problem
        self._robot = problem.robot
        self._address = (host, port)
        self._slack = slack_of(problem.robot)
        self._rates = joint_rates(problem.robot)
        self._joint = 0  # the joint that is sent off again and again
        self._way = 0.0  # and how far [rad or m]

    def run(self) -> Iterator[Finding]:
        """Yield what is found, check by check.

        Raises:
            InputError: If there is no server with this arm.
        """
        try:
            with self._connected() as probe:
                version = probe.greeting.version
                start = probe.joints()
                if probe.greeting.rates is not None:
                    self._rates = np.minimum(self._rates, probe.greeting.rates)
        except OSError as error:
            host, port = self._address
            raise InputError(f"arm at {host}:{port}: {error}; is its server running?") from None

        yield Finding(f"greets in version {VERSION}, with rates and hold", version >= VERSION, f"version {version}")
        yield self._check("answers with ids, ages and states", self._answers)

        near = [self._free_way(start, joint, self._slack[joint]) for joint in range(self._robot.dof)]
        for joint in np.flatnonzero(near):
            what = f"{self._robot.joint_names[joint]}: does what it is told"
            yield self._check(what, self._driven, int(joint), near[joint])

        far = [self._free_way(start, joint, FAR_SECONDS * self._rates[joint]) for joint in range(self._robot.dof)]
        if not any(far):
            yield Finding("moves", False, "no joint is free to move for a second: drive the arm elsewhere first")
            return

        self._joint = int(np.flatnonzero(far)[0])
        self._way = far[self._joint]
        yield self._check("stops when it is told", self._stops)
        yield self._check("lets a set point expire", self._expires)
        yield self._check("stops when its client is silent", self._interrupted, b"")
        yield self._check("stops when its client has gone", self._gone)
        for what, data in NONSENSE.items():
            yield self._check(f"stops at {what}", self._interrupted, data)
        for what, words in WRONG.items():
            yield self._check(f"refuses {what}", self._refuses, words)
        yield self._check("is moved by one client only", self._second)
        yield self._check("answers two requests that come at once", self._at_once)

    def _check(self, what: str, check: Callable[..., str], *given: object) -> Finding:
        """Run a check, which returns what it measured, and raises an OSError with what is wrong."""
        try:
            return Finding(what, True, check(*given))
        except OSError as error:
            return Finding(what, False, str(error))

    @contextmanager
    def _connected(self) -> Iterator[Probe]:
        """Open a connection; a server that is still busy with the last client is given time."""
        end = time.monotonic() + 2.0
        while True:
            try:
                probe = Probe(self._problem, *self._address)
                break
            except TimeoutError:
                if time.monotonic() > end:
                    raise
        try:
            yield probe
        finally:
            with suppress(OSError):
                probe.ask(do="stop")
            probe.line.close()

    def _free_way(self, q: Vector, joint: int, distance: float) -> float:
        """Return by how much a joint may move, up or down by a distance, with the scene free; 0 if it may not."""
        for way in (distance, -distance):
            end = q.copy()
            end[joint] += 1.2 * way  # and a little more, for an arm that goes too far
            if self._robot.within_limits(end)[0] and self._problem.world.motion_valid(q, end):
                return float(way)
        return 0.0

    # --- what it does ---------------------------------------------------------------------------------------------

    def _answers(self) -> str:
        with self._connected() as probe:
            oldest = max(probe.ask(do="read")[0].age for _ in range(10))
            if oldest > REACTION_SECONDS:
                raise ConnectionError(f"its joints are {oldest:.2f} s old")
            return f"joints at most {1e3 * oldest:.0f} ms old"

    def _driven(self, joint: int, way: float) -> str:
        """Drive a joint to and fro under the supervisor, and compare where it arrives."""
        with self._connected() as probe:
            start = probe.joints()
            worst = 0.0
            for goal in (start[joint] + way, start[joint]):
                q = self._drive(probe, joint, float(goal))
                worst = max(worst, abs(float(q[joint] - goal)))
            return f"arrives within {self._words(joint, worst)}"

    def _drive(self, probe: Probe, joint: int, goal: float) -> Vector:
        """Drive a joint to a value as the pilot's tool does, and return the joints once it is there."""
        judge = Supervisor(self._robot, self._rates)
        q = probe.joints()
        speed = np.zeros(self._robot.dof)
        speed[joint] = self._rates[joint]
        lead = self._rates[joint] * LEAD_SECONDS
        end = time.monotonic() + 5.0 * abs(goal - float(q[joint])) / float(self._rates[joint]) + 2.0

        while abs(goal - float(q[joint])) > NEAR * self._slack[joint]:
            now = time.monotonic()
            judge.read(q, now)
            point = q.copy()
            point[joint] += np.clip(goal - q[joint], -lead, lead)
            point = judge.told(point, speed, q, now)
            standing = judge.standing(now)
            if judge.fault or standing or now > end:
                raise ConnectionError(judge.fault or f"{self._robot.joint_names[joint]} does not get there")

            answer, _ = probe.ask(do="move", joint=joint, target=float(point[joint]), seconds=2.0 * BEAT_SECONDS)
            if answer.fault or answer.q is None:
                raise ConnectionError(answer.fault)
            q = answer.q
            time.sleep(STEP_SECONDS)

        probe.ask(do="stop")
        judge.stopped(time.monotonic())
        for _ in range(10):
            time.sleep(STEP_SECONDS)
            q = probe.joints()
            judge.read(q, time.monotonic())
        if judge.fault:
            raise ConnectionError(judge.fault)
        return q

    def _stops(self) -> str:
        with self._moving() as (probe, start, since):
            probe.ask(do="stop")
            return self._rests(probe, start, time.monotonic() - since)

    def _expires(self) -> str:
        with self._moving(seconds=BEAT_SECONDS) as (probe, start, _):
            time.sleep(0.3)
            return self._rests(probe, start, BEAT_SECONDS)

    def _gone(self) -> str:
        with self._moving() as (probe, start, since):
            probe.line.close()
            seconds = time.monotonic() - since
            with self._connected() as other:
                return self._rests(other, start, seconds)

    def _interrupted(self, data: bytes) -> str:
        """Send what a client must never send, or nothing, and then nothing more."""
        with self._moving() as (probe, start, since):
            with suppress(OSError):  # the server may end the connection before it has read all
                probe.socket.sendall(data)
            seconds = time.monotonic() - since
            time.sleep(WAIT_SECONDS)
            with self._connected() as other:
                return self._rests(other, start, seconds + TIMEOUT_SECONDS)

    def _refuses(self, words: dict[str, object]) -> str:
        with self._connected() as probe:
            before = probe.joints()
            _, message = probe.ask(**words)
            time.sleep(REACTION_SECONDS)
            moved = np.abs(probe.joints() - before) / self._slack
            if moved.max() > NEAR:
                raise ConnectionError("the arm has moved")
            if "error" not in message:
                raise ConnectionError("it is answered as if it were done")
            return str(message["error"])[:MAX_WORDS]

    def _second(self) -> str:
        """A second client asks for a move while the first is connected: it has to wait, or is refused."""
        with self._connected() as probe:
            before = probe.joints()
            target = float(before[self._joint] + self._way)
            with suppress(TimeoutError), socket.create_connection(self._address, timeout=TIMEOUT_SECONDS) as other:
                Line(other).send(id=1, do="move", joint=self._joint, target=target, seconds=10.0 * STEP_SECONDS)
                for _ in range(10):
                    time.sleep(STEP_SECONDS)
                    if np.abs((probe.joints() - before) / self._slack).max() > NEAR:
                        raise ConnectionError("a second client has moved the arm")
        return ""

    def _at_once(self) -> str:
        with self._connected() as probe:
            probe.socket.sendall(b'{"id": 901, "do": "read"}\n{"id": 902, "do": "read"}\n')
            ids = [probe.line.receive().get("id") for _ in range(2)]
            if ids != [901, 902]:
                raise ConnectionError(f"the answers have the ids {ids}")
        return ""

    @contextmanager
    def _moving(self, **words: object) -> Iterator[tuple[Probe, Vector, float]]:
        """Send the joint off, and bring it back afterwards.

        Yields:
            The connection, the joints before, shape (dof,), and when the joint was sent off [s].
        """
        with self._connected() as probe:
            start = probe.joints()
            since = time.monotonic()
            probe.ask(do="move", joint=self._joint, target=float(start[self._joint] + self._way), **words)
            yield probe, start, since
        with self._connected() as again:
            self._drive(again, self._joint, float(start[self._joint]))

    def _rests(self, probe: Probe, start: Vector, seconds: float) -> str:
        """Return how far the joint went; raise where that is more than it may in a time [s], or where it goes on."""
        joint = self._joint
        time.sleep(REACTION_SECONDS)
        q = probe.joints()
        time.sleep(REACTION_SECONDS)
        later = probe.joints()

        on = abs(float(later[joint] - q[joint]))
        if on > NEAR * self._slack[joint]:
            raise ConnectionError(f"it goes on, by {self._words(joint, on)} in {REACTION_SECONDS:g} s")

        went = abs(float(later[joint] - start[joint]))
        if went > self._rates[joint] * (seconds + REACTION_SECONDS) + NEAR * self._slack[joint]:
            raise ConnectionError(f"it went on, by {self._words(joint, went)}")
        return f"went on by {self._words(joint, went)}"

    def _words(self, joint: int, value: float) -> str:
        return amount(value, prismatic=bool(self._robot.prismatic[joint]))
