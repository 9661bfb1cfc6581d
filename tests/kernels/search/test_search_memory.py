"""Searches in kernels write nothing beyond their memory: guard words are as they were, also where memory grows."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.search import connect
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.crdt import search as crdt_search
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.repair import PathRepair
from rrtik_ompl.kernels.search.shortcut import ShortcutSearch
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

pytestmark = pytest.mark.kernels

NONE = np.empty((0, 4))
NAMES = ("planar3_c", "titan4_prisms", "env_e")


@cache
def shipped(name: str) -> Problem:
    return load_problem(name)


def goal_of(problem: Problem) -> np.ndarray:
    return np.atleast_2d(problem.goal.q)


def doubtful_motions(world: World) -> FastMotions:
    """As the world's, but with bounding balls alone, so that most motions near anything are undecided."""
    chain, bodies = world.robot.chain, world.bodies
    moving = [pair for pair in world.pairs if any(bodies[i].joint > 0 for i in pair)]
    covers = {"outer": [NONE] * len(bodies), "inner": [NONE] * len(bodies)}
    bare = FastWorld(chain, bodies, moving, **covers, strokes=100.0)
    return FastMotions(bare, chain.gain, chain.offset, weights=world.weights, resolution=world.motion_resolution)


@pytest.mark.parametrize("doubtful", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_rrt_connect_keeps_to_its_memory_while_trees_roots_and_paths_grow(
    name: str, doubtful: bool, monkeypatch: Any
) -> None:
    monkeypatch.setattr(connect, "FIRST_CAPACITY", WIDTH)
    monkeypatch.setattr(connect, "FIRST_PATH", 2)
    problem = shipped(name)
    world, (low, high) = problem.world, problem.robot.finite_range()
    motions = doubtful_motions(world) if doubtful else world.motions
    search = ConnectSearch(motions, low, high, range_=0.02 * float(np.linalg.norm(high - low)))
    assert search.intact()
    goals = np.repeat(goal_of(problem), 20, axis=0)
    found = 0
    for seed in range(5):
        path = search.solve(problem.start[None], goals, seed, ask=world.motion_valid_batch, max_iterations=2000)
        assert search.intact()
        found += path is not None
    assert found > 0
    assert search.statistics()["vertices"] > 2 * WIDTH
    search.proven_free(np.repeat(problem.start[None], 50, axis=0))
    assert search.intact()


@pytest.mark.parametrize("name", NAMES)
def test_c_rdt_keeps_to_its_memory_while_trees_grow(name: str, monkeypatch: Any) -> None:
    monkeypatch.setattr(crdt_search, "FIRST_CAPACITY", WIDTH)
    problem = shipped(name)
    low, high = problem.robot.finite_range()
    ones = np.ones(len(low))
    rules = CrdtRules(low, high, ones, 0.0 * ones, 0.9 * ones)
    starts, goals = problem.start[None], goal_of(problem)
    pair = CrdtSearch(problem.world, rules, 1, 300, starts, goals)
    single = CrdtSearch(problem.world, rules, 1, 300, starts, goals=goals, tolerance=0.3 * float(np.linalg.norm(high)))
    for search in (pair, single):
        assert search.intact()
        while search.advance(lambda: False):
            assert search.intact()
        assert search.intact()
        assert search.vertices > 4 * WIDTH


@pytest.mark.parametrize("doubtful", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_shortcuts_keep_to_their_memory_while_the_route_grows_and_shrinks(name: str, doubtful: bool) -> None:
    problem = shipped(name)
    world, (low, high) = problem.world, problem.robot.finite_range()
    path = ConnectSearch(world.motions, low, high, range_=0.05 * float(np.linalg.norm(high - low))).solve(
        problem.start[None], goal_of(problem), 3, ask=world.motion_valid_batch, max_iterations=20000
    )
    assert path is not None
    motions = doubtful_motions(world) if doubtful else world.motions
    for share in (0.0, 0.5):
        search = ShortcutSearch(motions, path, seed=5, share=share)
        search.run(2000, ask=world.motion_valid_batch)
        assert search.gains > 0
        assert search.intact()


@pytest.mark.parametrize("max_edge", [0.02, 1.0])
def test_a_repair_keeps_to_its_memory_while_paths_grow(max_edge: float) -> None:
    robot = load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0, 20], [0, 20]]})
    wall = Obstacle("wall", Box([2.0, 12.0, 1.0]), pin.SE3(np.eye(3), np.array([10.0, 10.0, 0.0])))
    world = MovingWorld(World(robot, Scene((wall,)), motion_resolution=0.05))
    low, high = robot.finite_range()
    repair = PathRepair(world.motions, low, high, max_edge=max_edge, iterations=10**6, tries=30, patience=30)
    path = np.array([[1.0, 10.0], [4.0, 10.0], [19.0, 10.0]])
    for forgetting in (False, True):
        assert not repair.check(path)
        assert repair.intact()
        found = repair.repair(2, lambda: False, forgetting=forgetting)
        assert found is not None
        assert repair.intact()
        assert repair.check(found)
        assert repair.intact()
