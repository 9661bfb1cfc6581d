"""The protocol between the pilot's tool and the server of an arm: greeting, requests, answers, and their checks.

The protocol is one JSON object a line over TCP, UTF-8, at most 64 kB. Joints are in the robot's order, values in rad or
m, times in s.

- the server greets: ``{"protocol": "rrtik-arm", "version": 2, "joints": ["azimuth", ..], "rates": [..], "hold": 0.5}``:
  its joints, the rates at which they move, and how long it moves on without a request, 0.5 s at most
- ``{"id": 7, "do": "read"}`` asks for the joints
- ``{"id": 8, "do": "move", "joint": 2, "target": 0.5}`` sends one joint (counted from 0) to a value; a new move
  replaces the last
- ``{"id": 9, "do": "follow", "q": [..]}`` sends all joints to set points, for trajectories
- ``{"id": 10, "do": "grip", "closed": true}`` closes or opens the gripper
- ``{"id": 11, "do": "stop"}`` stops at once
- ``"seconds": 0.04`` in a move or a follow limits its validity: if no next request comes in this time, the arm stops
- every request is answered once, by ``{"id": 7, "q": [..], "age": 0.004, "state": "ready"}``: the joints, how old
  they are, and one of `STATES`; with "estop" and "fault" also ``"fault": "oil pressure is low"``, in words. It may say
  ``"health": [{"name": "oil", "value": 180.0, "unit": "bar", "ok": true}, ..]``
- a request that cannot be fulfilled is answered by the same with ``"error": "one line"``, and moves nothing

The client requests the joints about 30 times a second. A server stops the arm when its client has gone, or has sent
no complete request for the time it greeted with. A client counts the connection as lost when no complete answer comes
within half a second, or an invalid one: too long, nested too deep, of a request that was not made, or with joint values
that the arm cannot have. It leaves out answers whose ``id`` has passed: they are late, or doubled.

Version 1 has no ids, ages, states, rates and health, and an error is answered without joints; such a server is driven,
too. Without ids a late or doubled answer cannot be told from the next one: an answer that nobody has asked for then
ends the connection.
"""

from __future__ import annotations

import json
import select
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import LARGEST, Vector, finite_array
from rrtik_ompl.base.errors import InputError, printable
from rrtik_ompl.files.messages import message_in, quoted
from rrtik_ompl.model.robot import Robot

PROTOCOL = "rrtik-arm"
VERSION = 2
VERSIONS = (1, 2)
STATES = ("ready", "moving", "estop", "fault")
TIMEOUT_SECONDS = 0.5  # time limit for a complete answer, and for a server without a request
LIMIT_SLACK = 0.2  # [rad or m]; by how much a reading may exceed the limits
MAX_LINE_BYTES = 64 * 1024
MAX_PASSED = 20  # answers to earlier requests that one answer may come after
MAX_HEALTH = 20  # values of health that are kept
MAX_WORDS = 60  # letters of a name or unit
SET_POINTS = ("move", "follow")


@dataclass(frozen=True, slots=True, eq=False)
class Greeting:
    """What a server says of its arm.

    Attributes:
        version: Version of the protocol.
        rates: Rates of the joints, shape (dof,) [rad/s or m/s]; None where it does not say.
    """

    version: int
    rates: Vector | None = None


@dataclass(frozen=True, slots=True)
class Health:
    """A value that tells how an arm is: a pressure, a temperature, a leak."""

    name: str
    value: float
    unit: str
    ok: bool


@dataclass(frozen=True, slots=True, eq=False)
class ArmAnswer:
    """What a server answers.

    Attributes:
        q: Joint values, shape (dof,) [rad or m]; None if they are not given.
        age: How old they were when they were sent [s].
        fault: Why the arm does not do what it is told, by itself; "" if it does.
        health: How it is.
    """

    q: Vector | None
    age: float = 0.0
    fault: str = ""
    health: tuple[Health, ...] = ()


