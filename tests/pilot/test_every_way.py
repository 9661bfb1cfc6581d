"""What arms do by every way of driving: those that err are stopped and named, honest ones only move."""

import numpy as np
import pytest

from bench.pilot.every_way import ERRS, WAYS, erring, good
from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.events import Level
from rrtik_ompl.pilot.session import Session
from rrtik_tests.pilot_session import PLACE, PROBLEM, ROBOT, seen_at
from rrtik_tests.sluggish_arm import SluggishArm

HELD = {"jog": {"direction": 1.0}, "lead": {}}
STEP = 1.0 / 30.0
SPEEDS = (1.0, 0.25, 0.05)
# By what an arm is sluggish: the least share of the speed that it is driven at.
SLUGGISH = {
    "not": ({}, 0.99),
    "late by 0.1 s": ({"late": 0.1}, 0.45),
    "late by 0.3 s": ({"late": 0.3}, 0.18),
    "coarse": ({"grain": 0.3}, 0.9),
    "late and coarse": ({"late": 0.1, "grain": 0.3}, 0.4),
    "sticky": ({"stick": 0.3}, 0.85),
    "slow": ({"slow": 0.3}, 0.25),
}


@pytest.mark.parametrize("fault", ERRS)
@pytest.mark.parametrize("way", WAYS)
def test_it_is_stopped_within_a_degree_and_half_a_second_and_named(way, fault):
    case = erring(way, fault)
    assert good(fault, case), case


def driven(arm, verb, speed, seconds=4.0):
    """Hold a command; the speed of the fastest joint [deg/s], and the session."""
    master = SimulatedArm(ROBOT, PROBLEM.start)
    made = Session(PROBLEM, arm, seed=1, master=master)
    made.see([seen_at(PLACE)], 0.0)
    made.command("speed", 0.0, share=speed)
    before = arm.links()

    for k in range(round(seconds / STEP)):
        made.see([], k * STEP)
        master._q = arm.read() + np.radians([2.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        made.command(verb, k * STEP, press=1, **HELD[verb])
        arm.advance(STEP)
        made.tick((k + 1) * STEP)

    return np.degrees(np.abs(arm.links() - before).max()) / seconds, made


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("verb", HELD)
@pytest.mark.parametrize("how", SLUGGISH)
def test_an_honest_arm_is_driven_at_the_speed_that_is_set_or_less_and_blamed_for_nothing(how, verb, speed):
    sluggish, least = SLUGGISH[how]
    reached, made = driven(SluggishArm(**sluggish), verb, speed)
    assert made.driving
    assert made.level is Level.NEWS, made.message
    # A coarse reading that is a grain too high lets a master's joint go a grain farther each time.
    most = 2.0 if verb == "lead" and "grain" in sluggish and speed < 1.0 else 1.01
    assert least * min(10.0 * speed, 3.0 if how == "slow" else 10.0) <= reached <= most * 10.0 * speed
