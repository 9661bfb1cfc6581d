from __future__ import annotations

from itertools import count, pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.model.transitions import lower_bound, merge_moves, route_length, single_joint, transitions
from rrtik_ompl.planning.moves.axis_cut import (
    axis_cut,
    axis_cut_rounds,
    axis_moves,
    cut_parts,
    double_axis_cut,
)
from rrtik_tests.mazes import GridWorld

GRID = 6


def free(tails: np.ndarray, _heads: np.ndarray) -> np.ndarray:
    return np.ones(len(tails), dtype=bool)


def blocked(tails: np.ndarray, _heads: np.ndarray) -> np.ndarray:
    return np.zeros(len(tails), dtype=bool)


@st.composite
def walks(draw: st.DrawFn) -> tuple[GridWorld, np.ndarray]:
    """A random axis walk on a grid of two or three dimensions, and obstacles in cells off the walk."""
    dof = draw(st.integers(2, 3))
    rows = [[draw(st.integers(0, GRID - 1)) for _ in range(dof)]]
    for axis, value in draw(st.lists(st.tuples(st.integers(0, dof - 1), st.integers(0, GRID - 1)), max_size=12)):
        rows.append([value if i == axis else old for i, old in enumerate(rows[-1])])
    route = np.array(rows, dtype=float)
    crossed = set()
    for a, b in pairwise(route):
        for share in np.linspace(0, 1, GRID * 4):
            crossed.add(tuple(np.rint(a + share * (b - a)).astype(int).tolist()))
    cells = st.sets(st.tuples(*[st.integers(0, GRID - 1)] * dof), max_size=40)
    return GridWorld(draw(cells) - crossed), route


def all_free(route: np.ndarray, world: GridWorld) -> bool:
    return bool(world.motion_valid_batch(route[:-1], route[1:]).all())


@settings(deadline=None)
@given(walks())
def test_a_pass_keeps_ends_validity_and_single_joint_moves_and_adds_no_move(case: tuple[GridWorld, np.ndarray]) -> None:
    world, route = case
    once, twice = axis_cut(route, world.motion_valid_batch), double_axis_cut(route, world.motion_valid_batch)
    for result in (once, twice, axis_cut_rounds(route, world.motion_valid_batch, rounds=3)):
        np.testing.assert_array_equal(result[[0, -1]], route[[0, -1]])
        assert single_joint(result)
        assert all_free(result, world)
    assert transitions(twice) <= transitions(once) <= transitions(route)


@settings(deadline=None)
@given(walks())
def test_without_obstacles_one_pass_reaches_the_lower_bound(case: tuple[GridWorld, np.ndarray]) -> None:
    _, route = case
    assert transitions(axis_cut(route, free)) == lower_bound(route[0], route[-1])


@settings(deadline=None)
@given(walks(), st.integers(0, 2**20))
def test_a_test_that_is_never_sure_ends_all_the_same(case: tuple[GridWorld, np.ndarray], seed: int) -> None:
    _, route = case
    rng = np.random.default_rng(seed)
    result = double_axis_cut(route, lambda a, b: rng.random(len(a)) < 0.3)
    np.testing.assert_array_equal(result[[0, -1]], route[[0, -1]])
    assert single_joint(result)


def test_the_last_joint_moves_first_seen_from_the_pivot() -> None:
    zigzag = [[0.0, 0], [1, 0], [1, 1], [2, 1], [2, 2]]
    assert axis_cut(zigzag, free).tolist() == [[0, 0], [2, 0], [2, 2]]
    assert axis_cut(zigzag, free, axes=[0, 1]).tolist() == [[0, 0], [0, 2], [2, 2]]


def test_the_second_pass_cuts_what_the_first_one_cannot() -> None:
    # Seen from the end, no waypoint before the last but one is in reach; seen from the start, a later one is.
    world = GridWorld({(2, 1), (1, 2), (4, 3)})
    route = np.array([[0.0, 0], [0, 1], [1, 1], [1, 0], [3, 0], [3, 2], [2, 2], [2, 4], [4, 4]])
    assert all_free(route, world)
    once, twice = axis_cut(route, world.motion_valid_batch), double_axis_cut(route, world.motion_valid_batch)
    assert transitions(twice) < transitions(once) < transitions(route)


