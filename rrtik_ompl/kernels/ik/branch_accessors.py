"""What kernels of closed forms read from their tables, by name; see :mod:`rrtik_ompl.kernels.tables.accessors`.

The places are those of :mod:`rrtik_ompl.kernels.ik.branch_layout`.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.ik import branch_layout
from rrtik_ompl.kernels.ik.branch_layout import BRANCHES, DOF, MATRIX_NUMBERS, MATRIX_SIDE
from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined
from rrtik_ompl.kernels.simd.lanes import set_wide_lanes, wide_lanes_at
from rrtik_ompl.kernels.simd.records import row_at


@inlined
def pose_of(call: branch_layout.CallTable, number: int) -> branch_layout.Matrices:
    """A target."""
    return row_at(call.poses, MATRIX_NUMBERS, number)


@inlined
def answer(call: branch_layout.CallTable, joint: int, branch: int, block: int) -> Any:
    """Place of a joint's values among the answers, in wide lanes."""
    return (BRANCHES * joint + branch) * call.blocks + block


@inlined
def matrix_entry(pose: branch_layout.Matrices, row: int, column: int) -> Any:
    """An entry of a pose."""
    return pose[MATRIX_SIDE * row + column]


@inlined
def hint_of(call: branch_layout.CallTable, row: int, joint: int) -> Any:
    """A joint value of a target's hint."""
    return call.near[DOF * row + joint]


@inlined
def set_lane(scratch: Doubles, place: int, lane: int, value: float) -> None:
    """Set one lane of wide lanes."""
    scratch[WIDTH * place + lane] = value


@inlined
def load_target(scratch: Doubles, lane: int, row: int, column: int, value: float) -> None:
    """Set an entry of the rotation of a target as given."""
    set_lane(scratch, branch_layout.TARGET + branch_layout.ROTATION + 3 * row + column, lane, value)


@inlined
def load_target_origin(scratch: Doubles, lane: int, axis: int, value: float) -> None:
    """Set a coordinate of the origin of a target as given."""
    set_lane(scratch, branch_layout.TARGET + branch_layout.ORIGIN + axis, lane, value)


@inlined
def set_placed_entry(scratch: Doubles, row: int, column: int, value: Any) -> None:
    """Set an entry of the rotation of the targets as the closed form wants them."""
    set_wide_lanes(scratch, branch_layout.FRAME + branch_layout.ROTATION + 3 * row + column, value)


@inlined
def set_placed_origin(scratch: Doubles, axis: int, value: Any) -> None:
    """Set a coordinate of the origin of the targets as the closed form wants them."""
    set_wide_lanes(scratch, branch_layout.FRAME + branch_layout.ORIGIN + axis, value)


@inlined
def frame_row(frame: branch_layout.Frame, row: int) -> Any:
    """A row of a frame's rotation."""
    place = branch_layout.ROTATION + 3 * row
    return frame[place], frame[place + 1], frame[place + 2]


@inlined
def frame_column(frame: branch_layout.Frame, column: int) -> Any:
    """A column of a frame's rotation."""
    place = branch_layout.ROTATION + column
    return frame[place], frame[place + 3], frame[place + 6]


@inlined
def frame_origin(frame: branch_layout.Frame) -> Any:
    """A frame's origin."""
    place = branch_layout.ORIGIN
    return frame[place], frame[place + 1], frame[place + 2]


@inlined
def target_column(scratch: Doubles, column: int) -> Any:
    """A column of the rotation of the targets as given, in wide lanes."""
    place = branch_layout.TARGET + branch_layout.ROTATION + column
    return wide_lanes_at(scratch, place), wide_lanes_at(scratch, place + 3), wide_lanes_at(scratch, place + 6)


@inlined
def target_row(scratch: Doubles, row: int) -> Any:
    """A row of the rotation of the targets as given, in wide lanes."""
    place = branch_layout.TARGET + branch_layout.ROTATION + 3 * row
    return wide_lanes_at(scratch, place), wide_lanes_at(scratch, place + 1), wide_lanes_at(scratch, place + 2)


@inlined
def target_origin(scratch: Doubles, axis: int) -> Any:
    """A coordinate of the origin of the targets as given, in wide lanes."""
    return wide_lanes_at(scratch, branch_layout.TARGET + branch_layout.ORIGIN + axis)


@inlined
def placed_entry(call: branch_layout.CallTable, row: int, column: int) -> Any:
    """An entry of the rotation of the targets as the closed form wants them, in wide lanes."""
    return wide_lanes_at(call.scratch, branch_layout.FRAME + branch_layout.ROTATION + 3 * row + column)


@inlined
def placed_origin(call: branch_layout.CallTable, axis: int) -> Any:
    """A coordinate of the origin of the targets as the closed form wants them, in wide lanes."""
    return wide_lanes_at(call.scratch, branch_layout.FRAME + branch_layout.ORIGIN + axis)
