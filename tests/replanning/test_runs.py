"""Whole runs: the robot arrives, waits, evades, catches what moves, and touches nothing."""

from __future__ import annotations

import subprocess
import sys
from itertools import groupby

import numpy as np
import pinocchio as pin
import pytest

from rrtik_bench.moving_scenes import moving_problem
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.goal import PositionGoal
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, PointCloud, Prism, Sphere
from rrtik_ompl.replanning.evading import evasion
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.settings import PLANNERS
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.moving_plane import FAST, OPTIONS, box, crossing, place, plane
from rrtik_tests.run_judge import judged


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_arrives_without_contact(planner):
    problem = crossing()
    run = replan(problem, planner=planner, seed=1, speed_bound=3.0, **OPTIONS)
    assert run.found
    assert run.count("repair") > 0
    assert run.configurations[-1] == pytest.approx(problem.goal.q, abs=1e-6)
    judged(run, problem)
    assert np.linalg.norm(np.diff(run.configurations, axis=0), axis=1).max() <= 0.5 + 1e-9


def test_the_same_seed_gives_the_same_run():
    runs = [replan(crossing(), seed=5, **OPTIONS) for _ in range(2)]
    assert (runs[0].configurations == runs[1].configurations).all()
    assert [t.event for t in runs[0].ticks] == [t.event for t in runs[1].ticks]


def test_a_robot_walks_while_things_move_elsewhere():
    run = replan(plane(box("far", 10.0, 18.0, 1.0, 1.0, ConstantVelocity([0.05, 0.0, 0.0]))), **OPTIONS)
    assert run.found
    assert run.count("wait") == run.count("repair") == 0
    assert run.length == pytest.approx(18.0)


def test_a_covered_goal_is_waited_for():
    over, away = place(19.0, 10.0), place(10.0, 3.0)
    motion = TimedPoses([0.0, 0.5, 0.8, 4.0, 4.3], [away, away, over, over, away])
    problem = plane(Obstacle("lid", Box([2.0, 2.0, 1.0]), away, motion))
    run = replan(problem, **OPTIONS)
    events = [
        event for event, _ in groupby("go" if t.event in ("plan", "walk", "repair") else t.event for t in run.ticks)
    ]
    assert events == ["go", "wait", "go", "arrive"]
    assert next(t.reason for t in run.ticks if t.event == "wait") == "the goal is not free"
    assert 4.0 < run.ticks[-1].time < 8.0


@pytest.mark.parametrize(
    ("budget", "reason"), [(30.0, "there is no path"), (1e-9, "no path within repair_budget, 1e-09 s a tick")]
)
def test_a_search_that_was_cut_short_does_not_say_that_there_is_no_path(budget, reason):
    problem = plane(box("wall", 10.0, 10.0, 1.0, 20.0))
    run = replan(problem, **(OPTIONS | {"repair_budget": budget, "seconds": 0.2}))
    assert {tick.reason for tick in run.ticks} == {reason}


def test_an_obstacle_that_comes_too_near_is_evaded():
    lid = box("lid", 19.0, 7.5, 2.0, 2.0, TimedPoses([0.0, 0.9], [place(19.0, 7.5), place(19.0, 10.0)]))
    chaser = box("chaser", 8.0, 3.0, 2.0, 2.0, TimedPoses([0.0, 6.0], [place(8.0, 3.0), place(17.0, 10.0)]))
    run = replan(plane(lid, chaser, start=(14.0, 10.0)), speed_bound=3.0, margin=0.1, seconds=7.0, **OPTIONS)
    assert run.outcome == "out of time"
    assert run.count("evade") > 0


def test_a_robot_between_two_obstacles_that_close_in_leaves_sideways():
    inwards = {side: ConstantVelocity([-0.5 * side, 0, 0]) for side in (-1, 1)}
    walls = [box(f"wall{side}", 10.0 + 1.2 * side, 10.0, 2.0, 8.0, motion) for side, motion in inwards.items()]
    problem = plane(*walls, start=(10.0, 13.0))
    scene, ticks = problem.world.scene, 4
    near, q, rng = MovingWorld(problem.world, self_collision=False), problem.start, np.random.default_rng(0)

    def ahead(ticks):
        near.move(scene.at(0.1 * ticks))
        return near

    way = evasion(
        q, None, step=0.5, max_change=np.full(2, 0.5), distance=0.5, ahead=ahead,
        alone=World(problem.robot, Scene()), rng=rng,
    ) - q  # fmt: skip
    assert abs(way[1]) > 2.0 * abs(way[0])
    assert World(problem.robot, scene.at(0.1 * ticks)).valid(q + ticks * way)


