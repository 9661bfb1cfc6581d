"""Plot slices of a reachability map, or of an effective workspace, to a PNG or SVG file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import known_ending
from rrtik_ompl.ik.reach import Slice
from rrtik_ompl.viewer.plots.joints import FORMATS, save_figure, tidy

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.image import AxesImage

BASE: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": "#1d2733", "markersize": 4}
MARK: dict[str, Any] = {"linestyle": "none", "marker": "^", "color": "#d55e00", "markersize": 8}
VEHICLE: dict[str, Any] = {"fill": False, "hatch": "//", "edgecolor": "#7f8a96"}


def plot_slices(
    slices: Sequence[Slice], file: str | os.PathLike[str], *, title: str = "", label: str = "", colors: str = "viridis"
) -> None:
    """Draw slices side by side with the same colour scale; 0 is left white.

    Args:
        slices: At least one.
        file: A .png or .svg file; written completely or not at all.
        title: Title of the picture.
        label: Label of the colour bar; no bar if "".
        colors: Name of a colour map of matplotlib.

    Raises:
        InputError: If there is no slice, the ending is another one, or the file cannot be written.
    """
    known_ending(file, FORMATS, "plot")
    if not slices:
        raise InputError("slices to plot: there is none")

    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    figure = Figure(figsize=(5.6 * len(slices), 5.0), layout="constrained")
    panels = figure.subplots(1, len(slices), squeeze=False)[0]
    drawn: list[Any] = []
    most = max(float(each.values.max(initial=0.0)) for each in slices) or 1.0

    for panel, each in zip(panels, slices, strict=True):
        steps = [float(axis[1] - axis[0]) if len(axis) > 1 else 1.0 for axis in (each.x, each.y)]
        extent = tuple(
            float(axis[end] + side * step / 2)
            for axis, step in zip((each.x, each.y), steps, strict=True)
            for end, side in ((0, -1), (-1, 1))
        )

        values = np.ma.masked_equal(each.values, 0.0)
        drawn.append(
            panel.imshow(values, origin="lower", extent=extent, cmap=colors, vmin=0.0, vmax=most, aspect="equal")
        )

        for x, y, right, top in each.boxes:
            panel.add_patch(Rectangle((x, y), right - x, top - y, **VEHICLE))
        if each.points:
            panel.plot(*np.array(each.points).T, **MARK)
        panel.plot(*each.base, **BASE)

        panel.set(xlabel=each.across, ylabel=each.up, xlim=extent[:2], ylim=extent[2:])
        panel.set_title(each.title, fontsize=10)
        tidy(panel, grid=False)

    if label:
        figure.colorbar(drawn[0], ax=panels, label=label, shrink=0.8)
    if slices[0].meanings:
        figure.legend(handles=_keys(slices[0].meanings, drawn[0]), loc="outside lower center", ncols=5, frameon=False)

    figure.suptitle(title, fontsize=11)
    save_figure(figure, file, dpi=110)


def _keys(meanings: Mapping[float, str], image: AxesImage) -> list[Artist]:
    """Return the entries of the legend."""
    from matplotlib.colors import to_hex
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colors = [to_hex(color) for color in image.to_rgba(np.array(list(meanings)))]
    return [
        *(Patch(color=color, label=meaning) for color, meaning in zip(colors, meanings.values(), strict=True)),
        Patch(label="vehicle", **VEHICLE),
        Line2D([], [], label="camera", **MARK),
        Line2D([], [], label="base of the arm", **BASE),
    ]
