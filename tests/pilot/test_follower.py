"""Routes that are followed, lost and found again."""

import numpy as np
import pytest

from rrtik_ompl.model.path import JointPath
from rrtik_ompl.pilot.devices.arm import joint_rates
from rrtik_ompl.pilot.routes.follower import REACTION_SECONDS, Follower
from rrtik_tests.pilot_session import ROBOT

CORNERS = np.zeros((4, 6))
CORNERS[1:, 0], CORNERS[2:, 1], CORNERS[3:, 0] = 0.5, -0.4, 0.2


def follower():
    return Follower(JointPath.of(ROBOT, CORNERS), joint_rates(ROBOT))


def progress(following, *rows):
    """Of an arm that is at some configurations, one after the other."""
    found = []
    for q in rows:
        following, each = following.update(q)
        found.append(each)
    return found


def test_moves_are_followed_in_their_order_with_advice_in_time():
    rate = float(joint_rates(ROBOT)[0])
    half = np.array([0.25, 0, 0, 0, 0, 0])
    near = np.array([0.5 - 0.9 * rate * REACTION_SECONDS, 0, 0, 0, 0, 0])
    found = progress(follower(), CORNERS[0], half, near, CORNERS[1], CORNERS[2], CORNERS[3])
    assert [each.advice for each in found] == ["move", "move", "stop", "move", "move", "done"]
    assert [each.move for each in found] == [0, 0, 0, 1, 2, 3]
    assert found[1].share == pytest.approx(0.5)


def test_a_follower_is_a_value_that_stays_as_it_is():
    before = follower()
    after, _ = before.update(CORNERS[1])
    assert (before.current, after.current) == (0, 1)
    assert not before.done


def test_a_move_shorter_than_the_tolerance_has_to_be_made_all_the_same():
    rows = np.zeros((3, 6))
    rows[1:, 0] = np.radians(0.8)
    rows[2:, 1] = 0.5
    following = Follower(JointPath.of(ROBOT, rows), joint_rates(ROBOT))
    assert [each.move for each in progress(following, rows[0], rows[1])] == [0, 1]


def test_the_wrong_joint_or_the_wrong_way_is_lost_and_named():
    (wrong,) = progress(follower(), np.array([0.0, 0.1, 0, 0, 0, 0]))
    assert wrong.advice == "lost"
    assert ROBOT.joint_names[1] in wrong.fault
    for first in (-0.1, 0.6):
        (lost,) = progress(follower(), np.array([first, 0, 0, 0, 0, 0]))
        assert lost.advice == "lost"


def test_what_remains_is_what_will_be_made_each_joint_alone_from_where_the_others_are():
    following = follower()
    off = np.radians([0.0, 0.6, -0.5, 0.3, 0.0, 0.9])
    following, _ = following.update(CORNERS[0] + off)
    here = CORNERS[0] + off
    rest = following.rest(here)
    assert [move.joint for move in rest.moves()] == [move.joint for move in following.moves]
    turned = [ROBOT.joint_names.index(move.joint) for move in following.moves]
    still = np.setdiff1d(np.arange(6), turned)
    assert np.array_equal(rest.end[turned], CORNERS[-1][turned])
    assert np.array_equal(rest.end[still], here[still])
    following, _ = following.update(CORNERS[1] + off)
    back = following.back(CORNERS[1] + off)
    assert back.one_joint_at_a_time
    assert np.array_equal(back.end[still], here[still])


def test_the_way_back_is_the_way_reversed():
    following, _ = follower().update(CORNERS[1])
    here = CORNERS[1].copy()
    here[1] = -0.2
    following, _ = following.update(here)
    assert following.back(here).waypoints == pytest.approx(np.vstack([here, CORNERS[1], CORNERS[0]]))
    assert following.rest(here).waypoints == pytest.approx(np.vstack([here, CORNERS[2:]]))
