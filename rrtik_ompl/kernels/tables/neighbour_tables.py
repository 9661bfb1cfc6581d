"""Neighbours of an arm as kernels read them: cells of the values of two joints in which two bodies are apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask
from rrtik_ompl.kernels.layout import (
    NEIGHBOUR_COLUMN,
    NEIGHBOUR_INTS,
    NEIGHBOUR_MARK,
    NEIGHBOUR_ROW,
    NeighbourTable,
)
from rrtik_ompl.kernels.tables.memory import packed, whole_records


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """In which cells of two joints' values two bodies are apart.

    Attributes:
        joints: Numbers of the joints of rows and of columns; the same twice where a single joint is between the bodies.
        apart: Whether the bodies keep ``CELLS_APART`` in all of a cell, shape (CELLS, CELLS). Cell k of a joint is that
            of the values from k to k + 1 times 2 pi / CELLS, and of those whole turns from there.
    """

    joints: tuple[int, int]
    apart: Mask

    @property
    def words(self) -> NDArray[np.int64]:
        """Each row as a whole number, a cell a bit; behind them rows of the cells around which the bodies are apart.

        Shape (2 * CELLS,).
        """
        around = self.apart
        for axis in range(2):
            around = around & np.roll(around, 1, axis) & np.roll(around, -1, axis)
        rows = np.concatenate([self.apart, around])
        return np.packbits(rows, axis=1, bitorder="little").view(np.int64).ravel()


def neighbour_table(neighbours: Sequence[tuple[Cells, int]]) -> NeighbourTable:
    """Table of pairs of bodies: the cells of each, and its place among the marks of a check."""
    rows = [
        {NEIGHBOUR_MARK: mark, NEIGHBOUR_ROW: cells.joints[0], NEIGHBOUR_COLUMN: cells.joints[1]}
        for cells, mark in neighbours
    ]
    return packed(
        NeighbourTable,
        count=len(rows),
        pairs=whole_records(NEIGHBOUR_INTS, rows),
        cells=np.concatenate([np.zeros(0, dtype=np.int64), *(cells.words for cells, _ in neighbours)]),
        joint_count=max((joint + 1 for cells, _ in neighbours for joint in cells.joints), default=0),
    )
