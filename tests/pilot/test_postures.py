"""Routes to named postures: of the robot, of the begin of the session, and kept ones."""

from itertools import pairwise

import numpy as np
import pytest

from rrtik_ompl.pilot.interlock import PROPOSED
from rrtik_ompl.pilot.postures import MAX_KEPT, named_postures
from rrtik_tests.pilot_session import PROBLEM, ROBOT, WORLD, arrived, drive_at, follow, refused, session


def test_stowed_comes_first_then_what_is_kept_then_the_other_postures_of_the_robot():
    made, _ = session()
    names = list(named_postures(made.means, made.state))
    assert names[:2] == ["stowed", "begin"]
    assert set(names) == {*ROBOT.postures, "begin"}


def test_the_arm_is_stowed_by_proven_moves_of_single_joints_and_comes_back_to_where_it_was_kept():
    made, arm = session()
    drive_at(made, 1.0)
    made.command("keep", 0.0)
    kept = arm.read()
    for name, goal in (("stowed", ROBOT.posture("stowed")), ("posture 1", kept)):
        made.command("posture", made.time, name=name)
        assert made.mode == PROPOSED, made.message
        assert f"to '{name}'" in made.message
        rows = made.route.path.waypoints
        assert (np.count_nonzero(np.diff(rows, axis=0), axis=1) == 1).all()
        assert all(WORLD.motion_proven(a, b) for a, b in pairwise(rows))
        made.command("accept", made.time)
        follow(made, arm, made.time)
        assert arrived(made)
        assert arm.read() == pytest.approx(goal, abs=1e-3)
    assert kept == pytest.approx(PROBLEM.start)


def test_a_posture_in_contact_an_unknown_one_and_the_present_one_lead_nowhere():
    made, _ = session()
    made.command("posture", 0.0, name="ready")
    assert refused(made, "no route to 'ready'", "overlap")
    made.command("posture", 0.0, name="sideways")
    assert refused(made, "posture", "sideways", "stowed")
    made.command("posture", 0.0, name="begin")
    assert made.message == "the arm is at 'begin'"
    assert made.mode != PROPOSED


def test_no_more_postures_are_kept_than_can_be_told_apart():
    made, _ = session()
    for _ in range(MAX_KEPT):
        made.command("keep", 0.0)
    assert f"'posture {MAX_KEPT}'" in made.message
    made.command("keep", 0.0)
    assert refused(made, "9 postures")
