"""The genetic algorithm at work: distance of the best individual over the generations, as a PNG or SVG file."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np

from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.files.text import known_ending
from rrtik_ompl.ik.genetic.search import GeneticRun
from rrtik_ompl.viewer.plots.joints import COLORS, FORMATS, save_figure, tidy

LEAST = 1e-12  # [m] drawn where the distance is 0, which has no logarithm
MILLIMETRES = 1e3


def plot_distances(
    runs: Mapping[str, GeneticRun], file: str | os.PathLike[str], *, tolerance: float | None = None
) -> None:
    """Draw runs of the genetic algorithm into one picture; both scales are logarithmic.

    Each time a point of the trajectory is gained the distance leaps up to that of the next one.

    Args:
        runs: Of `rrtik_ompl.ik.genetic.search.follow_targets`, by what to call them; at least one.
        file: A .png or .svg file; written whole or not at all.
        tolerance: Of the points [m], drawn as a line if given.

    Raises:
        InputError: If there is no run, the ending is another one, or the file cannot be written.
    """
    known_ending(file, FORMATS, "plot")
    if not runs:
        raise InputError("runs to plot: there is none")
    for name, run in runs.items():
        require(run, GeneticRun, f"run '{name}' to plot")

    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    panel = figure.subplots()

    for k, (name, run) in enumerate(runs.items()):
        counts = f"{name}: {len(run.q)} points in {run.generations} generations"
        over = np.arange(1, run.generations + 1)
        distance = MILLIMETRES * np.maximum(run.distances, LEAST)
        panel.plot(over, distance, color=COLORS[k % len(COLORS)], linewidth=0.9, label=counts)

    if tolerance is not None:
        panel.axhline(MILLIMETRES * tolerance, color="#1d2733", linewidth=1.0, linestyle="dashed", label="tolerance")

    panel.set(xscale="log", yscale="log", xlabel="generation", ylabel="distance of the best [mm]")
    tidy(panel)
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=9)
    save_figure(figure, file, dpi=110)
