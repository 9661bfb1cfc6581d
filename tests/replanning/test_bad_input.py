"""What makes no sense to replanning is refused in one line that names it."""

from __future__ import annotations

import warnings
from itertools import chain, repeat

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import HalfSpace, Sphere
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.replanning.feed import Snapshot
from rrtik_ompl.replanning.in_time import plan_in_time
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.travels import SpeedWarning
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.moving_plane import OPTIONS, box, crossing, plane


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rate": 0.0}, "rate: must be greater than 0, got 0; give ticks a second"),
        ({"step": -1.0}, "step: must be greater than 0"),
        ({"margin": -0.1}, "margin must not be negative"),
        ({"lookahead_ticks": 1.5}, "lookahead_ticks must be a whole number"),
        ({"speed_bound": 0.0}, "speed_bound: must be greater than 0"),
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


@pytest.mark.parametrize("later", [float("nan"), "x", None])
def test_a_clock_that_goes_wrong_later_is_named(later):
    readings = chain([0.001 * k for k in range(20)], repeat(later))
    with pytest.raises(InputError, match="clock: what it gives"):
        replan(crossing(), **{**OPTIONS, "clock": lambda: next(readings)})


@pytest.mark.parametrize(
    ("unseen", "words"),
    [
        ({"box": -0.1}, "'box' must not be negative, got -0.1"),
        ({"box": float("nan")}, "'box': must be a finite number"),
        ({"box": "long"}, "'box': expected numbers, got 'long'"),
        ({"bax": 0.1}, "no obstacle 'bax'"),
        ([("box", 0.1)], "must be of type Mapping, got list; give names and seconds"),
        (3, "must be of type Mapping, got int"),
    ],
)
@pytest.mark.parametrize("source", [iter, lambda pairs: lambda time: pairs[0]])
def test_how_long_an_obstacle_was_out_of_view_is_checked(unseen, words, source):
    snapshots = [Snapshot(0.0, Scene([box("box", 10.0, 16.0)]), unseen)]
    with pytest.raises(InputError, match=f"scene feed: unseen of the snapshot of 0 s.* {words}"):
        replan(crossing(), source(snapshots), **OPTIONS)


def test_a_patience_of_ages_is_no_error():
    still = Scene([box("box", 10.0, 16.0)])
    assert replan(crossing(), lambda _: still, **OPTIONS, seconds=0.1, feed_patience=1e300).ticks


def test_an_unknown_planner_is_answered_with_those_there_are():
    with pytest.raises(UnknownNameError, match="drrt-con"):
        replan(crossing(), planner="drrtcon", **OPTIONS)


def test_times_that_go_backwards_are_refused():
    scene = crossing().world.scene
    with pytest.raises(InputError, match=r"backwards: 0.04 s.*0.5 s.*feed_patience is 0.4 s"):
        replan(crossing(), [(0.0, scene), (0.1, scene), (0.5, scene), (0.04, scene)], **OPTIONS, feed_patience=0.4)


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
    assert run.found


def test_an_obstacle_that_begins_inside_the_robot_is_refused_with_its_name():
    hit = Scene([box("lift", 1.0, 10.0)])
    with pytest.raises(InputError, match=r"in collision: .*'lift'"):
        replan(crossing(), lambda _: hit, **OPTIONS)


def test_a_start_within_the_margin_says_what_to_lower():
    with pytest.raises(InputError, match=r"contact.*margin"):
        replan(plane(box("near", 1.0, 12.2)), margin=0.5, **OPTIONS)


def test_a_run_ends_at_the_first_scene_that_shows_an_obstacle_faster_than_the_bound():
    slow, fast = (crossing(speed).world.scene for speed in (0.5, 2.0))

    def feed(time):
        return slow.at(time) if time < 0.45 else fast.at(time - 0.375)

    with pytest.warns(SpeedWarning, match="'lift'") as caught:
        run = replan(crossing(0.5), feed, speed_bound=1.0, **OPTIONS)
    assert len(caught) == 1
    assert run.outcome == "too fast"
    assert run.ticks[-1].time == pytest.approx(0.6)
    assert (run.ticks[-1].event, run.ticks[-1].reason) == ("wait", run.reason)
    assert "'lift' moves at 2 m/s at 0.6 s, 1 m/s faster than the stated speed_bound of 1 m/s" in run.reason


def test_a_floor_that_slides_has_a_speed_like_any_obstacle():
    tilted, slid = (pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3])), np.array([x, 0.0, 0.0])) for x in (0.0, 4.0))
    floor = Obstacle("floor", HalfSpace([0.0, 1.0, 0.0], -5.0), tilted, TimedPoses([0.0, 8.0], [tilted, slid]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert replan(plane(floor), speed_bound=0.6, **OPTIONS).found
    with pytest.warns(SpeedWarning, match="'floor' moves at 0.5 m/s"):
        assert replan(plane(floor), speed_bound=0.4, **OPTIONS).outcome == "too fast"


@pytest.mark.parametrize("seen", [0.0, 0.2])
def test_a_feed_whose_scenes_forget_what_the_arm_holds_is_refused(seen):
    robot = load_robot("planar", parameters={"lengths": [1.0, 1.0]})
    far, held = box("far", 9.0, 9.0), AttachedObject("tool", robot.tip, Sphere(0.05))
    problem = Problem(World(robot, Scene((far,), (held,))), [0.0, 0.3], [1.0, 0.3])

    def feed(time):
        return Scene((far,), () if time >= seen else (held,))

    with pytest.raises(InputError, match=r"held tool.*nothing"):
        replan(problem, feed, step=0.02, rate=20.0)


def test_path_constraints_are_refused_for_they_would_not_be_kept():
    robot = load_robot("planar", parameters={"lengths": [1.0, 1.0]})
    bounds = [[-9, 9]] * 3 + [[-7, 7]] * 3
    held = Problem(World(robot), [0.0, 0.3], [1.0, 0.3], constraints=[TaskRegion(np.eye(4), bounds)])
    with pytest.raises(InputError, match="replan: path constraints"):
        replan(held, step=0.02, rate=20.0)
    with pytest.raises(InputError, match="plan in time: path constraints"):
        plan_in_time(held)
