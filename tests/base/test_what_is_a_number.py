"""Truths, texts and more numbers than fit are no numbers; batches need little memory beyond their answers."""

import itertools
import os
import subprocess
import sys
import textwrap
from typing import Any

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.arrays import BLOCK_ROWS, MOST_NUMBERS, finite_array, in_blocks, number_rows, truths
from rrtik_ompl.base.errors import listed
from rrtik_ompl.motion.trajectory.cubics import places

ROBOT = rrtik.load_robot("planar3")
WORLD = rrtik.World(ROBOT)


def nothing() -> Any:
    """A function that takes nothing and gives nothing."""


HUGE = np.broadcast_to(0.0, (10**9, 3))
LIMITS = rrtik.RateLimits([1, 1, 1], [2, 2, 2])
PROBLEM = rrtik.Problem(WORLD, [0, 0, 0], [0.5, 0.2, 0])
PATH = rrtik.JointPath.of(ROBOT, [[0, 0, 0], [0.5, 0.2, 0]])

NO_NUMBERS = {
    "truth": True,
    "numpy's truth": np.True_,
    "array of a truth": np.array(True),
    "text": "0.1",
    "bytes": b"1",
}
TAKES_A_NUMBER = {
    "sphere": lambda x: rrtik.Sphere(x),
    "box": lambda x: rrtik.Box([1, 1, x]),
    "capsule": lambda x: rrtik.Capsule(x, 1),
    "capsule's length": lambda x: rrtik.Capsule(1, x),
    "cylinder": lambda x: rrtik.Cylinder(1, x),
    "half-space": lambda x: rrtik.HalfSpace([0, 0, 1], x),
    "normal": lambda x: rrtik.HalfSpace([0, 0, x]),
    "prism": lambda x: rrtik.Prism([[0, 0], [1, 0], [0, 1]], x),
    "cloud": lambda x: rrtik.PointCloud([[0, 0, 0]], x),
    "points": lambda x: rrtik.PointCloud([[0, 0, x]]),
    "heights": lambda x: rrtik.HeightField([[0, 1]], x),
    "floor": lambda x: rrtik.HeightField([[2, 3]], 1, x),
    "cubes": lambda x: rrtik.Octree([[0, 0, 0]], [x]),
    "vertices": lambda x: rrtik.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, x]], [[0, 1, 2]]),
    "triangles": lambda x: rrtik.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 2, x]]),
    "margin": lambda x: rrtik.Obstacle("a", rrtik.Sphere(1), margin=x),
    "resolution": lambda x: rrtik.World(ROBOT, motion_resolution=x),
    "self_margin": lambda x: rrtik.World(ROBOT, self_margin=x),
    "position": lambda x: rrtik.pose([0, 0, x]),
    "tolerance": lambda x: rrtik.PositionGoal([1, 1, 0], x),
    "goal joints": lambda x: rrtik.JointGoal([0, 0, x]),
    "configuration": lambda x: WORLD.valid([0, 0, x]),
    "rows": lambda x: WORLD.valid_batch([[0, 0, 0], [0, 0, x]]),
    "forward kinematics": lambda x: ROBOT.fk_batch([[0, 0, x]]),
    "limits": lambda x: rrtik.RateLimits([1, 1, x], 1),
    "waypoints": lambda x: rrtik.JointPath([[0, 0], [1, x]]),
    "clearance": lambda x: WORLD.motions_proven([[0, 0, 0]], [[1, 0, 0]], clearance=x),
    "resample": lambda x: PATH.resample(x),
    "seconds": lambda x: rrtik.plan(PROBLEM, seconds=x),
}


@pytest.mark.parametrize("odd", NO_NUMBERS)
@pytest.mark.parametrize("name", TAKES_A_NUMBER)
def test_what_is_no_number_is_not_taken_for_one(name, odd):
    with pytest.raises(rrtik.InputError) as error:
        TAKES_A_NUMBER[name](NO_NUMBERS[odd])
    assert "\n" not in str(error.value)


def test_numbers_of_every_kind_are_taken():
    for one in (1, 1.0, np.float32(1.0), np.int8(1), np.array(1), np.array(1.0, dtype=object)):
        assert rrtik.Sphere(one).radius == 1.0
    assert finite_array((1, 2.0, np.uint8(3)), (3,), "x").tolist() == [1.0, 2.0, 3.0]


