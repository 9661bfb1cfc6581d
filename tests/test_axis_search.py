"""The search in kernels is the search in Python, to the bit, and both keep what the planners promise."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.errors import InputError, PlannerError, UnknownNameError
from rrtik_ompl.fast.search.crdt import search as axis_search
from rrtik_ompl.fast.search.crdt.rules import KERNELS, AxisRules
from rrtik_ompl.fast.search.crdt.search import AxisSearch
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.ompl_bridge import WorldChecker
from rrtik_ompl.ompl_bridge.attempt import attempt
from rrtik_ompl.ompl_bridge.contract import small_problem
from rrtik_ompl.problem import Problem
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.scene import Obstacle, Scene
from rrtik_ompl.shapes import Box
from rrtik_ompl.transitions import merge_moves, single_joint
from rrtik_ompl.world import World
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_planners import CRDT, BiCRDT
from rrtik_planners.bicrdt import TwoTreeSearch
from rrtik_planners.crdt import OneTreeSearch

NAMES = ("env_e", "planar3_a", "planar3_c", "planar3_boxes", "planar6_c", "titan4_prisms", "titan4_sdu", "cut_two_ls")
SPHERE = '<collision><geometry><sphere radius="{}"/></geometry></collision>'
SLIDER = f"""
<robot name="slider"><link name="base"/><link name="a">{SPHERE.format(0.1)}</link>
  <link name="b">{SPHERE.format(0.08)}</link><link name="c">{SPHERE.format(0.06)}</link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="a"/><origin xyz="0 0.1 0.2" rpy="0.3 0 0"/>
    <axis xyz="0.6 0 0.8"/><limit lower="-0.5" upper="0.5" velocity="1" effort="1"/></joint>
  <joint name="swing" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0" rpy="0 0.4 1"/>
    <axis xyz="1 2 -2"/></joint>
  <joint name="nod" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0 0 0.3"/><axis xyz="1 0 -1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/><mimic joint="swing" multiplier="-0.5" offset="0.2"/></joint>
</robot>"""


class Plain:
    """A world without its kernels."""

    def __init__(self, world: Any) -> None:
        self.valid, self.motion_valid = world.valid, world.motion_valid
        self.motion_valid_batch, self.robot = world.motion_valid_batch, world.robot


class Silent:
    """A world whose kernels may be used, but that answers nothing itself."""

    def __init__(self, world: Any) -> None:
        self._world = world

    def __getattr__(self, name: str) -> Any:
        if name == "motion_valid_batch":
            raise AssertionError("the world was asked")
        return getattr(self._world, name)


@cache
def shipped(name: str) -> Problem:
    """A problem of ours, its goal a configuration."""
    problem = load_problem(name)
    aims = goal_configurations(problem, np.random.default_rng(0))
    return Problem(problem.world, problem.start, aims.rows[0])


@cache
def slider() -> Problem:
    """A sliding joint, a continuous one and one that mimics it, near a box."""
    wall = Obstacle("wall", Box((0.2, 0.5, 0.1)), pin.SE3(np.eye(3), np.array([0.45, 0.2, 0.75])))
    world = World(robot_from_urdf_text(SLIDER), Scene([wall]))
    return Problem(world, [0.4, -1.2], [-0.4, 1.9])


def rules_of(
    problem: Problem, *, smallest_move: float = 0.0, frozen: tuple[int, ...] = (), costly: int = -1
) -> AxisRules:
    lower, upper = problem.robot.finite_range()
    lower[list(frozen)] = upper[list(frozen)] = problem.start[list(frozen)]
    scale, chance = np.linspace(1.0, 2.0, len(lower)), np.where(np.arange(len(lower)) == costly, 0.3, 1.0)
    return AxisRules(lower, upper, scale, np.full(len(lower), smallest_move), chance)


def ends(problem: Problem, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Starts and goals: those of the problem and other free configurations."""
    lower, upper = problem.robot.finite_range()
    others = np.random.default_rng(seed).uniform(lower, upper, (40 * count, len(lower)))
    others = others[problem.world.valid_batch(others)][: 2 * count]
    return np.vstack([problem.start, others[:count]]), np.vstack([problem.goal.q, others[count:]])


