"""An arm that does another thing than it is told is stopped within a degree and named; so it is over slow lines."""

import re
import time

import numpy as np
import pytest

from rrtik_ompl.pilot.interlock import LATE_SECONDS, Sight
from rrtik_ompl.pilot.machine import READ_SECONDS
from rrtik_ompl.pilot.motion.supervisor import Supervisor
from rrtik_tests.hostile_arm import HostileArm, Pilot, SteppedPilot
from rrtik_tests.pilot_session import PROBLEM, ROBOT, refused, session

RATES = np.full(ROBOT.dof, np.radians(10.0))
STEP = 1.0 / 30.0


def degrees(arm, before):
    return np.degrees(arm._q - before)


FAULTS = {
    "other": r"shoulder_pitch moved by 0\.\d deg while azimuth was driven: stopped",
    "reverse": r"azimuth goes the wrong way, by 0\.\d deg: stopped",
    "jump": r"azimuth jumped by 3\d\.\d deg between two readings: stopped",
    "dead": r"azimuth does not move \(0\.0 deg in 0\.[345] s\): stopped",
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(("joint", "direction"), [(0, 1.0), (2, -1.0), (4, 1.0)])
def test_an_arm_with_a_fault_is_stopped_within_a_degree_and_half_a_second_and_named(fault, joint, direction):
    made, _ = session()
    arm = made.arm = HostileArm()
    made.command("select", 0.0, joint=joint)
    time_ = 0.0
    told = 0

    for k in range(60):
        arm.fault = fault if k >= 20 else ""
        if k == 20:
            before = arm._q.copy()
            began = time_
        made.see([], time_)
        made.command("jog", time_, direction=direction, press=1)
        told += made.driving
        arm.advance(STEP)
        time_ += STEP
        made.tick(time_)
        if k >= 20 and not made.driving:
            break

    assert time_ - began <= 0.5
    assert told > 20
    expected = FAULTS[fault].replace("shoulder_pitch", ROBOT.joint_names[(joint + 1) % 6])
    assert re.search(expected.replace("azimuth", ROBOT.joint_names[joint]), made.message), made.message
    arm.advance(2 * STEP)  # a stop takes as long to arrive
    assert np.abs(degrees(arm, before)).max() <= 1.0


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_latched_until_it_is_reset(fault):
    with SteppedPilot() as pilot:
        pilot.hold(0.5)
        pilot.arm.fault = fault
        state = pilot.go_on(10.0, until=lambda state: state["level"] == "alarm")
        pilot.look(0.3)
        assert re.search(FAULTS[fault].replace(r"0\.\d deg", r"\d\.\d deg"), state["message"]), state["message"]
        if fault == "dead":
            return
        pilot.arm.fault = ""
        there = pilot.arm._q.copy()
        assert "'reset' acknowledges" in pilot.hold(0.2)["message"]
        assert (pilot.arm._q == there).all()
        pilot.look(READ_SECONDS)
        pilot.say("stop")
        assert "'reset' acknowledges" in pilot.look(0.3)["message"]
        pilot.say("reset")
        assert pilot.look(0.3)["fault_of_arm"] == ""
        pilot.hold(0.4)
        assert pilot.arm._q[0] > there[0]


def test_an_arm_that_does_not_stop_is_named():
    with SteppedPilot() as pilot:
        pilot.hold(0.4)
        pilot.arm.fault = "runaway"
        pilot.go_on(0.1)
        pilot.release()
        state = pilot.look(1.2)
        assert re.search(r"azimuth moved on by \d\.\d deg after the stop", state["message"])
        assert "azimuth" in pilot.hold(0.1)["message"]


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
def test_after_the_release_an_arm_moves_a_degree_at_most_over_any_line(delay):
    with SteppedPilot(delay=delay) as pilot:
        begin = pilot.arm._q.copy()
        state = pilot.hold(0.8 + 2.0 * delay)
        released = pilot.arm._q.copy()
        pilot.release()
        pilot.look(0.6 + 2.0 * delay)
        assert np.abs(degrees(pilot.arm, released)).max() <= 1.0
        slow = 2.0 * delay > LATE_SECONDS
        assert (pilot.arm._q == begin).all() == slow
        if slow:
            assert state["level"] == "refusal"
            assert re.search(r"line too slow .* [\d.]+ s", state["message"])


def test_the_rate_falls_as_the_line_gets_slower():
    reached = {}
    for age in (0.05, 0.2, 0.29):
        made, arm = session()
        time_ = 0.0
        for _ in range(30):
            made.see([], time_)
            made.command("jog", time_, Sight(age, age), direction=1.0, press=age)
            arm.advance(STEP)
            time_ += STEP
            made.tick(time_)
        made.command("release", time_)
        reached[age] = np.degrees(arm.read()[0] - PROBLEM.start[0])
        assert reached[age] * age <= 1.05
    assert reached[0.05] > 9.0
    assert 4.0 < reached[0.2] < 5.2
    made.command("jog", made.time, Sight(0.31, 0.0), direction=1.0, press=9)
    assert refused(made, "line too slow", "0.31 s")


def test_a_hold_that_lapses_is_said_and_needs_a_new_press():
    with SteppedPilot() as pilot:
        pilot.hold(0.4)
        state = pilot.look(0.5)
        assert state["level"] == "alarm"
        assert "0.25 s" in state["message"]
        there = pilot.arm._q.copy()
        pilot.go_on(0.3)
        assert (pilot.arm._q == there).all()


def test_a_page_that_does_not_say_what_it_shows_or_shows_old_pictures_drives_nothing():
    with SteppedPilot() as pilot:
        before = pilot.arm._q.copy()
        pilot.page.say(name="jog", direction=1.0, press=90)
        assert "reload it" in pilot.look(0.2)["message"]
        for number, stamp in enumerate((-1.0, 1e300, float("nan"), "now", True, None)):
            pilot.page.say(name="jog", direction=1.0, press=100 + number, seen=stamp, picture=stamp)
            assert pilot.look(0.1)["level"] == "refusal"
        pilot.page.say(name="jog", direction=1.0, press=110, seen=pilot._seen, picture=None)
        assert "no picture yet" in pilot.look(0.2)["message"]
        old = pilot._state["stamp"] - 0.7
        pilot.page.say(name="jog", direction=1.0, press=91, seen=pilot._seen, picture=old)
        assert "the picture on the page is stale" in pilot.look(0.2)["message"]
        assert (pilot.arm._q == before).all()


@pytest.mark.parametrize("fault", ["other", "reverse"])
@pytest.mark.parametrize("late", ["the session", "the thread that reads the arm"])
def test_an_arm_behind_a_line_goes_a_degree_at_most_however_late_a_thread_is(fault, late, monkeypatch):
    with Pilot(line=True) as pilot:
        pilot.hold(0.5)
        rng = np.random.default_rng(1)
        arm = pilot.session.arm
        owner, name = (pilot.session, "tick") if late == "the session" else (arm, "_exchange")
        work = getattr(owner, name)

        def working_late(*given):
            time.sleep(rng.uniform(0.1, 0.2))
            return work(*given)

        monkeypatch.setattr(owner, name, working_late)
        there = pilot.arm._q.copy()
        pilot.arm.fault = fault
        pilot.go_on(0.8)
        while not (pilot.arm._q != there).any():  # a press that lapsed on a busy machine is made again
            pilot.hold(0.5)
        assert np.abs(degrees(pilot.arm, there)).max() <= 1.0


# --- the supervisor alone ------------------------------------------------------------------------------------------


def driven(motion, seconds=2.0):
    """What a supervisor says of an arm told to turn its joint 0; ``motion(time)`` is how far each joint has gone."""
    watching = Supervisor(ROBOT, RATES)
    q = PROBLEM.start.copy()
    for k in range(round(seconds / STEP)):
        time_ = k * STEP
        q = PROBLEM.start + motion(time_)
        watching.read(q, time_)
        aim = q.copy()
        speed = np.zeros(ROBOT.dof)
        speed[0] = RATES[0]
        aim[0] += 0.1 * RATES[0]
        watching.told(aim, speed, q, time_)
        if watching.fault or watching.standing(time_):
            break
    return watching, time_


def along(first, second=0.0):
    return np.radians([first, second, 0.0, 0.0, 0.0, 0.0])


def test_an_arm_that_does_what_it_is_told_has_no_fault_however_its_readings_tremble():
    rng = np.random.default_rng(1)
    for speed in (1.0, 5.0, 10.0, 12.0):
        watching, _ = driven(lambda time_, v=speed: along(v * time_) + rng.normal(0.0, 4e-4, 6))
        assert watching.fault == ""
        assert watching.standing(2.0) is None


def test_a_joint_that_sags_slowly_by_half_a_degree_is_let_be_and_a_fast_one_is_not():
    assert driven(lambda time_: along(10.0 * time_, min(0.3 * time_, 0.5)))[0].fault == ""
    watching, when = driven(lambda time_: along(10.0 * time_, 10.0 * max(time_ - 1.0, 0.0)))
    assert "shoulder_pitch moved by" in watching.fault
    assert when <= 1.0 + 2.1 * STEP


@pytest.mark.parametrize("every", [5, 20])
def test_an_arm_that_goes_the_wrong_way_does_so_for_a_degree_at_most_however_often_the_key_is_let_go(every):
    watching = Supervisor(ROBOT, RATES)
    gone = 0.0
    k = 0
    while not watching.fault:
        assert gone <= 0.7
        time_ = k * STEP
        k = k + 1
        if k % every == 0:
            gone += 0.25
            q = PROBLEM.start + along(-gone)
            watching.told(q + along(1.0), along(10.0), q, time_)
        else:
            watching.stopped(time_)
        watching.read(PROBLEM.start + along(-gone), time_)
    assert "azimuth goes the wrong way" in watching.fault


def test_a_joint_that_is_faster_than_its_rate_allows_is_named():
    watching, when = driven(lambda time_: along(10.0 * min(time_, 1.0) + 40.0 * max(time_ - 1.0, 0.0)))
    assert "azimuth moves faster than 15.0 deg/s" in watching.fault
    assert when <= 1.2


def test_the_hostile_arm_of_these_tests_is_an_honest_one_without_a_fault():
    arm = HostileArm()
    arm.move(0, float(PROBLEM.start[0]) + 0.1)
    arm.advance(10.0)
    assert np.degrees(arm.read()[0] - PROBLEM.start[0]) == pytest.approx(np.degrees(0.1))
