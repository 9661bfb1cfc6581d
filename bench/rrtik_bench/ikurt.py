"""The examples of [1, ch. 5.1]: figures without numbers, so that what is compared is what its text says of them."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.goal import PoseGoal, PositionGoal
from rrtik_ompl.ik.ikurt.metric import TipMetric
from rrtik_ompl.problem import Problem

SOURCE = "[1, ch. 5.1]"
METRIC = 1e-2  # accuracy of poses in the published metric
EXAMPLES = {
    "planar3_boxes": "1, planar arm of three joints, two boxes",
    "planar6_c": "2, six joints, inside a C, position",
    "planar6_c_pose": "3, the same, pose",
    "puma_position": "4, PUMA, position",
    "puma_pose": "5, PUMA, pose",
    "titan4_regular": "6, TITAN-4, pose",
    "titan4_wrist": "6, TITAN-4, singular: theta5 = 90 deg",
    "titan4_axis1": "6, TITAN-4, singular: tool axis on axis 1",
    "titan4_p_axis1": "6, TITAN-4, singular: P on axis 1",
}
SLOW = ("planar3_boxes", "titan4_wrist", "titan4_axis1", "titan4_p_axis1")  # for the algorithm to the letter
SINGULAR = SLOW[1:]
BLOCKED = "CONNECT ends at its first blocked sample"
INWARD = "towards a limit few samples lie, see ikurt-limits"
MOST_SOLUTIONS = 8  # of a PUMA's pose, joints turning less than once
SCENE = "numbers of the scene, parameters and accuracy chosen here: none is printed"


@dataclass(frozen=True, slots=True)
class Solved:
    """Of some runs: how many led to a path, and the median of their wall time [s], failures included."""

    found: int
    runs: int
    seconds: float

    @property
    def all(self) -> bool:
        """Whether every run led to a path."""
        return self.found == self.runs

    def __str__(self) -> str:
        return f"{self.found} of {self.runs}, median {self.seconds:.3g} s"


def metric_of(problem: Problem) -> TipMetric:
    """The published metric of a problem with its default weight."""
    return TipMetric.published(problem.robot, [problem.goal], problem.start)  # type: ignore[list-item]


def as_published(problem: Problem) -> Problem:
    """The problem with a goal as loose as acceptance allows: poses to 1e-2 in the metric."""
    if isinstance(problem.goal, PositionGoal) or not isinstance(problem.goal, PoseGoal):
        return problem
    metric = metric_of(problem)
    goal = PoseGoal(problem.goal.T_world_tip, METRIC / metric.unit, METRIC / (metric.unit * metric.metres_per_radian))
    return Problem(problem.world, problem.start, goal, name=problem.name)


def _solved(problem: Problem, planner: str, runs: int, seconds: float, **parameters: Any) -> Solved:
    found, times = 0, []
    for seed in range(runs):
        begin = time.perf_counter()
        plan = rrtik.plan(problem, planner, seconds=seconds, seed=seed, parameters=parameters)
        times.append(time.perf_counter() - begin)
        found += plan.found
    return Solved(found, runs, float(np.median(times)))


def examples(quick: bool) -> list[Row]:
    """Every example by the algorithm to the letter, and by the repaired one, which uses no Jacobian either."""
    rows = []
    for name, what in EXAMPLES.items():
        problem = as_published(rrtik.load_problem(name))
        repaired = _solved(problem, "ikurt", 3 if quick else 20, 10.0, jacobian=False)
        if not quick or name not in SLOW:
            literal = _solved(problem, "ikurt-published", 1 if quick else 5, 10.0)
            reading = (
                f"{INWARD if name in SINGULAR else BLOCKED}: {literal.runs - literal.found} of {literal.runs} fail"
            )
            rows.append(judged(f"{what}: to the letter", "solved; no time", str(literal), literal.found / literal.runs,
                               _literal_bar(name, repaired), SCENE if literal.all else reading))  # fmt: skip
        text = f"{SCENE}; repaired: misses tolerated, directions of equal chance, no Jacobian"
        rows.append(judged(f"{what}: repaired", "solved; no time", str(repaired), repaired.found / repaired.runs,
                           all_of(), text))  # fmt: skip
    return rows


def _literal_bar(name: str, repaired: Solved) -> Bar:
    """Of the share of runs that lead to a path: the singular goals are those of [1], and the boxes are ours."""
    if name in SINGULAR and repaired.all:
        return all_of(refutes=True)
    return Bar((0.0, 1.0), held=(1.0, 1.0), differs=(0.2, 1.0) if name in SLOW else None)


def solutions(quick: bool) -> list[Row]:
    """How many configurations of a PUMA reach a pose."""
    robot, rng = rrtik.load_robot("puma560"), np.random.default_rng(0)
    goals = [PoseGoal(robot.fk(q)) for q in rng.uniform(*robot.finite_range(), (50 if quick else 500, robot.dof))]
    counts = [len(rrtik.solve_ik(robot, goal, method="closed-form", all=True).solutions) for goal in goals]
    text = f"up to {max(counts)} within the limits, {np.mean(counts):.1f} in the mean"
    reading = f"a PUMA has {MOST_SOLUTIONS}, further ones by whole turns alone; 16 is the bound of a general arm"
    bar = Bar((0.0, 64.0), held=(16.0, 16.0), refuted=(MOST_SOLUTIONS, MOST_SOLUTIONS))
    return [judged("solutions of a pose, PUMA", "up to 16", text, max(counts), bar, reading)]


TABLES = (
    Table("ikurt-examples", "Six examples, to the letter and repaired", SOURCE, examples, 180, 8),
    Table("ikurt-solutions", "Solutions of a pose", SOURCE, solutions, 1, 1),
)
