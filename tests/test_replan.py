"""Replanning: the path is cut from both sides and reconnected, the robot waits, evades, arrives; bad input; records."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from itertools import groupby

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.catalog import load_robot
from rrtik_ompl.collision.contacts import measured
from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.goal import PositionGoal
from rrtik_ompl.problem import Problem
from rrtik_ompl.replanning import PLANNERS, SpeedWarning, load_run, replan
from rrtik_ompl.replanning.connecting import KernelConnect, PlainConnect, Tree, never
from rrtik_ompl.replanning.contact_check import check_contacts
from rrtik_ompl.replanning.drrt_con import DrrtCon, FromScratch, points_along, sequential_cut, without_points_between
from rrtik_ompl.replanning.evading import evasion
from rrtik_ompl.replanning.generate import moving_problem, moving_scene
from rrtik_ompl.replanning.single_tree import trimmed
from rrtik_ompl.replanning.walking import one_step, to_first_corner
from rrtik_ompl.scene import ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.shapes import Box, HalfSpace, Prism, Sphere
from rrtik_ompl.trajectory.limits import RateLimits
from rrtik_ompl.world import World
from rrtik_ompl.world.moving_world import MovingWorld

FAST = RateLimits([1e3, 1e3], [1e3, 1e3])
OPTIONS = {"step": 0.5, "rate": 10.0, "max_edge": 1.0, "repair_budget": 30.0, "limits": FAST}
LOW, HIGH = np.zeros(2), np.full(2, 20.0)


def place(x, y):
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


def box(name, x, y, wide=4.0, high=4.0, motion=None):
    return Obstacle(name, Box([wide, high, 1.0]), place(x, y), motion)


def plane(*obstacles, start=(1.0, 10.0), goal=(19.0, 10.0)):
    robot = load_robot("point2d", radius=0.0, bounds=[[0, 20], [0, 20]])
    return Problem(World(robot, Scene(obstacles), motion_resolution=0.05), start, goal, name="plane")


class Scripted:
    """A judge in the plane: a disc that is not free, and counts of the calls."""

    def __init__(self, centre, radius):
        self.centre, self.radius, self.calls = np.array(centre, dtype=float), radius, 0

    def valid_batch(self, Q):
        return np.linalg.norm(Q - self.centre, axis=1) > self.radius

    def motion_valid_batch(self, A, B):
        self.calls += 1
        way = B - A
        share = ((self.centre - A) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300)
        foot = A + np.clip(share, 0.0, 1.0)[:, None] * way
        return np.linalg.norm(foot - self.centre, axis=1) > self.radius


def on_straight_path(length=20.0):
    """DRRT-Con with a straight path along y = 10, found while nothing was in its way."""
    planner = DrrtCon(PlainConnect(LOW, HIGH, 1.0, seed=3), 1.0)
    assert planner.begin(np.array([0.0, 10.0]), np.array([[length, 10.0]]), Scripted((0, 0), 0.1))
    return planner


def test_a_blocked_path_keeps_its_beginning_and_its_end():
    planner, judge_ = on_straight_path(), Scripted((10.0, 10.0), 2.0)
    assert not planner.look(judge_)
    assert planner.repair(judge_)
    assert planner.look(judge_)
    kept = planner.path[np.abs(planner.path[:, 1] - 10.0) < 1e-12]
    assert kept[:, 0].min() == 0.0
    assert kept[:, 0].max() == 20.0
    assert (kept[:, 0] > 2.0).any()
    assert np.abs(planner.path[:, 1] - 10.0).max() > 1.5


def test_a_look_asks_once_for_all_motions():
    planner, judge_ = on_straight_path(), Scripted((10.0, 17.0), 1.0)
    assert planner.look(judge_)
    assert judge_.calls == 1


def test_where_no_way_is_found_the_path_is_kept_and_serves_again_without_a_search():
    planner, lid = on_straight_path(), Scripted((20.0, 10.0), 2.0)
    assert not planner.look(lid)
    assert not planner.repair(lid)
    drawn = planner.connect.samples
    assert planner.path is not None
    assert planner.look(Scripted((20.0, 17.0), 2.0))
    assert planner.connect.samples == drawn


def test_from_scratch_forgets_the_pieces():
    planner = FromScratch(PlainConnect(LOW, HIGH, 1.0, seed=3), 1.0)
    planner.begin(np.array([0.0, 10.0]), np.array([[20.0, 10.0]]), Scripted((0, 0), 0.1))
    judge_ = Scripted((10.0, 10.0), 2.0)
    planner.look(judge_)
    assert planner.repair(judge_)
    assert judge_.motion_valid_batch(planner.path[:-1], planner.path[1:]).all()


@pytest.mark.parametrize("kind", ["plain", "kernel"])
def test_both_searches_join_two_pieces_of_a_path(kind):
    world = MovingWorld(plane(box("wall", 10.0, 10.0, 2.0, 12.0)).world)
    connect = PlainConnect(LOW, HIGH, 1.0, 5) if kind == "plain" else KernelConnect(world, LOW, HIGH, 1.0, 5)
    first = np.array([[1.0, 10.0], [4.0, 10.0], [8.0, 10.0]])
    second = np.array([[12.0, 10.0], [15.0, 10.0], [19.0, 10.0]])
    found = connect(first, second, world, never)
    assert (found.path[0] == first[0]).all()
    assert (found.path[-1] == second[-1]).all()
    assert world.motion_valid_batch(found.path[:-1], found.path[1:]).all()
    assert any((found.path[found.begin] == row).all() for row in first)
    assert any((found.path[found.end] == row).all() for row in second)


def test_the_sequential_cut_shortens_and_keeps_both_ends():
    judge_ = Scripted((10.0, 10.0), 2.0)
    zigzag = np.array([[0.0, 10.0], [3.0, 14.0], [6.0, 12.0], [9.0, 16.0], [12.0, 13.0], [16.0, 15.0], [20.0, 10.0]])
    cut = sequential_cut(zigzag, 0.5, judge_)
    assert (cut[[0, -1]] == zigzag[[0, -1]]).all()
    assert judge_.motion_valid_batch(cut[:-1], cut[1:]).all()
    assert np.linalg.norm(np.diff(cut, axis=0), axis=1).sum() < 23.0


def test_points_along_a_path_are_dense_and_fall_away_again():
    path = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0]])
    dense = points_along(path, 0.5)
    assert np.linalg.norm(np.diff(dense, axis=0), axis=1).max() <= 0.5 + 1e-9
    assert without_points_between(dense) == pytest.approx(path)


def test_a_step_goes_round_corners_or_stops_at_them_and_keeps_the_limits():
    path = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 5.0]])
    place_, passed = one_step(path, 0.5, np.array([9.0, 9.0]))
    assert place_ == pytest.approx([0.3, 0.2])
    assert passed == 1
    assert to_first_corner(path, 0.5, np.array([9.0, 9.0]))[0] == pytest.approx([0.3, 0.0])
    slow, _ = one_step(path, 0.5, np.array([0.1, 9.0]))
    assert slow == pytest.approx([0.1, 0.0])


def test_trimming_cuts_off_what_hangs_on_a_blocked_edge():
    tree = Tree(np.array([[0.0, 0.0]]))
    a = tree.add(np.array([5.0, 0.0]), 0)
    tree.add(np.array([9.0, 0.0]), a)
    tree.add(np.array([0.0, 5.0]), 0)
    left = trimmed(tree, Scripted((3.0, 0.0), 0.5))
    assert np.array(left.rows).tolist() == [[0.0, 0.0], [0.0, 5.0]]


# The world that moves -----------------------------------------------------------------------------------------------
def arm_scenes():
    robot = load_robot("titan4")
    shapes = [Sphere(0.1), Box([0.2, 0.1, 0.3]), Prism([(0, 0), (0.3, 0), (0, 0.3)], 0.2), HalfSpace([0, 0, 1], -1.2)]
    rng = np.random.default_rng(4)
    scenes = []
    for _ in range(3):
        places = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-1.5, 1.5, 3)) for _ in shapes[:3]]
        poses = [*places, pin.SE3(np.eye(3), np.array([0.0, 0.0, rng.uniform(-0.2, 0.2)]))]
        scenes.append(Scene([Obstacle(f"o{k}", s, p) for k, (s, p) in enumerate(zip(shapes, poses, strict=True))]))
    return robot, scenes


def test_a_moved_world_answers_as_a_new_one():
    robot, scenes = arm_scenes()
    moving = MovingWorld(World(robot, scenes[0]))
    rng = np.random.default_rng(1)
    rows = rng.uniform(*robot.finite_range(), (1500, robot.dof))
    ends = np.clip(rows + 0.2 * rng.normal(size=rows.shape), robot.lower, robot.upper)
    for scene in scenes[1:]:
        moving.move(scene)
        fresh = World(robot, scene, accuracy="conservative")
        assert (moving.valid_batch(rows) == fresh.valid_batch(rows)).all()
        assert (moving.motion_valid_batch(rows, ends) == fresh.motion_valid_batch(rows, ends)).all()
        assert 0.0 < moving.valid_batch(rows).mean() < 1.0


def test_free_with_room_means_that_far_away():
    robot, scenes = arm_scenes()
    exact, moving = World(robot, scenes[1]), MovingWorld(World(robot, scenes[0]))
    rows = np.random.default_rng(2).uniform(*robot.finite_range(), (150, robot.dof))
    moving.move(scenes[1], rooms={o.name: 0.15 for o in scenes[1].obstacles})
    near = MovingWorld(exact, self_collision=False)
    names = set(moving.names)
    for row in rows[moving.valid_batch(rows)][:40]:
        frames = exact.robot.joint_frames(row[None])[0]
        found = measured(exact.bodies, exact.pairs, frames, near_only=False)
        gaps = [c.distance for c in found if {c.first, c.second} & names]
        assert min(gaps) >= 0.15
    near.move(scenes[1])
    assert (near.clearance(rows[moving.valid_batch(rows)]) >= 0.15 - 1e-4).all()


def test_a_moved_scene_must_have_the_same_obstacles():
    moving = MovingWorld(plane(box("a", 5.0, 10.0)).world)
    moving.move(Scene([box("a", 6.0, 10.0)]), rooms={"a": 0.0})  # made anew, but alike
    with pytest.raises(InputError, match="expected the obstacles a"):
        moving.move(Scene([box("b", 5.0, 10.0)]))
    with pytest.raises(InputError, match="'a' has another shape"):
        moving.move(Scene([Obstacle("a", Sphere(3.0))]))
    with pytest.raises(InputError, match="no obstacle 'c'"):
        moving.move(moving.scene, rooms={"c": 0.1})
    for room in (-0.1, float("nan")):
        with pytest.raises(InputError, match="'a' must be 0 metres or more"):
            moving.move(moving.scene, rooms={"a": room})


def test_copies_of_an_obstacle_count_as_well():
    problem = plane(box("a", 5.0, 10.0))
    moving = MovingWorld(problem.world, copies=2)
    ahead = Scene([box("a", 12.0, 10.0)])
    moving.move(problem.world.scene, ahead)
    assert not moving.valid([5.0, 10.0])
    assert not moving.valid([12.0, 10.0])
    moving.move(problem.world.scene)
    assert moving.valid([12.0, 10.0])


# Runs ---------------------------------------------------------------------------------------------------------------
def crossing(speed=3.0):
    """A box that crosses the straight way."""
    return plane(box("lift", 10.0, 16.0, 3.0, 3.0, ConstantVelocity([0.0, -speed, 0.0])))


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_arrives_without_contact(planner):
    problem = crossing()
    run = replan(problem, planner=planner, seed=1, speed_bound=3.0, **OPTIONS)
    assert run.arrived
    assert run.count("repair") > 0
    assert run.configurations[-1] == pytest.approx(problem.goal.q, abs=1e-6)
    assert check_contacts(problem.robot, run, problem.world.scene).contacts == ()
    assert np.linalg.norm(np.diff(run.configurations, axis=0), axis=1).max() <= 0.5 + 1e-9


def test_the_same_seed_gives_the_same_run():
    runs = [replan(crossing(), seed=5, **OPTIONS) for _ in range(2)]
    assert (runs[0].configurations == runs[1].configurations).all()
    assert [t.event for t in runs[0].ticks] == [t.event for t in runs[1].ticks]


def test_a_robot_walks_while_things_move_elsewhere():
    run = replan(plane(box("far", 10.0, 18.0, 1.0, 1.0, ConstantVelocity([0.05, 0.0, 0.0]))), **OPTIONS)
    assert run.arrived
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


def test_an_obstacle_that_comes_too_near_is_evaded():
    lid = Obstacle(
        "lid", Box([2.0, 2.0, 1.0]), place(19.0, 3.0), TimedPoses([0.0, 0.1], [place(19.0, 3.0), place(19.0, 10.0)])
    )
    chaser = box("chaser", 8.0, 3.0, 2.0, 2.0, TimedPoses([0.0, 6.0], [place(8.0, 3.0), place(17.0, 10.0)]))
    with pytest.warns(SpeedWarning, match="'lid'"):
        run = replan(plane(lid, chaser, start=(14.0, 10.0)), speed_bound=3.0, margin=0.1, seconds=7.0, **OPTIONS)
    assert run.outcome == "out of time"
    assert run.count("evade") > 0


def test_a_robot_between_two_obstacles_that_close_in_leaves_sideways():
    inwards = {side: ConstantVelocity([-0.5 * side, 0, 0]) for side in (-1, 1)}
    walls = [box(f"wall{side}", 10.0 + 1.2 * side, 10.0, 2.0, 8.0, motion) for side, motion in inwards.items()]
    problem = plane(*walls, start=(10.0, 13.0))
    scene, ticks = problem.world.scene, 4
    near, q = MovingWorld(problem.world, self_collision=False), problem.start
    later, rng = (lambda ticks: scene.at(0.1 * ticks)), np.random.default_rng(0)
    way = evasion(
        q, None, step=0.5, max_change=np.full(2, 0.5), distance=0.5, near=near, later=later,
        alone=World(problem.robot, Scene()), rng=rng,
    ) - q  # fmt: skip
    assert abs(way[1]) > 2.0 * abs(way[0])
    assert World(problem.robot, scene.at(0.1 * ticks)).valid(q + ticks * way)


def test_an_arm_that_waits_for_its_goal_is_not_caught_between_obstacles():
    before = moving_problem(load_robot("ur5"), 20, 0.2, 922, seconds=20.0)
    scene, q = before.world.scene.at(1.78), [-0.756, -0.719, -0.34, 0.668, -1.135, -0.415]
    problem, keep = (
        Problem(World(before.robot, scene), q, q),
        {"margin": 0.02, "speed_bound": 0.2, "repair_budget": 30.0},
    )
    run = replan(problem, step=0.05, rate=50.0, seconds=1.2, goal_feed=lambda time: before.goal.q, seed=1, **keep)
    assert run.count("evade") > 0
    assert not check_contacts(problem.robot, run, scene, samples_per_tick=5).contacts


def test_a_moving_goal_is_caught():
    run = replan(
        plane(box("block", 10.0, 10.0)), goal_feed=lambda t: np.array([16.0, 8.0 + 2.0 * min(t, 3.0)]), **OPTIONS
    )
    assert run.arrived
    assert run.configurations[-1] == pytest.approx([16.0, 8.0 + 2.0 * min(run.ticks[-2].time, 3.0)])


def test_another_branch_is_taken_where_the_goal_configuration_is_blocked():
    robot = load_robot("planar", lengths=[1.0, 1.0], radius=0.01)
    pole = [(-0.08, -0.08), (0.08, -0.08), (0.08, 0.08), (-0.08, 0.08)]
    poles = [
        Obstacle(name, Prism(pole), place(*p), TimedPoses([0.0, 0.3], [place(*p), place(*q)]))
        for name, p, q in (("first", (2.5, 2.0), (0.99, 0.7)), ("far", (3.0, -2.5), (3.0, -2.0)))
    ]
    problem = Problem(World(robot, Scene(poles)), [0.0, 0.4], PositionGoal([1.0, 1.2, 0.0], 1e-3))
    run = replan(problem, step=0.05, rate=20.0, max_edge=0.3, seconds=20.0, repair_budget=30.0, limits=FAST)
    assert run.arrived
    assert problem.goal.satisfied(robot, run.configurations[-1:])[0]


def test_predicted_places_are_heeded():
    problem = crossing(3.0)
    plain, ahead = (replan(problem, lookahead_ticks=k, seed=2, **OPTIONS) for k in (0, 20))
    assert plain.arrived
    assert ahead.arrived
    assert (plain.configurations[:5] != ahead.configurations[:5]).any()


# Bad input ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rate": 0.0}, "rate must be greater than 0, got 0; give ticks a second"),
        ({"step": -1.0}, "step must be greater than 0"),
        ({"margin": -0.1}, "margin must not be negative"),
        ({"lookahead_ticks": 1.5}, "lookahead_ticks must be a whole number"),
        ({"speed_bound": 0.0}, "speed_bound must be greater than 0"),
        ({"seconds": float("nan")}, "seconds"),
        ({"max_edge": 1e-6}, "max_edge must be at least .* suits this robot"),
        ({"limits": RateLimits([1.0] * 3, [1.0] * 3)}, "limits: there are 2 joints, but limits for 3"),
        ({"clock": None}, "clock: expected a function"),
        ({"record": "run.txt"}, "unknown ending '.txt'; use .json"),
        ({"record": "no/such/folder/run.json"}, "does not exist; create it"),
    ],
)
def test_a_number_that_makes_no_sense_is_named(changes, words):
    with pytest.raises(InputError, match=words) as caught:
        replan(crossing(), **{**OPTIONS, **changes})
    assert "\n" not in str(caught.value)


def test_an_unknown_planner_is_answered_with_those_there_are():
    with pytest.raises(UnknownNameError, match="drrt-con"):
        replan(crossing(), planner="drrtcon", **OPTIONS)


def test_times_that_go_backwards_are_refused():
    scene = crossing().world.scene
    with pytest.raises(InputError, match=r"times go backwards: 0.3 s comes after 0.5 s"):
        replan(crossing(), [(0.0, scene), (0.5, scene), (0.3, scene)], **OPTIONS)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([5, 6], "expected pairs of a time"),
        ([(0.0, None)], "expected pairs of a time"),
        ([(float("nan"), Scene(()))], "expected pairs of a time"),
        (lambda time: None, "what it returns at 0 s must be of type Scene, got NoneType"),
    ],
)
def test_what_is_no_feed_is_refused(given, words):
    with pytest.raises(InputError, match=words):
        replan(crossing(), given, **OPTIONS)


@pytest.mark.parametrize(
    "later",
    [
        lambda lift: [],
        lambda lift: [lift, box("new", 5.0, 5.0)],
        lambda lift: [Obstacle("lift", Box([4.0, 9.0, 1.0]), lift.pose)],
    ],
)
def test_obstacles_that_come_go_or_grow_are_refused_and_the_record_is_kept(later, tmp_path):
    lift = box("lift", 10.0, 4.0)
    with pytest.raises(InputError, match=r"expected the obstacles lift|another shape than before"):
        replan(
            plane(lift), lambda t: Scene([lift] if t < 0.5 else later(lift)), record=tmp_path / "run.json", **OPTIONS
        )
    assert len(load_run(tmp_path / "run.json").ticks) == 5


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ([1.0, 2.0], "goal_feed: expected a function of time"),
        (lambda time: [1.0, 2.0, 3.0], "goal at 0 s: robot 'point2d' has 2 joints"),
        (lambda time: [16.0, 10.0 + 50.0 * time], r"goal at 0\.\d s: joint 'y' is at \d+ m, outside its limits"),
    ],
)
def test_a_moving_goal_that_is_none_is_refused(goal, words):
    with pytest.raises(InputError, match=words):
        replan(crossing(), goal_feed=goal, **OPTIONS)


def test_snapshots_are_a_feed_too():
    scene = crossing().world.scene
    run = replan(crossing(), ((0.1 * k, scene.at(0.1 * k)) for k in range(200)), **OPTIONS)
    assert run.arrived


def test_an_obstacle_that_begins_inside_the_robot_is_refused_with_its_name():
    hit = Scene([box("lift", 1.0, 10.0)])
    with pytest.raises(InputError, match=r"in collision: .*'lift'"):
        replan(crossing(), lambda _: hit, **OPTIONS)


def test_a_start_within_the_margin_says_what_to_lower():
    with pytest.raises(InputError, match="nearer to contact than the margin"):
        replan(plane(box("near", 1.0, 12.2)), margin=0.5, **OPTIONS)


def test_an_obstacle_faster_than_the_bound_is_warned_about_once():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        replan(crossing(2.0), speed_bound=1.0, **OPTIONS)
    said = [str(w.message) for w in caught if w.category is SpeedWarning]
    assert len(said) == 1
    assert "'lift' moves at 2 m/s" in said[0]
    assert "speed_bound of 1 m/s" in said[0]


def test_a_floor_that_slides_has_a_speed_like_any_obstacle():
    tilted, slid = (pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3])), np.array([x, 0.0, 0.0])) for x in (0.0, 4.0))
    floor = Obstacle("floor", HalfSpace([0.0, 1.0, 0.0], -5.0), tilted, TimedPoses([0.0, 8.0], [tilted, slid]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert replan(plane(floor), speed_bound=0.6, **OPTIONS).arrived
    with pytest.warns(SpeedWarning, match="'floor' moves at 0.5 m/s"):
        assert replan(plane(floor), speed_bound=0.4, **OPTIONS).arrived


# Records ------------------------------------------------------------------------------------------------------------
def test_a_record_reads_back_as_the_same_run(tmp_path):
    run = replan(crossing(), record=tmp_path / "run.json", **OPTIONS)
    again = load_run(tmp_path / "run.json")
    assert (again.configurations == run.configurations).all()
    assert again.figures() == run.figures()
    assert again.ticks[3].poses["lift"] == pytest.approx(run.ticks[3].poses["lift"])


def test_a_record_of_a_long_run_is_read_too(tmp_path):
    file = tmp_path / "run.json"
    replan(crossing(), record=file, **{**OPTIONS, "seconds": 0.5})
    with file.open("a") as record:
        record.write(" " * (65 * 2**20))
    assert len(load_run(file).ticks) == 6


def test_the_record_is_kept_when_the_run_is_interrupted(tmp_path):
    scene = crossing().world.scene

    def feed(time):
        if time > 1.0:
            raise KeyboardInterrupt
        return scene.at(time)

    with pytest.raises(KeyboardInterrupt):
        replan(crossing(), feed, record=tmp_path / "run.json", **OPTIONS)
    kept = load_run(tmp_path / "run.json")
    assert kept.outcome == "interrupted"
    assert len(kept.ticks) == 11


def test_a_run_interrupted_before_its_first_tick_leaves_no_record(tmp_path):
    scene, looks = crossing().world.scene, iter(range(9))

    def feed(_):
        if next(looks) == 2:
            raise KeyboardInterrupt
        return scene

    with pytest.raises(KeyboardInterrupt):
        replan(crossing(), feed, record=tmp_path / "run.json", **OPTIONS)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_record_is_refused(tmp_path):
    (tmp_path / "run.json").write_text('{"kind": "replan_run", "version": 1, "ticks": [{"time": 0}]}')
    with pytest.raises(InputError, match="not a whole record"):
        load_run(tmp_path / "run.json")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda record: record.update(ticks=[]), "no tick"),
        (lambda record: record.update(outcome="flew"), "no outcome 'flew'"),
        (lambda record: record["ticks"][1].update(event="jump"), "no event of a tick 'jump'"),
        (lambda record: record["ticks"][2].update(time=0.0), "times go backwards"),
        (lambda record: record["ticks"][2].update(time="x"), "time of a tick: expected numbers, got 'x'"),
        (lambda record: record["ticks"][1]["poses"].update(lift=[0.0] * 7), "'lift': quat_xyzw must have length 1"),
        (lambda record: record["ticks"][1]["seconds"].update(look="x"), "seconds of 'look': expected numbers"),
        (lambda record: record["ticks"][1].update(checked=0.5), "checked must be a whole number"),
        (lambda record: record.update(rate=0), "rate must be greater than 0"),
        (lambda record: record.update(problem=7), "problem must be of type str"),
    ],
)
def test_a_record_that_cannot_be_is_refused_with_its_name(tmp_path, change, words):
    file = tmp_path / "run.json"
    replan(crossing(), record=file, **{**OPTIONS, "seconds": 0.5})
    record = json.loads(file.read_text())
    change(record)
    file.write_text(json.dumps(record))
    with pytest.raises(InputError, match=f"run.json: .*{words}"):
        load_run(file)


# The judge and the generator ----------------------------------------------------------------------------------------
def test_the_judge_sees_contact_between_two_ticks():
    problem = plane(box("bullet", 10.0, 16.0, 1.0, 1.0, ConstantVelocity([0.0, -60.0, 0.0])), start=(10.0, 10.0))
    run = replan(problem, **{**OPTIONS, "seconds": 0.25, "step": 1e-3})
    found = check_contacts(problem.robot, run, problem.world.scene)
    assert found.contacts
    assert found.contacts[0][3] == "bullet"
    assert found.nearest == 0.0


def test_generated_obstacles_keep_to_their_speed_and_their_distance():
    robot = load_robot("titan4")
    scene = moving_scene(robot, 6, 0.1, 3, seconds=10.0)
    again = moving_scene(robot, 6, 0.1, 3, seconds=10.0)
    for obstacle, twin in zip(scene.obstacles, again.obstacles, strict=True):
        assert np.array_equal(obstacle.pose.homogeneous, twin.pose.homogeneous)
        at = [obstacle.motion.pose_at(obstacle.pose, t).translation for t in np.arange(0.0, 10.0, 0.05)]
        assert np.linalg.norm(np.diff(at, axis=0), axis=1).max() <= 0.1 * 0.05 * (1.0 + 1e-9)


def test_a_six_joint_arm_arrives_among_wandering_obstacles_without_contact():
    problem = moving_problem(load_robot("titan4"), 8, 0.1, 2, seconds=12.0)
    run = replan(problem, step=0.04, rate=25.0, margin=0.02, speed_bound=0.1, seconds=20.0, repair_budget=30.0)
    assert run.arrived
    assert check_contacts(problem.robot, run, problem.world.scene, samples_per_tick=3).contacts == ()


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
    assert run.arrived
    assert waits
    assert all("'ball'" in t.reason and "base" in t.reason and 0.4 < t.time < 1.0 for t in waits)


def test_a_run_that_begins_with_an_obstacle_in_the_base_is_refused_in_one_line():
    robot, scene = base_and_ball()
    q = robot.clamp([0.0, -1.2, 0.9, -1.2, -1.5, 0.0])
    problem = Problem(World(robot), q, q + 0.3)
    with pytest.raises(InputError, match=r"in collision: .*'ball'") as error:
        replan(problem, scene, step=0.01, rate=50)
    assert "\n" not in str(error.value)
