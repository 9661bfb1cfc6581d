"""Figures of [1, ch. 4]: precision and accuracy of markers by distance. Millimetres."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_bench.report.figures import Figure
from rrtik_bench.sensing.detections import NUMBERS, confusion
from rrtik_bench.sensing.sequences import APART, NEAR, errors
from rrtik_bench.sensing.tables import ACCURACY, COORDINATES, simulated
from rrtik_ompl.viewer.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


def precision(drawing: Drawing, quick: bool) -> None:
    """Standard deviations of a marker's place by its distance, simulated and printed."""
    panel = drawing.subplots()
    distance = [series[2][2] for series in COORDINATES]
    ours = np.array([row.value for row in simulated(quick)]).reshape(-1, 3)
    for k, axis in enumerate("xyz"):
        printed = [series[k][3] for series in COORDINATES]
        panel.plot(distance, ours[:, k], "-", color=COLORS[k], label=f"{axis}, simulated, 0.03 px")
        panel.plot(distance, printed, "x", color=COLORS[k], markersize=8, label=f"{axis}, published")
    panel.set(xlabel="distance [mm]", ylabel="standard deviation [mm]", yscale="log")
    panel.legend(frameon=False)
    tidy(panel)


def accuracy(drawing: Drawing, quick: bool) -> None:
    """Error of a known distance between two markers, lens not corrected."""
    del quick
    panel = drawing.subplots()
    for k, apart in enumerate(APART):
        found = errors(apart)
        panel.plot(NEAR, [found[d] for d in NEAR], "o-", color=COLORS[k], label=f"{apart} mm apart")
    panel.plot([row[0] for row in ACCURACY], [row[3] for row in ACCURACY], "x", color="#1d2733", markersize=10,
               label="published, 300 mm apart")  # fmt: skip
    panel.axhline(0.0, color="#8494a5", linewidth=0.8)
    panel.set(xlabel="distance to the camera [mm]", ylabel="error [%]")
    panel.legend(frameon=False)
    tidy(panel)


def matrix(drawing: Drawing, quick: bool) -> None:
    """How often which number was found as which, and as none."""
    panel, found = drawing.subplots(), confusion(quick)
    image = panel.imshow(np.where(found > 0, found, np.nan), cmap="viridis", interpolation="nearest", vmin=0)
    panel.axvline(NUMBERS - 0.5, color="#8494a5", linewidth=0.8)
    panel.set(xlabel=f"found as; {NUMBERS}: as none", ylabel="number of the marker")
    drawing.colorbar(image, ax=panel, label="photographs")


FIGURES: dict[str, tuple[Figure, ...]] = {
    "sensing-noise": (
        Figure("sensing_precision", "Precision by distance", "[1, ch. 4], figures of test 1", precision,
               "published deviations as crosses"),
    ),
    "sensing-detections": (
        Figure("sensing_confusion", "Number by number: found as which", "[1, ch. 4.2.3]", matrix,
               "the source names confusion and has no matrix", size=(6.4, 5.4)),
    ),
    "sensing-sequences": (
        Figure("sensing_accuracy", "Accuracy by distance", "[1, ch. 4], figures 4.23 to 4.28", accuracy,
               "published errors of 300 mm as crosses; the others were published only as a picture"),
    ),
}  # fmt: skip
