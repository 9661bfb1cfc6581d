"""Ground as a grid of heights, such as a seabed from sonar or terrain from a picture."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import LARGEST, Matrix, finite_number, frozen, length, number_rows, positive, whole_number
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.errors import CloudWarning, InputError, require
from rrtik_ompl.files.kinds import read
from rrtik_ompl.model.shapes.box_pile import BoxPile, few_enough, merged
from rrtik_ompl.model.shapes.point_cloud import Invalid, known_choice

FEW = 0.05  # largest share of the heights that count as outliers
FAR = 20.0  # heights are outliers if they are this many times the extent of the rest, and of the grid, away
COARSER = "take .coarser(2), or a part of it"


@dataclass(frozen=True, slots=True, eq=False)
class HeightField(BoxPile):
    """A grid of columns from a common floor up to their heights; the solid is exactly the union of these.

    Adjacent columns of equal height form one box. The origin is the middle of the grid; columns of the array go along
    x, rows along y.

    Attributes:
        heights: Upper end of each column along z [m], shape (rows, columns); NaN where there is no column.
        cell: Side of a column [m].
        floor: Lower end of all columns along z [m].
        source: Path of the file it was read from, or "" if it was changed since.
        scale: Metres per unit of that file; it is written back with the scene.
        nodata: The number that stands for missing data in that file; it is written back as well. None if unknown.

    Args:
        heights: See above.
        cell: See above.
        floor: See above; one cell below the lowest height if None.
        invalid: Whether heights that are not finite are refused, or dropped, which leaves out their columns.
        source: See above.
        scale: See above.
        nodata: See above.

    Raises:
        InputError: If there are no heights, heights are not numbers or not finite, one is not above the floor, or
            there are more boxes than a scene can hold.

    Warns:
        CloudWarning: If a few heights lie far beyond the rest, as they probably mark missing data.

    Example:
        >>> seabed = rrtik.HeightField([[0.1, 0.1, 0.3], [0.1, 0.1, 0.2]], cell=0.5)
        >>> seabed
        HeightField(2 x 3 cells of 0.5 m, 3 boxes)
    """

    key = "heights"

    heights: Matrix
    cell: float
    floor: float
    source: str
    scale: float
    nodata: float | None

    __reduce__ = as_value

    def __init__(
        self,
        heights: ArrayLike,
        cell: float,
        floor: float | None = None,
        *,
        invalid: Invalid = "refuse",
        source: str = "",
        scale: float = 1.0,
        nodata: float | None = None,
    ) -> None:
        require(source, str, "source of heights")
        require(nodata, float | None, "nodata of heights")
        what = f"heights {source}" if source else "heights"
        rows = number_rows(heights, what).astype(np.float64)
        if rows.ndim != 2 or rows.size == 0:
            raise InputError(f"{what}: expected rows of numbers, shape (rows, columns), got shape {rows.shape}")

        finite = np.isfinite(rows)
        known_choice(invalid, what)
        if not finite.all() and invalid == "refuse":
            row, column = np.argwhere(~finite)[0].tolist()
            first = f"the first in row {row}, column {column} (from 0)"
            some = f"{np.count_nonzero(~finite)} of {rows.size} heights are not finite, {first}"
            raise InputError(f"{what}: {some}; invalid='drop' leaves out their columns")

        if not finite.any():
            raise InputError(f"{what}: none of the {rows.size} heights is finite")
        if (highest := float(np.abs(rows[finite]).max())) > LARGEST:
            raise InputError(f"{what}: {highest:g} m is too far away; check their unit")

        rows = np.where(finite, rows, np.nan)
        side = length(cell, f"{what}: cell")
        lowest = float(np.nanmin(rows))
        bottom = lowest - side if floor is None else finite_number(floor, f"{what}: floor")
        if not bottom < lowest:
            raise InputError(f"{what}: floor must be below the lowest height of {lowest:g} m, got {bottom:g}")

        object.__setattr__(self, "heights", frozen(rows))
        object.__setattr__(self, "cell", side)
        object.__setattr__(self, "floor", bottom)
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "scale", positive(scale, f"{what}: scale"))
        object.__setattr__(self, "nodata", nodata)

        few_enough(len(merged(self.heights)), what, COARSER)
        if far := _far_beyond(rows, side):
            warnings.warn(f"{what}: {far}; if that stands for no data, make it NaN or say nodata=", CloudWarning, 2)

    @staticmethod
    def load(
        file: str | os.PathLike[str],
        cell: float,
        floor: float | None = None,
        *,
        scale: float = 1.0,
        invalid: Invalid = "refuse",
        nodata: float | None = None,
    ) -> HeightField:
        """Read a grid of heights: ``.npy``, rows of numbers (``.csv``, ``.txt``), or a grey picture of up to 32 bits.

        Rows of arrays and tables go along y, from the lowest y on; a picture is a view from above, with its upper edge
        at the largest y. A value of 0 in a picture is a height of 0.

        Args:
            file: The file.
            cell: Side of a cell [m].
            floor: Height of the solid's lower face [m]; one cell below the lowest height if None.
            scale: Metres per unit of the file's heights; 0.001 for millimetres.
            invalid: Whether heights that are not finite, or mean "no data", are refused or dropped.
            nodata: The number in the file that means "no data". If None, the one that a TIFF states (GDAL_NODATA) is
                used, and the usual ones (-9999, -32768...) are refused where they lie far below all heights.

        Raises:
            InputError: If the file cannot be read, is broken, has cells without data, or makes no height field; one
                line.

        Warns:
            CloudWarning: If a few heights lie far beyond the rest.

        Example:
            >>> seabed = rrtik.HeightField.load("seabed.npy", cell=0.1)  # doctest: +SKIP
        """
        return read(HeightField, file, cell, floor, scale=scale, invalid=invalid, nodata=nodata)

    def __repr__(self) -> str:
        rows, columns = self.heights.shape
        return f"HeightField({rows} x {columns} cells of {self.cell:g} m, {len(self.boxes[0])} boxes)"

    @property
    def boxes(self) -> tuple[Matrix, Matrix]:
        """Centres and full side lengths of the boxes [m], shape (n, 3) each."""
        first_row, end_row, first, end = merged(self.heights).T
        rows, columns = self.heights.shape
        tops = self.heights[first_row, first]

        y = 0.5 * (first_row + end_row - rows)
        x = 0.5 * (first + end - columns)

        centres = np.stack([self.cell * x, self.cell * y, 0.5 * (tops + self.floor)], axis=1)
        sizes = np.stack([self.cell * (end - first), self.cell * (end_row - first_row), tops - self.floor], axis=1)
        return centres, sizes

    def coarser(self, factor: int) -> HeightField:
        """Return a grid with cells ``factor`` times as wide, each as high as the highest cell in it.

        At most, the whole grid becomes one cell.

        Raises:
            InputError: If the factor is not a whole number of at least 1.

        Example:
            >>> rrtik.HeightField([[0.0, 0.2], [0.1, 0.3]], cell=0.5).coarser(2).heights
            array([[0.3]])
        """
        step = min(whole_number(factor, "factor of a coarser grid", 1), max(self.heights.shape))
        grown = np.pad(self.heights, [(0, -size % step) for size in self.heights.shape], constant_values=np.nan)
        blocks = grown.reshape(grown.shape[0] // step, step, -1, step)
        highest = np.where(np.isnan(blocks), -np.inf, blocks).max(axis=(1, 3))
        return HeightField(highest, self.cell * step, self.floor, invalid="drop")

    def rounded(self, step: float) -> HeightField:
        """Return the grid with heights rounded up to multiples of a step [m], so that more columns form one box.

        Raises:
            InputError: If the step is not positive.
        """
        size = length(step, "step of heights")
        return HeightField(np.ceil(self.heights / size - 1e-9) * size, self.cell, self.floor, invalid="drop")


def _far_beyond(rows: Matrix, cell: float) -> str:
    """Describe a few heights that lie far above or below all others; "" if there are none."""
    heights = np.sort(rows[np.isfinite(rows)])
    few = max(int(FEW * len(heights)), 1)
    width = cell * max(rows.shape)
    for ends, word in ((heights, "below"), (-heights[::-1], "above")):
        steps = np.diff(ends[: few + 1])
        if len(steps) == 0:
            continue

        # The largest step between consecutive heights separates the outliers from the rest.
        k = int(np.argmax(steps))
        rest = ends[k + 1 :]
        if steps[k] > FAR * max(float(rest[-1] - rest[0]), width):
            value = float(heights[0] if word == "below" else heights[-1])
            row, column = np.argwhere(rows == value)[0].tolist()
            count = "1 height lies" if k == 0 else f"{k + 1} heights lie"
            return f"{count} {steps[k]:.4g} m {word} all others: {value:g} m in row {row}, column {column} (from 0)"
    return ""
