"""Figures of [1, ch. 5.2 and 5.3]: frames of DRRT-Con, and the three ways to shorten a route."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rrtik_bench.drrt_con import REPAIR_SECONDS
from rrtik_bench.figures.plane import INK, SOLID, draw_arm, draw_scene
from rrtik_bench.report.figures import Figure
from rrtik_bench.shortening.plane_worlds import PUBLISHED, sampled_route
from rrtik_bench.shortening.tables import METHODS, STEP
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning.shortening.task import Task
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.viewer.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

FRAMES = 6
CUTS = {"sequential": COLORS[0], "random 100": COLORS[1], "retraction": COLORS[2]}


def frames(name: str, drawing: Drawing, quick: bool) -> None:
    """Frames of one run: walked black, the path ahead green."""
    del quick
    scenario = Scenario.load(name)
    run = scenario.run(seed=0, repair_budget=REPAIR_SECONDS)
    walked = np.array([tick.q for tick in run.ticks])
    panels = drawing.subplots(2, FRAMES // 2, sharex=True, sharey=True)
    for panel, k in zip(panels.flat, np.linspace(0, len(run.ticks) - 1, FRAMES).astype(int), strict=True):
        tick = run.ticks[k]
        draw_scene(panel, scenario.problem.world.scene.at(tick.time))
        panel.plot(*walked[: k + 1].T, color=INK, linewidth=1.4)
        if tick.path is not None:
            panel.plot(*tick.path.T, color=COLORS[2], linewidth=1.4)
        panel.plot(*tick.q, "o", color=INK, markersize=4)
        panel.plot(*walked[-1], "x", color=COLORS[1])
        panel.set_title(f"{tick.time:.1f} s: {tick.event}", fontsize=9)
        panel.set(xlim=(0, 20), ylim=(0, 20))
        tidy(panel)


def _first(run: ReplanRun, event: str, after: int = 0) -> int:
    return next((k for k, tick in enumerate(run.ticks) if k >= after and tick.event == event), len(run.ticks) - 1)


def arm(drawing: Drawing, quick: bool) -> None:
    """The planar arm whose goal is covered for a while: follows, stops, holds, goes on, arrives."""
    del quick
    scenario = Scenario.load("replan_planar_arm")
    run = scenario.run(seed=0, repair_budget=REPAIR_SECONDS)
    stop = _first(run, "wait")
    go = next((k for k in range(stop, len(run.ticks)) if run.ticks[k].event != "wait"), len(run.ticks) - 1)
    shown = (stop // 2, stop, (stop + go) // 2, go, len(run.ticks) - 1)
    printed = (6, 14, 39, 68, 86)
    for panel, k, step in zip(drawing.subplots(1, len(shown), sharey=True), shown, printed, strict=True):
        tick = run.ticks[k]
        draw_scene(panel, scenario.problem.world.scene.at(tick.time))
        draw_arm(panel, scenario.problem.robot, run.ticks[-1].q, COLORS[1], width=1.0, strength=0.6)
        draw_arm(panel, scenario.problem.robot, tick.q, INK)
        panel.set_title(f"step {k} (printed {step}): {tick.event}", fontsize=8)
        panel.set(xlim=(-3.2, 3.2), ylim=(-1.0, 4.2))
        tidy(panel)


def cuts(drawing: Drawing, quick: bool) -> None:
    """One route of RRT-Connect in each of two worlds, by the three methods."""
    del quick
    for panel, make in zip(drawing.subplots(1, 2), list(PUBLISHED.values())[:2], strict=True):
        plane = make()
        route = sampled_route(plane, 0, STEP)
        for polygon in plane.polygons:
            panel.fill(*polygon.T, color=SOLID)
        panel.plot(*route.T, color=INK, linewidth=0.7, label=f"RRT-Connect: {route_length(route):.2f}")
        for name, color in CUTS.items():
            cut = METHODS[name](route, Task(plane))
            panel.plot(*cut.T, color=color, linewidth=1.6, label=f"{name}: {route_length(cut):.2f}")
        panel.set_title(f"shortest of its class: {plane.class_optimum(route):.2f}", fontsize=9)
        panel.set(aspect="equal", xlim=(0, 26), ylim=(0, 20))
        panel.legend(frameon=True, fontsize=7)
        tidy(panel)


FIGURES: dict[str, tuple[Figure, ...]] = {
    "drrt-con-pockets": (
        Figure("drrt_con_pockets", "Two pockets, one slides", "[1, ch. 5.2], figure of two obstacles",
               partial(frames, "replan_pockets"), size=(9.0, 6.4)),
    ),
    "drrt-con-triangles": (
        Figure("drrt_con_triangles", "Six triangles", "[1, ch. 5.2], figure of six triangles",
               partial(frames, "replan_triangles"), size=(9.0, 6.4)),
    ),
    "drrt-con-arm": (
        Figure("drrt_con_arm", "Planar arm; red: where it arrives", "[1, ch. 5.2], figure of the arm", arm,
               "the printed steps stand above the frames", size=(13.0, 3.4)),
    ),
    "shortening-4": (
        Figure("shortening_routes", "Routes and their lengths", "[1, ch. 5.3], figures of the three methods", cuts,
               size=(11.0, 4.8)),
    ),
}  # fmt: skip
