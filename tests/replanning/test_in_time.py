"""Planning in configuration and time: never back in time, never too fast, free at every time, as others judge it."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicHermiteSpline

import rrtik_ompl as rrtik
from rrtik_bench.contact_check import check_contacts
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.app import run as run_command
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, HalfSpace, Sphere
from rrtik_ompl.replanning.in_time import plan_in_time
from rrtik_ompl.replanning.in_time.foreseen import Travel
from rrtik_ompl.replanning.in_time.pace import Pace, Timing, stretch
from rrtik_ompl.replanning.in_time.search import TimeTree
from rrtik_ompl.world.opinion import opinion_on
from rrtik_ompl.world.world import World
from rrtik_tests.moving_plane import FAST, box, crossing, place, plane

PLANE = {"speed": 5.0, "limits": FAST}
DENSE = 12  # exact checks in a slot
SHUT, OPEN = 10.0, -30.0


def gate(opens_at: float):
    """A wall with a door across the only way; the door is elsewhere from a time [s] on."""
    door = TimedPoses([0.0, opens_at, opens_at + 0.5], [place(10.0, SHUT), place(10.0, SHUT), place(10.0, OPEN)])
    wall = [box("low", 10.0, 3.0, 1.0, 10.0), box("high", 10.0, 17.0, 1.0, 10.0)]
    return plane(*wall, Obstacle("door", Box([1.0, 6.0, 1.0]), place(10.0, SHUT), door))


def faults_of(problem, run, velocity, speed=np.inf):
    """Faults that exact worlds at single times see, coal's contacts, and whether speeds are kept."""
    rows, times = run.configurations, run.times
    assert (np.diff(times) > 0.0).all()
    seconds = np.diff(times)[:, None]
    assert (np.abs(np.diff(rows, axis=0)) <= seconds * velocity * (1.0 + 1e-9)).all()
    assert (np.linalg.norm(np.diff(rows, axis=0), axis=1) <= seconds[:, 0] * speed * (1.0 + 1e-9)).all()
    faults = []
    for k in range(len(rows) - 1):
        for share in np.linspace(0.0, 1.0, DENSE):
            now = times[k] + share * (times[k + 1] - times[k])
            world = World(problem.robot, problem.world.scene.at(now))
            if not world.valid(rows[k] + share * (rows[k + 1] - rows[k])):
                faults.append(now)
    return faults, check_contacts(problem.robot, run, problem.world.scene).contacts


def keeps_accelerations(plan, limits):
    """The exported motion, differentiated by differences alone, keeps its limits; it is where the record has it."""
    motion, step = plan.trajectory, 1e-3
    assert np.abs(motion(plan.motion.times).positions - plan.motion.configurations).max() < 1e-9
    rows = motion(np.arange(-5, round(motion.duration / step) + 5) * step).positions
    speeds = np.diff(rows, axis=0) / step
    assert (np.abs(speeds) <= limits.velocity * (1.0 + 1e-6)).all()
    assert (np.abs(np.diff(speeds, axis=0) / step) <= limits.acceleration * (1.0 + 1e-6)).all()


def test_a_crossing_box_is_not_met_at_any_time():
    problem = crossing()
    plan = plan_in_time(problem, seed=1, **PLANE)
    assert plan.found, plan.reason
    assert faults_of(problem, plan.motion, 1e3, 5.0) == ([], ())
    assert plan.motion.moves[0] == plan.motion.moves[1] > 0
    assert plan.motion.configurations[0].tolist() == problem.start.tolist()
    assert plan.motion.configurations[-1].tolist() == problem.goal.q.tolist()


def test_a_door_is_waited_for_and_passed_when_it_opens():
    problem = gate(6.0)
    plan = plan_in_time(problem, seed=1, **PLANE)
    assert plan.found, plan.reason
    assert faults_of(problem, plan.motion, 1e3, 5.0) == ([], ())
    crossing_time = plan.motion.times[np.flatnonzero(plan.motion.configurations[:, 0] > 10.0)[0]]
    assert crossing_time > 6.0
    assert plan.arrival >= plan.least_seconds
    assert plan.arrival < 6.5 + 18.0 / 5.0  # it does not begin only when the door is open