@settings(deadline=None)
@given(walks(), st.integers(0, 4))
def test_parts_of_a_long_route_are_cut_as_the_whole_is_and_a_stop_leaves_the_rest(
    case: tuple[GridWorld, np.ndarray], most: int
) -> None:
    world, walk = case
    route = np.vstack([walk, walk[-2::-1]] * 3 + [walk])  # to and fro, so long that there are several parts
    looks = count()
    stopped = double_axis_cut(route, world.motion_valid_batch, stop=lambda: next(looks) >= most)
    for result in (cut_parts(route, world.motion_valid_batch), stopped):
        np.testing.assert_array_equal(result[[0, -1]], route[[0, -1]])
        assert len(result) == 1 or single_joint(result)
        assert all_free(result, world)
        assert transitions(result) <= transitions(route)
    if most == 0:
        assert transitions(stopped) == transitions(route)


@settings(deadline=None)
@given(walks())
def test_the_earliest_waypoint_in_reach_is_the_one_that_is_found_one_by_one(case: tuple[GridWorld, np.ndarray]) -> None:
    world, walk = case
    route = merge_moves(walk, tolerance=0.0)
    pivot, new = len(route) - 1, [route[-1:]]
    while pivot > 0:
        ways = ((test, axis_moves(route[pivot], route[test], range(route.shape[1])[::-1])) for test in range(pivot))
        pivot, way = next((t, w) for t, w in ways if all_free(np.vstack([route[pivot], w]), world))
        new.append(way)
    np.testing.assert_array_equal(axis_cut(walk, world.motion_valid_batch), merge_moves(np.vstack(new), 0.0)[::-1])


def test_a_doubtful_original_edge_is_kept() -> None:
    route = np.array([[0.0, 0], [0, 3], [3, 3]])
    np.testing.assert_array_equal(axis_cut(route, blocked), route)


def test_an_edge_of_several_joints_is_replaced_by_single_moves_where_they_are_free() -> None:
    assert single_joint(axis_cut(np.array([[0.0, 0], [1, 2], [3, 3]]), free))
    diagonal = np.array([[0.0, 0], [3, 3]])
    np.testing.assert_array_equal(axis_cut(diagonal, blocked), diagonal)


def test_every_motion_is_asked_once_and_in_one_direction() -> None:
    asked: list[tuple[tuple[float, ...], tuple[float, ...]]] = []

    def remember(tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        asked.extend((tuple(a), tuple(b)) for a, b in zip(tails.tolist(), heads.tolist(), strict=True))
        return blocked(tails, heads)

    axis_cut_rounds(np.array([[0.0, 0], [0, 3], [3, 3], [3, 1], [5, 1]]), remember)
    assert asked
    assert len({frozenset(motion) for motion in asked}) == len(asked)


def test_axis_moves_change_the_joints_in_the_given_order_and_skip_those_at_rest() -> None:
    moves = axis_moves(np.array([0.0, 0, 0]), np.array([1.0, 0, 2]), [2, 1, 0])
    assert moves.tolist() == [[0, 0, 2], [1, 0, 2]]
    assert axis_moves(np.zeros(2), np.zeros(2), [0, 1]).shape == (0, 2)


def test_a_route_of_one_configuration_stays() -> None:
    assert double_axis_cut(np.array([[1.0, 2.0]]), free).tolist() == [[1, 2]]


@settings(deadline=None)
@given(walks(), st.integers(0, 1000))
def test_further_rounds_are_never_worse_and_repeat_with_their_seed(
    case: tuple[GridWorld, np.ndarray], seed: int
) -> None:
    world, route = case
    results = [axis_cut_rounds(route, world.motion_valid_batch, rounds=4, budget=Budget(seed)) for _ in range(2)]
    np.testing.assert_array_equal(results[0], results[1])
    double = double_axis_cut(route, world.motion_valid_batch)
    assert (transitions(results[0]), route_length(results[0])) <= (transitions(double), route_length(double) + 1e-12)
