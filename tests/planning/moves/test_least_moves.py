"""Lower bounds of the number of moves, and what is proven and what is not."""

from __future__ import annotations

import numpy as np
import pytest

from bench.moves.oracles import grid_route, least_moves
from rrtik_ompl.base.budget import no_stop
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.overlap_depth import OverlapDepth
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.planning.moves.lower_bounds import OneFreeValue, sharper_bound
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.mazes import OPTIMA


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
    robot = load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0.0, 10.0], [0.0, 10.0]]})
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