def test_a_door_that_stays_shut_until_the_horizon_is_not_passed():
    plan = plan_in_time(gate(8.0), horizon=7.0, iterations=400, seed=1, **PLANE)
    assert not plan.found
    assert "no way was found" in plan.reason
    assert plan.arrival == np.inf


def test_a_goal_that_stays_blocked_is_named():
    lid = TimedPoses([0.0, 0.5], [place(19.0, 2.0), place(19.0, 10.0)])
    plan = plan_in_time(plane(box("lid", 19.0, 2.0, 1.0, 1.0, lid)), iterations=200, seed=1, **PLANE)
    assert not plan.found
    assert "the goal is not proven free at any of the" in plan.reason
    assert "horizon" in plan.reason


def test_nothing_in_the_way_arrives_as_soon_as_speed_allows():
    plan = plan_in_time(plane(box("far", 10.0, 18.0, 1.0, 1.0)), seed=1, **PLANE)
    assert plan.arrival == pytest.approx(plan.least_seconds) == pytest.approx(3.7)  # 3.6 s at full speed
    aside = plan_in_time(plane(), goal=[1.0, 12.0], seed=1, **PLANE)
    assert aside.path.end.tolist() == [1.0, 12.0]


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["replan_ur5", "replan_planar_arm"])
def test_arms_among_what_moves_are_free_at_every_time_with_margin(name):
    scenario = rrtik.replanning.Scenario.load(name)
    problem, settings = scenario.problem, scenario.settings
    speed = settings.step * settings.rate
    plan = plan_in_time(problem, speed=speed, margin=settings.margin, limits=settings.limits, seed=2)
    assert plan.found, plan.reason
    velocity = settings.max_change(problem.robot) * settings.rate
    assert faults_of(problem, plan.motion, velocity, speed) == ([], ())
    keeps_accelerations(plan, settings.limits or rrtik.RateLimits.of(problem.robot))
    nearest = check_contacts(problem.robot, plan.motion, problem.world.scene, samples_per_tick=40).nearest
    assert nearest >= settings.margin


def test_the_same_seed_gives_the_same_motion_and_a_record_keeps_it(tmp_path):
    one, two = (plan_in_time(crossing(), seed=3, seconds=600.0, **PLANE).motion for _ in range(2))
    assert (one.configurations == two.configurations).all()
    one.save(tmp_path / "run.json")
    back = rrtik.replanning.ReplanRun.load(tmp_path / "run.json")
    assert (back.configurations == one.configurations).all()
    assert back.planner == "in-time"


def test_the_command_plans_in_time_and_says_when_there_is_no_way(tmp_path, capsys):
    record = tmp_path / "run.json"
    assert run_command(["replan", "replan_planar_arm", "--foreseen", "--record", str(record)]) == 0
    assert rrtik.replanning.ReplanRun.load(record).planner == "in-time"
    assert "moves proven" in capsys.readouterr().out
    assert run_command(["replan", "replan_planar_arm", "--foreseen", "--horizon", "0.5", "--json"]) == 1
    reason = json.loads(capsys.readouterr().out)["reason"]
    assert "limits allow no arrival" in reason
    assert "raise --horizon" in reason
    assert run_command(["replan", "replan_planar_arm", "--foreseen", "--clearance", "5"]) == 1
    assert "lower --clearance" in capsys.readouterr().err
    assert run_command(["replan", "replan_planar_arm", "--horizon", "5"]) == 2