def test_a_robot_that_is_nearer_than_it_may_be_leaves_also_where_a_first_step_gains_little():
    wall = box("wall", 12.0, 10.0, 2.0, 40.0)
    problem = plane(wall, start=(10.0, 10.0))
    near, q = MovingWorld(problem.world, self_collision=False), problem.start

    def ahead(ticks):  # the margin that is wanted is more than what is left, and the wall may come
        near.move(problem.world.scene, inflation={"wall": 1.5 + 0.2 * ticks})
        return near

    assert near.clearance(q[None])[0] > 0.0 > ahead(0).clearance(q[None])[0]
    way = evasion(
        q, None, step=0.01, max_change=np.full(2, 0.01), distance=1.5, ahead=ahead,
        alone=World(problem.robot, Scene()), rng=np.random.default_rng(0),
    ) - q  # fmt: skip
    assert way[0] < -0.9 * 0.01


@pytest.mark.parametrize("shut", [False, True])
def test_a_cloud_that_closes_in_is_evaded_before_it_is_too_near(shut):
    around = np.random.default_rng(0).normal(size=(500, 3))
    ball = around / np.linalg.norm(around, axis=1, keepdims=True)
    walls = [box(f"wall{x}", x, 13.0, 0.2, 2.0) for x in (7.0, 9.0)] + [box(f"lid{y}", 8, y, 2, 0.2) for y in (12, 14)]

    def seen(time):
        cloud = Obstacle("seen", PointCloud(ball + np.array([9.4 - 0.4 * time, 10, 0]), 0.02))
        return Scene([cloud, *(walls if shut else ())])  # there is no path to what is shut up

    problem = Problem(World(plane().robot, seen(0.0), motion_resolution=0.05), [8.0, 10.0], [8.0, 13.0])
    slow = OPTIONS | {"step": 0.05, "max_edge": 0.2}
    run = replan(problem, seen, speed_bound=0.4, seconds=3.0, **slow)
    if shut:
        first = next(tick for tick in run.ticks if tick.event == "evade")
        left = World(problem.robot, seen(first.time)).clearance(first.q)
        assert left > 2.0 * 0.4 / 10.0  # farther than the cloud goes within two ticks
    else:
        assert run.count("walk") > 20
    assert all(World(problem.robot, seen(tick.time)).clearance(tick.q) > 0.02 for tick in run.ticks)
    judged(run, problem)


def test_an_arm_that_waits_for_its_goal_is_not_caught_between_obstacles():
    before = moving_problem(load_robot("ur5"), 20, 0.2, 922, seconds=20.0)
    scene, q = before.world.scene.at(1.78), [-0.756, -0.719, -0.34, 0.668, -1.135, -0.415]
    problem, keep = (
        Problem(World(before.robot, scene), q, q),
        {"margin": 0.02, "speed_bound": 0.2, "repair_budget": 30.0},
    )
    run = replan(problem, step=0.05, rate=50.0, seconds=1.2, goal_feed=lambda time: before.goal.q, seed=1, **keep)
    assert run.count("evade") > 0
    judged(run, problem)


def test_a_moving_goal_is_caught():
    run = replan(
        plane(box("block", 10.0, 10.0)), goal_feed=lambda t: np.array([16.0, 8.0 + 2.0 * min(t, 3.0)]), **OPTIONS
    )
    assert run.found
    assert run.configurations[-1] == pytest.approx([16.0, 8.0 + 2.0 * min(run.ticks[-2].time, 3.0)])


