"""Figures of [2]: its four trajectories, and the joints along them beside the closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rrtik_bench.genetic.coding import GENERATIONS, coded_run
from rrtik_bench.genetic.published import INCH, TABLE_4, curve
from rrtik_bench.genetic.runs import TRAJECTORIES, arm, run
from rrtik_bench.report.figures import Figure
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.genetic.options import HISTORICAL, STANDARD
from rrtik_ompl.viewer.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


def curves(drawing: Drawing, quick: bool) -> None:
    """The printed curves, and where the tip was in one run along each."""
    del quick
    robot = arm(3)
    for number in TRAJECTORIES:
        panel = drawing.add_subplot(2, 2, number, projection="3d")
        wanted, found = curve(number), run(robot, number, replace(STANDARD, gain=1.0), 0)
        tips = robot.fk_batch(found.result.q)[:, :3, 3] / INCH
        panel.plot(*wanted.T, color=COLORS[5], linewidth=3.0)
        panel.plot(*tips.T, color=COLORS[1], linewidth=0.8)
        panel.set_title(f"{number}: {len(tips)} of {len(wanted)} points", fontsize=9)


def joints(drawing: Drawing, quick: bool) -> None:
    """Joints of one run along each trajectory, beside the branch of the closed form that is nearest."""
    del quick
    robot = arm(3)
    panels = drawing.subplots(2, 2)
    for panel, number in zip(panels.flat, TRAJECTORIES, strict=True):
        q = run(robot, number, replace(STANDARD, gain=1.0), 0).result.q
        found = solutions(robot, curve(number)[: len(q)] * INCH, check=False).branches
        away = np.abs(wrapped(found - q[:, None])).max(axis=(0, 2))
        branch = q + wrapped(found[:, int(np.argmin(away))] - q)
        for k in range(robot.dof):
            panel.plot(np.degrees(branch[:, k]), color=COLORS[k], linewidth=3.0, alpha=0.35)
            panel.plot(np.degrees(q[:, k]), color=COLORS[k], linewidth=0.9, label=f"theta{k + 1}")
        panel.set_title(f"{number}: off by {np.degrees(away.min()):.3f} deg at most", fontsize=9)
        panel.set(xlabel="point", ylabel="[deg]")
        tidy(panel)
    panels[0, 0].legend(frameon=False, fontsize=8)


def generations(drawing: Drawing, quick: bool) -> None:
    """Points reached by generation with range reduction, and the printed totals of table 4."""
    del quick
    panel, robot = drawing.subplots(), arm(3)
    for k, number in enumerate(TRAJECTORIES):
        cost = np.cumsum(run(robot, number, replace(HISTORICAL, gain=0.0), 0).result.cost_of_point)
        panel.plot(cost, np.arange(1, len(cost) + 1), color=COLORS[k], label=f"trajectory {number}")
        panel.plot(TABLE_4[number][1][0], 251, "x", color=COLORS[k], markersize=10)
    panel.set(xlabel="generation (historical preset)", ylabel="points reached")
    panel.legend(frameon=False)
    tidy(panel)


def coding(drawing: Drawing, quick: bool) -> None:
    """Distance from the first point by generation with both codes, and points gained."""
    first, gained = drawing.subplots(1, 2)
    for k, (name, gray) in enumerate({"Gray code": True, "natural binary": False}.items()):
        for seed in range(3 if quick else 10):
            run = coded_run(1, gray, seed, restarts=False)
            one = int(run.cost_of_point[0]) if len(run.q) else len(run.distances)
            first.plot(1 + np.arange(one), run.distances[:one] / INCH, color=COLORS[k], linewidth=0.9,
                       label="" if seed else name)  # fmt: skip
            gained.plot(np.append(np.cumsum(run.cost_of_point), GENERATIONS), [*range(1, len(run.q) + 1), len(run.q)],
                        color=COLORS[k], linewidth=0.9)  # fmt: skip
    first.axhline(0.002, color="#1d2733", linewidth=0.8)
    first.set(xscale="log", yscale="log", xlabel="generation", ylabel="distance from the first point [in]")
    gained.set(xlabel="generation", ylabel="points of 251")
    first.legend(frameon=False, fontsize=8)
    tidy(first)
    tidy(gained)


FIGURES: dict[str, tuple[Figure, ...]] = {
    "ga-reb-4": (
        Figure("genetic_curves", "The four trajectories", "[2], figure 2", curves, size=(8.0, 7.0)),
        Figure("genetic_joints", "Joints along them; broad: closed form", "[2], figure 3", joints, size=(9.0, 6.0)),
        Figure("genetic_generations", "Generations", "[2, table 4]", generations, "published totals as crosses"),
    ),
    "ga-reb-coding": (
        Figure("genetic_coding", "Trajectory 1, no restarts; line: reached", "[2], choice of the code", coding,
               "told in words only", size=(9.0, 4.2)),
    ),
}  # fmt: skip
