"""What was seen has an age: what an obstacle may have done since then is kept clear, and an end is an end."""

from __future__ import annotations

import warnings
from itertools import repeat

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, HalfSpace, Sphere
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.replanning.feed import Snapshot, Stream
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.travels import MotionTracker, SpeedWarning
from rrtik_ompl.replanning.unavoidable import ContactWarning
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.pedestal import beside_pedestal
from rrtik_tests.run_judge import judged

SPEED, RATE, MARGIN = 0.2, 50.0, 0.02
PLATE = Obstacle("plate", Box([0.04, 0.3, 0.4]), pin.SE3(np.eye(3), np.array([0.0, 0.28, 0.0])))
KEPT = {"margin": MARGIN, "speed_bound": SPEED}
OPTIONS = {
    "step": 0.0135, "rate": RATE, "seconds": 8.0, "repair_budget": 30.0, "seed": 1,
    "limits": RateLimits([5.0, 5.0], [5.0, 5.0]),
}  # fmt: skip


def at(time, speed=SPEED):
    """The plate comes down across the way of the ball."""
    there = pin.SE3(np.eye(3), PLATE.pose.translation - [0.0, speed * min(time, 2.0), 0.0])
    return Scene([Obstacle("plate", PLATE.shape, there)])


def stream(begin=0.0, end=8.0, silent=(), every=0.02, unit=1.0):
    """Snapshots until an end, none in a time of silence; their clock begins anywhere and has any unit."""
    for k in range(round(end / every) + 1):
        time = k * every
        if not silent or not silent[0] < time < silent[1]:
            yield begin + unit * time, at(time)


def ball():
    robot = load_robot("point2d", parameters={"radius": 0.05, "bounds": [[-1, 1], [-1, 1]]})
    return Problem(World(robot, at(0.0)), [-0.6, 0.0], [0.6, 0.0], name="ball")


def nearest(run):
    """Least distance of the ball and the plate, looked at densely where the plate really is."""
    least = np.inf
    for tick, after in zip(run.ticks, run.ticks[1:], strict=False):
        for share in np.linspace(0.0, 1.0, 9):
            there = at(tick.time + share / RATE).obstacle("plate").pose.translation[:2]
            away = np.abs(tick.q + share * (after.q - tick.q) - there) - 0.5 * np.asarray(PLATE.shape.size)[:2]
            least = min(least, float(np.linalg.norm(np.maximum(away, 0.0))) - 0.05)
    return least


def test_a_stream_that_is_never_silent_keeps_the_margin():
    run = judged(replan(ball(), stream(), **OPTIONS, **KEPT), ball(), at)
    assert run.found
    assert nearest(run) >= MARGIN


@pytest.mark.parametrize("begin", [100.0, -3.0, 1.7e9])
def test_times_are_counted_from_the_first_of_any_clock(begin):
    runs = [replan(ball(), stream(first), **OPTIONS, **KEPT) for first in (0.0, begin)]
    assert runs[0].configurations.tolist() == runs[1].configurations.tolist()
    assert [tick.proven for tick in runs[0].ticks] == [tick.proven for tick in runs[1].ticks]


@pytest.mark.parametrize("silent", [(0.5, 0.9), (0.3, 1.1), (0.0, 1.5)])
def test_a_gap_costs_time_and_no_margin(silent):
    with warnings.catch_warnings():
        warnings.simplefilter("error", SpeedWarning)  # the plate was no faster
        run = replan(ball(), stream(silent=silent), **OPTIONS, **KEPT)
    judged(run, ball(), at)
    assert run.found
    assert nearest(run) >= MARGIN


def test_one_scene_a_second_costs_time_and_no_margin():
    run = replan(ball(), stream(every=1.0), **OPTIONS, **KEPT)
    judged(run, ball(), at)
    assert nearest(run) >= MARGIN


