from __future__ import annotations

import signal
import time
from itertools import count, pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.catalog import load_robot
from rrtik_ompl.collision.overlap_depth import OverlapDepth
from rrtik_ompl.errors import InputError
from rrtik_ompl.moves.axis_cut import double_axis_cut
from rrtik_ompl.moves.lattice import MoveLattice
from rrtik_ompl.moves.lower_bounds import OneFreeValue, sharper_bound
from rrtik_ompl.moves.search import MoveSearch
from rrtik_ompl.moves.staircase import one_joint_moves
from rrtik_ompl.ompl_bridge import SearchResult
from rrtik_ompl.path import JointPath
from rrtik_ompl.planning import plan
from rrtik_ompl.problem import Problem
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.shapes import Box
from rrtik_ompl.shortening import MoveRules, shorten
from rrtik_ompl.shortening.fewest_moves import fewest_moves, grid_route, least_moves
from rrtik_ompl.transitions import lower_bound, route_length, single_joint, transitions
from rrtik_ompl.world import World
from rrtik_ompl.world.motion_queries import no_stop
from rrtik_planners import FewestMoves

GRID = 4
OPTIMA = {"env_e": 4, "planar3_a": 4, "planar3_b": 4, "planar3_c": 3, "titan4_prisms": 3, "titan4_sdu": 6}


class GridWorld:
    """Cells of a grid, some blocked; a motion along an axis is free if all the cells it crosses are."""

    def __init__(self, blocked: set[tuple[int, ...]]) -> None:
        self.blocked = blocked

    def motion_valid_batch(self, tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        return np.array([self._free(a, b) for a, b in zip(tails, heads, strict=True)], dtype=bool)

    def _free(self, a: np.ndarray, b: np.ndarray) -> bool:
        steps = 2 * int(np.ceil(np.abs(b - a).max())) + 1
        cells = np.rint(a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a)).astype(int)
        return not any(tuple(cell) in self.blocked for cell in cells.tolist())


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


@given(mazes(), st.integers(0, 100))
def test_a_search_is_never_worse_than_what_it_was_offered_and_repeats_with_its_seed(
    case: tuple[GridWorld, np.ndarray, np.ndarray], seed: int
) -> None:
    world, start, goal = case
    offered = grid_lattice(world, len(start)).best_route(start, goal, range(len(start)))
    found = []
    for _ in range(2):
        limits = np.zeros(len(start)), np.full(len(start), GRID - 1.0)
        search = MoveSearch(start[None], goal[None], *limits, world.motion_valid_batch, seed=seed, most_nodes=64)
        if offered is not None:
            search.offer(offered)
        search.settle_corners()
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
        search.settle_corners()
        search.improve(3)
        assert (None if search.route is None else search.moves) == moves


@pytest.mark.parametrize("name", OPTIMA)
def test_planner_meets_the_proven_optimum(name: str) -> None:
    problem = load_problem(name)
    found = plan(problem, FewestMoves, seed=3, seconds=60.0)
    assert found.path is not None
    assert found.path.transitions == found.statistics["lower_bound"] == OPTIMA[name]
    assert found.statistics["gap"] == 0
    assert single_joint(found.path.waypoints)
    np.testing.assert_array_equal(found.path.waypoints[[0, -1]], [problem.start, problem.goal.q])
    again = plan(problem, FewestMoves, seed=3, seconds=60.0)
    assert again.path is not None
    np.testing.assert_array_equal(found.path.waypoints, again.path.waypoints)


def test_theta6_rests_at_the_subsea_unit() -> None:
    found = plan(load_problem("titan4_sdu"), FewestMoves, seed=5, seconds=60.0)
    assert found.path is not None
    assert np.ptp(found.path.waypoints[:, 5]) == 0.0


@pytest.mark.parametrize("name", ["titan4_prisms", "planar3_c"])
def test_shortening_keeps_ends_and_validity_and_is_never_worse(name: str) -> None:
    problem = load_problem(name)
    for seed in range(3):
        path = plan(problem, "bicrdt", seed=seed).path
        assert path is not None
        shorter = shorten(path, problem, method="fewest-moves")
        assert (shorter.transitions, shorter.length) <= (path.transitions, path.length)
        assert shorter.transitions == OPTIMA[name]
        assert not shorter.violations(problem.world)
        assert single_joint(shorter.waypoints)
        np.testing.assert_array_equal(shorter.waypoints[[0, -1]], path.waypoints[[0, -1]])
        again = shorten(path, problem, method="fewest-moves")
        np.testing.assert_array_equal(shorter.waypoints, again.waypoints)