def test_the_way_of_an_obstacle_bounds_every_point_of_it():
    rng = np.random.default_rng(0)
    turns = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3)) for _ in range(4)]
    solid = Obstacle("solid", Sphere(0.3), turns[0], TimedPoses([0.0, 0.3, 0.7, 1.5], turns))
    points = rng.normal(size=(50, 3))
    points *= 0.3 / np.linalg.norm(points, axis=1, keepdims=True)
    for begin in np.linspace(0.0, 1.4, 15):
        bound = Travel(solid, 0.3).from_middle(begin, begin + 0.2)
        middle = solid.motion.pose_at(solid.pose, begin + 0.1)
        for now in np.linspace(begin, begin + 0.2, 21):
            there = solid.motion.pose_at(solid.pose, now)
            moved = [np.linalg.norm(there.act(p) - middle.act(p)) for p in points]
            assert max(moved) <= bound
    steady = Obstacle("steady", Sphere(0.3), motion=ConstantVelocity([0.0, 3.0, 4.0]))
    assert Travel(steady, 0.3).from_middle(1.0, 1.2) == pytest.approx(0.5)


def test_a_stretch_that_barely_reaches_full_speed_keeps_the_limits():
    slot = 0.1
    for slots in (2, 10):
        for excess in np.geomspace(1e-15, 1e-3, 60):
            fast = 0.5 * slots * (1.0 + excess)
            steep = fast * (slots - fast)  # so that all slots are needed
            pace = Pace(np.ones(1), np.array([fast / steep]), np.inf)
            timing = Timing(np.array([[3.0], [3.0 + fast]]), np.array([0, slots]))
            motion = timing.trajectory(pace, slot, JointPath(timing.rows, ("joint",)))

            spline = CubicHermiteSpline(motion.times, motion.positions, motion.velocities)
            moments = np.concatenate([np.linspace(a, b, 11) for a, b in pairwise(motion.times)])
            assert np.abs(spline(moments, 1)).max() <= (1.0 + 1e-7) / slot
            knots = np.concatenate([np.nextafter(motion.times[1:], 0.0), motion.times[:-1]])
            assert np.abs(spline(knots, 2)).max() <= (1.0 + 1e-7) * fast / steep / slot**2


def test_stretches_of_all_lengths_keep_the_limits():
    random = np.random.default_rng(0)
    slot = 0.1
    for _ in range(2000):
        change = slot * random.uniform(0.5, 3.0, 3)
        rise = slot * change * 10.0 ** random.uniform(-2.0, 2.0)
        pace = Pace(change, rise, np.inf)
        start = random.uniform(-3.0, 3.0, 3)
        end = start + 10.0 ** random.uniform(-16.0, 0.5) * random.uniform(-1.0, 1.0, 3)
        least = max(1, int(pace.whole_slots((end - start)[None])[0]))
        wait = random.integers(1, 150)
        slots = np.array([0, wait, wait + least + random.integers(0, 5)])
        timing = Timing(np.array([start, start, end]), slots)
        motion = timing.trajectory(pace, slot, JointPath(timing.rows, ("a", "b", "c")))

        spline = CubicHermiteSpline(motion.times, motion.positions, motion.velocities)
        begins = 2.0 * spline.c[1]
        ends = begins + 6.0 * spline.c[0] * np.diff(motion.times)[:, None]
        assert (np.abs([begins, ends]) <= (1.0 + 1e-6) * rise / slot**2).all()
        assert (np.abs(motion.velocities) <= (1.0 + 1e-9) * change / slot).all()


def test_a_vertex_is_reached_only_onwards_in_time_and_at_a_speed_that_is_allowed():
    pace = Pace(np.array([1.0, 0.5]), np.full(2, 1e12), np.inf)
    for onward in (1, -1):
        tree = TimeTree(pace, onward)
        tree.add(np.zeros(2), 10, -1)
        assert tree.nearest(np.array([0.0, 1.0]), 10 + 2 * onward) == 0
        assert tree.nearest(np.array([0.0, 1.0]), 10 + onward) is None
        assert tree.nearest(np.zeros(2), 10 - onward) is None
        assert tree.nearest(np.zeros(2), 10) is None


