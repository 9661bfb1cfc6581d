"""Figures of [1, ch. 6.3]: environment E, and lists of single-joint moves beside the printed ones."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.crdt.baseline import crdt_run, rrt_run
from rrtik_bench.crdt.published import CRDT_TABLE, PRISM_LIST, RRT_TABLE, SDU_LIST
from rrtik_bench.crdt.runs import STAGES, route_run
from rrtik_bench.crdt.tables import TWICE
from rrtik_bench.figures.plane import draw_arm, draw_scene
from rrtik_bench.report.figures import Figure
from rrtik_ompl.model.transitions import transitions
from rrtik_ompl.viewer.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

JOINT_5 = 4
STRAIGHT = 90.0  # [deg] theta5 of a straight wrist, as printed


def environment_e(drawing: Drawing, quick: bool) -> None:
    """Routes by stages in the letter E, and iterations of both trees beside the printed mean, least and most."""
    problem, count = rrtik.load_problem("env_e"), 60 if quick else 300
    scene, panel = drawing.subplots(1, 2)
    draw_scene(scene, problem.world.scene)
    routes = route_run(problem, 0).routes
    for k, (name, route) in enumerate(zip(STAGES[: TWICE + 1], routes, strict=False)):
        scene.plot(*route.T, color=COLORS[k], linewidth=2.4 - 0.7 * k, label=f"{name}: {transitions(route)} moves")
    scene.set(xlim=(0, 25), ylim=(0, 25))
    scene.legend(frameon=True, fontsize=8)
    for k, (name, run, printed) in enumerate((("RRT", rrt_run, RRT_TABLE), ("C-RDT", crdt_run, CRDT_TABLE))):
        found = np.sort([run(problem, seed).iterations for seed in range(count)])
        panel.plot(found, np.arange(1, count + 1) / count, color=COLORS[k], label=f"{name}, {count} runs")
        mean, least, most = (row[0] for row in printed[:3])
        panel.plot(mean, 0.5 - 0.05 * k, "x", color=COLORS[k], markersize=9, label=f"{name}: printed mean")
        panel.plot([least, most], [0.5 - 0.05 * k] * 2, color=COLORS[k], linewidth=0.7)
    panel.set(xscale="log", xlabel="iterations", ylabel="share of the runs")
    panel.legend(frameon=False, fontsize=8)
    tidy(scene)
    tidy(panel)


def squares(drawing: Drawing, quick: bool) -> None:
    """Postures at the vertices of the best route of some runs between the squares, three proposals."""
    count = 3 if quick else 20
    for panel, case in zip(drawing.subplots(1, 3), "abc", strict=True):
        problem = rrtik.load_problem(f"planar3_{case}")
        route = min((route_run(problem, seed).routes[TWICE] for seed in range(count)), key=transitions)
        draw_scene(panel, problem.world.scene)
        for k, q in enumerate(route):
            draw_arm(panel, problem.robot, q, COLORS[k % 6], width=1.6, strength=0.9)
        panel.set_title(f"{case.upper()}: {transitions(route)} moves", fontsize=9)
        tidy(panel)


def moves(name: str, printed: list[list[float]], drawing: Drawing, quick: bool) -> None:
    """Joints from vertex to vertex: the printed list dashed, the best of some runs solid; theta5 as printed."""
    problem, count = rrtik.load_problem(name), 10 if quick else 100
    ours = min((route_run(problem, seed).routes[TWICE] for seed in range(count)), key=transitions)
    shown = np.degrees(ours)
    shown[:, JOINT_5] += STRAIGHT
    titles = f"printed: {len(printed) - 1} moves", f"best of {count} runs: {len(shown) - 1} moves"
    for panel, rows, title in zip(drawing.subplots(1, 2, sharey=True), (np.array(printed), shown), titles, strict=True):
        for k, column in enumerate(rows.T):
            panel.plot(column, "o-", color=COLORS[k], label=f"theta{k + 1}", markersize=4)
        panel.set(xlabel="vertex", ylabel="[deg]", title=title)
        tidy(panel)
    drawing.axes[0].legend(frameon=False, fontsize=8, ncols=2)


FIGURES: dict[str, tuple[Figure, ...]] = {
    "crdt-e": (
        Figure("crdt_e", "Environment E", "[1, ch. 6.3], figures and tables of test E", environment_e,
               "printed means as crosses, least to most as lines", size=(10.0, 4.8)),
    ),
    "crdt-planar": (
        Figure("crdt_planar", "Planar arm, two squares", "[1, ch. 6.3], figures of the planar test", squares,
               size=(11.0, 4.2)),
    ),
    "crdt-sdu": (
        Figure("crdt_sdu", "TITAN-4 at the subsea unit: the moves", "[1, ch. 6.3], list of the SDU test",
               partial(moves, "titan4_sdu", SDU_LIST), "the printed list on the left", size=(10.0, 4.6)),
    ),
    "crdt-prisms": (
        Figure("crdt_prisms", "TITAN-4 and two prisms: the moves", "[1, ch. 6.3], list of the prism test",
               partial(moves, "titan4_prisms", PRISM_LIST), "the printed list on the left", size=(10.0, 4.6)),
    ),
}  # fmt: skip