def test_masks_are_truths():
    assert truths([True, False], "x").tolist() == truths([1, 0], "x").tolist() == [True, False]
    path = rrtik.JointPath([[0, 0]], prismatic=[True, False])
    assert path.prismatic.tolist() == [True, False]
    with pytest.raises(rrtik.InputError, match="expected numbers"):
        rrtik.JointPath([[0, 0]], prismatic=["yes", "no"])
    for wrong in ([7, 0], [0.5], [float("nan")], [-1]):
        with pytest.raises(rrtik.InputError, match="x: must be true or false"):
            truths(wrong, "x")


TOO_MANY = {
    "valid_batch": lambda: WORLD.valid_batch(HUGE),
    "certify": lambda: WORLD.certify(HUGE),
    "motion_valid_batch": lambda: WORLD.motion_valid_batch(HUGE, HUGE),
    "motions_proven": lambda: WORLD.motions_proven(HUGE, HUGE),
    "prove": lambda: WORLD.prove(HUGE),
    "fk_batch": lambda: ROBOT.fk_batch(HUGE),
    "jacobian_batch": lambda: ROBOT.jacobian_batch(HUGE),
    "joint_frames": lambda: ROBOT.joint_frames(HUGE),
    "within_limits": lambda: ROBOT.within_limits(HUGE),
    "distance": lambda: rrtik.JointGoal([0, 0, 0]).distance(ROBOT, HUGE),
    "solve_ik_many": lambda: rrtik.solve_ik_many(ROBOT, np.broadcast_to(np.eye(4), (10**8, 4, 4))),
    "solve_trajectory": lambda: rrtik.ik.solve_trajectory(ROBOT, HUGE),
    "plan_many": lambda: rrtik.plan_many(WORLD, [0, 0, 0], HUGE),
    "goal set": lambda: rrtik.GoalSet(np.broadcast_to(np.eye(4), (10**8, 4, 4))),
    "path": lambda: rrtik.JointPath(HUGE),
    "path of a robot": lambda: rrtik.JointPath.of(ROBOT, HUGE),
    "cloud": lambda: rrtik.PointCloud(HUGE),
    "numbers of Python": lambda: ROBOT.fk(range(10**12)),
    "integers": lambda: WORLD.valid_batch(np.broadcast_to(np.int8(0), (10**9, 3))),
    "an endless list": lambda: rrtik.GoalSet(itertools.repeat(np.eye(4))),
    "obstacles without end": lambda: rrtik.Scene(itertools.repeat(rrtik.Obstacle("a", rrtik.Sphere(1)))),
    "poses without end": lambda: rrtik.tip.follow(WORLD, [0, 0, 0], itertools.repeat([1.0, 1.0, 0.0])),
}

GUARDED = """
import resource, sys
from tests.base.test_what_is_a_number import TOO_MANY
import rrtik_ompl as rrtik
most = 2 << 30
soft = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize() + most
resource.setrlimit(resource.RLIMIT_AS, (soft, soft))
resource.setrlimit(resource.RLIMIT_CPU, (120, 120))
for name, call in TOO_MANY.items():
    try:
        call()
    except rrtik.InputError as error:
        assert "\\n" not in str(error), name
    else:
        sys.exit(f"{name}: taken")
"""


@pytest.mark.timeout(1200)
def test_more_numbers_than_a_call_takes_are_refused_before_they_are_copied():
    words = [sys.executable, "-c", textwrap.dedent(GUARDED)]
    ended = subprocess.run(words, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": "."})
    assert ended.returncode == 0, ended.stderr[-2000:]


@pytest.mark.parametrize("count", [0, 1, BLOCK_ROWS, BLOCK_ROWS + 1, 2 * BLOCK_ROWS + 7])
def test_blocks_give_what_all_rows_at_once_give(count):
    rows = np.random.default_rng(1).normal(size=(count, 3))
    assert np.array_equal(in_blocks(lambda part: part**2, rows), rows**2)
    assert np.array_equal(in_blocks(lambda a, b: a[:, 0] < b[:, 1], rows, rows), rows[:, 0] < rows[:, 1])


def test_long_batches_are_those_of_their_parts():
    rows = np.random.default_rng(1).uniform(-2.5, 2.5, size=(BLOCK_ROWS + 500, 3))
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.5), rrtik.pose([1.5, 0.5, 0.0]))
    world, some = rrtik.World(ROBOT, rrtik.Scene([ball])), slice(BLOCK_ROWS - 20, BLOCK_ROWS + 20)
    assert np.array_equal(ROBOT.fk_batch(rows)[some], ROBOT.fk_batch(rows[some]))
    assert np.array_equal(ROBOT.jacobian_batch(rows)[some], ROBOT.jacobian_batch(rows[some]))
    free = world.valid_batch(rows)
    assert np.array_equal(free[some], world.valid_batch(rows[some]))
    assert 0 < free.sum() < len(free)
    moves = world.motion_valid_batch(rows, rows + 0.01)
    assert np.array_equal(moves[some], world.motion_valid_batch(rows[some], rows[some] + 0.01))
    sure = world.motions_proven(rows, rows + 0.01)
    assert np.array_equal(sure[some], world.motions_proven(rows[some], rows[some] + 0.01))


