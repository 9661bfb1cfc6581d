"""An arm on the other side of a TCP connection: what it is told, and what happens when the line is cut."""

import itertools
import json
import socket
import time
from itertools import pairwise

import numpy as np
import pytest

from rrtik_ompl import load_problem
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.line_arm import UNSEEN_SECONDS, LineArm, LineServer
from rrtik_ompl.pilot.session import Session
from rrtik_tests.pilot_session import alarmed, refused
from rrtik_tests.waiting import until

PROBLEM = load_problem("titan4_sdu")
ROBOT, START = PROBLEM.robot, PROBLEM.start
FAST = np.full(6, 3.0)


def test_a_move_is_made_over_the_line_and_stops_when_told():
    with LineServer(SimulatedArm(ROBOT, START, FAST)) as server:
        arm = LineArm(ROBOT, "127.0.0.1", server.port)
        assert arm.read() == pytest.approx(START)
        arm.move(0, float(START[0]) - 0.5)
        until(lambda: abs(arm.read()[0] - START[0] + 0.5) < 1e-9)
        assert arm.read()[1:] == pytest.approx(START[1:])
        arm.move(0, float(ROBOT.lower[0]))
        until(lambda: arm.read()[0] < START[0] - 0.6)
        arm.stop()
        until(lambda: server.arm.moving is None)
        arm.close()
        assert arm.read()[0] > ROBOT.lower[0]


def test_a_lost_line_is_said_keeps_the_joints_stops_the_arm_and_comes_back():
    server = LineServer(SimulatedArm(ROBOT, START))
    with server:
        arm = LineArm(ROBOT, "127.0.0.1", server.port)
        session = Session(PROBLEM, arm, past=True)
        until(
            lambda: "driving" in session.command("jog", 0.0, direction=1.0, press=1) and server.arm.read()[0] > START[0]
        )
    assert server.arm.moving is None
    until(lambda: arm.lost)
    session.tick(1.0)

    kept = session.q.copy()
    assert alarmed(session, arm.lost)
    for verb, arguments in (("jog", {"direction": 1.0, "press": 2}), ("move", {"target": 0.1}), ("plan", {})):
        session.command(verb, 1.1, **arguments)
        assert refused(session, arm.lost)
    session.tick(1.2)
    assert session.q == pytest.approx(kept)

    with LineServer(SimulatedArm(ROBOT, START), server.port):
        until(lambda: not arm.lost)
        until(lambda: np.allclose(arm.read(), START))
        session.tick(1.3)
        assert "known again" in session.message
        arm.close()


def test_who_is_not_such_an_arm_is_named():
    other = SimulatedArm(load_problem("puma_pose").robot, np.zeros(6))
    with LineServer(other) as server, pytest.raises(InputError, match="not those of 'titan4'"):
        LineArm(ROBOT, "127.0.0.1", server.port)
    with pytest.raises(InputError, match="is its server running"):
        LineArm(ROBOT, "127.0.0.1", server.port)


def test_the_server_answers_nonsense_with_one_line():
    with (
        LineServer(SimulatedArm(ROBOT, START)) as server,
        socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection,
    ):
        lines = connection.makefile("rw")
        assert json.loads(lines.readline())["joints"] == list(ROBOT.joint_names)
        for asked, word in [
            ({"do": "read", "id": None}, "needs an id"),
            ({"do": "read", "id": "1"}, "needs an id"),
            ({"do": "fly"}, "read, move, grip or stop"),
            ({"do": "move", "joint": 9, "target": 0}, "from 0 to 5"),
            ({"do": "move", "joint": 0, "target": float("nan")}, "finite"),
            ({"do": "move", "joint": [0], "target": 0}, "from 0 to 5"),
            ({"do": "grip", "closed": 1}, "true or false"),
        ]:
            lines.write(json.dumps({"id": 1, **asked}) + "\n")
            lines.flush()
            answer = json.loads(lines.readline())
            assert word in answer["error"], asked
            assert (answer["id"], answer["q"]) == (asked.get("id", 1), START.tolist())
        assert server.arm.read() == pytest.approx(START)


