"""Goals that are reached one after the other, as one path."""

import numpy as np
import pytest

from rrtik_ompl.catalog import load_robot
from rrtik_ompl.constraints.shorthands import upright
from rrtik_ompl.errors import InputError
from rrtik_ompl.goal import PoseGoal, PositionGoal
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.shapes import Box
from rrtik_ompl.tasks.through import plan_through
from rrtik_ompl.world import World

START = np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])


@pytest.fixture(scope="module")
def world():
    post = Obstacle("post", Box([0.05, 0.05, 0.4]), [0.4, -0.3, 0.2])
    return World(load_robot("ur5"), Scene([post]))


def test_every_goal_is_reached_in_its_order(world):
    robot = world.robot
    turned = np.add(START, [0.9, 0.2, -0.3, 0.0, 0.0, 0.4])
    goals = [turned, PoseGoal(robot.fk(START + 0.3)), PositionGoal([0.3, 0.3, 0.5]), START]
    tour = plan_through(world, START, goals, seed=3)
    assert tour.found, tour.reason
    rows = tour.path.waypoints[list(tour.reached)]
    assert (tour.path.start == START).all()
    assert (rows[0] == turned).all()
    assert (rows[3] == START).all()
    assert goals[1].satisfied(robot, rows[1:2]).all()
    assert goals[2].satisfied(robot, rows[2:3]).all()
    assert list(tour.reached) == sorted(tour.reached)
    assert tour.reached[-1] == len(tour.path.waypoints) - 1
    assert tour.path.violations(world) == ()
    assert (plan_through(world, START, goals, seed=3).path.waypoints == tour.path.waypoints).all()


def test_constraints_hold_on_the_whole_way_as_seen_from_the_start(world):
    robot = world.robot
    goals = [np.add(START, [0.8, 0, 0, 0, 0, 0]), np.add(START, [-0.5, 0, 0, 0, 0, 0])]
    column = int(np.argmax(np.abs(robot.fk(START).rotation[2])))  # the axis of the tip that stands upright there
    cup = upright(robot, "xyz"[column], tolerance_deg=5.0)
    tour = plan_through(world, START, goals, constraints=[cup], seed=1)
    assert tour.found, tour.reason
    rows = np.vstack(
        [
            a + np.linspace(0, 1, 50)[:, None] * (b - a)
            for a, b in np.lib.stride_tricks.sliding_window_view(tour.path.waypoints, 2, axis=0).transpose(0, 2, 1)
        ]
    )
    axis = robot.fk_batch(rows)[:, :3, column]
    tilt = np.degrees(np.arccos(np.clip(axis @ axis[0], -1.0, 1.0)))
    assert tilt.max() <= 5.2


def test_a_goal_out_of_reach_is_named(world):
    tour = plan_through(world, START, [START + 0.1, PositionGoal([5.0, 0.0, 0.0])], seconds=5.0)
    assert (tour.found, tour.path, tour.reached) == (False, None, ())
    assert "stage 2" in tour.reason


@pytest.mark.parametrize(
    ("goals", "error", "said"),
    [
        ([], InputError, "there is none; give at least one"),
        ("up", InputError, "goals to be reached in order must be a list, got str"),
        ([START, "upp"], InputError, "stage 2.*no posture .*'upp'.*did you mean 'up'"),
        (START, InputError, r"this is one configuration; put it into a list: \[q\]"),
        ([START, None], InputError, "goal of MoveTo: expected a goal such as PoseGoal.*got NoneType"),
        ([START, [0.0, 1.0]], InputError, "stage 2.*6 joints"),
    ],
)
def test_bad_goals_are_one_line(world, goals, error, said):
    with pytest.raises(error, match=said) as caught:
        plan_through(world, START, goals)
    assert "\n" not in str(caught.value)
