"""Our side of the speed rows. Which planner and which checks are measured is decided here and nowhere else."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from bench.shared.clocks import spent
from rrtik_ompl import Problem, World
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.ompl_bridge.attempt import attempt
from rrtik_ompl.ompl_bridge.planner_names import find_planner
from rrtik_ompl.ompl_bridge.setup import unchecked_space
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.world.problem import planning_bounds

Search = Callable[[int], Matrix | None]  # from a seed to a path

PLANNER = "fastrrtconnect"


def our_search(problem: Problem, *, seconds: float, per_radian: float | None = None) -> Search:
    """The bare search from Python: what a call costs when the world stands ready.

    Args:
        problem: What to solve.
        seconds: Time limit [s].
        per_radian: Checks per radian of the motion, as the peers count; the world's own, denser rule if None.
    """
    goals = goal_configurations(problem, np.random.default_rng(0)).rows
    if problem.world.fast is not None:
        return _kernel_search(problem, goals, seconds, per_radian)
    factory = find_planner(PLANNER)
    return lambda seed: attempt(problem, factory, goals, Budget(seed, seconds)).rows


def ompl_overhead(problem: Problem, *, seconds: float, seed: int) -> Callable[[], tuple[float, float]]:
    """Calls of ``SimpleSetup.solve`` with the kernel planner, everything set up.

    Each call gives its own CPU seconds and those of the search inside of it: two separate searches would not be the
    same, for a planner goes on with its random numbers.
    """
    goals = goal_configurations(problem, np.random.default_rng(0)).rows
    setup = og.SimpleSetup(unchecked_space(*planning_bounds(problem, goals)))  # the planner asks the world itself
    states, ends = StateIO(setup.getSpaceInformation()), []
    for row in (problem.start, goals[0]):
        ends.append(setup.getSpaceInformation().allocState())
        states.write(ends[-1], row)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(find_planner(PLANNER)(setup.getSpaceInformation(), world=problem.world, seed=seed))
    setup.setup()
    usual, inside = ConnectSearch.solve, []

    def clocked(*arguments: Any, **options: Any) -> Any:
        taken, path = spent(lambda: usual(*arguments, **options))
        inside.append(taken)
        return path

    def solve() -> tuple[float, float]:
        setup.clear()
        inside.clear()
        condition = ob.timedPlannerTerminationCondition(seconds)
        with patch.object(ConnectSearch, "solve", clocked):
            whole, _ = spent(lambda: setup.solve(condition))
        if not inside:
            raise RuntimeError(f"planner {PLANNER} did not call ConnectSearch.solve: its share cannot be told")
        return whole, sum(inside)

    return solve


def joint_values(world: World, Q: Matrix) -> Matrix:
    """Values of the joints of the chain, mimic joints resolved, shape (m, joints)."""
    return np.asarray(Q @ world.robot.chain.gain.T + world.robot.chain.offset)


def warm_up(problem: Problem) -> None:
    """Compile or load all kernels and fill all caches."""
    our_search(problem, seconds=5.0)(1)
    problem.world.valid_batch(problem.start[None])


def _motions_by_length(world: World, per_radian: float) -> FastMotions:
    """The rule that divides a motion by its length in configuration space alone."""
    assert world.fast is not None
    chain, weights = world.robot.chain, np.zeros(world.robot.dof)
    resolution = world.motion_resolution
    return FastMotions(
        world.fast, chain.gain, chain.offset, weights=weights, resolution=resolution, steps_per_unit=per_radian
    )


def _kernel_search(problem: Problem, goals: Matrix, seconds: float, per_radian: float | None) -> Search:
    """The search object of the kernel planner without OMPL around it; undecided motions are asked as always.

    In a conservative world they count as colliding.
    """
    world, starts = problem.world, problem.start[None]
    ask = None if world.accuracy == "conservative" else world.motion_valid_batch
    motions = world.motions if per_radian is None else _motions_by_length(world, per_radian)
    assert motions is not None
    search = ConnectSearch(motions, *planning_bounds(problem, goals))

    def solve(seed: int) -> Matrix | None:
        end = time.perf_counter() + seconds
        return search.solve(starts, goals, seed, ask=ask, stop=lambda: time.perf_counter() > end)

    return solve
