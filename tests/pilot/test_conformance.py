"""The check of somebody's arm server: it finds what is wrong with a server, and nothing with ours."""

import pytest

from rrtik_ompl.pilot.devices.conformance import Conformance
from rrtik_ompl.pilot.devices.line_arm import LineServer
from rrtik_tests.command_line import rrtik
from rrtik_tests.hostile_arm import HostileArm
from rrtik_tests.pilot_session import PROBLEM


def failed(server):
    return {each.what: each.measured for each in Conformance(PROBLEM, "127.0.0.1", server.port).run() if not each.held}


def test_our_own_server_holds_all_and_the_arm_is_where_it_was():
    arm = HostileArm()
    with LineServer(arm) as server:
        assert failed(server) == {}
    assert arm.read() == pytest.approx(PROBLEM.start, abs=0.005)


@pytest.mark.parametrize(
    ("fault", "words"),
    [("other", "was driven"), ("reverse", "the wrong way"), ("jump", "jumped"), ("dead", "does not get there")],
)
def test_an_arm_that_errs_is_named(fault, words):
    with LineServer(HostileArm(fault=fault)) as server:
        findings = Conformance(PROBLEM, "127.0.0.1", server.port).run()
        found = next(each for each in findings if each.what.startswith("azimuth"))
    assert not found.held
    assert words in found.measured


class Deaf(LineServer):
    """A server that goes on whatever comes, and refuses nothing."""

    def _execute(self, request):
        super()._execute(request)
        return ""


def test_a_server_that_refuses_nothing_and_greets_as_before_is_found_out(monkeypatch):
    with Deaf(HostileArm()) as server:
        whole = server._greeting()
        monkeypatch.setattr(server, "_greeting", lambda: whole | {"version": 1})
        found = failed(server)
    assert {"greets in version 2, with rates and hold", "refuses an unknown request"} <= set(found)


def test_the_command_says_what_failed(capsys):
    with Deaf(HostileArm()) as server:
        code, out, err = rrtik(capsys, "pilot", "titan4_sdu", "--conform", f"127.0.0.1:{server.port}")
    assert code == 1
    assert "FAILED  refuses an unknown request" in out
    assert "the arm is moved" in err
    assert rrtik(capsys, "pilot", "titan4_sdu", "--conform", "nowhere")[0] == 2
