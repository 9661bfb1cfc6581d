"""Every fault of a feed has one answer: the arm keeps away from what may be there, says a word, and goes on."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Obstacle, Scene, Touching, pairs_that_may_touch
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, PointCloud, Sphere, same_shape
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.replanning.faults import ANSWERS, FeedWarning, SceneMemory, shape_around
from rrtik_ompl.replanning.feed import Snapshot
from rrtik_ompl.replanning.in_time import plan_in_time
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.travels import SpeedWarning
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.run_judge import judged

RATE, SPEED, MARGIN = 25.0, 0.2, 0.02
OPTIONS = {
    "step": 0.05, "rate": RATE, "seconds": 6.0, "repair_budget": 30.0, "seed": 1, "margin": MARGIN,
    "speed_bound": SPEED, "limits": RateLimits([5.0, 5.0], [5.0, 5.0]), "feed_patience": 0.4,
}  # fmt: skip


def at(x, y):
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


POST = Obstacle("post", Box([0.1, 0.3, 0.4]), at(0.1, 0.1))
NEW = Obstacle("new", Sphere(0.08), at(0.3, -0.15))
ON_ARM = Obstacle("new", Sphere(0.06), at(-0.45, 0.05))


def ball():
    robot = load_robot("point2d", parameters={"radius": 0.05, "bounds": [[-1, 1], [-1, 1]]})
    return Problem(World(robot, Scene([POST])), [-0.6, 0.0], [0.6, 0.0], name="ball")


def from_to(begin, end, there, otherwise=(POST,)):
    """A feed of a scene at 25 Hz that has other obstacles for a while."""
    return [(k / RATE, Scene(there if begin <= k / RATE < end else otherwise)) for k in range(int(6 * RATE))]


def shuffled(order):
    pairs = from_to(9.0, 9.0, ())
    return [pairs[0], *(pairs[k] for block in range(1, len(pairs) - 2, 3) for k in block + np.array(order))]


FEEDS = {
    "appears": (from_to(0.3, 9.0, (POST, NEW)), ["appears"]),
    "appears on the arm": (from_to(0.12, 9.0, (POST, ON_ARM)), ["appears on the arm"]),
    "vanishes": (from_to(0.1, 0.2, ()), ["vanishes"]),
    "stays away": (from_to(0.1, 9.0, ()), ["vanishes", "stays away"]),
    "changes size": (from_to(0.1, 9.0, (replace(POST, shape=Box([0.1, 0.4, 0.4])),)), ["changes size"]),
    "changes shape": (from_to(0.1, 9.0, (replace(POST, shape=Sphere(0.2)),)), ["changes shape", "stays away"]),
    "changes name": (from_to(0.1, 9.0, (replace(POST, name="pole"),)), ["changes name"]),
    "doubled": (shuffled([0, 0, 1, 2]), ["doubled"]),
    "out of order": (shuffled([1, 0, 2]), ["out of order"]),
}


def test_each_fault_has_a_feed_an_answer_and_a_row_in_the_docs():
    page = (Path(__file__).parents[2] / "docs" / "replanning.md").read_text()
    rows = dict(re.findall(r"^\| (.+?) \| (.+?) \|$", page, flags=re.MULTILINE))
    assert FEEDS.keys() == ANSWERS.keys()
    assert {kind: rows[kind] for kind in ANSWERS} == ANSWERS


@pytest.mark.parametrize("kind", FEEDS)
def test_each_fault_is_named_survived_and_recorded(kind, tmp_path):
    feed, kinds = FEEDS[kind]
    with pytest.warns(FeedWarning, match=f"{kinds[0]} at .* s.*: {ANSWERS[kinds[0]]}"):
        run = replan(ball(), feed, **OPTIONS, record=tmp_path / "run.json")
    assert run.found, run.reason
    assert list(dict.fromkeys(fault.kind for fault in run.faults)) == kinds
    judged(run, ball(), may_touch=kind == "appears on the arm")

    again = ReplanRun.load(tmp_path / "run.json")
    assert again.faults == run.faults
    assert str(again.violations(ball())) == str(run.violations(ball()))
    assert [each.scene.names for each in again.scenes] == [each.scene.names for each in run.scenes]


def test_what_appears_on_the_arm_is_left_and_no_move_before_is_called_proven():
    with pytest.warns(FeedWarning):
        run = replan(ball(), FEEDS["appears on the arm"][0], **OPTIONS)
    begin = run.faults[0].time
    touching = {each.tick for each in run.violations(ball()) if each.touches}
    assert touching
    assert not any(run.ticks[k].proven for k in touching)
    assert {run.ticks[k].event for k in touching} <= {"evade", "wait"}
    assert all(each.proven is not True for each in run.ticks if begin - 1.5 / RATE < each.time < begin - 0.5 / RATE)


def test_a_run_that_never_sees_an_obstacle_again_keeps_away_from_where_it_may_be():
    runs = []
    for back, stays in ((0.3, 9.0), (9.0, 0.48)):
        with pytest.warns(FeedWarning):
            run = replan(ball(), from_to(0.1, back, ()), **OPTIONS)
        runs.append(judged(run, ball(), lambda time, end=stays: Scene([POST] if time <= end else ())))
    assert all(run.found for run in runs)
    remembered = [each for each in runs[1].scenes if "post" in each.scene.names]
    assert remembered[-1].time == pytest.approx(0.4 + 2 / RATE)  # it was seen last at 0.08 s
    assert remembered[-1].unseen["post"] == pytest.approx(0.4)


def test_a_cloud_that_goes_leaves_the_arm_alone():
    def feed(time):
        points = np.array([[0.1 * time, 0.5, 0.0], [0.0, 0.6, 0.0]])
        return Scene([Obstacle("cloud", PointCloud(points, 0.02))] if time < 0.5 else [])

    problem = Problem(World(ball().robot, feed(0.0)), [-0.6, 0.0], [0.6, 0.0])
    with pytest.warns(FeedWarning):
        run = replan(problem, feed, **{**OPTIONS, "speed_bound": None})
    assert [fault.kind for fault in run.faults] == ["vanishes", "stays away"]
    assert run.found, run.reason


def take(*scenes, patience=1.0, bound=SPEED):
    memory = SceneMemory(patience, bound)
    return [memory.take(0.1 * k, Scene(obstacles), {}) for k, obstacles in enumerate(scenes)]


def test_a_size_that_shrinks_is_believed_once_it_stays():
    small, large = (replace(POST, shape=Box([0.1, high, 0.4])) for high in (0.2, 0.3))
    known = take([large], *([small],) * 12)
    sizes = [each.scene.obstacle("post").shape.size[1] for each in known]
    assert sizes == [0.3] * 11 + [0.2] * 2
    assert [fault.kind for each in known for fault in each.faults] == ["changes size"]


def test_a_new_name_far_away_is_another_obstacle():
    reach = 0.1 * SPEED
    for way, kinds in ((0.9 * reach, ["changes name"]), (1.1 * reach, ["appears", "vanishes"])):
        pole = replace(POST, name="pole", pose=at(0.1 + way, 0.1))
        known = take([POST], [pole])[-1]
        assert [fault.kind for fault in known.faults] == kinds
        assert len(known.scene.obstacles) == len(kinds)


@pytest.mark.parametrize("kind", FEEDS)
def test_what_scenes_between_two_ticks_show_is_not_missed(kind):
    feed, _ = FEEDS[kind]
    found = []
    for rate in (RATE, RATE / 5.0):
        with pytest.warns(FeedWarning):
            run = replan(ball(), feed, **{**OPTIONS, "rate": rate, "step": 1.25 / rate})
        found.append([(each.time, each.obstacle) for each in run.faults if each.time < 1.0])
    assert found[0] == found[1]
    assert found[0]


@pytest.mark.parametrize("there", [(POST, ON_ARM), (replace(POST, pose=at(-0.4, 0.0)),)])
def test_a_move_is_not_called_proven_that_a_scene_between_two_ticks_refutes(there):
    pairs = [(0.01 * k, Scene(there if k % 4 == 1 and k > 8 else (POST,))) for k in range(300)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = replan(ball(), pairs, **OPTIONS)
    touching = {each.tick for each in run.violations(ball()) if each.touches}
    assert len(there) == 1 or touching
    assert len(there) == 2 or (run.outcome, run.ticks[-1].time) == ("too fast", 0.12)
    assert not any(run.ticks[k].proven for k in touching)
    assert not any(each.proven for each in run.ticks if 0.04 < each.time < 0.13)


@pytest.mark.parametrize("bound", [None, 10.0])
def test_what_says_that_it_stays_and_moves_ends_the_run(bound):
    def feed(time):
        stays = replace(POST, motion=ConstantVelocity([0.0, 0.0, 0.0]), pose=at(0.1, 0.3 - 0.1 * max(time - 0.3, 0.0)))
        return Scene([stays])

    with pytest.warns(SpeedWarning, match="'post' moves at 0.05 m/s at 0.32 s, and its motion says that it stays"):
        run = replan(ball(), feed, **{**OPTIONS, "speed_bound": bound})
    assert run.outcome == "too fast"
    proven = [each.proven for each in run.ticks[:-1]]
    assert proven == [True] * 7 + [False]


def test_what_is_out_of_view_is_where_it_was_seen_last():
    memory = SceneMemory(9.0, SPEED)
    memory.take(0.5, Scene([POST]), {})
    for age in (0.1, 0.2):  # seen last at the same time again, and before
        away = Scene([replace(POST, pose=at(-0.4, 0.0))])
        known = memory.take(0.6, away, {"post": age}) if age == 0.1 else memory.take(0.7, away, {"post": 0.4})
        assert np.array_equal(known.scene.obstacle("post").pose.homogeneous, POST.pose.homogeneous)
        assert known.unseen["post"] == pytest.approx(age)


@pytest.mark.parametrize("others", [(), (NEW,), (replace(NEW, name="post (before)"),)])
def test_each_old_shape_counts_until_it_is_out_of_date_or_there_again(others):
    shapes = Box([0.1, 0.3, 0.4]), Sphere(0.1), Cylinder(0.1, 0.2), Capsule(0.1, 0.2)
    scenes = [(replace(POST, shape=shape), *others) for shape in (*shapes, shapes[1], *[shapes[0]] * 9)]
    known = take(*scenes, patience=0.45)
    there = [
        {each.shape.key for each in one.scene.obstacles if each.name not in {o.name for o in others}} for one in known
    ]
    keys = [shape.key for shape in shapes]
    assert there[:4] == [set(keys[: k + 1]) for k in range(4)]
    assert there[4] == there[5] == set(keys)
    assert there[-1] == {keys[0]}
    for one in known:
        assert all(any(o is other for o in one.scene.obstacles) for other in others)


@pytest.mark.parametrize("says", ["allow", "pair", "contact"])
@pytest.mark.parametrize("forgets", [True, False])
def test_a_thing_that_held_objects_may_touch_may_go_away(says, forgets, tmp_path):
    problem = ball()
    cup = AttachedObject("cup", problem.robot.link_names[-1], Sphere(0.02), allow=["post"] if says == "allow" else [])
    pairs = [("cup", "post")] if says == "pair" else []
    contacts = [Touching("cup", "post", 0.0)] if says == "contact" else []
    scene = Scene([POST], [cup], pairs, contacts)
    left = scene.without("post") if forgets else replace(scene, obstacles=())
    feed = [(k / RATE, left if k > 3 else scene) for k in range(150)]
    held = Problem(World(problem.robot, scene), problem.start, problem.goal)
    with pytest.warns(FeedWarning):
        run = judged(replan(held, feed, **OPTIONS), held)
    assert [fault.kind for fault in run.faults] == ["vanishes", "stays away"]
    assert run.found, run.reason
    run.save(tmp_path / "run.json")
    may_touch = [pairs_that_may_touch(each.scene) for each in ReplanRun.load(tmp_path / "run.json").scenes]
    assert may_touch == [pairs_that_may_touch(each.scene) for each in run.scenes]
    assert may_touch[0] != may_touch[-1]
    assert World(problem.robot, scene.without("post")).valid(problem.start)
    assert plan_in_time(held, rate=5.0, iterations=200).found


def test_pairs_that_may_touch_stay_with_what_is_remembered():
    memory = SceneMemory(1.0, None)
    memory.take(0.0, Scene([POST, NEW], allowed_collisions=[("tool", "post"), ("tool", "new")]), {})
    changed = replace(POST, shape=Sphere(0.2))
    known = memory.take(0.1, Scene([changed], allowed_collisions=[("tool", "post")]), {})
    assert set(known.scene.names) == {"post", "post (before)", "new"}
    assert set(known.scene.allowed_collisions) == {("tool", "post"), ("tool", "post (before)"), ("tool", "new")}


@pytest.mark.parametrize(
    ("first", "second", "around"),
    [
        (Box([1, 2, 3]), Box([2, 1, 3]), Box([2, 2, 3])),
        (Sphere(1), Sphere(2), Sphere(2)),
        (Cylinder(1, 3), Cylinder(2, 2), Cylinder(2, 3)),
        (Capsule(1, 3), Capsule(2, 2), Capsule(2, 3)),
        (HalfSpace([0, 0, 1], 0.1), HalfSpace([0, 0, 1], 0.3), HalfSpace([0, 0, 1], 0.3)),
        (HalfSpace([0, 0, 1], 0.1), HalfSpace([0, 1, 0], 0.3), None),
        (Sphere(1), Box([1, 1, 1]), None),
    ],
)
def test_what_is_around_two_shapes(first, second, around):
    found = shape_around(first, second)
    assert (found is None) == (around is None)
    assert around is None or same_shape(found, around)


@pytest.mark.parametrize("late", [0.1, 0.3])
def test_a_function_may_say_when_its_scene_was_taken(late):
    def feed(time):
        return Snapshot(max(time - late, 0.0), Scene([POST]))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = judged(replan(ball(), feed, **OPTIONS), ball())
    assert run.found or any("too old" in tick.reason for tick in run.ticks)
    assert run.moves[0] == run.moves[1]


@pytest.mark.parametrize(
    ("time_of", "words"),
    [
        (lambda time: time + 0.1, "at 0 s it gives the scene of 0.1 s; give the last scene that was seen"),
        (lambda time: 1.0 - time, "at 0 s it gives the scene of 1 s"),
        (lambda time: time if time < 1.0 else 0.2, "times go backwards: 0.2 s comes after 0.96 s"),
    ],
)
def test_a_function_whose_times_cannot_be_is_refused(time_of, words):
    with pytest.raises(InputError, match=words):
        replan(ball(), lambda time: Snapshot(time_of(time), Scene([POST])), **{**OPTIONS, "step": 0.01})
