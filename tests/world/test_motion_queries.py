"""The one interface of motion checks, and RRT-Connect on any of them."""

import time

import numpy as np
import pytest

from rrtik_ompl.base.budget import no_stop
from rrtik_ompl.kernels.search.shortcut_layout import KERNELS
from rrtik_ompl.planning.search.rrt_connect import (
    ConfigurationTree,
    ConnectRules,
    RrtConnect,
    extend,
    path_between,
    reach,
    straight_path,
)
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.motion_queries import (
    CALL_TARGET_SECONDS,
    FIRST_BATCH,
    BatchedMotionQueries,
    MotionQueries,
    OutOfTime,
    has_kernels,
    is_conservative,
)

LOW, HIGH = np.zeros(2), np.full(2, 10.0)


class Wall(MotionQueries):
    """A wall across x = 5 that is open above y = 7; in steps, so fine that nothing slips through."""

    def motion_valid_batch(self, A, B):
        shares = np.linspace(0.0, 1.0, 200)[:, None, None]
        points = (1.0 - shares) * A + shares * B
        return ~((np.abs(points[..., 0] - 5.0) < 0.3) & (points[..., 1] < 7.0)).any(axis=0)


def path_of(seed, **rules):
    wall = Wall()
    search = RrtConnect(
        np.array([[1.0, 1.0]]),
        np.array([[9.0, 1.0], [9.0, 2.0]]),
        ConnectRules(LOW, HIGH, 0.8, **rules),
        wall.motion_valid,
        np.random.default_rng(seed),
    )
    return search.run(no_stop), search


@pytest.mark.parametrize("rules", [{}, {"balanced": True}, {"balanced": True, "domain": 2.0}])
def test_a_path_leads_from_the_start_to_a_goal_by_free_edges_no_longer_than_allowed(rules):
    for seed in range(5):
        path, search = path_of(seed, **rules)
        assert path[0].tolist() == [1.0, 1.0]
        assert path[-1].tolist() in ([9.0, 1.0], [9.0, 2.0])
        assert Wall().motion_valid_batch(path[:-1], path[1:]).all()
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.8 + 1e-12
        assert search.vertices == sum(tree.size for tree in search.trees)


def test_the_same_seed_gives_the_same_path_and_a_limit_ends_the_search():
    assert np.array_equal(path_of(3)[0], path_of(3)[0])
    path, search = path_of(3, max_iterations=4)
    assert path is None
    assert search.iterations == 4


def test_a_search_can_be_stopped_and_goes_on():
    _, search = path_of(1, max_iterations=0)
    search._limit = np.inf
    polls = iter(range(1000))
    assert search.run(lambda: next(polls) >= 10) is None
    assert 0 < search.iterations <= 10
    assert search.run(no_stop)[-1].tolist() in ([9.0, 1.0], [9.0, 2.0])


def test_a_blocked_vertex_takes_only_samples_within_its_domain():
    tree, rules = ConfigurationTree(np.array([[4.0, 1.0]])), ConnectRules(LOW, HIGH, 1.0, domain=0.5)
    assert extend(tree, np.array([8.0, 1.0]), rules, Wall().motion_valid) is None
    assert tree.radii == [0.5]
    assert extend(tree, np.array([4.0, 2.0]), rules, Wall().motion_valid) is None
    assert extend(tree, np.array([4.0, 1.4]), rules, Wall().motion_valid) == 1


def test_reaching_stops_before_the_target_is_added_and_where_an_edge_is_blocked():
    tree, rules = ConfigurationTree(np.array([[1.0, 1.0]])), ConnectRules(LOW, HIGH, 1.0)
    vertex = reach(tree, np.array([1.0, 3.5]), rules, Wall().motion_valid, no_stop)
    assert tree.row(vertex).tolist() == [1.0, 3.0]
    assert tree.branch(vertex).tolist() == [[1.0, 1.0], [1.0, 2.0], [1.0, 3.0]]
    assert reach(tree, np.array([9.0, 3.0]), rules, Wall().motion_valid, no_stop) is None


def test_a_straight_motion_is_taken_where_it_is_free():
    start, goals = np.array([[1.0, 1.0]]), np.array([[9.0, 1.0], [1.0, 9.0]])
    assert straight_path(start, goals, Wall().motion_valid, no_stop).tolist() == [[1.0, 1.0], [1.0, 9.0]]
    assert straight_path(start, goals[:1], Wall().motion_valid, no_stop) is None
    assert straight_path(start, start, Wall().motion_valid, no_stop).tolist() == [[1.0, 1.0]]
    assert path_between(start, goals[:1]).tolist() == [[1.0, 1.0], [9.0, 1.0]]


def test_a_stand_in_needs_to_check_motions_alone():
    wall = Wall()
    assert wall.valid(np.array([1.0, 1.0]))
    assert wall.valid_batch(np.array([[5.0, 1.0], [5.0, 8.0]])).tolist() == [False, True]
    assert not wall.motion_valid(np.array([1.0, 1.0]), np.array([9.0, 1.0]))


@pytest.mark.kernels
def test_a_stand_in_has_no_kernels_and_counts_as_exact():
    world = load_problem("planar3_b").world
    assert not has_kernels(Wall(), KERNELS)
    assert not has_kernels(None)
    assert has_kernels(world, KERNELS)
    assert not has_kernels(world, KERNELS, within=np.full((1, 3), 1e12))
    assert [is_conservative(each) for each in (Wall(), None, world)] == [False] * 3
    assert is_conservative(world.with_accuracy("conservative"))


def test_batches_give_the_answers_of_one_call_and_end_when_it_is_time():
    rng, wall = np.random.default_rng(0), Wall()
    A, B = rng.uniform(0.0, 10.0, (2, 700, 2))
    queries = BatchedMotionQueries(wall.motion_valid_batch)
    assert np.array_equal(queries(A, B), wall.motion_valid_batch(A, B))
    assert queries.asked == 700
    queries.stop = lambda: True
    assert not queries.in_time(A, B).any()
    with pytest.raises(OutOfTime):
        queries(A, B)


def test_what_is_left_when_it_is_time_is_not_free():
    looks = iter([False, True])
    queries = BatchedMotionQueries(lambda tails, _: np.ones(len(tails), dtype=bool), lambda: next(looks))
    rows = np.zeros((20, 2))
    assert queries.in_time(rows, rows).tolist() == [True] * FIRST_BATCH + [False] * (20 - FIRST_BATCH)


def test_batches_grow_while_the_machine_is_busy_with_something_else():
    sizes = []

    def kept_waiting(tails, _):
        sizes.append(len(tails))
        time.sleep(2.0 * CALL_TARGET_SECONDS)  # no work of ours
        return np.ones(len(tails), dtype=bool)

    rows = np.zeros((7 * FIRST_BATCH, 2))
    assert BatchedMotionQueries(kept_waiting)(rows, rows).all()
    assert sizes == [FIRST_BATCH, 2 * FIRST_BATCH, 4 * FIRST_BATCH]
