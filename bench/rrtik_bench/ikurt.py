"""The examples of [1, ch. 5.1]: figures without numbers, so that what is compared is what its text says of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.report.rows import Bar, Row, all_of, judged
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.ikurt.metric import TipMetric, reach
from rrtik_ompl.ik.ikurt.published import PublishedSearch, Steps
from rrtik_ompl.ik.ikurt.search import BatchedSearch, IkurtValidity, Options
from rrtik_ompl.model.goal import PoseGoal, PositionGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.route_check import verification_resolution
from rrtik_ompl.world.world import World

SOURCE = "[1, ch. 5.1]"
METRIC = 1e-2  # accuracy of poses in the published metric
STEP, STRIDE, MOST_VERTICES = 0.15, 0.6, 10_000  # [rad]: of both searches, of the repaired one
THRESHOLD_ANGLE, THRESHOLD_REACH = 0.5, 0.13  # in the metric, of poses; of the reach, for positions
EVALUATIONS = 200_000  # of the metric, after which a run ends
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
SINGULAR = ("titan4_wrist", "titan4_axis1", "titan4_p_axis1")
SLOW = ("planar3_boxes", *SINGULAR)  # for the algorithm to the letter
MOST_SOLUTIONS = 8  # of a PUMA's pose, joints turning less than once
SCENE = "numbers of the scene, parameters and accuracy chosen here: none is printed"
AFTER = f"arrival within {EVALUATIONS:,} evaluations of the metric"
INWARD = "towards a limit few samples lie: it comes nearer as one over the evaluations, see ikurt-limits"
FAR = 10.0  # times the accuracy: nearer, one over the evaluations arrives after ten times as many


@dataclass(frozen=True, slots=True)
class Searched:
    """One search for an example, ended by the number of its evaluations of the metric: no clock decides.

    Attributes:
        arrived: Whether it led to a path that passes the second check.
        evaluations: Of the metric.
        nearest: Distance of its nearest vertex from the goal, as a multiple of the accuracy.
    """

    arrived: bool
    evaluations: int
    nearest: float


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


def letter_steps(problem: Problem) -> Steps:
    """The numbers of the algorithm to the letter for an example."""
    metric = metric_of(problem)
    far = THRESHOLD_ANGLE if metric.metres_per_radian else THRESHOLD_REACH * reach(problem.robot)
    return Steps(STEP, far, metric.radius)


def _dense(problem: Problem) -> World:
    """Its world, motions checked as densely as by the second check."""
    return problem.world.with_resolution(verification_resolution(problem.world.settings))


def letter(problem: Problem, seed: int, most: int = EVALUATIONS) -> Searched:
    """The algorithm to the letter."""
    metric, bounds = metric_of(problem), problem.robot.finite_range()
    search = PublishedSearch(
        metric,
        letter_steps(problem),
        *bounds,
        _dense(problem).motion_valid,
        lambda: metric.evaluations >= most,
        np.random.default_rng(seed),
        problem.start,
    )
    vertex = search.run()
    path = None if vertex is None else search.tree.branch(vertex)
    return _searched(problem, metric, path, float(search.tree.distance.min()))


def repaired_search(problem: Problem, seed: int, most: int = EVALUATIONS) -> tuple[Matrix | None, TipMetric]:
    """The repaired one without Jacobian: its path, shape (k, n), if it arrived, and the metric that has counted."""
    assert isinstance(problem.goal, PoseGoal | PositionGoal)
    metric, world = TipMetric(problem.robot, [problem.goal]), _dense(problem)
    validity = IkurtValidity(world.valid_batch, world.motion_valid_batch, lambda: metric.evaluations >= most)
    search = BatchedSearch(
        metric,
        Options(STEP, STRIDE, jacobian=False, most_vertices=MOST_VERTICES),
        *problem.robot.finite_range(),
        validity,
        np.random.default_rng(seed),
        problem.start[None],
    )
    return search.run(), metric


def repaired(problem: Problem, seed: int, most: int = EVALUATIONS) -> Searched:
    """The repaired algorithm, which uses no Jacobian either."""
    path, metric = repaired_search(problem, seed, most)
    return _searched(problem, metric, path, float("inf") if path is None else metric.distance(path[-1:])[0])


def _searched(problem: Problem, metric: TipMetric, path: Matrix | None, nearest: float) -> Searched:
    good = path is not None and not JointPath(path).violations(problem.world)
    return Searched(good, metric.evaluations, nearest / metric.radius)


def _told(runs: list[Searched]) -> str:
    found, median = sum(run.arrived for run in runs), np.median([run.evaluations for run in runs])
    return f"{found} of {len(runs)}, median {median:,.0f} evaluations"


def examples(quick: bool) -> list[Row]:
    """Every example by the algorithm to the letter, and by the repaired one."""
    rows = []
    for name, what in EXAMPLES.items():
        problem = as_published(rrtik.load_problem(name))
        if not quick or name not in SLOW:
            rows.append(_letter_row(name, [letter(problem, seed) for seed in range(1 if quick else _runs(name))]))
        runs = [repaired(problem, seed) for seed in range(3 if quick else 20)]
        text = f"{AFTER}; {SCENE}; repaired: misses tolerated, directions of equal chance, no Jacobian"
        share = sum(run.arrived for run in runs) / len(runs)
        rows.append(judged(f"{what}: repaired", "solved; no time", _told(runs), share, all_of(), text))
    return rows


def _runs(name: str) -> int:
    """Of the algorithm to the letter in the full table; at singular goals each takes a while."""
    return 3 if name in SINGULAR else 5


def _letter_row(name: str, runs: list[Searched]) -> Row:
    """At singular goals, those of [1], it is judged by how near it comes; else by how many runs arrive."""
    what, text = f"{EXAMPLES[name]}: to the letter", f"{AFTER}; {SCENE}"
    if name not in SINGULAR:
        share = sum(run.arrived for run in runs) / len(runs)
        return judged(what, "solved; no time", _told(runs), share, all_of(), text)
    worst = max(run.nearest for run in runs)
    bar = Bar((0.0, 1e4), held=(0.0, 1.0), differs=(0.0, FAR))
    told = f"{_told(runs)}; the farthest ends at {worst:.2g} times the accuracy"
    return judged(what, "solved; no time", told, worst, bar, text if worst <= 1.0 else f"{AFTER}; {INWARD}")


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
    Table(
        "ikurt-examples",
        "Six examples, to the letter and repaired",
        SOURCE,
        examples,
        130,
        10,
        bars="the source says that all are solved; evaluations and ten times the accuracy ours",
    ),
    Table("ikurt-solutions", "Solutions of a pose", SOURCE, solutions, 1, 1),
)
