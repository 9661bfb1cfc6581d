"""Fewest moves of arms with one joint, and with more joints than a lattice can hold the corners of."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from bench.moves.oracles import least_moves
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Sphere
from rrtik_ompl.model.transitions import single_joint
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening import shorten
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_planners import FewestMoves
from rrtik_robots.planar import planar


def fan(dof: int, *balls: tuple[float, float, float]) -> Problem:
    """An arm of 1 m in all that turns from one side to the other past balls (x, y, radius)."""
    obstacles = [
        Obstacle(f"ball{k}", Sphere(radius), pin.SE3(np.eye(3), np.array([x, y, 0.0])))
        for k, (x, y, radius) in enumerate(balls)
    ]
    start, goal = np.zeros(dof), np.full(dof, 0.02)
    start[0], goal[0] = 0.5, -0.7
    return Problem(World(planar(lengths=[1.0 / dof] * dof, radius=0.005), Scene(obstacles)), start, goal)


def test_a_single_joint_goes_straight_or_not_at_all() -> None:
    for balls, moves in (((), 1), (((0.9, 0.0, 0.05),), None)):
        problem = fan(1, *balls)
        found = plan(problem, FewestMoves, seed=1, seconds=0.5, shorten=False)
        assert found.found == (moves is not None)
        if found.path is not None:
            assert (found.path.transitions, found.statistics["lower_bound"]) == (moves, 1)
            short = shorten(found.path, problem, method="fewest-moves")
            np.testing.assert_array_equal(short.waypoints, [problem.start, problem.goal.q])


@pytest.mark.parametrize("dof", [13, 28, 65])
def test_without_obstacles_any_number_of_joints_moves_once_each(dof: int) -> None:
    problem = fan(dof)
    assert least_moves(problem) == dof
    found = plan(problem, FewestMoves, seed=1, seconds=20.0, shorten=False)
    assert found.path is not None
    assert (found.path.transitions, found.statistics["lower_bound"], found.statistics["gap"]) == (dof, dof, 0)


@pytest.mark.parametrize("dof", [28, 40])
def test_with_too_many_corners_the_bound_is_the_number_of_joints_that_differ(dof: int) -> None:
    problem = fan(dof, (0.75, 0.0, 0.05))
    found = plan(problem, FewestMoves, seed=1, seconds=1.5, shorten=False)
    assert found.path is not None
    assert single_joint(found.path.waypoints)
    assert not found.path.violations(problem.world)
    assert found.statistics["lower_bound"] == dof < found.path.transitions
    raw = plan(problem, "bicrdt", seed=1, shorten=False).path
    assert raw is not None
    short = shorten(raw, problem, method="fewest-moves", seconds=1.0)
    assert dof < short.transitions <= raw.transitions
    assert not short.violations(problem.world)