def test_another_branch_is_taken_where_the_goal_configuration_is_blocked():
    robot = load_robot("planar", parameters={"lengths": [1.0, 1.0], "radius": 0.01})
    pole = [(-0.08, -0.08), (0.08, -0.08), (0.08, 0.08), (-0.08, 0.08)]
    poles = [
        Obstacle(name, Prism(pole), place(*p), TimedPoses([0.0, 0.3], [place(*p), place(*q)]))
        for name, p, q in (("first", (2.5, 2.0), (0.99, 0.7)), ("far", (3.0, -2.5), (3.0, -2.0)))
    ]
    problem = Problem(World(robot, Scene(poles)), [0.0, 0.4], PositionGoal([1.0, 1.2, 0.0], 1e-3))
    run = replan(problem, step=0.05, rate=20.0, max_edge=0.3, seconds=20.0, repair_budget=30.0, limits=FAST)
    assert run.found
    assert problem.goal.satisfied(robot, run.configurations[-1:])[0]


def test_predicted_places_are_heeded():
    problem = crossing(3.0)
    plain, ahead = (replan(problem, lookahead_ticks=k, seed=2, **OPTIONS) for k in (0, 20))
    assert plain.found
    assert ahead.found
    assert (plain.configurations[:5] != ahead.configurations[:5]).any()


def test_a_six_joint_arm_arrives_among_wandering_obstacles_without_contact():
    problem = moving_problem(load_robot("titan4"), 8, 0.1, 2, seconds=12.0)
    run = replan(problem, step=0.04, rate=25.0, margin=0.02, speed_bound=0.1, seconds=20.0, repair_budget=30.0)
    assert run.found
    judged(run, problem)


def test_replanning_needs_no_ompl():
    code = "import sys, rrtik_ompl.replanning; print('ompl' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def base_and_ball(*, moves=False):
    """UR5 and a ball that stands in its base, or gets there after half a second."""
    robot = load_robot("ur5")
    far, near = (pin.SE3(np.eye(3), np.array([x, 0.0, 0.03])) for x in (-1.2, -0.08))
    motion = TimedPoses([0.4, 0.5, 0.9, 1.0], [far, near, near, far]) if moves else None
    return robot, Scene([Obstacle("ball", Sphere(0.06), far if moves else near, motion)])


def test_nothing_is_free_while_an_obstacle_stands_in_the_base():
    robot, scene = base_and_ball(moves=True)
    world = World(robot, scene)
    moving = MovingWorld(world, copies=2)
    rows = np.random.default_rng(0).uniform(-1.5, 1.5, (50, robot.dof))
    before = moving.valid_batch(rows)
    assert before.any()
    assert moving.blocked == ""
    moving.move(scene.at(0.6), scene.at(0.6))
    assert "'ball'" in moving.blocked
    assert "base" in moving.blocked
    assert not moving.valid_batch(rows).any()
    assert not moving.motion_valid_batch(rows, rows).any()
    assert moving.fast is None
    assert not World(robot, scene.at(0.6)).valid_batch(rows).any()
    moving.move(scene.at(0.0), scene.at(0.6))
    assert moving.blocked == ""  # that place is only foreseen
    moving.move(scene.at(0.0))
    assert (moving.valid_batch(rows) == before).all()


@pytest.mark.parametrize("lookahead_ticks", [0, 10])
def test_a_run_waits_while_an_obstacle_stands_in_the_base_and_says_so(lookahead_ticks):
    robot, scene = base_and_ball(moves=True)
    q = robot.clamp([0.0, -1.2, 0.9, -1.2, -1.5, 0.0])
    problem = Problem(World(robot, scene), q, q + np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    run = replan(problem, step=0.01, rate=50, lookahead_ticks=lookahead_ticks, seconds=10.0)
    waits = [t for t in run.ticks if t.event == "wait"]
    assert run.found
    assert waits
    assert all("'ball'" in t.reason and "base" in t.reason and 0.4 < t.time < 1.0 for t in waits)


def test_a_run_that_begins_with_an_obstacle_in_the_base_is_refused_in_one_line():
    robot, scene = base_and_ball()
    q = robot.clamp([0.0, -1.2, 0.9, -1.2, -1.5, 0.0])
    problem = Problem(World(robot), q, q + 0.3)
    with pytest.raises(InputError, match=r"in collision: .*'ball'") as error:
        replan(problem, scene, step=0.01, rate=50)
    assert "\n" not in str(error.value)
