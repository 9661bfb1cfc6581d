"""The tree of MB-RRT and the regions in which its joints are useful: a picture as a PNG or SVG file, a page in 3-D."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.files.text import known_ending
from rrtik_ompl.ik.mb_rrt.published import TreeSearch
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.marks import Mark, balls, tubes
from rrtik_ompl.viewer.plots.joints import COLORS, FORMATS, save_figure, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAX_COLORS = 6  # one an index; then they repeat
INK, GREY = COLORS[6], COLORS[7]
LINK_RADIUS, SOLUTION_RADIUS = 0.0016, 0.006  # of links and of the solution, over the reach
MAX_LINKS = 600  # drawn of each index, the first ones
REGION_OPACITY = 0.08


def plot_tree(run: TreeSearch, file: str | os.PathLike[str]) -> None:
    """Draw a planar tree: links by index, the solution region of each index in the same colour, the chain found.

    The same input gives the same file.

    Args:
        run: A planar run.
        file: A .png or .svg file; written whole or not at all.

    Raises:
        InputError: If the run is not planar, the ending is another one, or the file cannot be written.
    """
    known_ending(file, FORMATS, "plot")
    require(run, TreeSearch, "tree to plot")
    if run.links.dimension != 2:
        raise InputError("tree to plot: it grows in space, and only planar ones are drawn; see tree_marks")

    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 7.2), layout="constrained")
    panel = figure.subplots()

    for index in range(1, run.links.count):
        _region(panel, run, index)
    _links(panel, run)
    _chain(panel, run)
    _frame(panel, run)

    save_figure(figure, file, dpi=100)


def _color(index: int) -> str:
    return COLORS[(index - 1) % MAX_COLORS]


def _region(panel: Axes, run: TreeSearch, index: int) -> None:
    """The ring about the goal in which the joint of an index can be part of a solution."""
    from matplotlib.patches import Annulus, Circle

    far = float(run.links.max_span[index])
    near = float(run.links.min_span[index])
    x = float(run.goal[0])
    y = float(run.goal[1])

    # Annulus refuses a ring as wide as its radius.
    width = min(far - near, 0.999 * far)
    if width > 1e-3 * run.links.reach:
        panel.add_patch(Annulus((x, y), far, width, facecolor=_color(index), alpha=0.05, edgecolor="none", zorder=0))
    panel.add_patch(Circle((x, y), far, fill=False, edgecolor=_color(index), linewidth=1.0, alpha=0.8, zorder=1))


def _links(panel: Axes, run: TreeSearch) -> None:
    """Every edge of the tree, and nodes outside their region as crosses."""
    from matplotlib.collections import LineCollection

    for index, (level, before, parents) in enumerate(
        zip(run.nodes[1:], run.nodes[:-1], run.parents, strict=True), start=1
    ):
        edges = np.stack([before[parents], level], axis=1)
        label = f"links of index {index}"
        panel.add_collection(
            LineCollection(list(edges), colors=_color(index), linewidths=0.7, alpha=0.55, zorder=2, label=label)
        )

        # Nodes of the last index are tips, which no region bounds.
        far = np.linalg.norm(level - run.goal, axis=1) > run.links.max_span[index] * (1.0 + 1e-9)
        inside = level[~far] if index < run.links.count else level
        panel.plot(*inside.T, linestyle="none", marker="o", markersize=2.2, color=_color(index), zorder=3)
        if index < run.links.count:
            panel.plot(*level[far].T, linestyle="none", marker="x", markersize=4.5, color=_color(index), zorder=3)


def _chain(panel: Axes, run: TreeSearch) -> None:
    chain = run.chain
    panel.plot(*chain.T, color=INK, linewidth=2.6, marker="o", markersize=5, zorder=5, label="solution")
    panel.plot(*run.goal, marker="*", markersize=15, color=COLORS[1], markeredgecolor="white", zorder=6)
    panel.plot(0.0, 0.0, marker="s", markersize=8, color=INK, zorder=6)


def _frame(panel: Axes, run: TreeSearch) -> None:
    reach = 1.06 * run.links.reach
    low = np.minimum(-0.35 * reach, run.goal - run.links.max_span[1] * 1.04)
    high = np.maximum(0.35 * reach, run.goal + run.links.max_span[1] * 1.04)
    panel.set_xlim(float(low[0]), float(high[0]))
    panel.set_ylim(float(low[1]), float(high[1]))
    panel.set_aspect("equal")

    tidy(panel)
    missed = f"{run.misses.min():.2g}"
    panel.set_title(
        f"{run.passes} passes, end within {missed} of the goal; "
        f"{100 * run.rho(1e-9):.0f} % of inner nodes outside their ring (x)",
        fontsize=10,
        color=INK,
    )
    panel.legend(loc="lower right", frameon=False, fontsize=9)


def tree_marks(run: TreeSearch, *, unit: float = 1.0) -> list[Mark]:
    """A tree to be shown by ``view(Scene(), marks=tree_marks(run))``, each index in a colour of its own.

    Args:
        run: A run in space or in the plane.
        unit: Length of one unit of the run [m]; 0.01 for centimetres.

    Raises:
        InputError: If ``run`` is something else.
    """
    require(run, TreeSearch, "tree to show")
    reach = run.links.reach * unit
    goal = _in_space(run.goal[None]) * unit

    marks = []
    for index in range(1, run.links.count + 1):
        color = palette.SERIES[(index - 1) % len(palette.SERIES)]
        if index < run.links.count:
            name = f"where joint {index + 1} can be"
            far = float(run.links.max_span[index]) * unit
            marks.append(balls(name, color, goal, far, opacity=REGION_OPACITY))

        before, level = (_in_space(run.nodes[k]) * unit for k in (index - 1, index))
        edges = np.stack([before[run.parents[index - 1]], level], axis=1)[:MAX_LINKS]
        rest = len(level) - len(edges)
        name = f"links of index {index}" + (f" (all but {rest})" if rest else "")
        marks.append(tubes(name, color, edges, LINK_RADIUS * reach))

    chain = _in_space(run.chain) * unit
    marks.append(
        tubes("answer", palette.INK, [chain[k : k + 2] for k in range(len(chain) - 1)], SOLUTION_RADIUS * reach)
    )
    marks.append(balls("its joints", palette.INK, chain, 1.6 * SOLUTION_RADIUS * reach))
    marks.append(balls("goal", palette.TRAIL, goal, 2.4 * SOLUTION_RADIUS * reach))

    return marks


def _in_space(points: Matrix) -> Matrix:
    """Points of the plane at height 0, those of space as they are; shape (k, 3)."""
    lifted: Matrix = np.pad(points, [(0, 0), (0, 3 - points.shape[1])])
    return lifted