@pytest.mark.parametrize("bound", [SPEED, None])
@pytest.mark.parametrize("end", [0.2, 0.3, 0.5])
def test_a_stream_that_ends_stops_the_arm_with_a_reason(end, bound):
    options = OPTIONS | {"margin": MARGIN, "speed_bound": bound}
    run = replan(ball(), stream(end=end), **options, feed_patience=0.6)
    assert (run.outcome, run.found) == ("no scene", False)
    assert run.reason == run.ticks[-1].reason
    assert f"no scene since {end:g} s" in run.reason
    assert "feed_patience (0.6 s)" in run.reason
    assert run.ticks[-1].time == pytest.approx(end + 0.6, abs=0.03)
    judged(run, ball(), at)
    assert nearest(run) >= (0.0 if bound is None else MARGIN)


@pytest.mark.parametrize("end", [0.2, 0.3, 0.5, 0.7])
def test_after_the_end_of_a_stream_no_way_leads_through_where_the_obstacle_may_be(end):
    run = replan(ball(), stream(end=end), **OPTIONS, **KEPT)  # there may be a way around all of it
    assert run.found or (run.outcome == "no scene" and "feed_patience (2 s)" in run.reason)
    judged(run, ball(), at)
    assert nearest(run) >= MARGIN


def test_how_long_a_stream_may_be_silent_is_a_setting():
    run = replan(ball(), stream(end=0.3), **OPTIONS, **KEPT, feed_patience=0.5)
    assert run.ticks[-1].time == pytest.approx(0.82)
    assert "feed_patience (0.5 s)" in run.reason


@pytest.mark.parametrize(
    ("pairs", "words"),
    [
        (stream(unit=1000.0), "second scene comes 20 s after the first.*give times in seconds, not milliseconds"),
        (stream(1.7e12, unit=1000.0), "times begin at 1700000000000; give seconds, not milliseconds"),
        (repeat((5.0, at(0))), "times stand still: none of 1000 scenes is later than 5 s"),
        ([(5.0, at(0)), (2.0, at(0.1))], "times go backwards: 2 s comes after 5 s"),
        ([(1.7e9, at(0)), (1.7e9 - 2.5, at(0.1))], "times go backwards: 1699999997.5 s comes after 1700000000 s"),
    ],
)
def test_times_that_cannot_be_are_refused_in_one_line(pairs, words):
    with pytest.raises(InputError, match=words) as caught:
        replan(ball(), pairs, **OPTIONS, **KEPT)
    assert "\n" not in str(caught.value)


def test_what_comes_to_rest_out_of_sight_may_begin_to_move():
    def seen():  # the plate rests beside the way as long as anybody looks, and comes down in the gap
        for k in range(400):
            time = 0.02 * k
            if not 0.3 < time < 1.2:
                yield time, at(max(time - 0.3, 0.0))

    def truth(time):
        return at(max(time - 0.3, 0.0))

    run = replan(ball(), seen(), **OPTIONS, **KEPT)
    judged(run, ball(), truth)
    assert run.count("evade") > 0


def test_a_move_beside_what_has_never_moved_is_proven_only_with_room_for_a_first_move():
    room = 0.5 * 0.002 + 0.002  # less than the post may go within a tick
    place = pin.SE3(np.eye(3), np.array([0.0, 0.15 + MARGIN + room, 0.0]))
    still = Scene([Obstacle("post", Sphere(0.1), place)])
    problem = Problem(World(ball().robot, still, motion_resolution=0.002), [-0.6, 0.0], [0.6, 0.0])
    exact = {**OPTIONS, **KEPT, "clearance": 0.0}
    from_feed = replan(problem, lambda time: still, **exact)
    stated = replan(problem, still, **exact)
    rests = Scene([Obstacle("post", Sphere(0.1), place, ConstantVelocity([0, 0, 0]))])
    said = replan(problem, lambda time: rests, **exact)
    moves, proven = stated.moves
    assert moves == proven
    assert from_feed.moves[0] == from_feed.moves[1] > 0  # It makes no move that is not proven.
    assert from_feed.length > stated.length
    assert said.moves == stated.moves


