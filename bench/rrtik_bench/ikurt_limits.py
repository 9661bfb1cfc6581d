"""Why IKURT to the letter does not arrive where joints are at their limits [1, ch. 5.1], and the smallest repair.

CONNECT steps towards a sample inside the limits. At a gap g from the limit of a joint whose range is r, a share of
g / r of the samples lies outwards, and leads outwards by no more than g: on the average the gap falls by its square,
that is, as one over the number of steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.ikurt import EXAMPLES, METRIC, SINGULAR, SOURCE, STEP, THRESHOLD_ANGLE, as_published
from rrtik_bench.report.rows import Bar, Row, all_of, exactly, judged
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.ikurt.metric import TipMetric
from rrtik_ompl.ik.ikurt.published import PublishedSearch, Steps
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.world.problem import Problem

WRIST = "titan4_wrist"
BEYOND = 0.5  # of a joint's range
LETTER = Steps(STEP, THRESHOLD_ANGLE, 0.99 * METRIC)
SLOW_RULE = "to the letter"
RULES = {
    SLOW_RULE: LETTER,
    "blocked steps tolerated": replace(LETTER, misses=25),
    "samples beyond the limits": replace(LETTER, beyond=BEYOND),
    "directions of equal chance": replace(LETTER, even=True),
}
ANYWHERE = (SLOW_RULE, "samples beyond the limits", "directions of equal chance")  # compared at random poses
RANDOM_POSES, RANDOM_EVALUATIONS = 12, 15_000
EVALUATIONS, FEW_EVALUATIONS = 20_000, 5_000  # of the metric, after which a run ends
BUDGET = "evaluations of the metric; step, threshold and accuracy are chosen here: none is printed"


class WatchedMetric(TipMetric):
    """The published metric; remembers the nearest configuration after each evaluation.

    Attributes:
        nearest: Distance in the metric, one number an evaluation.
        at: The configuration there, shape (dof,) each.
    """

    def distance(self, Q: Matrix) -> Vector:
        """See :meth:`rrtik_ompl.ik.ikurt.metric.TipMetric.distance`."""
        if self.evaluations == 0:
            self.nearest: list[float] = []
            self.at: list[Vector] = []
        found = super().distance(Q)
        for q, away in zip(Q, found, strict=True):
            better = not self.nearest or away < self.nearest[-1]
            self.nearest.append(float(away) if better else self.nearest[-1])
            self.at.append(q.copy() if better else self.at[-1])
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """One run: whether it arrived, how often CONNECT began, and the nearest configuration after each evaluation."""

    arrived: bool
    connects: int
    nearest: Vector
    at: Matrix

    @property
    def evaluations(self) -> int:
        """Of the metric."""
        return len(self.nearest)


def letter_search(problem: Problem, steps: Steps, seed: int, evaluations: int) -> tuple[PublishedSearch, WatchedMetric]:
    """The published search of a problem that begins at its start, ended after so many evaluations of the metric."""
    metric = WatchedMetric.published(problem.robot, [problem.goal], problem.start)  # type: ignore[list-item]
    assert isinstance(metric, WatchedMetric)
    bounds, rng = problem.robot.finite_range(), np.random.default_rng(seed)
    search = PublishedSearch(
        metric,
        steps,
        *bounds,
        problem.world.motion_valid,
        lambda: metric.evaluations >= evaluations,
        rng,
        problem.start,
    )
    return search, metric


@cache
def approach(name: str, rule: str, seed: int, evaluations: int) -> Approach:
    """One run of an example by one of `RULES`."""
    search, metric = letter_search(as_published(rrtik.load_problem(name)), RULES[rule], seed, evaluations)
    arrived = search.run() is not None
    return Approach(arrived, search.connects, np.array(metric.nearest), np.array(metric.at))


def outward_share(rule: str, gap: Vector, width: float) -> Vector:
    """Share of the steps that lead a joint towards a limit, by its gap from it; its range is ``width``."""
    room = RULES[rule].beyond * width
    return np.full(len(gap), 0.5) if RULES[rule].even else (gap + room) / (width + 2.0 * room)


def limits(quick: bool) -> list[Row]:
    """The goals at limits, by the letter and with one change at a time."""
    count, most = (1, FEW_EVALUATIONS) if quick else (5, EVALUATIONS)
    rows = []
    for name in SINGULAR:
        for rule in RULES:
            runs = [approach(name, rule, seed, most) for seed in range(count)]
            arrived = sum(run.arrived for run in runs)
            nearest = float(np.median([run.nearest[-1] for run in runs]))
            text = f"{arrived} of {count}; nearest {nearest:.2g} after {np.median([r.evaluations for r in runs]):.0f}"
            label, printed = f"{EXAMPLES[name]}: {rule}", PRINTED.get(rule, "not in the print")
            reading = f"at most {most} {BUDGET}"
            if rule == SLOW_RULE:
                rows.append(Row(label, printed, text, None, f"{reading}; it goes on as one over the evaluations"))
            else:
                rows.append(judged(label, printed, text, arrived / count, BARS[rule], reading))
        blocked = sum(approach(name, "to the letter", seed, most).connects - 1 for seed in range(count))
        rows.append(judged(f"{EXAMPLES[name]}: blocked steps", "end CONNECT", str(blocked), blocked, NEVER_BLOCKED,
                           "limits are a convex set: no step towards a sample inside leaves it"))  # fmt: skip
    return rows


def random_poses(quick: bool) -> list[Row]:
    """Poses of random postures of TITAN-4 without obstacles, by the letter and with one change at a time."""
    count, most = (3, FEW_EVALUATIONS) if quick else (RANDOM_POSES, RANDOM_EVALUATIONS)
    problems = [_random_problem(seed) for seed in range(count)]
    rooms = np.array([_room(problem) for problem in problems])
    rows = []
    arrived = {}
    for rule in ANYWHERE:
        searches = [letter_search(problem, RULES[rule], 0, most) for problem in problems]
        arrived[rule] = np.array([search.run() is not None for search, _ in searches])
        nearest = np.array([watched.nearest[-1] for _, watched in searches]) / METRIC
        text = (
            f"{arrived[rule].sum()} of {count}; the others end at {_span(nearest[~arrived[rule]])} times the accuracy"
        )
        label = f"random poses: {rule}"
        reading = f"at most {most} {BUDGET}"
        if rule == SLOW_RULE:
            rows.append(Row(label, PRINTED[rule], text, None, f"{reading}; not only goals at limits are slow"))
        else:
            more = float(arrived[rule].sum() - arrived[SLOW_RULE].sum()) / count
            rows.append(judged(label, "not in the print", text, more, Bar((-1.0, 1.0), held=(1e-9, 1.0)), reading))

    slow = ~arrived[SLOW_RULE]
    text = f"arrived: {_span(rooms[~slow])} deg; not: {_span(rooms[slow])} deg"
    reading = "of the nearest joint from its limit, at the solution that has the most room"
    rows.append(Row("random poses: room to the limits", "not in the print", text, None, reading))
    return rows


def _random_problem(seed: int) -> Problem:
    """The pose of a random posture, from the start of the regular example."""
    example = rrtik.load_problem("titan4_regular")
    robot = example.robot
    q = np.random.default_rng([5, seed]).uniform(robot.lower, robot.upper)
    return as_published(Problem(example.world, example.start, PoseGoal(robot.fk(q))))


def _room(problem: Problem) -> float:
    """How far the nearest joint is from its limit [deg], at the solution of a pose where that is most."""
    robot = problem.robot
    Q = rrtik.solve_ik(robot, problem.goal, method="closed-form", all=True).solutions
    return float(np.degrees(np.minimum(Q - robot.lower, robot.upper - Q).min(axis=1).max()))


def _span(values: Vector) -> str:
    """Median, and from least to most; "none" if there are no values."""
    return f"{np.median(values):.2g} ({values.min():.2g} to {values.max():.2g})" if len(values) else "none"


PRINTED = {"to the letter": "solved; no time", "blocked steps tolerated": "no help, if none is blocked"}
BARS = {
    "blocked steps tolerated": Bar((0.0, 1.0), held=(0.0, 0.4)),
    "samples beyond the limits": all_of(),
    "directions of equal chance": all_of(),
}
NEVER_BLOCKED = exactly(0, 1e6)
TABLES = (
    Table(
        "ikurt-limits",
        "Goals at limits: one change at a time",
        SOURCE,
        limits,
        80,
        6,
        bars="the source says that they are solved; evaluations and shares ours",
    ),
    Table(
        "ikurt-random",
        "Random poses: one change at a time",
        SOURCE,
        random_poses,
        150,
        12,
        bars="the source says that poses are solved; evaluations and shares ours",
    ),
)
