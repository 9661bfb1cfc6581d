"""Figures drawn from what is measured, with the published numbers marked where there are any."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

from rrtik_ompl.viewer.plots.joints import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

LETTERS = 13  # of a caption on an inch
PICTURE = "published only as a picture: no number to mark"


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a publication.

    Attributes:
        name: Of the file, without its ending.
        title: What it shows.
        source: Where it was published.
        draw: Measures, quickly or in full, and draws into an empty drawing.
        marked: What of the print is marked in it; by default that nothing can be.
        size: Width and height [in].
    """

    name: str
    title: str
    source: str
    draw: Callable[[Drawing, bool], None]
    marked: str = PICTURE
    size: tuple[float, float] = (7.0, 4.5)

    def save(self, file: Path, quick: bool) -> None:
        """Measure what it shows, and write it.

        Raises:
            InputError: If the file cannot be written.
        """
        import matplotlib.figure

        drawing = matplotlib.figure.Figure(figsize=self.size, layout="constrained")
        self.draw(drawing, quick)
        lines = wrap(f"{self.source}; {self.marked}", round(LETTERS * self.size[0]))
        drawing.suptitle("\n".join([self.title, *lines]), fontsize=9)
        save_figure(drawing, file)