def assert_same_pair(problem: Problem, rules: AxisRules, seed: int, starts: Any, goals: Any, limit: int = 60) -> None:
    checker = WorldChecker(problem.world)
    fast = AxisSearch(problem.world, rules, seed, limit, starts, goals)
    slow = TwoTreeSearch(rules, seed, limit, starts, goals, checker)
    for _ in range(3):  # a search goes on after a solution
        found = slow.advance(lambda: False)
        assert fast.advance(lambda: False) == found
        counts = (slow.iterations, slow.vertices, checker.checked_motions)
        assert (fast.iterations, fast.vertices, fast.motions) == counts
        for mine, theirs in zip(fast.meeting(), slow.meeting(), strict=True):
            np.testing.assert_array_equal(mine, theirs) if found else None
    for number, tree in enumerate(slow._trees):
        np.testing.assert_array_equal(fast.tree(number), [tree.vertex(i) for i in range(tree.size)])
        for vertex in range(tree.size):
            np.testing.assert_array_equal(fast.branch(number, vertex), tree.branch(vertex))


@pytest.mark.parametrize("name", NAMES)
def test_two_trees_grow_as_in_python_to_the_bit(name: str) -> None:
    problem = shipped(name)
    for seed in range(5):
        assert_same_pair(problem, rules_of(problem), seed, problem.start[None], problem.goal.q[None])


@pytest.mark.parametrize("name", ["planar3_c", "titan4_sdu"])
@pytest.mark.parametrize("smallest_move", [0.0, 0.3])
def test_two_forests_grow_as_in_python_to_the_bit(name: str, smallest_move: float) -> None:
    problem = shipped(name)
    for seed in range(4):
        rules = rules_of(problem, smallest_move=smallest_move, costly=1)
        assert_same_pair(problem, rules, seed, *ends(problem, seed, seed))


def test_sliding_continuous_and_mimic_joints_are_the_same_to_the_bit() -> None:
    for seed in range(10):
        assert_same_pair(slider(), rules_of(slider()), seed, *ends(slider(), 1, seed))


def test_frozen_joints_stay_and_the_others_are_the_same_to_the_bit() -> None:
    problem = shipped("titan4_sdu")
    goal = np.where([1, 1, 1, 1, 1, 0], problem.goal.q, problem.start)[None]
    for seed in range(5):
        rules = rules_of(problem, frozen=(5,))
        assert_same_pair(problem, rules, seed, problem.start[None], goal)
        search = AxisSearch(problem.world, rules, seed, 60, problem.start[None], goal)
        search.advance(lambda: False)
        assert (search.tree(0)[:, 5] == problem.start[5]).all()


@pytest.mark.parametrize("name", ["env_e", "planar3_c", "titan4_sdu"])
def test_a_single_tree_grows_as_in_python_to_the_bit(name: str) -> None:
    problem = shipped(name)
    lower, upper = problem.robot.finite_range()
    tolerance = 0.2 * float(np.linalg.norm(upper - lower))
    for seed in range(4):
        starts, goals = ends(problem, seed % 2, seed)
        checker, rules = WorldChecker(problem.world), rules_of(problem)
        fast = AxisSearch(problem.world, rules, seed, 100, starts, goals=goals, tolerance=tolerance)
        slow = OneTreeSearch(rules, seed, 100, starts, goals, tolerance, checker)
        for _ in range(3):
            found = slow.advance(lambda: False)
            assert fast.advance(lambda: False) == found
            counts = (slow.iterations, slow.vertices, checker.checked_motions)
            assert (fast.iterations, fast.vertices, fast.motions) == counts
            np.testing.assert_array_equal(fast.ending(), slow.ending()) if found else None
        np.testing.assert_array_equal(fast.tree(0), slow.tree(0))
        for vertex in range(slow.vertices):
            np.testing.assert_array_equal(fast.branch(0, vertex), slow.branch(0, vertex))


