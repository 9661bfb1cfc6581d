"""The search on a lattice finds the best route, is repeatable, and keeps costs, limits and frozen joints."""

from __future__ import annotations

from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.model.transitions import lower_bound, route_length, single_joint, transitions
from rrtik_ompl.planning.moves.lattice import MoveLattice, within_travel
from rrtik_ompl.planning.moves.search import MoveSearch
from rrtik_tests.mazes import GridWorld

GRID = 4


@st.composite
def mazes(draw: st.DrawFn) -> tuple[GridWorld, np.ndarray, np.ndarray]:
    """A grid with blocked cells, a start and a goal."""
    dof = draw(st.integers(2, 3))
    cells = st.tuples(*[st.integers(0, GRID - 1)] * dof)
    start, goal = draw(cells), draw(cells)
    blocked = draw(st.sets(cells, max_size=GRID**dof // 2)) - {start, goal}
    return GridWorld(blocked), np.array(start, dtype=float), np.array(goal, dtype=float)


def grid_lattice(world: GridWorld, dof: int) -> MoveLattice:
    return MoveLattice([np.arange(GRID, dtype=float)] * dof, world.motion_valid_batch, np.ones(dof))


def best_rank(world: GridWorld, start: np.ndarray, goal: np.ndarray) -> tuple[int, float] | None:
    """Fewest moves and least travel on the grid, one cell after the other, the slow and obvious way."""
    dof = len(start)
    best = {tuple(start.astype(int).tolist()): (0, 0.0)}
    for _ in range(GRID**dof):
        before = dict(best)
        for cell, (moves, travel) in before.items():
            for axis, way in product(range(dof), (-1, 1)):
                step = list(cell)
                while 0 <= step[axis] + way < GRID:
                    step[axis] += way
                    place = tuple(step)
                    if place in world.blocked:
                        break
                    rank = (moves + 1, travel + abs(step[axis] - cell[axis]))
                    best[place] = min(best.get(place, rank), rank)
        if best == before:
            break
    return best.get(tuple(goal.astype(int).tolist()))


@given(mazes())
def test_the_best_route_on_a_lattice_is_the_one_of_an_exhaustive_search(
    case: tuple[GridWorld, np.ndarray, np.ndarray],
) -> None:
    world, start, goal = case
    route = grid_lattice(world, len(start)).best_route(start, goal, range(len(start)))
    expected = best_rank(world, start, goal)
    assert (route is None) == (expected is None)
    if route is not None:
        np.testing.assert_array_equal(route[[0, -1]], [start, goal])
        assert len(route) == 1 or single_joint(route)
        assert (len(route) - 1, route_length(route)) == expected
        assert world.motion_valid_batch(route[:-1], route[1:]).all()


@given(mazes(), st.lists(st.floats(0.5, 4.0), min_size=3, max_size=3), st.floats(0.0, 3.0))
def test_a_lattice_of_the_values_within_a_travel_has_the_same_best_route(
    case: tuple[GridWorld, np.ndarray, np.ndarray], dear: list[float], spare: float
) -> None:
    world, start, goal = case
    dof, costs = len(start), np.array(dear[: len(start)])
    values = [np.arange(GRID, dtype=float)] * dof
    best = MoveLattice(values, world.motion_valid_batch, costs).best_route(start, goal, range(dof))
    travel = np.inf if best is None else float((np.abs(np.diff(best, axis=0)) @ costs).sum())
    direct = float(costs @ np.abs(goal - start))
    assert within_travel(values, start, goal, costs, direct - 0.1) is None
    left = within_travel(values, start, goal, costs, direct + spare)
    assert left is not None
    few = MoveLattice(left, world.motion_valid_batch, costs).best_route(start, goal, range(dof))
    if travel <= direct + spare:
        assert few is not None
        assert (few == best).all()


@given(mazes(), st.integers(0, 100))
def test_a_search_is_never_worse_than_what_it_was_offered_and_repeats_with_its_seed(
    case: tuple[GridWorld, np.ndarray, np.ndarray], seed: int
) -> None:
    world, start, goal = case
    offered = grid_lattice(world, len(start)).best_route(start, goal, range(len(start)))
    found = []
    for _ in range(2):
        limits = np.zeros(len(start)), np.full(len(start), GRID - 1.0)
        search = MoveSearch(
            start[None], goal[None], *limits, world.motion_valid_batch, budget=Budget(seed), most_nodes=64
        )
        if offered is not None:
            search.offer(offered)
        search.try_corner_routes()
        search.improve(2)
        found.append(search.route)
        if offered is not None and search.route is not None:
            assert (search.moves, route_length(search.route)) <= (transitions(offered), route_length(offered) + 1e-6)
            assert lower_bound(start, goal) <= search.bound <= search.moves
            np.testing.assert_array_equal(search.route[[0, -1]], [start, goal])
            assert len(search.route) == 1 or single_joint(search.route)
            assert world.motion_valid_batch(search.route[:-1], search.route[1:]).all()
    assert (found[0] is None) == (found[1] is None)
    if found[0] is not None:
        np.testing.assert_array_equal(found[0], found[1])


def test_a_dear_joint_travels_less() -> None:
    around = GridWorld({(1, 1)})
    start, goal = np.array([0.0, 1.0]), np.array([2.0, 1.0])
    for costs, travelled in ((np.array([1.0, 1.0]), 2.0), (np.array([1.0, 9.0]), 2.0)):
        values = [np.array([0.0, 1.0, 2.0]), np.array([-2.0, 0.0, 1.0])]
        route = MoveLattice(values, around.motion_valid_batch, costs).best_route(start, goal, range(2))
        assert route is not None
        assert np.abs(np.diff(route[:, 1])).sum() == travelled


def test_limits_and_frozen_joints_are_kept() -> None:
    wall = GridWorld({(1, y) for y in range(-1, GRID)})
    start, goal = np.array([0.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])

    def ask(tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        low = (np.abs(tails[:, 2]) < 0.5) & (np.abs(heads[:, 2]) < 0.5)
        return ~low | wall.motion_valid_batch(tails[:, :2], heads[:, :2])

    for frozen, moves in (((), 3), ((2,), None)):
        search = MoveSearch(start[None], goal[None], -np.ones(3), np.full(3, 3.0), ask, frozen=frozen)
        search.try_corner_routes()
        search.improve(3)
        assert (None if search.route is None else search.moves) == moves
