"""Figure 5.12 of [1]: the loop of planner, generator of motions and reshaper, as what each of them did in one run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_bench.figures.plane import INK, draw_scene
from rrtik_bench.report.figures import Figure
from rrtik_bench.reshaping import SCENES, SOURCE, WAYS, reshaped
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.viewer.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

SCENE, WAY = "replan_triangles", "both"
ACTS = {
    "": ("as generated", INK),
    "slowed": ("slowed", COLORS[0]),
    "bent": ("edited", COLORS[2]),
    "planned": ("planner called", COLORS[1]),
}


def loop(drawing: Drawing, quick: bool) -> None:
    """One run among the triangles: what was walked, and steps and calls over time."""
    del quick
    _, bound, shift = SCENES[SCENE]
    found = reshaped(SCENE, WAYS[WAY](shift), 0, bound)
    ticks, acts = found.run.ticks, np.array(found.acts)
    walked, times = np.array([tick.q for tick in ticks]), np.array([tick.time for tick in ticks])
    steps = np.append(np.linalg.norm(np.diff(walked, axis=0), axis=1), 0.0)
    ahead = [np.nan if tick.path is None else route_length(tick.path) for tick in ticks]
    room, course = drawing.subplots(1, 2, width_ratios=(1.0, 1.4))
    draw_scene(room, Scenario.load(SCENE).problem.world.scene)
    room.plot(*walked.T, color=INK, linewidth=0.8)
    for act, (label, color) in ACTS.items():
        chosen = acts == act
        room.plot(*walked[chosen].T, "o", color=color, markersize=4, label=label)
        course.bar(times[chosen], steps[chosen], width=0.08, color=color)
    room.set(xlim=(0, 20), ylim=(0, 20), title="walked; triangles where they begin")
    room.legend(frameon=True, fontsize=7)
    course.set(xlabel="time [s]", ylabel="length of the tick's step", title="line: length of the path ahead")
    beside = course.twinx()
    beside.plot(times, ahead, color=INK, linewidth=0.8)
    beside.set_ylim(bottom=0.0)
    for panel in (room, course):
        tidy(panel)


FIGURES: dict[str, tuple[Figure, ...]] = {
    "drrt-con-loop": (
        Figure("drrt_con_loop", "The loop: what generator, reshaper and planner did", SOURCE, loop,
               "published as a diagram without numbers", size=(11.0, 4.8)),
    ),
}  # fmt: skip
