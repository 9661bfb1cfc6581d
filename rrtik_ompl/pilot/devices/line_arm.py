"""An arm on the other side of a TCP connection, and the server that offers one; `arm_protocol` is what they speak.

An arm that a pilot drives has a judge. It is called in the thread that talks to the arm, so that nothing else delays
it: each reading is judged when it comes, and while there is a fault every request is a stop. The last set point is
repeated until the next one comes, for `RENEW_SECONDS` at most; then the arm is stopped. Each set point is valid only
for a short time: no longer than the arm, at its rate, can move without leaving the error that the judge allows,
counting what was sent before. So an arm that moves differently from its set points stops by itself even if this
machine is too busy to stop it.
"""

from __future__ import annotations

import itertools
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import LARGEST, Vector
from rrtik_ompl.base.errors import InputError, printable
from rrtik_ompl.files.messages import quoted
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.arm_protocol import (
    MAX_PASSED,
    PROTOCOL,
    SET_POINTS,
    TIMEOUT_SECONDS,
    VERSION,
    ArmAnswer,
    Greeting,
    Health,
    Line,
    answer_in,
    greeting_in,
)

POLL_SECONDS = 1.0 / 30.0  # between two requests for the joints
DRIVEN_POLL_SECONDS = 0.02  # the same interval while an arm with a judge is driven
# The last set point is repeated for this long; an arm without faults has reached it by then.
RENEW_SECONDS = 0.1
# Longest motion between the last reading that was judged and the end of the validity of a set point.
UNSEEN_SECONDS = 0.09
SHORTEST_SECONDS = 0.005  # least validity of a set point
RETRY_SECONDS = 1.0
MAX_ID = 2**53  # the largest whole number that every JSON reader keeps


class Judge(Protocol):
    """Compare the readings of an arm with its set points. Called by the thread that reads the arm.

    Attributes:
        fault: What the arm did against its set points; "" if nothing.
    """

    fault: str

    def read(self, q: Vector, time: float) -> None:
        """Judge a reading, shape (dof,), taken at a time by ``time.monotonic()``."""

    def room(self) -> float:
        """Return the share of the allowed error that is left, from 0 to 1."""