def test_nothing_is_proven_of_what_moves_at_a_speed_that_nobody_states():
    run = replan(ball(), stream(), **OPTIONS, margin=MARGIN)
    assert run.moves[0] > 0 == run.moves[1]


def test_what_states_its_motion_needs_no_bound_to_be_proven_apart():
    times, places = [0.0, 4.0], [at(time).obstacle("plate").pose for time in (0.0, 2.0)]
    moving = Scene([Obstacle("plate", PLATE.shape, places[0], TimedPoses(times, places))])
    problem = Problem(World(ball().robot, moving), [-0.6, 0.0], [0.6, 0.0])
    run = judged(replan(problem, **OPTIONS, margin=MARGIN), problem)
    assert run.moves[1] > 0.5 * run.moves[0] > 0


def test_a_move_in_which_an_obstacle_was_faster_than_stated_is_not_proven():
    def feed(time):
        return at(0.0 if time < 0.5 else 0.5)  # a jump

    with pytest.warns(SpeedWarning):
        run = replan(ball(), feed, **OPTIONS, **KEPT)
    jumped = [tick.proven for tick in run.ticks if 0.48 <= tick.time < 0.499]
    assert jumped == [False]
    assert sum(tick.proven is True for tick in run.ticks if tick.time < 0.47) > 20


def test_an_obstacle_out_of_view_has_the_age_of_its_own_sighting():
    def feed():  # pictures go on, the plate is hidden in some of them
        for k in range(400):
            time = 0.02 * k
            hidden = max(0.0, time - 0.4) if time < 1.0 else 0.0
            yield Snapshot(time, at(time - hidden), {"plate": hidden} if hidden else {})

    with warnings.catch_warnings():
        warnings.simplefilter("error", SpeedWarning)
        run = replan(ball(), feed(), **OPTIONS, **KEPT)
    judged(run, ball(), at)
    assert nearest(run) >= MARGIN


@pytest.mark.parametrize("given", ["feed", "stream"])
def test_what_one_scene_allows_is_not_allowed_by_the_next(given):
    wall = Obstacle("wall", Box([0.1, 0.4, 0.4]), pin.SE3(np.eye(3), np.zeros(3)))
    link = ball().robot.link_names[-1]
    scenes = [Scene([wall], allowed_collisions=[(link, "wall")]), Scene([wall])]

    def feed(time):
        return scenes[time >= 0.3]

    problem = Problem(World(ball().robot, scenes[0]), [-0.6, 0.0], [0.6, 0.0])
    source = feed if given == "feed" else ((0.02 * k, feed(0.02 * k)) for k in range(400))
    run = judged(replan(problem, source, **OPTIONS, **KEPT), problem, feed)
    assert run.found
    assert np.abs(run.configurations[:, 1]).max() > 0.25  # around the wall


def test_what_is_held_otherwise_than_before_is_refused():
    robot = load_robot("planar", parameters={"lengths": [1.0, 1.0]})
    far = Obstacle("far", Sphere(0.1), pin.SE3(np.eye(3), np.array([9.0, 9.0, 0.0])))

    def scene(shift):
        place = pin.SE3(np.eye(3), np.array([shift, 0.0, 0.0]))
        return Scene((far,), (AttachedObject("tool", robot.tip, Sphere(0.05), place),))

    problem = Problem(World(robot, scene(0.0)), [0.0, 0.3], [1.0, 0.3])
    with pytest.raises(InputError, match="'tool' is held"):
        replan(problem, lambda time: scene(0.0 if time < 0.2 else 0.3), step=0.02, rate=20.0)


def tilted(angle):
    return pin.SE3(pin.exp3(np.array([angle, 0.0, 0.0])), np.zeros(3))