@pytest.mark.parametrize("slots", [3, 4, 7, 40])
def test_a_stretch_keeps_its_limits_and_ends_where_it_should(slots):
    pace = Pace(np.array([1.0, 0.6]), np.array([0.5, 0.3]), np.inf)
    move = np.array([1.0, -0.6])
    share = pace.reach(move, slots)
    assert pace.slots(share * move[None])[0] <= slots + 1e-9
    assert share == 1.0 or pace.slots(1.001 * share * move[None])[0] > slots
    rows = stretch(np.zeros(2), share * move, slots, pace)
    assert rows[[0, -1]].tolist() == [[0.0, 0.0], (share * move).tolist()]
    steps = np.abs(np.diff(rows, axis=0))
    assert (steps <= pace.change + 1e-9).all()
    assert (np.abs(np.diff(steps, axis=0)) <= pace.rise + 1e-9).all()


@pytest.mark.parametrize("short", [0.0, 2e-16, 1e-14, 1e-12, 1e-9, 1e-5, 1e-2])
def test_knots_are_far_enough_apart_to_have_an_acceleration(short):
    """A stretch whose acceleration needs all of its slots but a few parts of them has a very short cruise."""
    pace = Pace(np.array([9.0, 9.0]), np.array([0.5, 0.3]), np.inf)
    rows = np.array([[0.7, -0.2], [0.7, -0.2] + (1.0 - short) * np.array([4.5, 0.3])])  # 36 square slots
    timing = Timing(rows, np.array([0, 6]))
    motion = timing.trajectory(pace, 0.1, JointPath(rows, ("a", "b"), np.zeros(2, dtype=bool), "two"))
    spline = CubicHermiteSpline(motion.times, motion.positions, motion.velocities)
    ends = [spline(motion.times[:-1], 2), spline(np.nextafter(motion.times[1:], 0.0), 2)]
    assert (np.abs(ends) <= np.array([0.5, 0.3]) / 0.1**2 * (1.0 + 1e-6)).all()
    assert np.abs(motion(0.1 * np.arange(7)).positions - timing.each_slot(pace)).max() < 1e-9


def test_no_motion_is_faster_than_the_bound_and_straight_ones_may_be_slower():
    pace = Pace(np.array([0.1, 9.0]), np.array([9.0, 0.1]), np.inf)
    move = np.array([[1.0, 1.0]])
    assert pace.least_slots(move) == [11]  # the first joint at full speed for 10 slots, and some to speed up
    assert pace.whole_slots(move) == [11]
    assert pace.least_slots(np.array([[1.0, 2.0]])) == [11]
    assert pace.whole_slots(np.array([[1.0, 2.0]])) == [12]  # the second joint's 20 square slots of acceleration


def test_a_goal_that_is_free_only_later_is_waited_for():
    lid = TimedPoses([0.0, 6.0, 6.5], [place(19.0, 10.0), place(19.0, 10.0), place(19.0, -30.0)])
    problem = plane(box("lid", 19.0, 10.0, 2.0, 2.0, lid))
    plan = plan_in_time(problem, seed=1, iterations=50, **PLANE)
    assert plan.found, plan.reason
    assert 6.0 < plan.arrival < 7.5
    assert faults_of(problem, plan.motion, 1e3, 5.0) == ([], ())
    keeps_accelerations(plan, FAST)


def test_a_goal_under_what_moves_is_refused_where_nothing_is_waited_for(tmp_path, capsys):
    lid = box("lid", 19.0, 10.0, 2.0, 2.0, ConstantVelocity([0.0, 1.0, 0.0]))
    problem = plane(lid)
    straight = [problem.start, problem.goal.q]
    for refuses in (
        lambda: rrtik.plan(problem),
        lambda: rrtik.plan(problem, "rrtconnect", shorten=False),
        lambda: rrtik.ompl.simple_setup(problem),
        lambda: opinion_on(problem.world, *straight, straight),
    ):
        with pytest.raises(rrtik.ProblemError, match=r"'lid' overlap.*plan_in_time") as caught:
            refuses()
        assert caught.value.part == "goal"
        assert caught.value.contacts == (("disc", "lid"),)
    assert all("plan_in_time" in each.reason for each in rrtik.plan_many([problem, problem]))

    problem.save(tmp_path / "lid.yaml")
    assert run_command(["check", str(tmp_path / "lid.yaml")]) == 0
    assert "goal is covered at first: 'disc' and 'lid' overlap" in capsys.readouterr().out

    rest = box("rest", 19.0, 10.0, 2.0, 2.0)
    for obstacles, ends in (((lid, rest), {}), ((lid,), {"goal": (30.0, 10.0)}), ((lid,), {"start": (19.0, 10.0)})):
        with pytest.raises(rrtik.ProblemError, match=r"'rest'|'x' is at 30 m|start is in"):
            plane(*obstacles, **ends)


