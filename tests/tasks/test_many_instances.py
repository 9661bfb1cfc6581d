"""Instances of a task: goals go along with things, and no instance depends on those before it."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import Variation
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.kernels import FastWorld

NAME = "panda_pick_place"
CUP = np.array([0.5, 0.25, 0.25])
PLACE = np.array([0.5, -0.25, 0.39])


def turned(yaw, at, shift):
    """The rigid motion that turns by an angle about the vertical at a point, and then shifts."""
    return pin.SE3(pin.utils.rotate("z", yaw), np.add(at, shift)) * pin.SE3(np.eye(3), -np.array(at))


def variation(k):
    """The cup and its place, some centimetres away and turned."""
    cup = pin.SE3(pin.utils.rotate("z", 0.2 * k), np.add(CUP, [0.01 * k, -0.02 * k, 0.0]))
    return Variation({"cup": cup}, {"cup": turned(-0.1 * k, PLACE, [0.0, 0.03 * k, 0.0])})


@pytest.fixture(scope="module")
def task():
    return rrtik.Task.load(NAME)


def rows(plan):
    return [path.waypoints for path in plan.paths]


def same(first, second):
    assert first.found
    assert first.chosen == second.chosen
    for one, other in zip(rows(first), rows(second), strict=True):
        np.testing.assert_array_equal(one, other)


def test_goals_go_along_with_what_is_taken_or_set_down_next(task):
    changed = variation(1)
    moved = task.varied(changed)
    shift = changed.poses["cup"] * pin.SE3(np.eye(3), CUP).inverse()
    picks, lift, places, ready = task.stages
    new_picks, new_lift, new_places, new_ready = moved.stages
    for old, new in zip(picks.options, new_picks.options, strict=True):
        np.testing.assert_allclose(new[0].goal.pose.homogeneous, (shift * old[0].goal.pose).homogeneous, atol=1e-12)
        np.testing.assert_allclose(new[1].by, old[1].by, atol=1e-12)  # straight down is straight down
    for old, new in zip(places.options, new_places.options, strict=True):
        wanted = changed.places["cup"] * old[0].goal.pose
        np.testing.assert_allclose(new[0].goal.pose.homogeneous, wanted.homogeneous, atol=1e-12)
    np.testing.assert_allclose(new_lift.by, lift.by, atol=1e-12)
    assert new_ready.goal == ready.goal == "ready"
    assert moved.world.scene.obstacle("cup").pose == changed.poses["cup"]
    np.testing.assert_array_equal(moved.start, task.start)


def test_lines_sideways_turn_with_the_thing():
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.02), [0.5, 0.0, 0.3])
    world = rrtik.World(rrtik.load_robot("panda"), rrtik.Scene([ball]))
    side = [rrtik.MoveTo(rrtik.PositionGoal([0.3, 0.0, 0.3])), rrtik.Straight(by=[0.1, 0.0, 0.0])]
    stages = [*side, rrtik.Attach("ball", "panda_hand"), rrtik.Straight(to=[0.4, 0.0, 0.4]), rrtik.Detach("ball")]
    quarter = turned(np.pi / 2, [0.5, 0.0, 0.3], [0.0, 0.0, 0.0])
    poses = {"ball": quarter * ball.pose}
    goal, line, _, to, _ = rrtik.Task(stages, world, "ready").varied(Variation(poses)).stages
    np.testing.assert_allclose(goal.goal.position, [0.5, -0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(line.by, [0.0, 0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(to.to, [0.5, -0.1, 0.4], atol=1e-12)  # it follows the goal before it


@pytest.mark.kernels
def test_an_instance_is_planned_as_if_it_were_alone(task):
    given = [variation(k) for k in (1, 2, 3)]
    plans = task.plan_many(given, seed=7, threads=1)
    seeds = np.random.SeedSequence(7).generate_state(3).tolist()
    for changed, plan, seed in zip(given, plans, seeds, strict=True):
        alone = rrtik.Task.load(NAME)  # another robot, which knows no worlds
        same(plan, alone.varied(changed).plan(seed=seed))
        assert plan.proven
        assert plan.violations() == ()
    for one, other in zip(plans, task.plan_many(given, seed=7, threads=2), strict=True):
        same(one, other)


@pytest.mark.kernels
def test_worlds_are_taken_over(task, monkeypatch):
    given = [variation(k) for k in range(4)]
    made = []
    pack = FastWorld.__init__
    monkeypatch.setattr(FastWorld, "__init__", lambda *args, **options: [made.append(1), pack(*args, **options)][-1])
    task.plan_many(given[:2], threads=1)
    first = len(made)
    task.plan_many(given, threads=1)
    assert len(made) <= 2 * first + 1  # and not once more for each instance


def test_what_is_done_then_stands_in_the_place_of_the_plan(task):
    done = task.plan_many([Variation(), Variation()], threads=1, then=lambda plan: plan.found)
    assert done == [True, True]


def test_an_instance_that_cannot_begin_says_why(task):
    inside = Variation({"cup": [0.31, 0.0, 0.55]})
    plan = task.plan_many([inside], threads=1)[0]
    assert not plan.found
    assert "start is in collision" in plan.reason


def test_what_cannot_be_asked_is_refused(task):
    with pytest.raises(UnknownNameError, match="no obstacle 'cap'; did you mean 'cup'"):
        task.plan_many([Variation({"cap": [0.0, 0.0, 0.0]})])
    with pytest.raises(UnknownNameError, match=r"places of a variation.*'table'"):
        task.varied(Variation(places={"table": [0.0, 0.0, 0.1]}))
    with pytest.raises(InputError, match=r"start of variations\[1\]"):
        task.plan_many([Variation(), Variation(start=[0.0, 1.0])])
    with pytest.raises(InputError, match="poses of a variation: 'cup'"):
        Variation({"cup": [0.0, np.nan, 0.0]})
    with pytest.raises(InputError, match=r"variations\[0\].*Variation"):
        task.plan_many([{"cup": [0.5, 0.25, 0.25]}])


def test_a_variation_goes_to_another_process():
    there = pickle.loads(pickle.dumps(variation(1)))
    assert there.poses["cup"] == variation(1).poses["cup"]
    assert there.start is None