def test_a_half_space_that_turns_is_refused_before_the_start(tmp_path):
    ground = HalfSpace([0.0, 1.0, 0.0], -0.9)
    tilting = Obstacle("ground", ground, motion=TimedPoses([1.0, 2.0], [tilted(0.0), tilted(0.3)]))
    problem = Problem(World(ball().robot, Scene([tilting])), [-0.6, 0.0], [0.6, 0.0])
    with pytest.raises(InputError, match=r"'ground'.*turns") as caught:
        replan(problem, **OPTIONS, **KEPT, record=tmp_path / "run.json")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_half_space_that_is_seen_to_turn_ends_the_run_in_one_line(tmp_path):
    def feed(time):
        return Scene([Obstacle("ground", HalfSpace([0.0, 0.0, 1.0], -0.9), tilted(max(0.0, time - 0.3)))])

    problem = Problem(World(ball().robot, feed(0.0)), [-0.6, 0.0], [0.6, 0.0])
    with pytest.raises(InputError, match="'ground' has no end and turns"):
        replan(problem, feed, **OPTIONS, **KEPT, record=tmp_path / "run.json")
    assert len(ReplanRun.load(tmp_path / "run.json").ticks) > 10


def test_a_stream_gives_the_last_scene_that_is_not_later_and_reads_no_further():
    taken = []

    def pairs():
        for k in range(9):
            taken.append(k)
            yield 7.0 + 0.1 * k, at(0.1 * k)

    watch = Stream(pairs())
    assert [round(watch(time).time, 6) for time in (0.0, 0.05, 0.1, 0.25)] == [0.0, 0.0, 0.1, 0.2]
    assert taken == [0, 1, 2, 3]


def test_the_speed_of_what_was_hidden_is_that_of_its_whole_way():
    tracker = MotionTracker(SPEED)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SpeedWarning)
        for time, hidden in ((0.0, 0.0), (0.5, 0.5), (1.0, 0.0)):
            tracker.update(Snapshot(time, at(time - hidden), {"plate": hidden}))
    assert tracker.speeds["plate"] == pytest.approx(SPEED)


def test_beside_what_may_have_come_to_the_base_unseen_the_arm_waits_for_the_next_scene(tmp_path):
    ball = Obstacle("ball", Sphere(0.06), pin.SE3(np.eye(3), np.array([0.5, 0.0, -0.8])))
    problem = beside_pedestal(tmp_path, ball)
    seen = [(time, Scene([ball])) for time in (0.0, 1.5, *np.arange(1.6, 4.0, 0.1))]
    with pytest.warns(ContactWarning, match="'ball'"):
        run = replan(problem, seen, step=0.05, rate=10.0, speed_bound=0.3, seconds=2.0)
    moves, proven = run.moves
    assert moves == proven
    waits = [tick.time for tick in run.ticks if tick.event == "wait"]
    assert 0.5 < waits[0] < waits[-1] < 1.5
    assert all(tick.unavoidable.pairs == (("base", "ball"),) for tick in run.ticks if tick.event == "wait")


def test_no_move_is_proven_in_a_tick_in_which_an_obstacle_may_reach_the_base():
    robot = load_robot("ur5")
    start = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.202]))
    ball = Obstacle("ball", Sphere(0.06), start, ConstantVelocity([0.0, 0.0, 1.0]))  # from below
    q = robot.clamp([0.0, -1.2, 0.9, -1.2, -1.5, 0.0])
    problem = Problem(
        World(robot, Scene([ball]), motion_resolution=0.005), q, q + np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    )
    run = replan(problem, step=0.01, rate=100.0, speed_bound=1.0, seconds=0.15, repair_budget=9.0)
    found = run.violations(problem)
    first = next(each for each in found if "ball" in (each.first, each.second))
    lost = run.ticks[first.tick].unavoidable
    assert lost is not None
    assert lost.pairs == (("base_link", "ball"),)
    assert 0.0 < lost.distances[0] < 0.01  # what the ball may go in the tick
    assert not any(each.proven for each in found)
    assert run.ticks[0].proven