ODD_CALLS = {
    "pose of an obstacle": lambda: rrtik.replanning.ConstantVelocity([0, 0, 1]).pose_at({}, 0.1),
    "time of a motion": lambda: rrtik.replanning.ConstantVelocity([0, 0, 1]).pose_at(rrtik.pose([0, 0, 0]), "late"),
    "pose of the tip": lambda: rrtik.Straight([0.1, 0, 0]).goal([0, 0, 0]),
    "robot of a goal": lambda: rrtik.JointGoal([0, 0, 0]).distance("planar3", [[0, 0, 0]]),
    "rows of a goal": lambda: rrtik.JointGoal([0, 0, 0]).satisfied(ROBOT, [["a"]]),
    "peaks": lambda: LIMITS.slowing([1, 1, 1], "fast"),
    "peaks of others": lambda: LIMITS.slowing([1, 1], [1, 1]),
    "directions": lambda: LIMITS.along(0.5),
    "number of joints": lambda: LIMITS.for_joints([1, 2, 3]),
    "set points": lambda: rrtik.time_parameterize(PATH, LIMITS).at_set_points([0, 99]),
    "set points between": lambda: rrtik.time_parameterize(PATH, LIMITS).at_set_points([0.5]),
    "world of a motion": lambda: rrtik.time_parameterize(PATH, LIMITS, world="planar3"),
    "mask of points": lambda: rrtik.PointCloud([[0, 0, 0]]).only("all"),
    "mask of other points": lambda: rrtik.PointCloud([[0, 0, 0]]).only([True, True]),
    "invalid points": lambda: rrtik.PointCloud([[0, 0, 0]], invalid=np.eye(4)),
    "axis of a map": lambda: rrtik.ik.reach_map(ROBOT, samples=10).centres(3),
    "measure of reach": lambda: rrtik.ik.reach_map(ROBOT, measure=["a"], samples=10),
    "axis of reach": lambda: rrtik.ik.reach_map(ROBOT, axis=np.eye(3), samples=10),
    "path to learn": lambda: rrtik.Roadmap(WORLD, vertices=5).learn("path"),
    "ends of a route": lambda: rrtik.Roadmap(WORLD, vertices=5).route([[0, 0, 0]], [[0, 0]], lambda: False),
    "no ends of a route": lambda: rrtik.Roadmap(WORLD, vertices=5).route(np.zeros((0, 3)), [[0, 0, 0]], lambda: False),
    "stop of a route": lambda: rrtik.Roadmap(WORLD, vertices=5).route([[0, 0, 0]], [[0, 0, 0]], None),
    "marks": lambda: rrtik.view(ROBOT, marks=0.5, html="page.html"),
    "mark": lambda: rrtik.view(ROBOT, marks=[0.5], html="page.html"),
    "scene of an arm": lambda: rrtik.sensing.without_robot(rrtik.PointCloud([[0, 0, 9]]), ROBOT, [0, 0, 0], scene=[1]),
    "ragged waypoints": lambda: rrtik.JointPath.of(ROBOT, [[1, 2], [3]]),
    "so2": lambda: rrtik.ompl.space_information(WORLD, so2=np.zeros(3)),
    "one_joint": lambda: rrtik.shorten(PATH, PROBLEM, one_joint=np.zeros(3)),
    "stop": lambda: rrtik.shorten(PATH, PROBLEM, stop="soon"),
    "planner of many": lambda: rrtik.plan_many(WORLD, [0, 0, 0], [[1, 0, 0]], ["a"]),
    "proof of many": lambda: rrtik.plan_many(WORLD, [0, 0, 0], [[1, 0, 0]], "bicrdt", proof=np.eye(2)),
    "replanner": lambda: rrtik.replan(PROBLEM, step=0.1, rate=1.0, planner=np.eye(2)),
    "feed": lambda: rrtik.replan(PROBLEM, lambda: None, step=0.1, rate=1.0),
    "words of a configuration": lambda: ROBOT.configuration([1, 2], np.eye(2)),
    "goal feed": lambda: rrtik.replan(PROBLEM, step=0.1, rate=1.0, goal_feed=nothing),
    "clock": lambda: rrtik.replan(PROBLEM, step=0.1, rate=1.0, clock=len),
    "on_ready": lambda: rrtik.view(ROBOT, html="page.html", on_ready="browser"),
    "on_better": lambda: rrtik.shorten(PATH, PROBLEM, on_better=nothing),
    "method of shortening": lambda: rrtik.shorten(PATH, PROBLEM, method=np.eye(2)),
    "method of inverse kinematics": lambda: rrtik.solve_ik(ROBOT, rrtik.pose([1, 1, 0]), method=np.eye(2)),
    "all solutions": lambda: rrtik.solve_ik(ROBOT, rrtik.pose([1, 1, 0]), all=np.zeros(3)),
    "method of many": lambda: rrtik.solve_ik_many(ROBOT, [np.eye(4)], method=np.eye(2)),
    "no configuration": lambda: rrtik.GoalSet([rrtik.pose([1, 1, 0])]).member_at(ROBOT, np.zeros((0, 3))),
    "margin of an arm": lambda: rrtik.sensing.without_robot(rrtik.PointCloud([[0, 0, 9]]), ROBOT, [0, 0, 0], 1e300),
    "a blend without end": lambda: rrtik.time_parameterize(PATH, LIMITS, blend=1e300, world=WORLD),
    "checks that are a time": lambda: rrtik.shorten(PATH, PROBLEM, checks=np.timedelta64(1)),
    "a seed that is a time": lambda: rrtik.plan(PROBLEM, seed=np.timedelta64(1, "s")),
    "payload": lambda: rrtik.time_parameterize(PATH, ROBOT, payload=np.zeros(3)),
    "title": lambda: rrtik.view(ROBOT, html="page.html", title=3),
    "problems": lambda: rrtik.plan_many(range(10**12)),
    "axis of a set": lambda: rrtik.GoalSet([rrtik.pose([1, 1, 0])], np.array(["x", "y"])),
    "no feed": lambda: rrtik.replan(PROBLEM, np.array(True), step=0.1, rate=1.0),
    "a clock that stands": lambda: rrtik.replan(PROBLEM, step=0.1, rate=1.0, clock=nothing),
    "parameters": lambda: rrtik.plan_many(WORLD, [0, 0, 0], [[1, 0, 0]], "bicrdt", parameters=np.zeros(3)),
    "proof in a file": lambda: PATH.save("path.json", proof=np.zeros(3)),
    "accelerations in a file": lambda: rrtik.time_parameterize(PATH, LIMITS).save("a.csv", accelerations=np.zeros(3)),
    "no peaks": lambda: LIMITS.slowing(None, None),
    "poses of the tip": lambda: rrtik.tip.follow(WORLD, [0, 0, 0], rrtik.pose([1, 0, 0])),
    "poses of a trajectory": lambda: rrtik.ik.solve_trajectory(ROBOT, [[1, 2], [3]]),
}