def test_a_path_that_moves_several_joints_at_once_is_refused_with_the_remedy() -> None:
    problem = open_problem()
    path = JointPath.of(problem.world.robot, [problem.start, problem.goal.q])
    with pytest.raises(InputError, match="one_joint_moves"):
        shorten(path, problem, method="fewest-moves")


def open_problem() -> Problem:
    return Problem(World(load_robot("planar3"), Scene()), [0.0, 0.0, 0.0], [1.0, 0.5, -0.5])


def test_without_obstacles_the_bound_is_the_number_of_joints_that_differ_and_is_met() -> None:
    problem = open_problem()
    assert least_moves(problem) == 3
    rows = np.array([[0.0, 0, 0], [0, 2, 0], [1, 2, 0], [1, 2, -0.5], [1, 0.5, -0.5]])
    found = fewest_moves(rows, problem.world)
    assert (found.moves, found.bound, found.gap) == (3, 3, 0)
    assert route_length(found.route) == pytest.approx(2.0)


def test_a_direct_route_needs_no_further_question() -> None:
    ends = np.array([[0.0, 0, 0], [1, 0.5, -0.5]])
    search = MoveSearch(ends[:1], ends[1:], -np.ones(3), np.ones(3), lambda tails, _: np.ones(len(tails), dtype=bool))
    search.settle_corners()
    asked = search.motions
    search.improve(100)
    assert search.direct
    assert (search.moves, search.motions) == (3, asked)