class LineArm:
    """An arm that a server offers. If the connection is lost, it keeps the last known joint values and reconnects.

    Attributes:
        robot: The robot model of the arm.
        judge: Judges its readings; None for no judge.
        lost: Why the connection is lost; "" if it is not.
        fault: Why the arm does not do what it is told, as it says itself (an emergency stop, a fault); "" if it does.
        health: How it is, as it says itself.
        greeting: What its server greeted with.
        reported: Time of the last sign of life of its thread, by ``time.monotonic()``.
    """

    def __init__(self, robot: Robot, host: str, port: int) -> None:
        """Connect to the server, and start the thread that talks to it.

        Args:
            robot: The robot that the arm must be.
            host: Host of the server.
            port: Port of the server.

        Raises:
            InputError: If there is no server, or it offers another arm.
        """
        self.robot = robot
        self._address = (host, port)
        self.lost = ""
        self.fault = ""
        self.health: tuple[Health, ...] = ()
        self.greeting = Greeting(VERSION)
        self.reported = time.monotonic()
        self.judge: Judge | None = None

        self._request: dict[str, Any] | None = None
        self._set_point: dict[str, Any] | None = None  # the last set point; None after a stop
        self._set_point_time = -np.inf  # time at which it was given
        self._valid_seconds = 0.0  # remaining validity of the last request sent [s]
        self._ids = itertools.count(1)
        self._read_at = -np.inf  # time of the last reading, by this machine's clock
        self._grip: dict[str, Any] | None = None  # sent before anything else; a move does not replace it

        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._wake = threading.Event()

        try:
            self._line = self._connect()
            first = self._exchange({"do": "read"})
            if first is None:
                raise ConnectionError(self.fault)
            self._q = first
        except (OSError, OverflowError) as error:
            raise InputError(f"arm at {host}:{port}: {error}; is its server running?") from None

        self._thread = threading.Thread(target=self._communicate, daemon=True)
        self._thread.start()

    def read(self) -> Vector:
        """Return the joint values received last, shape (dof,) [rad or m]."""
        with self._lock:
            return self._q.copy()

    @property
    def age(self) -> float:
        """How old the last reading is at most [s]: from the arm, over the line, until now."""
        return time.monotonic() - self._read_at

    def move(self, joint: int, target: float) -> None:
        """Send one joint to a value [rad or m].

        Raises:
            InputError: If the connection is lost.
        """
        if self.lost:
            raise InputError(self.lost)
        self._send_later({"do": "move", "joint": int(joint), "target": float(target)})

    def follow(self, q: ArrayLike) -> None:
        """Send all joints to a set point, shape (dof,) [rad or m].

        Raises:
            InputError: If the connection is lost, or it does not fit the robot.
        """
        if self.lost:
            raise InputError(self.lost)
        self._send_later({"do": "follow", "q": self.robot.configuration(q, "set point").tolist()})

    def stop(self) -> None:
        """Stop at once; without a connection the server stops the arm by itself."""
        self._send_later({"do": "stop"})

    def grip(self, closed: bool) -> None:
        """Close or open the gripper.

        Raises:
            InputError: If the connection is lost.
        """
        if self.lost:
            raise InputError(self.lost)
        with self._lock:
            self._grip = {"do": "grip", "closed": bool(closed)}
        self._wake.set()

    def close(self) -> None:
        """Stop the arm, and end the connection."""
        self.stop()
        self._ended.set()
        self._thread.join(timeout=5.0)
        self._line.close()

    def _send_later(self, message: dict[str, Any]) -> None:
        with self._lock:
            self._request = message
            self._set_point = message if message["do"] in SET_POINTS else None
            self._set_point_time = time.monotonic()
        self._wake.set()

    def _connect(self) -> Line:
        line = Line(socket.create_connection(self._address, timeout=TIMEOUT_SECONDS))
        try:
            self.greeting = greeting_in(line.receive(), self.robot)
        except OSError:
            line.close()
            raise
        return line

    def _exchange(self, message: dict[str, Any]) -> Vector | None:
        """Send a request, and return the joint values of the answer, shape (dof,); None if it has none."""
        if self.greeting.version == 1 and self._line.has_more():
            raise ConnectionError("an answer that nobody has asked for: late, or doubled")

        number = next(self._ids)
        sent_at = time.monotonic()
        self._line.send(**message, id=number)
        answer = self._answer_to(number, sent_at + TIMEOUT_SECONDS)

        self.fault = answer.fault
        self.health = answer.health
        if answer.q is not None:
            self._read_at = sent_at - answer.age
        return answer.q

    def _answer_to(self, number: int, deadline: float) -> ArmAnswer:
        """Wait for the answer to a request; answers to earlier ones are late, or doubled, and are left out."""
        for _ in range(MAX_PASSED):
            message = self._line.receive(deadline - time.monotonic())
            version = self.greeting.version
            if version == 1 or message.get("id") == number:
                return answer_in(message, self.robot, version)
            if type(message.get("id")) is not int or message["id"] > number:
                raise ConnectionError(f"an answer with the id {quoted(message.get('id'))}, which was not asked")
        raise ConnectionError("it answers more than it is asked")

    def _next_request(self) -> dict[str, Any]:
        """Return the request to send next.

        A gripper command goes first, then the last command given. Without one, an arm with a judge gets its last set
        point again while that is recent, then a stop; otherwise the joints are read. While the judge has a fault, or
        the arm itself says that it has one, every request is a stop. Set points get a validity that keeps the
        unobserved motion within what the judge allows.
        """
        with self._lock:
            message = self._grip
            self._grip = None
            if message is None:
                message = self._request
                self._request = None
            if message is None and self.judge is not None and self._set_point is not None:
                is_recent = time.monotonic() - self._set_point_time < RENEW_SECONDS
                message = self._set_point if is_recent else {"do": "stop"}
                self._set_point = self._set_point if is_recent else None

        message = message or {"do": "read"}
        if self.judge is None:
            return message
        if self.judge.fault or self.fault:
            message = {"do": "stop"}

        if message["do"] == "stop":
            self._valid_seconds = 0.0
        if message["do"] not in SET_POINTS:
            return message

        # The last request is still valid when this one arrives: its time counts, too.
        allowed_seconds = UNSEEN_SECONDS * self.judge.room() - self._valid_seconds
        self._valid_seconds = max(min(allowed_seconds, 0.5 * UNSEEN_SECONDS), SHORTEST_SECONDS)
        return message | {"seconds": self._valid_seconds}

    def _judge(self, q: Vector) -> None:
        """Have a reading judged; on a new fault, send the stop without delay."""
        if self.judge is None:
            return
        previous_fault = self.judge.fault
        self.judge.read(q, time.monotonic())
        if self.judge.fault and not previous_fault:
            self._wake.set()

    def _communicate(self) -> None:
        """Exchange requests and readings until the arm is closed; reconnect when the connection is lost."""
        while True:
            self._wake.wait(DRIVEN_POLL_SECONDS if self._valid_seconds else POLL_SECONDS)
            self._wake.clear()

            message = self._next_request()
            try:
                if self.lost:
                    self._line = self._connect()
                    message = {"do": "read"}  # commands given before the loss are out of date
                q = self._exchange(message)
                if q is not None:
                    self._judge(q)
                with self._lock:
                    self._q = self._q if q is None else q
                    self.lost = ""
            except Exception as error:  # no message, however malformed, may end this thread
                self._line.close()
                with self._lock:
                    self._set_point = None
                why = getattr(error, "strerror", None) or error
                self.lost = printable(f"the connection to the arm is lost: {why}; the joints are the last known ones")
                self._ended.wait(RETRY_SECONDS)

            self.reported = time.monotonic()
            if self._ended.is_set() and self._request is None and self._grip is None:
                return


