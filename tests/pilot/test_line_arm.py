"""An arm on the other side of a TCP connection: what it is told, and what happens when the line is cut."""

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
            ({"do": "fly"}, "read, move, grip or stop"),
            ({"do": "move", "joint": 9, "target": 0}, "from 0 to 5"),
            ({"do": "move", "joint": 0, "target": float("nan")}, "finite"),
            ({"do": "move", "joint": [0], "target": 0}, "from 0 to 5"),
            ({"do": "grip", "closed": 1}, "true or false"),
        ]:
            lines.write(json.dumps(asked) + "\n")
            lines.flush()
            assert word in json.loads(lines.readline())["error"], asked
        assert server.arm.read() == pytest.approx(START)


def test_a_set_point_holds_only_for_as_long_as_it_says():
    rate = np.radians(10.0)
    with (
        LineServer(SimulatedArm(ROBOT, START)) as server,
        socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection,
    ):
        lines = connection.makefile("rw")
        lines.readline()

        def ask(**words):
            lines.write(json.dumps(words) + "\n")
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
