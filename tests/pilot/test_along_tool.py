"""Driving the tool straight along its own axis."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.pilot.motion.leading import TOOL_SPEED
from rrtik_tests.pilot_session import ROBOT, WORLD, refused, session

STEP = 1.0 / 30.0


def hold(made, arm, direction, seconds, press=1):
    """Hold the command; where the tip was, and the configurations, shape (n, dof)."""
    rows = [arm.read()]
    for _ in range(round(seconds / STEP)):
        made.command("tool", made.time, direction=direction, press=press)
        arm.advance(STEP)
        made.see([], made.time + STEP)
        made.tick(made.time)
        rows.append(arm.read())
    made.command("release", made.time)
    return np.array(rows)


@pytest.mark.parametrize("speed", [1.0, 0.25])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_tip_goes_straight_along_the_tool_without_turning_as_fast_as_is_set_or_slower(direction, speed):
    made, arm = session()
    made.command("speed", 0.0, share=speed)
    begin = ROBOT.fk(arm.read())
    rows = hold(made, arm, direction, 1.0)
    tips = [begin.actInv(ROBOT.fk(row)) for row in rows]
    along = np.array([tip.translation[2] for tip in tips]) * direction
    assert 0.01 * speed < along[-1] <= TOOL_SPEED * speed * 1.1
    assert (np.diff(along) > -1e-6).all()
    assert max(np.linalg.norm(tip.translation[:2]) for tip in tips) < 2e-3
    assert max(np.linalg.norm(pin.log3(tip.rotation)) for tip in tips) < np.radians(0.5)
    assert not made.driving


def test_it_ends_before_it_touches_and_says_so():
    made, arm = session()
    rows = hold(made, arm, 1.0, 20.0)
    assert WORLD.motion_valid_batch(rows[:-1], rows[1:]).all()
    last = made.state
    made.command("tool", made.time, direction=1.0, press=2)
    assert refused(made, "no farther", "in the way"), last.answer
    assert (arm.read() == rows[-1]).all()


def test_a_tool_in_contact_is_not_driven_along_its_axis():
    made, arm = session()
    arm._q = ROBOT.posture("ready").copy()
    made.tick(0.01)
    made.state = replace(made.state, fault="")
    made.command("tool", 0.02, direction=1.0, press=1)
    assert refused(made, "no farther")
