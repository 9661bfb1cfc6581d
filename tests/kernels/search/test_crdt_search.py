"""C-RDT in kernels is C-RDT in Python, to the bit."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.kernels.search.crdt import search as crdt_search
from rrtik_ompl.kernels.search.crdt.rules import KERNELS, CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.ompl_bridge import WorldChecker
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_planners.bicrdt import TwoTreeSearch
from rrtik_planners.crdt import OneTreeSearch
from rrtik_tests.slider_arm import NAMES, Plain, shipped

pytestmark = pytest.mark.kernels

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


class Silent:
    """A world whose kernels may be used, but that answers nothing itself."""

    def __init__(self, world: Any) -> None:
        self._world = world

    def __getattr__(self, name: str) -> Any:
        if name == "motion_valid_batch":
            raise AssertionError("the world was asked")
        return getattr(self._world, name)


@cache
def slider() -> Problem:
    """A sliding joint, a continuous one and one that mimics it, near a box."""
    wall = Obstacle("wall", Box((0.2, 0.5, 0.1)), pin.SE3(np.eye(3), np.array([0.45, 0.2, 0.75])))
    world = World(robot_from_urdf_text(SLIDER), Scene([wall]))
    return Problem(world, [0.4, -1.2], [-0.4, 1.9])


def rules_of(
    problem: Problem, *, smallest_move: float = 0.0, frozen: tuple[int, ...] = (), costly: int = -1
) -> CrdtRules:
    lower, upper = problem.robot.finite_range()
    lower[list(frozen)] = upper[list(frozen)] = problem.start[list(frozen)]
    scale, chance = np.linspace(1.0, 2.0, len(lower)), np.where(np.arange(len(lower)) == costly, 0.3, 1.0)
    return CrdtRules(lower, upper, scale, np.full(len(lower), smallest_move), chance)


def ends(problem: Problem, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Starts and goals: those of the problem and other free configurations."""
    lower, upper = problem.robot.finite_range()
    others = np.random.default_rng(seed).uniform(lower, upper, (40 * count, len(lower)))
    others = others[problem.world.valid_batch(others)][: 2 * count]
    return np.vstack([problem.start, others[:count]]), np.vstack([problem.goal.q, others[count:]])


def assert_same_pair(problem: Problem, rules: CrdtRules, seed: int, starts: Any, goals: Any, limit: int = 60) -> None:
    checker = WorldChecker(problem.world)
    fast = CrdtSearch(problem.world, rules, seed, limit, starts, goals)
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
        search = CrdtSearch(problem.world, rules, seed, 60, problem.start[None], goal)
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
        fast = CrdtSearch(problem.world, rules, seed, 100, starts, goals=goals, tolerance=tolerance)
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
    search = CrdtSearch(problem.world, rules_of(problem), seed, limit, problem.start[None], problem.goal.q[None])
    while search.advance(lambda: False):
        pass
    assert search.iterations == limit
    return [search.tree(0), search.tree(1)]


def test_neither_the_budget_nor_the_room_changes_a_search(monkeypatch: Any) -> None:
    problem = shipped("planar3_c")
    usual = [grown(problem, seed) for seed in range(3)]
    assert max(len(tree) for trees in usual for tree in trees) > crdt_search.FIRST_CAPACITY
    monkeypatch.setattr(crdt_search, "FIRST_BUDGET", 1)
    monkeypatch.setattr(crdt_search, "MIN_PAUSE", 0.0)
    monkeypatch.setattr(crdt_search, "FIRST_CAPACITY", 16)
    for seed, trees in enumerate(usual):
        for mine, theirs in zip(grown(problem, seed), trees, strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_a_search_looks_up_between_its_pieces_of_work() -> None:
    problem = shipped("env_e")
    boxed_in = World(problem.robot, problem.world.scene, motion_resolution=problem.world.motion_resolution)
    looks = iter([False] * 5 + [True])
    goal = np.array([[9.5, 12.0]])  # inside the letter
    search = CrdtSearch(boxed_in, rules_of(problem), 0, None, problem.start[None], goal)
    assert not search.advance(lambda: next(looks))
    assert next(looks, None) is None
    assert search.iterations >= 5


def test_a_conservative_world_is_never_asked() -> None:
    problem = shipped("planar3_boxes")
    careful: Any = problem.world.with_accuracy("conservative")
    for seed in range(5):
        search = CrdtSearch(Silent(careful), rules_of(problem), seed, 200, problem.start[None], problem.goal.q[None])
        if search.advance(lambda: False):
            for branch in search.meeting():
                assert careful.motion_valid_batch(branch[:-1], branch[1:]).all()


def test_every_edge_of_the_trees_is_free() -> None:
    for problem in (shipped("planar3_c"), shipped("titan4_sdu"), slider()):
        search = CrdtSearch(problem.world, rules_of(problem), 3, 300, problem.start[None], problem.goal.q[None])
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
