"""Goals that are reached one after the other are a task, whose path leads through all of them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError, NotFoundError, ProblemError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.constraints.shorthands import inside, upright
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.model.goal import PoseGoal, PositionGoal
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.tasks import MoveTo, Straight, Task
from rrtik_ompl.world.world import World

START = np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])


def tour_of(goals, **constraints):
    return Task([MoveTo(goal) for goal in goals], **constraints)


@pytest.fixture(scope="module")
def world():
    post = Obstacle("post", Box([0.05, 0.05, 0.4]), [0.4, -0.3, 0.2])
    return World(load_robot("ur5"), Scene([post]))


def test_every_goal_is_reached_in_its_order(world):
    robot = world.robot
    turned = np.add(START, [0.9, 0.2, -0.3, 0.0, 0.0, 0.4])
    goals = [turned, PoseGoal(robot.fk(START + 0.3)), PositionGoal([0.3, 0.3, 0.5]), START]
    tour = tour_of(goals).plan(world, START, seed=3)
    assert tour.found, tour.reason
    rows = np.array([path.end for path in tour.paths])
    assert (tour.path.start == START).all()
    assert (rows[0] == turned).all()
    assert (rows[3] == START).all()
    assert goals[1].satisfied(robot, rows[1:2]).all()
    assert goals[2].satisfied(robot, rows[2:3]).all()
    assert len(tour.path) == 1 + sum(len(path) - 1 for path in tour.paths)
    assert tour.path.violations(world) == ()
    assert tour.path.proven_in(world)
    assert tour.path.proof.motions == len(tour.path) - 1
    assert (tour.require().waypoints == tour.path.waypoints).all()
    assert (tour_of(goals).plan(world, START, seed=3).path.waypoints == tour.path.waypoints).all()


def test_constraints_hold_on_the_whole_way_as_seen_from_the_start(world):
    robot = world.robot
    goals = [np.add(START, [0.8, 0, 0, 0, 0, 0]), np.add(START, [-0.5, 0, 0, 0, 0, 0])]
    column = int(np.argmax(np.abs(robot.fk(START).rotation[2])))  # the axis of the tip that stands upright there
    cup = upright(robot, "xyz"[column], tolerance_deg=5.0)
    tour = tour_of(goals, constraints=[cup]).plan(world, START, seed=1)
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
    assert tour.path.proven
    assert tour.proven
    with pytest.raises(ProblemError, match="start"):
        tour_of(goals, constraints=[inside(pose([9.0, 0.0, 0.0]), [0.1, 0.1, 0.1])]).plan(world, START)


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
        tour = tour_of([[angle, 0.1], [angle + 0.05, 0.25], start]).plan(world, start, seed=1)
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
    tour = tour_of([START + 0.1, PositionGoal([5.0, 0.0, 0.0])]).plan(world, START, seconds=5.0)
    assert (tour.found, tour.path, tour.proven) == (False, None, None)
    assert "stage 2" in tour.reason
    with pytest.raises(NotFoundError, match=r"no motion for the task: .*stage 2"):
        tour.require()


def test_the_path_of_a_task_is_as_proven_as_its_motions(world):
    tour = tour_of([START + 0.1, START]).plan(world, START, seed=1)
    through = tour.paths[1].with_waypoints([START + 0.1, [0.0, -1.6, 3.1, -0.2, 1.6, 0.0], START])
    doubtful = replace(tour, paths=(tour.paths[0], through.proved(world)))
    assert not doubtful.proven
    assert not doubtful.path.proven
    assert [gap.motion for gap in doubtful.path.proof.unproven] == [
        len(tour.paths[0]) - 1 + gap.motion for gap in doubtful.paths[1].proof.unproven
    ]
    bare = replace(tour, paths=tuple(path.with_waypoints(path.waypoints) for path in tour.paths))
    assert bare.path.proven


def test_a_tip_that_rests_has_a_path_of_one_waypoint(world):
    still = Task([Straight(to=world.robot.fk(START))]).plan(world, START, seed=1)
    assert len(still.require()) == 1
    assert still.path.proven


@pytest.mark.parametrize(
    ("goals", "said"),
    [
        ([], "needs at least one stage"),
        ([START, "upp"], "stage 2.*no posture .*'upp'.*did you mean 'up'"),
        ([START, None], "goal of MoveTo: expected a goal such as PoseGoal.*got NoneType"),
        ([START, [0.0, 1.0]], "stage 2.*6 joints"),
    ],
)
def test_bad_goals_are_one_line(world, goals, said):
    with pytest.raises(InputError, match=said) as caught:
        tour_of(goals).plan(world, START)
    assert "\n" not in str(caught.value)


def test_constraints_of_a_task_are_regions():
    with pytest.raises(InputError, match="each constraint of a task must be of type TaskRegion"):
        tour_of([START], constraints=["upright"])
