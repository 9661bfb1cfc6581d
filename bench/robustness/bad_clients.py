"""Bad clients of an arm's line and of the page of `rrtik show`, a bad server of an arm: what rules were not kept."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time
from contextlib import suppress

import numpy as np

from bench.robustness.messages import Witness, comes_true, drain, leave, mutated, send_in_pieces, silence
from rrtik_ompl import load_problem
from rrtik_ompl.pilot.devices import line_arm
from rrtik_ompl.pilot.devices.arm_protocol import LIMIT_SLACK, PROTOCOL
from rrtik_ompl.pilot.devices.line_arm import LineArm, LineServer
from rrtik_ompl.viewer.serve import PageServer

LINE_REQUESTS = (
    '{"id": 1, "do": "read"}',
    '{"id": 1, "do": "move", "joint": 2, "target": 0.1}',
    '{"id": 1, "do": "move", "joint": 0, "target": -0.4}',
    '{"id": 1, "do": "follow", "q": [0.1, 0.2, 0.1, 0.0, 0.3, 0.1]}',
    '{"id": 1, "do": "stop"}',
)
ON_A_LINE = 12  # messages of a client before it goes
BETWEEN_LOOKS = 2e-4  # [s] at an arm, which leave its line the processor


def line_server(first: int, count: int) -> list[str]:
    """Messages ``first`` and on of bad clients of a :class:`LineServer`; the rules that it did not keep.

    The arm stands still as soon as its client has gone, whatever that has sent; it is always where an arm can be; the
    next client is served; nothing is printed.
    """
    problem, faults = load_problem("titan4_sdu"), list[str]()
    arm = Witness(problem.robot, problem.start)
    with silence(faults), LineServer(arm) as server:
        for seed in range(first, first + count, ON_A_LINE):
            _talk(np.random.default_rng(seed), server.port, min(ON_A_LINE, first + count - seed))
            if not comes_true(lambda: arm.stands):
                faults.append(f"{seed}: the arm goes on without a client")
            if arm.fault():
                faults.append(f"{seed}: {arm.fault()}")
        try:
            LineArm(problem.robot, "127.0.0.1", server.port).close()
        except Exception as error:
            faults.append(f"{first + count}: the next client is not served: {error}")
    return faults


def _talk(rng: np.random.Generator, port: int, messages: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=5.0) as line:
        others = [socket.create_connection(("127.0.0.1", port), timeout=5.0) for _ in range(int(rng.random() < 0.1))]
        for _ in range(messages):
            send_in_pieces(rng, line, mutated(rng, LINE_REQUESTS))
            for other in others:
                send_in_pieces(rng, other, mutated(rng, LINE_REQUESTS))
            if rng.random() < 0.5:  # the others do not read
                drain(line)
        for each in (line, *others):
            leave(rng, each)


def page_server(first: int, count: int) -> list[str]:
    """Messages of bad clients of a :class:`PageServer`; the rules that it did not keep.

    Who asks rightly is answered with the page; what comes under another name never is; nothing is printed.
    """
    faults, text = list[str](), "<p>the page</p>" * 20_000
    with silence(faults), PageServer(text) as server:
        host = f"127.0.0.1:{server.port}"
        good = [f"{verb} / HTTP/1.1\r\nHost: {host}\r\nAccept: */*\r\n" for verb in ("GET", "HEAD")]
        good += [f"POST / HTTP/1.1\r\nHost: {host}\r\nContent-Length: 9\r\n\r\nx=1&y=222"]
        good += [f"GET / HTTP/1.0\r\nHost: {host}\r\nOrigin: http://evil.example\r\n"]
        for seed in range(first, first + count):
            rng = np.random.default_rng(seed)
            with socket.create_connection(("127.0.0.1", server.port), timeout=5.0) as line:
                send_in_pieces(rng, line, mutated(rng, good, "\r\n"))
                if rng.random() < 0.5:
                    drain(line)
                leave(rng, line)
            if seed % 50 == 0 and _fetched(server.port, host) != (200, text):
                faults.append(f"{seed}: the page is not served any more")
            if seed % 50 == 1 and _fetched(server.port, "evil.example")[0] != 403:
                faults.append(f"{seed}: the page is served under another name")
    return faults


def _fetched(port: int, host: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60.0)
    connection.request("GET", "/", headers={"Host": host})
    answer = connection.getresponse()
    try:
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def arm_of_a_line(first: int, count: int) -> list[str]:
    """Answers of a bad server to a :class:`LineArm`; the rules that it did not keep.

    Its thread lives and reports; joints are always such as the arm can have; a bad one is said in one line; as soon as
    answers are good it works again; nothing is printed.
    """
    problem, faults = load_problem("titan4_sdu"), list[str]()
    server = _BadServer(problem.robot.joint_names, problem.start.tolist(), first, count)
    before, line_arm.RETRY_SECONDS = line_arm.RETRY_SECONDS, 0.0
    try:
        with silence(faults):
            arm = LineArm(problem.robot, "127.0.0.1", server.port)
            while server.left > 0:
                if not problem.robot.within_limits(arm.read(), LIMIT_SLACK)[0]:
                    faults.append(f"{server.seed}: joints that the arm cannot have: {arm.read().tolist()}")
                if not arm.lost.isprintable():
                    faults.append(f"{server.seed}: a line that cannot be shown: {arm.lost!r}")
                with suppress(Exception):
                    arm.move(0, 0.1)
                time.sleep(BETWEEN_LOOKS)
            reported = arm.reported
            if not comes_true(lambda: arm.reported > reported and not arm.lost):
                faults.append(f"{first + count}: the line does not come back: {arm.lost}")
            arm.close()
    finally:
        line_arm.RETRY_SECONDS = before
        server.close()
    return faults


class _BadServer:
    """Greets, and answers most often badly; well from the last message on.

    Attributes:
        port: Where it listens.
        left: Number of bad answers that it has yet to give.
        seed: Of the answer that is given.
    """

    def __init__(self, joints: tuple[str, ...], q: list[float], first: int, count: int) -> None:
        self.left, self.seed = count, first
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._greeting = json.dumps({"protocol": PROTOCOL, "version": 1, "joints": list(joints)})
        self._good, self._ended = json.dumps({"q": q}), threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def close(self) -> None:
        """End."""
        self._ended.set()
        self._listening.close()

    def _serve(self) -> None:
        good = True  # the first client is answered well
        while not self._ended.is_set():
            with suppress(OSError):
                connection, _ = self._listening.accept()
                with connection:
                    connection.settimeout(5.0)
                    self._answer(connection, good)
                    good = False

    def _answer(self, connection: socket.socket, good: bool) -> None:
        connection.sendall((self._greeting + "\n").encode())
        while connection.recv(4096):
            if good or self.left <= 0:
                connection.sendall((self._good + "\n").encode())
                good = False
                continue
            rng = np.random.default_rng(self.seed)
            self.seed, self.left = self.seed + 1, self.left - 1
            send_in_pieces(rng, connection, mutated(rng, (self._good, '{"error": "no"}', self._greeting)))