@pytest.mark.parametrize("name", ODD_CALLS)
def test_odd_arguments_end_in_one_line(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(rrtik.RrtikError) as error:
        ODD_CALLS[name]()
    assert "\n" not in str(error.value)


def test_a_factor_beyond_the_grid_makes_one_cell():
    field = rrtik.HeightField([[0.0, 0.2], [0.1, 0.3]], cell=0.5)
    assert field.coarser(10**30).heights.tolist() == field.coarser(2).heights.tolist() == [[0.3]]


def test_lists_end():
    assert listed(iter([1, 2]), "x", 2) == (1, 2)
    with pytest.raises(rrtik.InputError, match="more than the 2 members"):
        listed(itertools.count(), "x", 2)


def test_places_are_whole_numbers_of_rows():
    assert places([0, 2], 3, "x").tolist() == [0, 2]
    for wrong in ([-1], [3], [0.5], 1, ["a"]):
        with pytest.raises(rrtik.InputError):
            places(wrong, 3, "x")


def test_rows_are_rows_however_many_are_given():
    assert number_rows([1, 2], "x").shape == (1, 2)
    assert number_rows(np.zeros((2, 3, 4)), "x").shape == (2, 3, 4)
    assert number_rows(3, "x").shape == (1, 1)
    with pytest.raises(rrtik.InputError, match=str(MOST_NUMBERS)):
        number_rows(HUGE, "x")
