"""What [1, ch. 6.3] compares with: the basic RRT [7], and collision checks counted as point tests along an edge."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import require
from rrtik_ompl.description.catalog import find_planner
from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.ompl_bridge.setup import ValidityCallback, problem_definition, space_information
from rrtik_ompl.world.problem import Problem

STEP = 1.0  # of the RRT, and the tolerance at the goal for both
SPACING = 0.2  # between two point tests
CAP = 20_000  # iterations


@dataclass(frozen=True)
class TreeRun:
    """One search: the columns of the two tables of test E in [1, ch. 6.3]."""

    iterations: int
    vertices: int
    checks: int
    seconds: float
    found: bool


class PointTests:
    """A world that tests points every SPACING along a motion, both ends included, and counts until the first hit."""

    def __init__(self, world: Any) -> None:
        self.world = world
        self.count = 0

    def valid(self, q: np.ndarray) -> bool:
        """Whether q is free; not counted."""
        return bool(self.world.valid(q))

    def motion_valid(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Whether all points of the motion are free."""
        steps = max(1, int(np.ceil(np.linalg.norm(b - a) / SPACING - 1e-9)))
        free = self.world.valid_batch(a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a))
        self.count += len(free) if free.all() else int(np.argmin(free)) + 1
        return bool(free.all())

    def motion_valid_batch(self, A: np.ndarray, B: np.ndarray) -> np.ndarray:
        """Motion by motion."""
        return np.array([self.motion_valid(a, b) for a, b in zip(A, B, strict=True)])


def rrt_run(problem: Problem, seed: int) -> TreeRun:
    """Basic RRT: step STEP, no goal bias, ends within STEP of the goal."""
    rng, tests, begin = np.random.default_rng(seed), PointTests(problem.world), perf_counter()
    lower, upper = problem.world.robot.lower, problem.world.robot.upper
    vertices, size = np.empty((CAP + 1, len(lower))), 1
    vertices[0] = problem.start
    for iteration in range(1, CAP + 1):
        target = rng.uniform(lower, upper)
        near = vertices[((vertices[:size] - target) ** 2).sum(axis=1).argmin()]
        new = near + (target - near) * min(1.0, STEP / float(np.linalg.norm(target - near)))
        if tests.motion_valid(near, new):
            vertices[size] = new
            size += 1
            if np.linalg.norm(new - _goal(problem)) <= STEP:
                return TreeRun(iteration, size, tests.count, perf_counter() - begin, True)
    return TreeRun(CAP, size, tests.count, perf_counter() - begin, False)


def _goal(problem: Problem) -> Vector:
    require(problem.goal, JointGoal, "goal of the problem")
    return problem.goal.q if isinstance(problem.goal, JointGoal) else problem.start


def crdt_run(problem: Problem, seed: int) -> TreeRun:
    """Basic C-RDT as an OMPL planner, with the same goal tolerance and the same counting."""
    tests, begin = PointTests(problem.world), perf_counter()
    goals = _goal(problem)[None]
    si = space_information(problem, goals, ValidityCallback(problem.world))
    planner = find_planner("crdt")(si, world=tests, seed=seed, goal_tolerance=STEP, max_iterations=CAP)
    planner.setProblemDefinition(problem_definition(problem, goals, si))
    planner.setup()
    found = str(planner.solve(600.0)) == "Exact solution"
    counts = planner.statistics
    seconds = perf_counter() - begin
    return TreeRun(int(counts["iterations"]), int(counts["vertices"]), tests.count, seconds, found)