class Line:
    """Exchange complete JSON objects over a socket."""

    def __init__(self, connection: socket.socket) -> None:
        connection.settimeout(TIMEOUT_SECONDS)
        self._socket = connection
        self._unread_bytes = b""

    def send(self, **words: object) -> None:
        """Send an object."""
        self._socket.sendall(json.dumps(words).encode() + b"\n")

    def has_more(self) -> bool:
        """Check whether something has come that was not received yet."""
        return bool(self._unread_bytes or select.select([self._socket], [], [], 0.0)[0])

    def receive(self, seconds: float = TIMEOUT_SECONDS) -> dict[str, Any]:
        """Wait for the next object and return it.

        Raises:
            OSError: If the connection ends, nothing comes in time, or what comes is no JSON object.
        """
        end = time.monotonic() + seconds
        while b"\n" not in self._unread_bytes:
            # One deadline applies to the whole line, however slowly its bytes arrive.
            self._socket.settimeout(max(end - time.monotonic(), 1e-3))
            received = self._socket.recv(4096)
            self._unread_bytes += received
            if not received or len(self._unread_bytes) > MAX_LINE_BYTES:
                raise ConnectionError("the other side has closed the connection" if not received else "an endless line")

        line, _, self._unread_bytes = self._unread_bytes.partition(b"\n")
        self._socket.settimeout(TIMEOUT_SECONDS)

        message = message_in(line)
        if message is None:
            raise ConnectionError("the other side does not send JSON lines")
        return message

    def close(self) -> None:
        """End the connection."""
        self._socket.close()


def greeting_in(message: Mapping[str, Any], robot: Robot) -> Greeting:
    """Return what a server greets with.

    Raises:
        ConnectionError: If it does not speak this protocol, or has another arm.
    """
    version = message.get("version")
    if message.get("protocol") != PROTOCOL or type(version) is not int or version not in VERSIONS:
        raise ConnectionError(f"the other side does not greet as {PROTOCOL} {VERSION}")
    if message.get("joints") != list(robot.joint_names):
        joints = quoted(message.get("joints"))
        raise ConnectionError(f"it has the joints {joints}, not those of '{robot.name}'")
    if version == 1:
        return Greeting(version)

    hold = message.get("hold")
    if not _is_number(hold) or not 0.0 < hold <= TIMEOUT_SECONDS:
        raise ConnectionError(
            f"it greets with hold {quoted(hold)}: it must stop after {TIMEOUT_SECONDS:g} s without a request, or less"
        )
    return Greeting(version, _rates(message.get("rates"), robot))


def answer_in(message: Mapping[str, Any], robot: Robot, version: int) -> ArmAnswer:
    """Return what a server answers.

    What an arm says of itself is believed in every version: nobody says "estop" without need.

    Raises:
        ConnectionError: If something is missing or impossible.
    """
    error = message.get("error")
    state = message.get("state")
    words = message.get("fault") or error

    fault = ""
    if state == "estop" or message.get("estop") is True:
        fault = "the arm is in emergency stop"
    elif state == "fault" or message.get("fault"):
        fault = "the arm has a fault"
    elif error is not None:
        fault = "the arm refuses"
    elif state not in (*STATES, *((None,) if version == 1 else ())):
        raise ConnectionError(f"an answer with the state {quoted(state)}; it must be one of {', '.join(STATES)}")
    if fault and words:
        fault = printable(f"{fault}: {quoted(words)}")

    age = message.get("age", 0.0 if version == 1 or error is not None else None)
    if not _is_number(age) or age < 0.0:
        raise ConnectionError(f"an answer whose joints have the age {quoted(age)}")

    q = None if error is not None and "q" not in message else _joints(message.get("q", ()), robot)
    return ArmAnswer(q, float(age), fault, _health(message.get("health", ())))


def _joints(given: ArrayLike, robot: Robot) -> Vector:
    try:
        q = robot.configuration(given, "q")
    except InputError as error:
        raise ConnectionError(f"an answer without the joints: {error}") from None
    if not (robot.within_limits(q, LIMIT_SLACK)[0] and np.abs(q).max() <= LARGEST):
        raise ConnectionError(f"an answer with joints that the arm cannot have: {robot.limit_fault(q)}")
    return q


def _rates(given: object, robot: Robot) -> Vector:
    try:
        rates = finite_array(given if isinstance(given, list) else [], (robot.dof,), "rates")
    except (InputError, TypeError, ValueError) as error:
        raise ConnectionError(f"it greets without the rates of its joints: {error}") from None
    if (rates <= 0.0).any():
        raise ConnectionError(f"it greets with rates that are not positive: {rates.tolist()}")
    return rates


def _health(given: object) -> tuple[Health, ...]:
    """Return the values of health that can be shown; others are left out, for they move nothing."""
    entries = given[:MAX_HEALTH] if isinstance(given, list) else ()
    return tuple(
        Health(
            printable(quoted(each.get("name"))[:MAX_WORDS]),
            float(each["value"]),
            printable(quoted(each.get("unit", ""))[:MAX_WORDS]),
            each.get("ok") is not False,
        )
        for each in entries
        if isinstance(each, dict) and _is_number(each.get("value"))
    )


def _is_number(value: object) -> TypeGuard[float]:
    """Check for a finite number; bool is a subclass of int, but no number here."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST
