"""Print markers and boards in true size, as PDF (vector) or PNG, with a scale to check the printer."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import finite_number, whole_number
from rrtik_ompl.base.errors import InputError, at_most, listed, require
from rrtik_ompl.files.text import check_target, file_name, write_bytes
from rrtik_ompl.sensing.markers.detection import charuco_board
from rrtik_ompl.sensing.markers.dictionaries import marker_cells

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPERS = {"a4": (0.210, 0.297), "a3": (0.297, 0.420), "letter": (0.2159, 0.2794)}  # width, height [m]
EDGE, GAP, CAPTION = 0.010, 0.008, 0.006  # [m]
RULE = 0.100  # length of the printed rule [m]
UP = "\u25b2 up"  # the y axis of the marker
SHEET_FORMATS = (".pdf", ".png")
LEAST_DOTS, MOST_DOTS = 20, 2400  # resolution of a PNG [dots per inch]


@dataclass(frozen=True, slots=True, eq=False)
class _Tile:
    """An array of cells on the paper.

    Attributes:
        cells: Grey values, shape (rows, columns).
        x: Left edge [m].
        y: Lower edge [m].
        cell: Side of a cell [m].
        caption: Text below it.
        caption_y: Height of the text [m].
    """

    cells: NDArray[np.uint8]
    x: float
    y: float
    cell: float
    caption: str
    caption_y: float


def print_markers(
    path: str | os.PathLike[str],
    numbers: Sequence[int],
    *,
    side: float,
    dictionary: str,
    paper: str = "a4",
    dots_per_inch: int = 600,
) -> int:
    """Write sheets with markers of a given side [m] (that of the black square), as many as fit on each.

    Returns:
        The number of sheets. Several PNG files are numbered: ``name-1.png``, ``name-2.png``.

    Raises:
        InputError: If a marker does not exist or does not fit the paper, or the file cannot be written.
    """
    numbers = listed(numbers, "numbers of markers")
    side = finite_number(side, "side of a marker")

    width, height = _paper(paper)
    cells = [marker_cells(dictionary, number) for number in numbers]
    if not cells:
        raise InputError("no marker is named; give at least one number")
    if not 0.002 <= side <= 1.0:
        raise InputError(f"side of a marker must be between 0.002 and 1 m, got {side:g}")

    cell = side / len(cells[0])
    outer = side + 2.0 * cell  # side with the white rim
    columns = int((width - 2 * EDGE + GAP) // (outer + GAP))
    rows = int((height - 2 * EDGE - 2 * CAPTION + GAP) // (outer + CAPTION + GAP))
    if columns < 1 or rows < 1:
        raise InputError(f"a marker of {side:g} m does not fit on {paper}; the rim takes {2 * cell:.3f} m more")

    tiles = []
    for place, (number, each) in enumerate(zip(numbers, cells, strict=True)):
        row, column = divmod(place % (rows * columns), columns)
        x = EDGE + column * (outer + GAP) + cell
        y = height - EDGE - (row + 1) * (outer + CAPTION) - row * GAP + CAPTION + cell
        caption = f"{UP}  {dictionary}  id {number}  side {1e3 * side:g} mm"
        tiles.append(_Tile(each, x, y, cell, caption, y - cell - 0.5 * CAPTION))

    pages = [tiles[k : k + rows * columns] for k in range(0, len(tiles), rows * columns)]
    _write(path, pages, (width, height), dots_per_inch)
    return len(pages)


def print_board(
    path: str | os.PathLike[str],
    *,
    columns: int = 6,
    rows: int = 8,
    square: float = 0.030,
    marker: float = 0.022,
    dictionary: str = "apriltag_36h11",
    paper: str = "a4",
    dots_per_inch: int = 600,
) -> None:
    """Write a ChArUco board for calibration; sides of squares and markers in metres.

    Raises:
        InputError: If the board makes no sense or does not fit the paper, or the file cannot be written.
    """
    board = charuco_board(columns, rows, square, marker, dictionary)
    width, height = _paper(paper)
    if columns * square > width - 2 * EDGE or rows * square > height - 2 * EDGE - 2 * CAPTION:
        raise InputError(f"a board of {columns * square:.3f} x {rows * square:.3f} m does not fit on {paper}")

    fine = 100  # cells a square, so that the side of a marker is a whole number of cells to 1 %
    picture = np.asarray(board.generateImage((columns * fine, rows * fine), marginSize=0, borderBits=1), dtype=np.uint8)

    caption = f"ChArUco {columns} x {rows}, {dictionary}, squares {1e3 * square:g} mm, markers {1e3 * marker:g} mm"
    x = 0.5 * (width - columns * square)
    y = height - EDGE - rows * square

    _write(path, [[_Tile(picture, x, y, square / fine, caption, y - CAPTION)]], (width, height), dots_per_inch)


def _paper(name: str) -> tuple[float, float]:
    require(name, str, "paper")
    if name.lower() not in PAPERS:
        raise InputError(f"no paper '{name}'; have {', '.join(PAPERS)}")
    return PAPERS[name.lower()]


def _write(
    path: str | os.PathLike[str], pages: list[list[_Tile]], size: tuple[float, float], dots_per_inch: int
) -> None:
    """Write pages of tiles to a PDF, or to one PNG for each page."""
    from matplotlib.backends.backend_pdf import PdfPages

    file = file_name(path)
    check_target(file, SHEET_FORMATS)
    dots_per_inch = whole_number(dots_per_inch, "dots_per_inch", least=LEAST_DOTS)
    at_most(dots_per_inch, MOST_DOTS, "dots_per_inch")

    figures = [_page(page, size) for page in pages]
    if file.suffix.lower() == ".pdf":
        made = BytesIO()
        with PdfPages(made) as book:
            for figure in figures:
                book.savefig(figure)
        write_bytes(file, made.getvalue())
        return

    for k, figure in enumerate(figures):
        target = file if len(figures) == 1 else file.with_stem(f"{file.stem}-{k + 1}")
        made = BytesIO()
        figure.savefig(made, format=file.suffix[1:].lower(), dpi=dots_per_inch)
        write_bytes(target, made.getvalue())


def _page(tiles: list[_Tile], size: tuple[float, float]) -> Figure:
    """Draw the tiles of one page and the scale for checking the printer; all sizes are in metres."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size[0] / 0.0254, size[1] / 0.0254))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, size[0]), ylim=(0.0, size[1]))
    axes.axis("off")

    for tile in tiles:
        rows, columns = tile.cells.shape
        box = (tile.x, tile.x + columns * tile.cell, tile.y, tile.y + rows * tile.cell)
        axes.imshow(tile.cells, cmap="gray", vmin=0, vmax=255, extent=box, interpolation="none", aspect="auto")
        axes.text(tile.x, tile.caption_y, tile.caption, fontsize=7, va="center")

    axes.plot([EDGE, EDGE + RULE], [EDGE, EDGE], color="black", linewidth=0.8)
    axes.text(
        EDGE + RULE + 0.003, EDGE, "100 mm: measure it; print at 100 %, not fitted to the page", fontsize=6, va="center"
    )

    axes.set_xlim(0.0, size[0])
    axes.set_ylim(0.0, size[1])
    return figure