def test_without_a_look_at_all_corners_the_bound_stays_and_nothing_is_proven_on_top_of_it() -> None:
    start, goal = np.zeros(8), np.ones(8)

    def ask(tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        return (tails[:, 7] < 0.0) | (tails[:, 0] == heads[:, 0])  # the first joint moves when the last stands aside

    def prove(*_: object) -> int:
        raise AssertionError("the corners are not settled")

    search = MoveSearch(start[None], goal[None], -np.ones(8), np.ones(8), ask, most_nodes=64, prove=prove)
    corners = [np.where(np.arange(8) < k, 1.0, 0.0) for k in range(1, 9)]
    aside = np.where(np.arange(8) == 7, -1.0, start)  # nine moves: the last joint moves twice
    search.offer(np.vstack([start, aside, *[np.where(np.arange(8) == 7, -1.0, c) for c in corners[:7]], goal]))
    search.settle_corners()
    assert search.bound == 8
    search.improve(1)
    assert search.bound == 8


def test_a_route_of_one_configuration_stays() -> None:
    found = fewest_moves(np.zeros((1, 3)), open_problem().world)
    assert found.route.tolist() == [[0.0, 0.0, 0.0]]
    assert (found.moves, found.bound) == (0, 0)


@pytest.mark.parametrize(("name", "bound"), list(OPTIMA.items()))
def test_the_lower_bound_is_the_optimum_where_one_joint_has_to_turn_back_at_most(name: str, bound: int) -> None:
    assert least_moves(load_problem(name)) == bound


def test_a_goal_that_is_no_configuration_has_no_least_moves() -> None:
    with pytest.raises(InputError, match="joint values"):
        least_moves(load_problem("planar3_boxes"))


def test_the_grid_oracle_agrees_with_the_proofs() -> None:
    for name, step in (("env_e", 0.5), ("planar3_c", np.radians(15.0))):
        route = grid_route(load_problem(name), step)
        assert route is not None
        assert len(route) - 1 == OPTIMA[name]


@pytest.mark.parametrize(
    ("name", "step", "match"), [("titan4_sdu", 0.1, "3 joints"), ("env_e", 0.0, "step"), ("env_e", 1e-4, "larger")]
)
def test_the_grid_oracle_refuses_what_it_cannot_hold(name: str, step: float, match: str) -> None:
    with pytest.raises(InputError, match=match):
        grid_route(load_problem(name), step)


def gate(width: float) -> Problem:
    """A point before a wall with a gate that is off its straight way; the gate is as wide as given."""
    halves = [Box([1.0, 10.0 - 0.5 * width, 2.0])] * 2
    middles = [7.0 + (0.25 * width + 5.0) * side for side in (-1.0, 1.0)]
    obstacles = [
        Obstacle(f"half{k}", box, pose(5.0, y)) for k, (box, y) in enumerate(zip(halves, middles, strict=True))
    ]
    robot = load_robot("point2d", radius=0.0, bounds=[[0.0, 10.0], [0.0, 10.0]])
    return Problem(World(robot, Scene(obstacles)), [2.0, 2.0], [8.0, 2.0])


def pose(x: float, y: float) -> object:
    import pinocchio as pin

    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


def test_a_narrow_gate_is_not_refuted_and_a_closed_one_is() -> None:
    for width, refuted in ((0.5, False), (0.02, False), (-0.05, True)):
        problem = gate(width)
        proof = OneFreeValue(problem.world, problem.start, problem.goal.q, 1, no_stop)
        assert proof.refuted() == refuted
        bound = sharper_bound(problem.world, range(2), problem.start, problem.goal.q, no_stop)
        assert bound == (4 if refuted else 3)


def test_nothing_is_proven_when_there_is_no_time() -> None:
    problem = gate(-0.05)
    assert sharper_bound(problem.world, range(2), problem.start, problem.goal.q, lambda: True) == 3


def test_no_motion_within_its_depth_ends_a_collision() -> None:
    world = load_problem("titan4_sdu").world
    depth = OverlapDepth(world.robot, world.bodies, world.pairs)
    rng = np.random.default_rng(0)
    rows = rng.uniform(world.robot.lower, world.robot.upper, (400, world.robot.dof))
    free, known = world.valid_batch(rows), 0
    for q, is_free in zip(rows, free, strict=True):
        travel = depth.travel(q)
        assert not (is_free and travel > 0.0)
        if travel > 0.0:
            known += 1
            steps = rng.uniform(-1.0, 1.0, (50, world.robot.dof))
            steps *= 0.999 * travel / (np.abs(steps) @ world.weights)[:, None]
            near = q + steps
            assert not world.valid_batch(near[world.robot.within_limits(near)]).any()
    assert known > 20


def test_time_that_runs_out_ends_the_search_soon_with_the_best_so_far() -> None:
    problem = load_problem("titan4_sdu")
    raw = plan(problem, "bicrdt", seed=1).path
    assert raw is not None
    for questions in (0, 1, 5, 20):
        left = [questions]

        def stop(left: list[int] = left) -> bool:
            left[0] -= 1
            return left[0] < 0

        found = fewest_moves(raw.waypoints, problem.world, stop=stop)
        assert left[0] >= -20  # a few looks at the clock after it struck, each without a question
        assert found.moves <= raw.transitions
        assert found.bound <= found.moves
        assert not raw.with_waypoints(found.route).violations(problem.world)


def test_an_interrupt_leaves_plan_and_the_next_one_works() -> None:
    problem = load_problem("cut_polygons")
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    previous = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    begin = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            plan(problem, FewestMoves, seed=1, seconds=120.0, parameters={"rounds": 10_000})
    finally:
        signal.signal(signal.SIGALRM, previous)
    assert time.monotonic() - begin < 60.0
    assert plan(problem, FewestMoves, seed=1, seconds=2.0, parameters={"rounds": 0}).found


@pytest.mark.parametrize("options", [{"rounds": -1}, {"searches": 0}, {"rounds": 1.5}, {"searches": True}])
def test_options_out_of_range_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        plan(load_problem("env_e"), FewestMoves, parameters=options)


def test_frozen_joints_rest() -> None:
    problem = load_problem("titan4_prisms")
    found = plan(problem, FewestMoves, seed=1, seconds=60.0, parameters={"frozen_joints": [1, 5]})
    assert found.path is not None
    assert np.ptp(found.path.waypoints[:, [1, 5]]) == 0.0
    assert found.path.transitions == 3
    assert [(a != b).sum() for a, b in pairwise(found.path.waypoints)] == [1, 1, 1]


def test_a_long_route_is_cut_before_anything_takes_long() -> None:
    problem = load_problem("titan4_sdu")
    sampled = plan(problem, "RRTConnect", seconds=10.0, seed=2).path
    assert sampled is not None
    route, asked = one_joint_moves(sampled, problem).waypoints, count()

    def free(tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        next(asked)
        return problem.world.motion_valid_batch(tails, heads)

    cut = double_axis_cut(route, free)
    most, looks = 6 * next(asked) + 100, count()  # looks at the clock: some for every question of the cut
    found = fewest_moves(route, problem.world, stop=lambda: next(looks) > most)
    assert found.moves <= transitions(cut) < 0.5 * transitions(route)
    half = count()
    found = fewest_moves(route, problem.world, stop=lambda: next(half) > most // 2)
    assert found.moves < transitions(route)  # a cut that is broken off is kept as far as it has come


@pytest.mark.parametrize("seed", range(2))
def test_where_single_joint_trees_find_nothing_a_sampled_route_is_converted(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rrtik_planners.bicrdt.BiCRDT.search", lambda *_: SearchResult(None, {}))
    problem = load_problem("titan4_sdu")
    found = plan(problem, FewestMoves, seconds=20.0, seed=seed, parameters={"rounds": 1})
    assert found.path is not None
    assert found.path.one_joint_at_a_time
    assert found.path.transitions <= 8
    frozen = plan(problem, FewestMoves, seconds=0.3, seed=seed, parameters={"frozen_joints": [5]})
    assert not frozen.found  # a sampled route would move the frozen joint


RULES = (
    ("titan4_prisms", {"frozen_joints": ["shoulder_pitch", 5], "joint_costs": [2.0, 1.0, 1.0, 1.0, 1.0, 1.0]}),
    ("titan4_sdu", {"last_joints": ["wrist_rotate", "azimuth"]}),
    ("titan4_sdu", {"smallest_move": 0.2}),
)


@pytest.mark.parametrize(("name", "options"), RULES, ids=["frozen", "last", "smallest"])
@pytest.mark.parametrize("planner", ["bicrdt", "fewest-moves"])
def test_shortening_keeps_to_the_rules_of_the_plan(planner: str, name: str, options: dict[str, object]) -> None:
    problem = load_problem(name)
    rules = MoveRules(problem.robot.joint_names, **options)
    found = plan(problem, planner, seed=2, seconds=60.0, parameters=options)
    assert found.path is not None
    assert rules.kept_by(found.path.waypoints)
    for method in ("fewest-moves", "axis"):
        shorter = shorten(found.path, problem, method=method, rules=rules)
        assert rules.kept_by(shorter.waypoints)
        assert shorter.one_joint_at_a_time
        assert shorter.transitions <= found.path.transitions
        np.testing.assert_array_equal(shorter.waypoints[[0, -1]], found.path.waypoints[[0, -1]])


def test_the_bound_of_a_plan_counts_the_last_moves_too() -> None:
    found = plan(load_problem("titan4_sdu"), FewestMoves, seed=1, seconds=60.0, parameters={"last_joints": [4]})
    assert found.path is not None
    assert found.path.transitions == found.statistics["lower_bound"] + found.statistics["gap"]
    assert [int((a != b).argmax()) for a, b in pairwise(found.path.waypoints)].index(4) == len(found.path.waypoints) - 2


def test_each_rule_is_judged() -> None:
    route = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 2.0, 0.5]])
    names = ("a", "b", "c")
    for options, kept in (
        ({}, True),
        ({"frozen_joints": ["c"]}, False),
        ({"last_joints": ["c"]}, True),
        ({"last_joints": ["c", "b"]}, True),
        ({"last_joints": ["b"]}, False),
        ({"smallest_move": 0.5}, True),
        ({"smallest_move": [0.0, 0.0, 0.6]}, False),
    ):
        assert MoveRules(names, **options).kept_by(route) == kept, options
    returns = np.vstack([route, [1.0, 1.5, 0.5]])
    assert not MoveRules(names, last_joints=["b", "c"]).kept_by(returns)  # b does not go straight to the goal


def test_a_path_that_breaks_the_rules_is_not_shortened_by_them() -> None:
    problem = load_problem("titan4_sdu")
    path = plan(problem, "bicrdt", seed=1).path
    assert path is not None
    with pytest.raises(InputError, match="rules"):
        shorten(path, problem, rules=MoveRules(problem.robot.joint_names, frozen_joints=["azimuth"]))
