"""Searches that outlive a call: one memory for a world, never used twice at a time, dropped where it may be broken."""

from __future__ import annotations

from threading import Thread
from typing import Any

import numpy as np
import pytest

from rrtik_ompl.fast.search import connect_keeping
from rrtik_ompl.fast.search.connect import ConnectSearch
from rrtik_ompl.fast.search.connect_keeping import kept_search
from rrtik_ompl.planning import plan
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
    monkeypatch.setattr(connect_keeping, "LARGEST_KEPT", 1)
    with used(problem) as first:
        pass
    with used(problem) as second:
        assert second is not first


def test_plans_one_after_the_other_are_those_of_fresh_worlds(problem: Any) -> None:
    for seed in range(4):
        fresh = load_problem("titan4_sdu")
        one, two = (plan(p, "fastrrtconnect", seed=seed).path for p in (problem, fresh))
        np.testing.assert_array_equal(one.waypoints, two.waypoints)


def test_threads_with_a_world_each_find_what_one_thread_finds() -> None:
    wanted = [plan(load_problem("titan4_sdu"), "fastrrtconnect", seed=s).path.waypoints for s in range(6)]
    found: dict[int, Any] = {}

    def work(seeds: range) -> None:
        own = load_problem("titan4_sdu")
        for seed in seeds:
            found[seed] = plan(own, "fastrrtconnect", seed=seed).path.waypoints

    threads = [Thread(target=work, args=(seeds,)) for seeds in (range(3), range(3, 6))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for seed, rows in enumerate(wanted):
        np.testing.assert_array_equal(found[seed], rows)