class LineServer:
    """Offer a simulated arm to one client at a time on this machine; use it as a context manager."""

    def __init__(self, arm: SimulatedArm, port: int = 0, host: str = "127.0.0.1") -> None:
        """Open a port; 0 chooses a free one.

        Raises:
            InputError: If the port cannot be used.
        """
        self.arm = arm
        self.says: Mapping[str, object] = {}  # what it says of its arm in each answer: state, fault, health
        try:
            self._listening = socket.create_server((host, port))
        except (OSError, OverflowError) as error:
            raise InputError(f"port {port}: cannot be used: {getattr(error, 'strerror', None) or error}") from None
        self.port = int(self._listening.getsockname()[1])
        self._listening.settimeout(0.1)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> LineServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(timeout=5.0)
        self._listening.close()

    def _serve(self) -> None:
        """Accept one client after the other.

        The arm stops when a client leaves, falls silent or sends no valid request.
        """
        while not self._ended.is_set():
            try:
                connection, _ = self._listening.accept()
            except TimeoutError:
                continue
            # The client has left already, or the process is out of file handles: try again later.
            except OSError:
                self._ended.wait(POLL_SECONDS)
                continue

            line = Line(connection)
            # The client has left, is silent, or sends no valid request.
            with suppress(Exception):
                line.send(**self._greeting())
                self._answer(line)
            self.arm.stop()
            line.close()

    def _greeting(self) -> dict[str, object]:
        robot = self.arm.robot
        rates = self.arm.rates.tolist()
        joints = list(robot.joint_names)
        return {"protocol": PROTOCOL, "version": VERSION, "joints": joints, "rates": rates, "hold": TIMEOUT_SECONDS}

    def _answer(self, line: Line) -> None:
        """Answer requests of one client.

        The simulated arm advances in real time, and stops when a set point's validity ends.
        """
        last_time = time.monotonic()
        expiry_time = np.inf
        while not self._ended.is_set():
            request = line.receive()
            now = time.monotonic()
            if now > expiry_time:
                self.arm.advance(expiry_time - last_time)
                self.arm.stop()
                last_time = expiry_time
                expiry_time = np.inf

            self.arm.advance(now - last_time)
            last_time = now

            fault = self._execute(request)
            if request.get("do") in SET_POINTS and not fault:
                expiry_time = now + request.get("seconds", np.inf)
            state = "ready" if self.arm.at_rest else "moving"
            answer = {"id": request.get("id"), "q": self.arm.read().tolist(), "age": 0.0, "state": state, **self.says}
            line.send(**answer, **({"error": fault} if fault else {}))

    def _execute(self, request: dict[str, Any]) -> str:
        """Execute a request, and return what is wrong with it; "" if nothing is."""
        action = request.get("do")
        joint = request.get("joint")
        target = request.get("target")
        seconds = request.get("seconds", 1.0)
        number = request.get("id")
        if type(number) is not int or not 0 <= number <= MAX_ID:
            return "a request needs an id, a whole number"
        if action in SET_POINTS and not (type(seconds) in (int, float) and 0.0 < seconds < LARGEST):
            return f"{action} needs seconds above 0, if any"

        if action == "stop":
            self.arm.stop()
        elif action == "move":
            # Types are compared exactly: bool is a subclass of int, but no number here.
            are_numbers = type(joint) is int and type(target) in (int, float)
            if not (are_numbers and 0 <= joint < self.arm.robot.dof and abs(target) < LARGEST):  # type: ignore[operator,arg-type]
                return f"move needs a joint from 0 to {self.arm.robot.dof - 1} and a finite target"
            self.arm.move(int(joint), float(target))  # type: ignore[arg-type]
        elif action == "grip":
            if not isinstance(request.get("closed"), bool):
                return "grip needs closed: true or false"
            self.arm.grip(request["closed"])
        elif action == "follow":
            try:
                self.arm.follow(request.get("q"))  # type: ignore[arg-type]
            except InputError as error:
                return str(error)
        elif action != "read":
            return "do must be read, move, grip or stop, or follow"
        return ""


class ArmLink:
    """Connect a simulated arm, or a `LineArm`, to the execution of trajectories."""

    def __init__(self, arm: SimulatedArm | LineArm) -> None:
        self.arm = arm

    def positions(self) -> Vector:
        """Return the present joint values, shape (dof,)."""
        return self.arm.read()

    def command(self, q: Vector, t: float) -> None:
        """Send all joints to a set point, shape (dof,) [rad or m]; the time ``t`` is not used."""
        self.arm.follow(q)