def test_a_set_point_holds_only_for_as_long_as_it_says():
    rate = np.radians(10.0)
    with (
        LineServer(SimulatedArm(ROBOT, START)) as server,
        socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection,
    ):
        lines = connection.makefile("rw")
        lines.readline()

        numbers = itertools.count(1)

        def ask(**words):
            lines.write(json.dumps({"id": next(numbers), **words}) + "\n")
            lines.flush()
            return json.loads(lines.readline())

        far = float(START[0]) + 0.5
        ask(do="move", joint=0, target=far, seconds=0.05)
        time.sleep(0.2)
        assert ask(do="read")["q"][0] - START[0] == pytest.approx(0.05 * rate)
        ask(do="follow", q=[far, *START[1:]], seconds=0.05)
        time.sleep(0.2)
        assert ask(do="read")["q"][0] - START[0] == pytest.approx(0.1 * rate)
        assert server.arm.moving is None
        for seconds in (0, -1.0, "1", True, float("nan"), None, 1e999):
            assert "seconds above 0" in ask(do="move", joint=0, target=far, seconds=seconds)["error"]


class Recording:
    """A judge that counts what it is given, and finds what it is told to find."""

    def __init__(self):
        self.fault = ""
        self.share = 1.0
        self.readings = 0

    def read(self, q, time):
        self.readings += 1

    def room(self):
        return self.share


def test_an_arm_with_a_judge_is_told_nothing_but_to_stop_while_there_is_a_fault(monkeypatch):
    asked = []
    execute = LineServer._execute

    def noting(server, request):
        asked.append(request)
        return execute(server, request)

    monkeypatch.setattr(LineServer, "_execute", noting)
    with LineServer(SimulatedArm(ROBOT, START)) as server:
        arm = LineArm(ROBOT, "127.0.0.1", server.port)
        judge = arm.judge = Recording()
        arm.move(0, float(START[0]) + 0.5)
        until(lambda: asked[-1]["do"] == "stop")  # nobody has renewed it
        told = [request for request in asked if request["do"] == "move"]
        assert len(told) > 1
        assert all(0.0 < request["seconds"] <= 0.5 * UNSEEN_SECONDS for request in told)
        holds = [request["seconds"] for request in told]
        assert all(first + second <= UNSEEN_SECONDS + 1e-9 for first, second in pairwise(holds))
        assert judge.readings > 1
        judge.fault = "it has gone elsewhere"
        until(lambda: asked[-1]["do"] == "stop")
        asked.clear()
        arm.move(0, float(START[0]) + 0.5)
        until(lambda: len(asked) > 5)
        assert {request["do"] for request in asked} == {"stop"}
        arm.close()


# --- the second version of the protocol --------------------------------------------------------------------------


class Spoken(LineServer):
    """A server whose answers can be changed on their way: ``change`` gets each, and returns what is sent for it."""

    change = staticmethod(lambda answer: [answer])

    def _answer(self, line):
        send = line.send
        line.send = lambda **answer: [send(**each) for each in self.change(answer)]
        super()._answer(line)


@pytest.fixture
def spoken():
    """A server that may be made to speak otherwise, an arm at it, and a session that drives the arm."""
    with Spoken(SimulatedArm(ROBOT, START)) as server:
        arm = LineArm(ROBOT, "127.0.0.1", server.port)
        yield server, arm, Session(PROBLEM, arm, past=True)
        arm.close()


