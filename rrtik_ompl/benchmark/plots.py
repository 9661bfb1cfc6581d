"""Plot results: solved runs over time, box plots, and planning time over growing problems."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rrtik_ompl.benchmark.statistics import QUANTITIES, Result, by_label
from rrtik_ompl.viewer.plots.joints import COLORS, DASHES, save_figure, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Draws results into a panel, with the styles of the lines.
Draw = Callable[[Any, Sequence[Result], Mapping[str, Any]], None]

PANELS = 24  # largest number of panels in a picture; the tables contain the rest
ACROSS = 3
LEGENDS = 2  # columns of the legend for each panel
BOXES = ("total_seconds", "length", "transitions")
LEAST = 1e-4  # [s]; begin of the time axes


def draw_all(results: Sequence[Result], folder: Path) -> list[Path]:
    """Draw all pictures, each as PNG and SVG; pictures without data are left out.

    Raises:
        InputError: If a file cannot be written.
    """
    plain = by_label(result for result in results if not result.axis)
    families: dict[str, list[Result]] = {}
    for result in results:
        if result.axis:
            families.setdefault(result.group, []).append(result)

    planners = list(dict.fromkeys(result.planner for result in results))
    figures = {"solved": _panels(plain, planners, _solved, "planning time [s]", "runs with a valid path [%]")}
    for quantity in BOXES:
        name, unit = QUANTITIES[quantity]
        draw = _boxes(quantity)
        figures[f"box_{quantity}"] = _panels(plain, planners, draw, "", f"{name} [{unit}]" if unit else name)
    figures["scaling"] = _panels(families, planners, _scaling, None, "planning time, median and quartiles [s]")

    files = []
    for name, figure in figures.items():
        if figure is not None:
            for ending in (".png", ".svg"):
                files.append(folder / f"{name}{ending}")
                save_figure(figure, files[-1])
    return files


def _panels(
    groups: Mapping[str, list[Result]], planners: Sequence[str], draw: Draw, across: str | None, upward: str
) -> Figure | None:
    """Draw a panel for each group, with a common legend; return None without groups.

    Args:
        groups: Results by title of the panel.
        planners: All planners, whose order defines their styles.
        draw: Draws one panel.
        across: Label of the x axis; None for the quantity that grows.
        upward: Label of the y axis.
    """
    if not groups:
        return None

    from matplotlib.figure import Figure

    shown = list(groups.items())[:PANELS]
    columns = min(ACROSS, len(shown))
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(4.2 * columns, 0.8 + 3.0 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()

    styles = {
        name: {"color": COLORS[k % len(COLORS)], "linestyle": DASHES[k // len(COLORS) % len(DASHES)]}
        for k, name in enumerate(planners)
    }

    for panel, (title, results) in zip(panels, shown, strict=False):
        draw(panel, results, styles)
        panel.set_title(title, fontsize=9)
        panel.set_xlabel(results[0].axis if across is None else across)
        tidy(panel)
    for panel in panels[len(shown) :]:
        panel.set_visible(False)

    figure.supylabel(upward, fontsize=10)
    lines = {line.get_label(): line for panel in panels for line in panel.get_lines()}
    known = [name for name in planners if name in lines]
    if known:
        beside = min(len(known), LEGENDS * columns)
        figure.legend([lines[name] for name in known], known, loc="outside upper center", ncols=beside, frameon=False)

    if len(groups) > len(shown):
        figure.suptitle(f"the first {len(shown)} of {len(groups)}", fontsize=9)
    return figure


def _solved(panel: Axes, results: Sequence[Result], styles: Mapping[str, Any]) -> None:
    """Draw the share of runs that are solved by a time, one step curve for each planner."""
    latest = max((value for result in results for value in result.values("plan_seconds")), default=1.0)
    for result in results:
        times = np.sort(result.values("plan_seconds"))
        share = 100.0 * np.arange(len(times) + 1) / result.total
        ends = np.concatenate([[LEAST], np.maximum(times, LEAST), [latest]])
        panel.step(ends, [*share, share[-1]], where="post", label=result.planner, **styles[result.planner])

    panel.set_xscale("log")
    panel.set_ylim(-3.0, 103.0)


def _boxes(quantity: str) -> Draw:
    """Return a function that draws box plots of a quantity, one box for each planner; whiskers are at 5 and 95 %."""

    def draw(panel: Axes, results: Sequence[Result], styles: Mapping[str, Any]) -> None:
        values = [result.values(quantity) for result in results]
        boxes = panel.boxplot(values, whis=(5, 95), patch_artist=True, showfliers=False, widths=0.6)
        for patch, median, result in zip(boxes["boxes"], boxes["medians"], results, strict=True):
            patch.set(facecolor=styles[result.planner]["color"], alpha=0.35)
            median.set(color="#1d2733")
            median.set_label("")

        names = [result.planner for result in results]
        panel.set_xticks(range(1, len(names) + 1), names, rotation=35, ha="right", fontsize=7)
        if quantity.endswith("seconds") and any(values):
            panel.set_yscale("log")

    return draw


def _scaling(panel: Axes, results: Sequence[Result], styles: Mapping[str, Any]) -> None:
    """Draw the median planning time with its quartiles over the quantity that grows, one line for each planner."""
    lines: dict[str, list[tuple[float, float, float, float]]] = {}
    for result in results:
        spread = result.spread("plan_seconds")
        if spread is not None:
            lines.setdefault(result.planner, []).append((result.value, spread.median, spread.q25, spread.q75))

    for planner, points in lines.items():
        value, median, low, high = np.array(sorted(points)).T
        panel.plot(value, median, marker="o", markersize=3, label=planner, **styles[planner])
        panel.fill_between(value, low, high, color=styles[planner]["color"], alpha=0.12, linewidth=0.0)

    panel.set_xscale("log")
    panel.set_yscale("log")
    values = sorted({result.value for result in results})
    panel.set_xticks(values, [f"{value:g}" for value in values])
    panel.xaxis.minorticks_off()
