"""Searches that outlive a call: one memory for a world, never used twice at a time, dropped where it may be broken."""

from __future__ import annotations

from threading import Thread
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl import Box, Obstacle, Scene, World, load_robot
from rrtik_ompl.kernels.search import connect
from rrtik_ompl.kernels.search.connect import ConnectSearch, kept_search, solve_each
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem

pytestmark = pytest.mark.kernels


@pytest.fixture(scope="module")
def problem() -> Any:
    return load_problem("titan4_sdu")


def used(problem: Any, key: object = "here") -> Any:
    motions = problem.world.motions
    return kept_search(motions, key, lambda: ConnectSearch(motions, *problem.robot.finite_range()))


def test_a_search_is_used_again_for_the_same_key_alone(problem: Any) -> None:
    with used(problem) as first:
        pass
    with used(problem) as second:
        pass
    with used(problem, "there") as third:
        pass
    assert first is second
    assert third is not first


def test_nobody_else_gets_a_search_in_use(problem: Any) -> None:
    with used(problem) as outer, used(problem) as inner:
        assert inner is not outer
        paths = [
            s.solve(problem.start[None], problem.goal.q[None], 3, ask=problem.world.motion_valid_batch)
            for s in (outer, inner)
        ]
    np.testing.assert_array_equal(*paths)


def test_a_search_that_an_interrupt_has_left_is_dropped(problem: Any) -> None:
    with pytest.raises(KeyboardInterrupt), used(problem) as broken:
        raise KeyboardInterrupt
    with used(problem) as other:
        assert other is not broken


def test_a_search_that_has_grown_too_large_gives_its_memory_back(problem: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(connect, "LARGEST_KEPT", 1)
    with used(problem) as first:
        pass
    with used(problem) as second:
        assert second is not first


def test_plans_one_after_the_other_are_those_of_fresh_worlds(problem: Any) -> None:
    for seed in range(4):
        fresh = load_problem("titan4_sdu")
        one, two = (plan(p, "fastrrtconnect", seed=seed, shorten=False).path for p in (problem, fresh))
        np.testing.assert_array_equal(one.waypoints, two.waypoints)


def test_threads_with_a_world_each_find_what_one_thread_finds() -> None:
    wanted = [
        plan(load_problem("titan4_sdu"), "fastrrtconnect", seed=s, shorten=False).path.waypoints for s in range(6)
    ]
    found: dict[int, Any] = {}

    def work(seeds: range) -> None:
        own = load_problem("titan4_sdu")
        for seed in seeds:
            found[seed] = plan(own, "fastrrtconnect", seed=seed, shorten=False).path.waypoints

    threads = [Thread(target=work, args=(seeds,)) for seeds in (range(3), range(3, 6))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for seed, rows in enumerate(wanted):
        np.testing.assert_array_equal(found[seed], rows)


@pytest.fixture(scope="module")
def crowded() -> Any:
    """A UR5 among many boxes: kernels leave motions of its searches undecided."""
    rng = np.random.default_rng(4)
    boxes = [Obstacle(f"box{k}", Box((0.12, 0.12, 0.12)), place(rng)) for k in range(15)]
    return World(load_robot("ur5"), Scene(boxes))


def place(rng: np.random.Generator) -> Any:
    way = rng.normal(size=3)
    return pin.SE3(pin.Quaternion(*rng.normal(size=4)).normalized().matrix(), 0.7 * way / np.linalg.norm(way))


def test_many_queries_in_one_call_find_what_each_finds_alone(crowded: Any) -> None:
    world = crowded.with_accuracy("conservative")
    rows = np.random.default_rng(1).uniform(-2.0 * np.pi, 2.0 * np.pi, (400, 6))
    rows = rows[world.valid_batch(rows)]
    ends, seeds = rows[:80].reshape(40, 2, 6), list(range(40))
    search = ConnectSearch(world.motions, world.robot.lower, world.robot.upper)
    together, asked, rejected = solve_each(search, ends, seeds, 1000), 0, 0
    for each, (start, goal), seed in zip(together, ends, seeds, strict=True):
        alone = search.solve(start[None], goal[None], seed, ask=none_free, max_iterations=1000)
        counts = search.statistics()
        if each is None:
            continue
        assert (each.path is None) == (alone is None)
        assert alone is None or np.array_equal(each.path, alone)
        assert [counts[name] for name in each._fields[1:]] == list(each[1:])
        asked, rejected = asked + each.questions, rejected + each.rejected
    assert together.count(None) < 4
    assert asked > 0
    assert rejected > 0
    assert search.intact()


def none_free(starts: Any, ends: Any) -> Any:
    return np.zeros(len(starts), dtype=bool)


def test_what_takes_long_or_has_no_room_is_left_to_a_search_of_its_own(crowded: Any, monkeypatch: Any) -> None:
    world = crowded.with_accuracy("conservative")
    rows = np.random.default_rng(1).uniform(-2.0 * np.pi, 2.0 * np.pi, (400, 6))
    ends = rows[world.valid_batch(rows)][:80].reshape(40, 2, 6)
    search = ConnectSearch(world.motions, world.robot.lower, world.robot.upper)
    whole = solve_each(search, ends, [1] * 40, 1000)
    monkeypatch.setattr(connect, "MEAN_BUDGET", 20)
    brief = solve_each(search, ends, [1] * 40, 1000)
    assert 0 < brief.count(None) < 40
    monkeypatch.undo()
    monkeypatch.setattr(connect, "FIRST_PATH", 3)
    narrow = solve_each(search, ends, [1] * 40, 1000)
    assert 0 < narrow.count(None) < 40
    for some in (brief, narrow):
        for one, other in zip(some, whole, strict=True):
            assert one is None or other is None or (one.path is None) == (other.path is None)
            assert one is None or other is None or one.path is None or np.array_equal(one.path, other.path)
