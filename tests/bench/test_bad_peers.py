"""A share of what `bench/robustness` sends to servers: the rules of arm and pilot are kept, nothing is printed."""

import pytest

from bench.robustness import bad_clients, bad_pages
from bench.robustness.messages import Witness, silence
from rrtik_tests.pilot_session import PROBLEM, ROBOT

PEERS = (bad_clients.line_server, bad_clients.page_server, bad_clients.arm_of_a_line, bad_pages.pilot_server)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]


@pytest.mark.parametrize("attack", PEERS, ids=lambda attack: attack.__name__)
def test_no_rule_is_broken(attack):
    assert attack(0, 120) == []


def test_an_arm_that_goes_on_is_seen(monkeypatch):
    monkeypatch.setattr(Witness, "stop", lambda self: None)
    monkeypatch.setattr("bench.robustness.messages.PATIENCE_SECONDS", 0.2)
    assert any("goes on without a client" in wrong for wrong in bad_clients.line_server(0, 200))


def test_an_arm_where_none_can_be_is_seen():
    arm = Witness(ROBOT, PROBLEM.start)
    assert arm.fault() == ""
    arm._q = arm._q + 100.0
    assert arm.fault().startswith("the arm is at")


def test_a_word_on_standard_error_is_seen():
    import os

    faults = []
    with silence(faults):
        os.write(2, b"Traceback")
    assert faults == ["written to standard error: Traceback"]
