"""Scenes whose course is known: what is at the base, what is kept in memory, and when a search has to end."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.budget import no_stop
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, TimedPoses
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.motion.trajectory.limits import RateLimits
from rrtik_ompl.replanning import in_time
from rrtik_ompl.replanning.in_time import foreseen, plan_in_time
from rrtik_ompl.replanning.in_time.foreseen import ForeseenWorlds
from rrtik_ompl.replanning.in_time.pace import NEVER, Pace, stretch
from rrtik_ompl.replanning.in_time.search import timed
from rrtik_tests.moving_plane import FAST, box, crossing, place, plane
from rrtik_tests.pedestal import beside_pedestal


def at(x):
    return pin.SE3(np.eye(3), np.array([x, 0.0, -0.8]))


def ball(*stations):
    times, places = zip(*stations, strict=True)
    return Obstacle("ball", Sphere(0.06), at(places[0]), TimedPoses(times, [at(x) for x in places]))


def test_a_ball_that_touches_the_base_between_the_middles_of_slots_ends_all_that_is_free(tmp_path):
    meets = ball((0.0, 1.0), (0.5, 0.2), (1.0, 1.0))  # 10 mm deep, and 80 mm away in the middles of both slots
    plan = plan_in_time(beside_pedestal(tmp_path, meets), seed=1)
    assert not plan.found
    assert "'ball' reaches 'base' at 0.49" in plan.reason
    assert plan.statistics == {"iterations": 0}
    late = ball((0.0, 1.0), (3.0, 1.0), (3.5, 0.2), (4.0, 1.0))
    plan = plan_in_time(beside_pedestal(tmp_path, late), seed=1)
    assert plan.arrival == pytest.approx(2.5)  # before the ball is there


def test_what_passes_the_base_or_stands_beside_it_does_not_reach_it(tmp_path):
    passes = ball((0.0, 1.0), (0.5, 0.2105), (1.0, 1.0))  # half a millimetre away
    rests = Obstacle("rests", Sphere(0.06), at(-0.21001), ConstantVelocity([0.0, 0.0, 0.0]))
    worlds = ForeseenWorlds(beside_pedestal(tmp_path, passes, rests).world, 0.1, 0.0)
    assert worlds.base_reached(5.0) == (np.inf, "")
    assert worlds.base_reached(1e4) == (np.inf, "")


def test_the_first_contact_with_the_base_is_found_at_its_time(tmp_path):
    problem = beside_pedestal(tmp_path, ball((0.0, 1.0), (10.0, 0.0)), ball_on_its_way("second", 0.79, 0.2))
    time, line = ForeseenWorlds(problem.world, 0.1, 0.0).base_reached(30.0)
    assert time == pytest.approx(2.9, abs=1e-2)
    assert "second" in line


def ball_on_its_way(name, x, speed):
    return Obstacle(name, Sphere(0.06), at(x), ConstantVelocity([-speed, 0.0, 0.0]))


def test_few_worlds_are_kept_and_they_answer_as_many_do(monkeypatch):
    problem = crossing()
    rng = np.random.default_rng(0)
    asked = [(int(rng.integers(40)), *rng.uniform(5.0, 15.0, (2, 2))) for _ in range(300)]
    many = ForeseenWorlds(problem.world, 0.1, 0.01)
    answers = [many.free(slot, a, b) for slot, a, b in asked]
    monkeypatch.setattr(foreseen, "MOST_PROVERS", 3)
    few = ForeseenWorlds(problem.world, 0.1, 0.01)
    assert [few.free(slot, a, b) for slot, a, b in asked] == answers
    assert len(few._provers) == 3
    assert 0.1 < np.mean(answers) < 0.9


@pytest.mark.parametrize("slots", [1, 5, 19])
def test_a_stretch_is_as_free_in_blocks_as_slot_by_slot(slots, monkeypatch):
    problem = crossing()
    pace = Pace(np.ones(2), np.full(2, 0.5), np.inf)
    begins = np.random.default_rng(slots).uniform(4.0, 16.0, (60, 2))
    stretches = [(k % 37, stretch(q, q + slots * np.array([0.3, 0.01]), slots, pace)) for k, q in enumerate(begins)]
    answers = {}
    for levels in (1, 4):
        monkeypatch.setattr(foreseen, "LEVELS", levels)
        worlds = ForeseenWorlds(problem.world, 0.1, 0.01)
        answers[levels] = [worlds.steps_free(slot, rows, 1, no_stop) for slot, rows in stretches]
        backwards = [worlds.steps_free(slot + slots - 1, rows[::-1], -1, no_stop) for slot, rows in stretches]
        assert [n == slots for n in backwards] == [n == slots for n in answers[levels]]
    assert answers[4] == answers[1]
    assert 0.1 < np.mean(np.array(answers[1]) == slots) < 1.0


def test_a_search_ends_in_the_midst_of_what_takes_long(monkeypatch):
    clock, asked = [0.0], []
    free = ForeseenWorlds._free

    def counted(worlds, level, block, a, b):
        clock[0] += 1.0  # a check takes a second
        asked.append(block)
        return free(worlds, level, block, a, b)

    monkeypatch.setattr("rrtik_ompl.base.budget.time.monotonic", lambda: clock[0])
    monkeypatch.setattr(ForeseenWorlds, "_free", counted)
    door = TimedPoses([0.0, 6.0, 6.5], [place(10.0, 10.0), place(10.0, 10.0), place(10.0, -30.0)])
    problem = plane(box("low", 10.0, 3.0, 1.0, 10.0), box("high", 10.0, 17.0, 1.0, 10.0),
                    Obstacle("door", Box([1.0, 6.0, 1.0]), place(10.0, 10.0), door))  # fmt: skip
    for seconds in (100.0, 3000.0, 5000.0):
        asked.clear()
        plan_in_time(problem, speed=5.0, limits=FAST, rate=20.0, seconds=seconds, seed=1)
        assert len(asked) <= seconds + 2


def test_what_a_search_has_to_wait_for_is_not_taken_from_its_time(monkeypatch):
    clock = [0.0]
    hopeless = in_time._why_impossible

    def compiled(*of):
        clock[0] += 1000.0
        return hopeless(*of)

    monkeypatch.setattr("rrtik_ompl.base.budget.time.monotonic", lambda: clock[0])
    monkeypatch.setattr(in_time, "_why_impossible", compiled)
    assert plan_in_time(crossing(), speed=5.0, limits=FAST, seconds=1.0, seed=1).found


def test_a_timing_that_is_stopped_is_none():
    problem = plane()
    way = np.array([problem.start, problem.goal.q])
    worlds, pace = ForeseenWorlds(problem.world, 0.1, 0.0), Pace(np.ones(2), np.full(2, 0.5), np.inf)
    assert timed(way, pace, worlds, 48, lambda: False).arrival == 18 + 2
    assert timed(way, pace, worlds, 19, lambda: False) is None
    assert timed(way, pace, worlds, 48, lambda: True) is None


def test_the_slowest_speeds_are_too_slow_and_nothing_else():
    problem = crossing()
    for options in ({"speed": 1e-20}, {"speed": 5e-324}, {"limits": RateLimits([1e-300, 1.0], [1.0, 1.0])}):
        plan = plan_in_time(problem, **options)
        assert "limits allow no arrival" in plan.reason
        assert plan.least_seconds > 1e9
    assert Pace(*np.full((2, 2), 1e-300), np.inf).whole_slots(np.ones((1, 2))).tolist() == [NEVER]
    assert "rate" in plan_in_time(problem, rate=1e-3, limits=FAST).reason


def test_obstacles_are_recorded_where_they_are_not_where_the_scene_has_written_them():
    ends = [place(16.0, 3.0), place(10.0, 3.0)]
    stated = Obstacle("lift", Box([1.0, 1.0, 1.0]), ends[1], TimedPoses([0.0, 0.5], ends))  # its pose is its last one
    run = plan_in_time(plane(stated), speed=5.0, limits=FAST, seed=1).motion
    assert "lift" not in run.ticks[0].poses
    for tick in run.ticks[1:]:
        assert tick.poses["lift"][0] == pytest.approx(max(16.0 - 12.0 * tick.time, 10.0))


def test_a_slot_in_which_the_arm_stands_is_a_wait(tmp_path):
    low, high = (pin.SE3(np.eye(3), np.array([0.5 * np.cos(0.85), -0.5 * np.sin(0.85), z])) for z in (0.1, 0.5))
    leaves = Obstacle("leaves", Sphere(0.03), low, TimedPoses([0.0, 4.0, 6.0], [low, low, high]))
    run = plan_in_time(beside_pedestal(tmp_path, leaves), seed=1).motion
    assert "wait" in {tick.event for tick in run.ticks}
    for tick in run.ticks[:-1]:
        assert (tick.event == "wait") == (tick.proven is None)