def grown(problem: Problem, seed: int, limit: int = 300) -> list[np.ndarray]:
    search = AxisSearch(problem.world, rules_of(problem), seed, limit, problem.start[None], problem.goal.q[None])
    while search.advance(lambda: False):
        pass
    assert search.iterations == limit
    return [search.tree(0), search.tree(1)]


def test_neither_the_budget_nor_the_room_changes_a_search(monkeypatch: Any) -> None:
    problem = shipped("planar3_c")
    usual = [grown(problem, seed) for seed in range(3)]
    assert max(len(tree) for trees in usual for tree in trees) > axis_search.FIRST_CAPACITY
    monkeypatch.setattr(axis_search, "FIRST_BUDGET", 1)
    monkeypatch.setattr(axis_search, "LEAST_PAUSE", 0.0)
    monkeypatch.setattr(axis_search, "FIRST_CAPACITY", 16)
    for seed, trees in enumerate(usual):
        for mine, theirs in zip(grown(problem, seed), trees, strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_a_search_looks_up_between_its_pieces_of_work() -> None:
    problem = shipped("env_e")
    boxed_in = World(problem.robot, problem.world.scene, motion_resolution=problem.world.motion_resolution)
    looks = iter([False] * 5 + [True])
    goal = np.array([[9.5, 12.0]])  # inside the letter
    search = AxisSearch(boxed_in, rules_of(problem), 0, None, problem.start[None], goal)
    assert not search.advance(lambda: next(looks))
    assert next(looks, None) is None
    assert search.iterations >= 5


def test_a_conservative_world_is_never_asked() -> None:
    problem = shipped("planar3_boxes")
    careful: Any = problem.world.with_accuracy("conservative")
    for seed in range(5):
        search = AxisSearch(Silent(careful), rules_of(problem), seed, 200, problem.start[None], problem.goal.q[None])
        if search.advance(lambda: False):
            for branch in search.meeting():
                assert careful.motion_valid_batch(branch[:-1], branch[1:]).all()


def test_every_edge_of_the_trees_is_free() -> None:
    for problem in (shipped("planar3_c"), shipped("titan4_sdu"), slider()):
        search = AxisSearch(problem.world, rules_of(problem), 3, 300, problem.start[None], problem.goal.q[None])
        while search.advance(lambda: False):
            pass
        for number in (0, 1):
            branches = [search.branch(number, vertex)[-2:] for vertex in range(1, len(search.tree(number)))]
            starts, ends_ = (np.array([branch[k] for branch in branches]) for k in (0, 1))
            assert problem.world.motion_valid_batch(starts, ends_).all()


def test_kernels_are_left_alone_where_they_are_not_certain() -> None:
    world = shipped("titan4_sdu").world
    assert has_kernels(world, KERNELS, within=np.ones((1, 6)))
    assert not has_kernels(world, KERNELS, within=np.full((1, 6), 1e9))
    assert not has_kernels(Plain(world), KERNELS, within=np.ones((1, 6)))
    assert not has_kernels(None, KERNELS, within=np.ones((1, 6)))


def solved(problem: Problem, planner: Any, seed: int, world: Any = None, **options: Any) -> Any:
    """Rows and statistics, in the problem's world or another."""
    aims, parameters = problem.goal.q[None], {"max_iterations": 4000, **options}
    factory = planner if world is None else lambda si, seed, **more: planner(si, world=world, seed=seed, **more)
    if world is None:
        found = attempt(problem, factory, aims, seconds=20.0, seed=seed, parameters=parameters)
        return found.rows, dict(found.statistics)

    class InAnotherWorld(planner):  # type: ignore[misc]
        def __init__(self, si: Any, **given: Any) -> None:
            super().__init__(si, **{**given, **parameters, "world": world})

    found = attempt(problem, InAnotherWorld, aims, seconds=20.0, seed=seed, parameters={})
    return found.rows, dict(found.statistics)


@pytest.mark.parametrize("name", ["planar3_a", "titan4_sdu", "titan4_prisms"])
@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
def test_a_planner_gives_the_same_path_and_counts_without_kernels(name: str, planner: Any) -> None:
    problem = shipped(name)
    for seed in range(4):
        rows, counts = solved(problem, planner, seed)
        plain_rows, plain_counts = solved(problem, planner, seed, Plain(problem.world))
        np.testing.assert_array_equal(rows, plain_rows)
        assert counts == plain_counts


@pytest.mark.parametrize("name", NAMES)
def test_paths_keep_what_the_planner_promises(name: str) -> None:
    problem = shipped(name)
    for seed in range(10):
        rows, counts = solved(problem, BiCRDT, seed)
        assert single_joint(rows)
        assert problem.world.motion_valid_batch(rows[:-1], rows[1:]).all()
        np.testing.assert_array_equal(rows[0], problem.start)
        np.testing.assert_array_equal(rows[-1], problem.goal.q)
        assert counts["vertices"] >= 2
        assert counts["checked_motions"] >= len(rows) - 1


@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
@pytest.mark.parametrize("kernels", [True, False])
def test_no_move_is_shorter_than_the_smallest(planner: Any, kernels: bool) -> None:
    problem, smallest = shipped("titan4_sdu"), np.radians(8.0)
    for seed in range(8):
        world = None if kernels else Plain(problem.world)
        rows, _ = solved(problem, planner, seed, world, smallest_move=smallest)
        moves = np.abs(np.diff(merge_moves(rows, 0.0), axis=0)).max(axis=1)
        assert moves.min() >= smallest
    rows = [solved(problem, planner, seed)[0] for seed in range(8)]
    assert min(np.abs(np.diff(merge_moves(r, 0.0), axis=0)).max(axis=1).min() for r in rows) < smallest


@pytest.mark.parametrize("kernels", [True, False])
def test_a_goal_nearer_than_the_smallest_move_is_reached_by_going_round(kernels: bool) -> None:
    problem = shipped("titan4_axis1")
    nearby = Problem(problem.world, problem.start, problem.start + np.array([0.02, 0, 0, 0, 0, 0]))
    world = None if kernels else Plain(problem.world)
    rows, _ = solved(nearby, BiCRDT, 1, world, smallest_move=[0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    moves = np.abs(np.diff(merge_moves(rows, 0.0), axis=0)).max(axis=1)
    assert moves.min() >= 0.1
    np.testing.assert_array_equal(rows[-1], nearby.goal.q)


@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
@pytest.mark.parametrize("kernels", [True, False])
@pytest.mark.parametrize("joint", [5, "theta6"])
def test_a_frozen_joint_does_not_move(planner: Any, kernels: bool, joint: Any) -> None:
    problem = shipped("titan4_sdu")
    names = load_robot("titan4").joint_names
    frozen = [names[5] if isinstance(joint, str) else joint]
    for seed in range(3):
        rows, _ = solved(problem, planner, seed, None if kernels else Plain(problem.world), frozen_joints=frozen)
        assert (rows[:, 5] == problem.start[5]).all()
        assert problem.world.motion_valid_batch(rows[:-1], rows[1:]).all()


def test_start_and_goal_must_agree_in_frozen_joints() -> None:
    problem = shipped("titan4_sdu")
    name = problem.robot.joint_names[0]
    with pytest.raises(
        PlannerError,
        match=f"^planner .*: frozen_joints: joint '{name}' must not move, but it is at 0.436.* start .* 0.174.* goal",
    ):
        solved(problem, BiCRDT, 0, frozen_joints=[0])


def test_goals_that_differ_in_frozen_joints_are_left_out() -> None:
    problem = shipped("titan4_sdu")
    other = problem.goal.q + np.array([0, 0, 0, 0, 0, 0.2])
    goals = np.vstack([other, problem.goal.q])
    found = attempt(problem, BiCRDT, goals, seconds=20.0, seed=1, parameters={"frozen_joints": [5]})
    np.testing.assert_array_equal(found.rows[-1], problem.goal.q)


def test_a_costly_joint_moves_less() -> None:
    problem = shipped("titan4_sdu")
    travel = []
    for costs in (None, [1.0, 1.0, 1.0, 1.0, 1.0, 10.0]):
        paths = [solved(problem, BiCRDT, seed, joint_costs=costs)[0] for seed in range(60)]
        travel.append(np.mean([np.abs(np.diff(rows[:, 5])).sum() for rows in paths]))
    assert travel[1] < 0.5 * travel[0]


@pytest.mark.parametrize("planner", [BiCRDT, CRDT])
@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"joint_costs": [1.0, 0.0, 1.0]}, InputError),
        ({"joint_costs": [1.0, 1.0]}, InputError),
        ({"joint_costs": float("nan")}, InputError),
        ({"smallest_move": -0.1}, InputError),
        ({"smallest_move": [0.1, 0.1]}, InputError),
        ({"frozen_joints": [3]}, InputError),
        ({"frozen_joints": [-1]}, InputError),
        ({"frozen_joints": [True]}, InputError),
        ({"frozen_joints": 1}, InputError),
        ({"frozen_joints": "elbow"}, InputError),
        ({"frozen_joints": ["elbow"]}, UnknownNameError),
    ],
)
def test_options_that_make_no_sense_are_refused_by_name(planner: Any, options: Any, error: Any) -> None:
    with pytest.raises(error, match=next(iter(options))):
        planner(small_problem().getSpaceInformation(), **options)


