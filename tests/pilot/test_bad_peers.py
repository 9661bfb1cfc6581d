"""Whatever the other side of a line sends, and however slowly: no thread ends, and the arm stops when it should."""

import json
import socket
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.messages import MAX_DEPTH, message_in, quoted
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.arm_protocol import MAX_LINE_BYTES, PROTOCOL
from rrtik_ompl.pilot.devices.camera_feed import Feed
from rrtik_ompl.pilot.devices.line_arm import LineArm, LineServer
from rrtik_ompl.pilot.devices.watchdog import Watchdog
from rrtik_ompl.sensing.cameras.pictures import CameraLostError, Picture
from rrtik_tests.pilot_session import PROBLEM, ROBOT
from rrtik_tests.waiting import until

START = PROBLEM.start


@pytest.fixture(autouse=True)
def _soon(monkeypatch):
    for module in ("line_arm", "camera_feed"):
        monkeypatch.setattr(f"rrtik_ompl.pilot.devices.{module}.RETRY_SECONDS", 0.1)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


class ServerOf:
    """A server without a connection."""

    def __init__(self, arm):
        self.arm = arm


# The first version has no ids: what is wrong with an answer is all that these tests need.
GREETING = json.dumps({"protocol": PROTOCOL, "version": 1, "joints": list(ROBOT.joint_names)}).encode() + b"\n"
GOOD = json.dumps({"q": START.tolist()}).encode() + b"\n"
DEEP = b"[" * 60_000 + b"\n"


@contextmanager
def peer(answer):
    """A server that greets as it should, answers twice well, and then as it likes: ``answer(connection)``."""
    listening = socket.create_server(("127.0.0.1", 0))
    listening.settimeout(0.05)
    ended = threading.Event()

    def serve():
        while not ended.is_set():
            try:
                connection, _ = listening.accept()
            except TimeoutError:
                continue
            with connection:
                connection.settimeout(5.0)
                try:
                    connection.sendall(GREETING)
                    for _ in range(2):
                        connection.recv(4096)
                        connection.sendall(GOOD)
                    connection.recv(4096)
                    answer(connection)
                    while connection.recv(4096):  # until the other side hangs up
                        pass
                except OSError:
                    pass

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        ended.set()
        thread.join(5.0)
        listening.close()


def joints(values):
    return json.dumps({"q": values}).encode() + b"\n"


BAD_ANSWERS = {
    "a number of 400 digits": b'{"q":[' + b"9" * 400 + b",0,0,0,0,0]}\n",
    "a number of 5000 digits": b'{"q":[' + b"9" * 5000 + b",0,0,0,0,0]}\n",
    "deep nesting": DEEP,
    "deep nesting in an object": b'{"q":' + b"[" * 20_000 + b"]" * 20_000 + b"}\n",
    "no JSON": b"hello\n",
    "no UTF-8": b"\xff\xfe\n",
    "no object": b"[1]\n",
    "no joints": b"{}\n",
    "joints of another arm": joints([0.0] * 5),
    "NaN": b'{"q":[NaN,0,0,0,0,0]}\n',
    "infinity": b'{"q":[1e999,0,0,0,0,0]}\n',
    "joints of 1e300": joints([1e300, *START[1:]]),
    "joints of 100 rad": joints([*START[:5], 100.0] if not ROBOT.continuous[5] else [100.0, *START[1:]]),
    "text for joints": joints(["0"] * 5 + ["a"]),
    "an age of an odd kind": b'{"age": "old"}\n',
    "an endless line": b"a" * (MAX_LINE_BYTES + 1),
    "nothing": b"",
}


@pytest.mark.parametrize("case", BAD_ANSWERS)
def test_no_answer_ends_the_thread_that_talks_to_the_arm(case):
    with peer(lambda connection: connection.sendall(BAD_ANSWERS[case])) as port:
        arm = LineArm(ROBOT, "127.0.0.1", port)
        until(lambda: arm.lost)
        assert "connection to the arm is lost" in arm.lost
        assert arm.lost.isprintable()
        assert arm.read() == pytest.approx(START)
        until(lambda: not arm.lost)  # it tries again, and takes what is right
        arm.close()


def trickle(connection):
    while True:
        connection.sendall(b" ")
        time.sleep(0.1)


def test_an_answer_that_trickles_in_has_one_deadline():
    with peer(trickle) as port:
        arm = LineArm(ROBOT, "127.0.0.1", port)
        until(lambda: "timed out" in arm.lost)
        arm.close()


BAD_REQUESTS = {
    "deep nesting": DEEP,
    "no object": b"3\n",
    "no JSON": b"{{{\n",
    "no UTF-8": b"\xff\n",
    "an endless line": b"a" * (MAX_LINE_BYTES + 1),
    "nothing": b"",
}


@pytest.mark.parametrize("case", BAD_REQUESTS)
def test_no_request_ends_the_server_and_the_arm_stops(case):
    with LineServer(SimulatedArm(ROBOT, START)) as server:
        with socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection:
            connection.sendall(b'{"id":1,"do":"move","joint":0,"target":0.1}\n')
            until(lambda: server.arm.moving == 0)
            connection.sendall(BAD_REQUESTS[case])
            until(lambda: server.arm.moving is None)
        arm = LineArm(ROBOT, "127.0.0.1", server.port)  # the next client is served
        arm.close()


