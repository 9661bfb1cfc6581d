"""Every method of `solve_ik` on the same reachable goals: how often, how fast, how near.

A few minutes.
"""

from __future__ import annotations

import time

import numpy as np

import rrtik_ompl as rrtik
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.solve import IkResult, list_ik_methods

POSES = ("ur5", "panda", "puma560", "titan4")
POINTS = ("puma560_5dof", "panda", "planar10")
HEAD = [
    "robot",
    "method",
    "solved",
    "median [ms]",
    "p95 [ms]",
    "steps",
    "worst [m]",
    "worst [rad]",
    "reasons of failures",
]


def goals(robot: rrtik.Robot, count: int, points: bool) -> list[rrtik.PoseGoal | rrtik.PositionGoal]:
    rng = np.random.default_rng(0)
    tips = [robot.fk(rng.uniform(*robot.finite_range())) for _ in range(count)]
    return [rrtik.PositionGoal(tip.translation) if points else rrtik.PoseGoal(tip) for tip in tips]


def rows(name: str, count: int, seconds: float, points: bool) -> list[list[str]]:
    robot, table = rrtik.load_robot(name), []
    asked = goals(robot, count, points)
    for method in list_ik_methods():
        done: list[IkResult] = []
        times = []
        try:
            for k, goal in enumerate(asked):
                begin = time.process_time()
                done.append(rrtik.solve_ik(robot, goal, method=method, seconds=seconds, seed=k))
                times.append(1e3 * (time.process_time() - begin))
        except InputError:
            continue
        table.append([name, method, *_figures(done, times)])
    return table


def _figures(done: list[IkResult], times: list[float]) -> list[str]:
    residuals = np.vstack([each.residuals for each in done if each.found] or [np.full((1, 2), np.nan)])
    return [
        f"{sum(each.found for each in done)} of {len(done)}",
        f"{np.median(times):.1f}",
        f"{np.quantile(times, 0.95):.1f}",
        f"{np.median([each.iterations for each in done]):.0f}",
        *(f"{worst:.1e}" for worst in residuals.max(axis=0)),
        ", ".join(sorted({each.reason for each in done} - {""})),
    ]


def main(run: Run, *, goals: int = 15, seconds: float = 2.0) -> Report:
    """Measure."""
    report = run.report("Methods of inverse kinematics side by side")
    for title, names, points in (("Poses, 1 mm and 0.01 rad", POSES, False), ("Points, 1 mm", POINTS, True)):
        table = [row for name in names for row in rows(name, goals, seconds, points)]
        text = f"{title}: {goals} reachable goals, at most {seconds:g} s each, processor time"
        report.table(text, HEAD, table)
    return report
