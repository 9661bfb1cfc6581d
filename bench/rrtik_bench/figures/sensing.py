"""Figures of [1, ch. 4]: precision and accuracy of markers by distance. Millimetres."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_bench.report.figures import Figure
from rrtik_bench.sensing.sequences import APART, NEAR, errors
from rrtik_bench.sensing.tables import ACCURACY, SERIES, simulated
from rrtik_ompl.plots.joints import COLORS, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


def precision(drawing: Drawing, quick: bool) -> None:
    """Standard deviation of the depth by distance, simulated and printed."""
    panel = drawing.subplots()
    distance, printed = (np.array([row[k] for row in SERIES]) for k in (2, 3))
    panel.plot(distance, [row.value for row in simulated(quick)], "o-", color=COLORS[0], label="simulated, 0.03 px")
    panel.plot(distance, printed, "x", color=COLORS[1], markersize=10, label="published")
    panel.set(xlabel="distance [mm]", ylabel="standard deviation of z [mm]", yscale="log")
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


FIGURES: dict[str, tuple[Figure, ...]] = {
    "sensing-noise": (
        Figure("sensing_precision", "Precision by distance", "[1, ch. 4], figures of test 1", precision,
               "published deviations as crosses"),
    ),
    "sensing-sequences": (
        Figure("sensing_accuracy", "Accuracy by distance", "[1, ch. 4], figures 4.23 to 4.28", accuracy,
               "published errors of 300 mm as crosses; the others were published only as a picture"),
    ),
}  # fmt: skip