def test_a_request_that_trickles_in_stops_the_arm_and_frees_the_place():
    with LineServer(SimulatedArm(ROBOT, START)) as server:
        with socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection:
            connection.sendall(b'{"id":1,"do":"move","joint":0,"target":0.1}\n')
            until(lambda: server.arm.moving == 0)
            end = time.monotonic() + 10.0
            while server.arm.moving is not None and time.monotonic() < end:
                try:
                    connection.sendall(b" ")
                except OSError:  # the server has closed the line
                    break
                time.sleep(0.1)
            until(lambda: server.arm.moving is None)
        arm = LineArm(ROBOT, "127.0.0.1", server.port)
        assert not arm.lost
        arm.close()


def test_a_connection_that_cannot_be_taken_does_not_end_the_server(monkeypatch):
    with LineServer(SimulatedArm(ROBOT, START)) as server:
        accept = socket.socket.accept
        failures = iter([OSError(24, "Too many open files")] * 3)

        def failing(listening):
            raise next(failures, None) or TimeoutError

        monkeypatch.setattr(socket.socket, "accept", failing)
        until(lambda: next(failures, None) is None)
        monkeypatch.setattr(socket.socket, "accept", accept)
        arm = LineArm(ROBOT, "127.0.0.1", server.port)
        assert not arm.lost
        arm.close()


@given(
    do=st.sampled_from(["move", "follow", "read", "stop"]) | st.text(),
    joint=JSON,
    target=JSON,
    q=JSON | st.lists(st.floats(-4, 4), min_size=6, max_size=6),
    seconds=JSON | st.floats(0, 1),
)
def test_whatever_a_request_says_the_arm_stays_where_an_arm_can_be(do, joint, target, q, seconds):
    arm = SimulatedArm(ROBOT, START)
    request = {"id": 1, "do": do, "joint": joint, "target": target, "q": q, "seconds": seconds}
    fault = LineServer._execute(ServerOf(arm), request)
    assert fault == "" or fault.isprintable()
    moves = do == "move" and type(joint) is int and type(target) in (int, float) and fault == ""
    assert (arm.moving is not None) == moves
    arm.advance(1e3)
    assert ROBOT.within_limits(arm.read(), 1e-9)[0]


def test_a_silent_thread_stops_the_arm_once_and_is_named():
    arm = SimulatedArm(ROBOT, START)
    told = []
    last = {"one": time.monotonic(), "two": np.inf}
    reports = {name: lambda name=name: last[name] for name in last}
    arm.move(0, 0.5)
    with Watchdog(arm, reports, patience=0.2, tell=told.append) as watchdog:
        until(lambda: watchdog.fault)
        assert "one: no report for 0.2 s; the arm was stopped" in watchdog.fault
        assert arm.moving is None
        last["one"] = np.inf
        until(lambda: not watchdog.fault)
        arm.move(0, 0.5)
        last["two"] = 0.0
        until(lambda: arm.moving is None)
    assert [line.split(":")[0] for line in told] == ["one", "two"]


def test_a_watchdog_outlives_an_arm_that_breaks():
    class Broken(SimulatedArm):
        def stop(self):
            raise RuntimeError("broken")

    told = []
    with Watchdog(Broken(ROBOT, START), {"one": lambda: 0.0}, patience=0.1, tell=told.append):
        until(lambda: told)


def test_a_watchdog_outlives_a_terminal_that_has_gone():
    def tell(_):
        raise BrokenPipeError("no reader")

    arm = SimulatedArm(ROBOT, START)
    last = {"one": 0.0, "two": np.inf}
    reports = {name: lambda name=name: last[name] for name in last}
    with Watchdog(arm, reports, patience=0.1, tell=tell) as watchdog:
        until(lambda: watchdog.fault)
        arm.move(0, 0.5)
        last["two"] = 0.0
        until(lambda: arm.moving is None)


def picture():
    return Picture(np.zeros((4, 4, 3), dtype=np.uint8), "a", 0.0)


def test_a_camera_that_breaks_in_any_way_is_lost_and_comes_back():
    breaks = [RuntimeError("a driver"), MemoryError(), InputError("no such device")]

    def pictures():
        yield picture()
        if breaks:
            raise breaks.pop(0)
        threading.Event().wait(10.0)

    feed = Feed(pictures)
    reasons = set[str]()
    shown = []

    def all_seen():
        try:
            shown.extend(filter(None, [feed.latest()]))
        except CameraLostError as error:
            reasons.add(str(error))
        return len(reasons) == 3 and len(shown) >= 2

    until(all_seen)
    assert reasons == {"the camera broke: a driver", "the camera broke: MemoryError", "no such device"}
    assert feed.reported > 0.0


@given(st.text() | st.binary() | JSON.map(json.dumps))
def test_any_text_is_an_object_or_none(text):
    found = message_in(text)
    assert found is None or json.loads(text) == found or found != found or "NaN" in str(text)


def test_messages_are_shallow_objects_or_none():
    fits = '{"a":' + "[" * (MAX_DEPTH - 1) + "]" * (MAX_DEPTH - 1) + "}"
    assert message_in(fits) == json.loads(fits)
    assert message_in(fits.replace("[", "[[").replace("]", "]]")) is None
    assert message_in('{"a": "' + "[" * 99 + '\\"]"}') == {"a": "[" * 99 + '"]'}
    deep = []
    for _ in range(100_000):
        deep = [deep]
    assert quoted(deep) == "a list"
    assert quoted("x" * 999) == "x" * 100
