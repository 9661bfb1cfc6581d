"""Goals that are reached one after the other, as one path."""

from itertools import pairwise

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.shorthands import upright
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.model.goal import PoseGoal, PositionGoal
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.tasks.through import plan_through
from rrtik_ompl.world.world import World

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


def test_goals_behind_which_a_continuous_joint_went_the_other_way_round_are_joined_without_a_jump():
    links = '<link name="base"/><link name="tip"/><link name="arm"><collision><origin xyz="0.3 0 0"/>'
    links += '<geometry><box size="0.5 0.04 0.04"/></geometry></collision></link>'
    turn = '<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>'
    lift = '<joint name="lift" type="prismatic"><parent link="arm"/><child link="tip"/><origin xyz="0.55 0 0"/>'
    lift += '<axis xyz="0 0 1"/><limit lower="0" upper="0.3" effort="10" velocity="1"/></joint>'
    robot = robot_from_urdf_text(f'<robot name="swing">{links}{turn}{lift}</robot>')
    wall = Obstacle("wall", Box([0.2, 0.1, 0.5]), [0.0, 0.4, 0.0])  # in the short way of every motion across it
    world, start = World(robot, Scene([wall])), [0.0, 0.1]
    for angle in np.linspace(2.2, 3.1, 19):
        tour = plan_through(world, start, [[angle, 0.1], [angle + 0.05, 0.25], start], seed=1)
        assert tour.found, tour.reason
        rows = tour.path.waypoints
        dense = np.vstack([a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a) for a, b in pairwise(rows)])
        corners = np.array([[0.05, -0.02], [0.05, 0.02], [0.55, -0.02], [0.55, 0.02]])  # of the arm, seen from above
        cosine, sine = np.cos(dense[:, :1]), np.sin(dense[:, :1])
        beside = np.abs(cosine * corners[:, 0] - sine * corners[:, 1])
        ahead = sine * corners[:, 0] + cosine * corners[:, 1]
        assert not ((beside < 0.1) & (ahead > 0.35)).any()
        assert tour.path.proven


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