def test_bad_input_names_what_is_wrong():
    problem = crossing()
    for options, words in (
        ({"rate": 0.0}, "rate"),
        ({"horizon": -1.0}, "horizon"),
        ({"speed": np.nan}, "speed"),
        ({"margin": -0.1}, "margin"),
        ({"iterations": 0}, "iterations"),
        ({"seed": -1}, "seed"),
        ({"horizon": 1e9}, "slots of time"),
        ({"limits": 3.0}, "limits"),
        ({"goal": [1.0]}, "goal"),
        ({"goal": [1.0, 99.0]}, "goal: joint 'y' is at 99 m, outside its limits"),
    ):
        with pytest.raises(InputError, match=words):
            plan_in_time(problem, **options)
    with pytest.raises(InputError, match="problem"):
        plan_in_time("replan_ur5")
    assert "no arrival before" in plan_in_time(problem, horizon=1.0, **PLANE).reason
    near = plane(box("beside", 4.0, 10.0, 4.0, 4.0, ConstantVelocity([-30.0, 0.0, 0.0])))
    assert "start" in plan_in_time(near, seed=1, **PLANE).reason


def test_a_ground_that_turns_has_no_bound():
    ground = HalfSpace([0.0, 0.0, 1.0], -5.0)
    turned = pin.SE3(pin.exp3(np.array([0.3, 0.0, 0.0])), np.zeros(3))
    tilting = Obstacle("ground", ground, motion=TimedPoses([0.0, 1.0], [pin.SE3.Identity(), turned]))
    problem = plane()
    scene = Scene((tilting,))
    moved = rrtik.Problem(World(problem.robot, scene, motion_resolution=0.05), problem.start, problem.goal)
    with pytest.raises(InputError, match="turns"):
        plan_in_time(moved, **PLANE)


def met_at(x, gap):
    """When the left face of a box four wide that comes along x at 2 m/s is a gap away from the goal at 19."""
    return (x - 2.0 - gap - 19.0) / 2.0


@pytest.mark.parametrize(
    ("motion", "until"),
    [
        (None, np.inf),
        (ConstantVelocity([0.0, 0.0, 0.0]), np.inf),
        (ConstantVelocity([-2.0, 0.0, 0.0]), met_at(60.0, 0.011)),
        (ConstantVelocity([2.0, 0.0, 0.0]), 25.0),
        (TimedPoses([0.0, 20.0], [place(60.0, 10.0), place(20.0, 10.0)]), met_at(60.0, 0.011)),
        (TimedPoses([0.0, 19.0], [place(60.0, 10.0), place(22.0, 10.0)]), np.inf),
    ],
    ids=["rests", "says that it rests", "comes", "goes", "comes and stops", "stops short"],
)
def test_until_when_the_arm_may_stay_where_it_arrives(motion, until):
    problem = plane(box("block", 60.0, 10.0, motion=motion))
    plan = plan_in_time(problem, seed=1, margin=0.01, horizon=25.0, iterations=50, **PLANE)
    assert until - 1e-4 <= plan.free_until <= until
    if np.isfinite(until):
        assert World(problem.robot, problem.world.scene.at(until - 1e-3)).valid(problem.goal.q)
    assert not plan_in_time(problem, horizon=1e-3).free_until