@pytest.mark.parametrize("kernels", [True, False])
def test_joints_that_move_last_stay_until_the_others_have_arrived(kernels: bool) -> None:
    problem, world = shipped("titan4_sdu"), None if kernels else Plain(shipped("titan4_sdu").world)
    name = problem.robot.joint_names[4]
    turned = problem.goal.q + np.array([0, 0, 0, 0, 0, 0.5])
    other = Problem(problem.world, problem.start, turned)
    for seed in range(5):
        rows, _ = solved(other, BiCRDT, seed, world, last_joints=[5, name])
        assert single_joint(rows)
        assert other.world.motion_valid_batch(rows[:-1], rows[1:]).all()
        np.testing.assert_array_equal(rows[0], other.start)
        np.testing.assert_array_equal(rows[-1], turned)
        assert (rows[:-2, 4:] == problem.start[4:]).all()
        assert rows[-2].tolist() == [*turned[:4], problem.start[4], turned[5]]


def test_goals_whose_last_moves_are_not_free_are_left_out() -> None:
    problem = shipped("env_e")
    goals = np.array([[15.0, 16.0], [22.0, 16.0]])  # on the way to the first along y stands the letter's middle arm
    start = np.array([15.0, 9.0])
    assert not problem.world.motion_valid(np.array([15.0, 9.0]), goals[0])
    other = Problem(problem.world, start, goals[1])
    found = attempt(other, BiCRDT, goals, seconds=20.0, seed=1, parameters={"last_joints": [1]})
    assert found.rows.tolist()[-2:] == [[22.0, 9.0], [22.0, 16.0]]
    blocked = attempt(other, BiCRDT, goals[:1], seconds=20.0, seed=1, parameters={"last_joints": [1]})
    assert blocked.rows is None


def test_a_last_move_shorter_than_the_smallest_is_not_made() -> None:
    problem = shipped("titan4_sdu")
    other = Problem(problem.world, problem.start, problem.goal.q + np.array([0, 0, 0, 0, 0, 0.05]))
    options = {"last_joints": [5], "smallest_move": 0.06}
    found = attempt(other, BiCRDT, other.goal.q[None], seconds=20.0, seed=1, parameters=options)
    assert found.rows is None
    options["smallest_move"] = 0.04
    found = attempt(other, BiCRDT, other.goal.q[None], seconds=20.0, seed=1, parameters=options)
    assert found.rows is not None
