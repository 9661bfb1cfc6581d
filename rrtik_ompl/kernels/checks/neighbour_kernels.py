"""Kernels that look up where neighbours of an arm are apart, by the values of the joints between them."""

from __future__ import annotations

from math import floor, pi
from typing import Any

from rrtik_ompl.kernels.layout import CELLS, JointValues, Marks, NeighbourTable
from rrtik_ompl.kernels.record import Doubles, Wholes
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, first_bit, int_at, set_int
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.tables.accessors import column_joint_of, mark_of_neighbours, neighbours_at, row_joint_of

CELLS_PER_RADIAN = CELLS / (2.0 * pi)


@inlined
def cell_holds(cells: Wholes, row: float, column: float) -> bool:
    """Whether the bit of a cell is set, of values that are counted in cells."""
    bit: int = (cells[floor(row) & (CELLS - 1)] >> (floor(column) & (CELLS - 1))) & 1
    return bit != 0


@kernel
def near_in_lanes(neighbours: NeighbourTable, number: int, values: Doubles, wanted: int) -> int:
    """Lanes among ``wanted`` in which a pair of neighbours is not known to be apart, at wide lanes of joint values."""
    pair = neighbours_at(neighbours.pairs, number)
    rows = WIDTH * row_joint_of(pair)
    columns = WIDTH * column_joint_of(pair)
    cells = row_at(neighbours.cells, CELLS, 2 * number)
    near = wanted

    while wanted != 0:
        lane = first_bit(wanted)
        wanted &= wanted - 1
        row = CELLS_PER_RADIAN * double_at(values, rows + lane)
        column = CELLS_PER_RADIAN * double_at(values, columns + lane)
        if cell_holds(cells, row, column):
            near &= ~(1 << lane)

    return near


@kernel
def neighbours_near(neighbours: NeighbourTable, pairs: int, values: Doubles, wanted: int) -> int:
    """Lanes among ``wanted`` in which some of the pairs, a set of bits, are not known to be apart."""
    near = 0
    while pairs != 0 and near != wanted:
        near |= near_in_lanes(neighbours, first_bit(pairs), values, wanted & ~near)
        pairs &= pairs - 1
    return near


@kernel
def mark_neighbours(neighbours: NeighbourTable, values: Doubles, wanted: int, marks: Marks) -> None:
    """Add to the marks the lanes in which neighbours are not known to be apart."""
    for number in range(neighbours.count):
        near = near_in_lanes(neighbours, number, values, wanted)
        mark = mark_of_neighbours(neighbours_at(neighbours.pairs, number))
        set_int(marks, mark, int_at(marks, mark) | near)


@kernel
def apart_on_way(neighbours: NeighbourTable, number: int, start: JointValues, end: JointValues) -> bool:
    """Whether a pair of neighbours is known to be apart on a whole motion between two rows of joint values.

    Places of the motion are looked at that are no farther apart than a cell is wide, so that the others lie in cells
    around those of the places.
    """
    pair = neighbours_at(neighbours.pairs, number)
    row = CELLS_PER_RADIAN * double_at(start, row_joint_of(pair))
    column = CELLS_PER_RADIAN * double_at(start, column_joint_of(pair))
    rows = CELLS_PER_RADIAN * double_at(end, row_joint_of(pair)) - row
    columns = CELLS_PER_RADIAN * double_at(end, column_joint_of(pair)) - column
    cells = row_at(neighbours.cells, CELLS, 2 * number + 1)
    steps = floor(max(abs(rows), abs(columns))) + 1

    for k in range(steps + 1):
        share = k / steps
        if not cell_holds(cells, row + share * rows, column + share * columns):
            return False
    return True


@inlined
def near_on_way(neighbours: NeighbourTable, start: JointValues, end: JointValues) -> Any:
    """The pairs of neighbours, as bits, that are not known to be apart on a whole motion."""
    pairs = 0
    for number in range(neighbours.count):
        if not apart_on_way(neighbours, number, start, end):
            pairs |= 1 << number
    return pairs