def test_answers_that_come_twice_or_late_do_not_shift_the_display(spoken):
    server, arm, session = spoken
    last = []

    def twice(answer):
        """Each answer twice, and after it the one before once more."""
        last.append(answer)
        return [answer, answer, last[-2] if len(last) > 1 else answer]

    server.change = twice
    arm.move(0, float(START[0]) + 0.2)
    until(lambda: "driving" in session.command("jog", 0.0, direction=1.0, press=1) and server.arm.read()[0] > START[0])
    session.command("stop", 0.1)
    until(lambda: server.arm.at_rest)
    until(lambda: np.array_equal(arm.read(), server.arm.read()))
    assert not arm.lost


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda answer: [answer | {"id": answer["id"] + 1}], "which was not asked"),
        (lambda answer: [{**answer, "id": None}], "which was not asked"),
        (lambda answer: [answer | {"id": 0}] * 2000, "more than it is asked"),
        (lambda answer: [answer | {"state": "asleep"}], "the state asleep"),
        (lambda answer: [{key: answer[key] for key in ("id", "q", "state")}], "the age None"),
        (lambda answer: [answer | {"age": -1.0}], "the age -1.0"),
    ],
)
def test_an_answer_that_is_none_ends_the_connection(spoken, change, words):
    server, arm, _ = spoken
    server.change = change
    until(lambda: words in arm.lost)


@pytest.mark.parametrize(
    ("says", "words"),
    [
        ({"state": "estop"}, "the arm is in emergency stop"),
        ({"state": "fault", "fault": "oil pressure is low"}, "the arm has a fault: oil pressure is low"),
        ({"error": "the hand is on the key \x1b[2J"}, r"the arm refuses: the hand is on the key \x1b[2J"),
    ],
)
def test_an_arm_that_stops_itself_is_no_lost_one_and_is_reset_here_too(spoken, says, words):
    server, arm, session = spoken
    server.says = says
    until(lambda: arm.fault)
    session.tick(0.1)
    assert alarmed(session, words)
    assert not arm.lost
    session.command("jog", 0.2, direction=1.0, press=1)
    assert refused(session, words)

    server.says = {}
    until(lambda: not arm.fault)
    session.tick(0.3)
    assert "'reset'" in session.message
    session.command("jog", 0.4, direction=1.0, press=2)
    assert refused(session, "'reset'")
    session.command("reset", 0.5)
    assert "driving" in session.command("jog", 0.6, direction=1.0, press=3)


def test_joints_that_come_late_from_the_arm_are_not_driven_on(spoken):
    server, arm, session = spoken
    server.says = {"age": 0.4}
    until(lambda: arm.age > 0.4)
    session.tick(0.1)
    assert alarmed(session, "the joints come from the arm more than 0.3 s late")


def test_rates_and_health_are_those_of_the_arm(spoken):
    server, arm, _ = spoken
    assert arm.greeting.rates == pytest.approx(np.full(6, np.radians(10.0)))
    server.says = {"health": [{"name": "oil", "value": 180, "unit": "bar", "ok": True}, {"value": "no number"}, 3]}
    until(lambda: arm.health)
    (oil,) = arm.health
    assert (oil.name, oil.value, oil.unit, oil.ok) == ("oil", 180.0, "bar", True)


@pytest.mark.parametrize(
    ("greeting", "words"),
    [
        ({"version": 3}, "greet as rrtik-arm 2"),
        ({"hold": 0.6}, "hold 0.6"),
        ({"hold": None}, "hold None"),
        ({"rates": [0.1] * 5}, "rates of its joints"),
        ({"rates": [0.1] * 5 + [0.0]}, "not positive"),
    ],
)
def test_a_greeting_that_promises_too_little_is_refused(monkeypatch, greeting, words):
    whole = LineServer._greeting
    monkeypatch.setattr(LineServer, "_greeting", lambda server: whole(server) | greeting)
    with LineServer(SimulatedArm(ROBOT, START)) as server, pytest.raises(InputError, match=words):
        LineArm(ROBOT, "127.0.0.1", server.port)


def test_without_ids_an_answer_that_nobody_has_asked_for_ends_the_connection(monkeypatch):
    whole = LineServer._greeting
    monkeypatch.setattr(LineServer, "_greeting", lambda server: whole(server) | {"version": 1})
    with Spoken(SimulatedArm(ROBOT, START)) as server:
        arm = LineArm(ROBOT, "127.0.0.1", server.port)
        assert not arm.lost
        server.change = lambda answer: [answer, answer]
        until(lambda: "late, or doubled" in arm.lost)
        arm.close()
