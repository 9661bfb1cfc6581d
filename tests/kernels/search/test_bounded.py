"""Searches that are bounded by the length of a path [15]."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.record import Floats
from rrtik_ompl.kernels.search import tree_kernels as trees
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration
from rrtik_ompl.kernels.search.tree_layout import CERTAIN, TreeTable
from rrtik_ompl.kernels.search.tree_memory import tree_table
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry
from rrtik_ompl.model.transitions import route_length

pytestmark = pytest.mark.kernels


@cache
def problem():
    return rrtik.load_problem("titan4_prisms")


@cache
def search():
    world = problem().world
    return ConnectSearch(world.motions, world.robot.lower, world.robot.upper)


def solved(seed, bound=None, max_iterations=20_000):
    world = problem().world
    ends = problem().start[None], problem().goal.q[None]
    return search().solve(*ends, seed, ask=world.motion_valid_batch, max_iterations=max_iterations, bound=bound)


@entry
def cheapest(tree: TreeTable, query: Floats, millionths: int) -> int:
    return trees.nearest_by_cost(tree, query, millionths * 1e-6)


@pytest.mark.parametrize("count", [1, WIDTH, 3 * WIDTH + 1])
def test_the_nearest_vertex_by_cost_is_the_one_of_numpy(count):
    rng = np.random.default_rng(count)
    rows, costs = rng.uniform(-3, 3, (count, 4)), rng.uniform(0, 5, count)
    tree = tree_table(4, 0, WIDTH * -(-count // WIDTH))
    for row in rows:
        kept = np.array(row).view(Configuration)
        trees.add_vertex(tree, kept, kept, -1, CERTAIN, 1e30)
    tree.costs[:count] = costs
    for query, wanted in zip(rng.uniform(-3, 3, (50, 4)), rng.integers(0, 5_000_000, 50).tolist(), strict=True):
        single = np.array(query, dtype=np.float32).view(Floats)
        squares = ((rows - query) ** 2).sum(axis=1) + np.maximum(costs - 1e-6 * wanted, 0.0) ** 2
        assert squares[cheapest(tree, single, wanted)] <= squares.min() + 1e-4
    assert tree.intact()


def test_paths_stay_below_the_bound_and_are_free():
    world, found = problem().world, 0
    for seed in range(20):
        bound = route_length(solved(seed))
        path = solved(seed + 100, bound)
        if path is None:  # the bound may be that of a path that is next to the shortest one
            continue
        found += 1
        assert route_length(path) < bound + 1e-5
        assert world.motion_valid_batch(path[:-1], path[1:]).all()
        assert (path[0] == problem().start).all()
        assert (path[-1] == problem().goal.q).all()
    assert found >= 10
    assert search().intact()


def test_ever_lower_bounds_lead_to_ever_shorter_paths_down_to_the_straight_line():
    path, lengths = solved(1), []
    for seed in range(30):
        lengths.append(route_length(path))
        path = solved(seed, lengths[-1], 5_000)
        if path is None:
            break
    assert (np.diff(lengths) < 1e-5).all()
    assert len(lengths) > 2
    assert lengths[-1] > np.linalg.norm(problem().goal.q - problem().start)


def test_no_sample_is_of_use_where_the_bound_is_below_the_straight_line():
    assert solved(3, 0.9 * np.linalg.norm(problem().goal.q - problem().start), 2_000) is None
    assert search().statistics()["vertices"] == 2


def test_a_search_without_bound_is_as_before_after_one_with_a_bound():
    first = solved(7)
    solved(8, route_length(first))
    assert np.array_equal(solved(7), first)


def test_the_same_seed_and_bound_give_the_same_path():
    bound = 1.1 * route_length(solved(5))
    assert np.array_equal(solved(6, bound), solved(6, bound))


def test_the_planner_takes_a_bound():
    free = rrtik.plan(problem(), "fastrrtconnect", seed=1, proof="off", shorten=False)
    bound = 0.95 * free.path.length
    found = rrtik.plan(problem(), "fastrrtconnect", seed=2, proof="off", parameters={"bound": bound}, shorten=False)
    assert found.path.length < bound
    with pytest.raises(InputError, match="bound"):
        rrtik.plan(problem(), "fastrrtconnect", parameters={"bound": 0.0})
