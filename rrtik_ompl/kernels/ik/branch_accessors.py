"""What kernels of closed forms read from their tables, by name; see :mod:`rrtik_ompl.kernels.tables.accessors`.

The places are those of :mod:`rrtik_ompl.kernels.ik.branch_layout`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.ik import branch_layout
from rrtik_ompl.kernels.ik.branch_layout import BRANCHES, DOF, MATRIX_NUMBERS, MATRIX_SIDE
from rrtik_ompl.kernels.ik.ik_layout import LimbTable
from rrtik_ompl.kernels.layout import DOUBLE_BYTES
from rrtik_ompl.kernels.record import Doubles, Ints
from rrtik_ompl.kernels.simd.access import field_reader, member_reader
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined
from rrtik_ompl.kernels.simd.lanes import double_at, field, set_double, set_wide_lanes, wide_lanes_at

# Arm
from_world_of: Callable[[branch_layout.ArmTable], branch_layout.Frame] = field_reader(branch_layout.FROM_WORLD)
to_frame_of: Callable[[branch_layout.ArmTable], branch_layout.Frame] = field_reader(branch_layout.TO_FRAME)
lowest_of: Callable[[branch_layout.ArmTable], Doubles] = field_reader(branch_layout.LOWEST)
highest_of: Callable[[branch_layout.ArmTable], Doubles] = field_reader(branch_layout.HIGHEST)
turning_of: Callable[[branch_layout.ArmTable], Ints] = field_reader(branch_layout.TURNING)
limb_of: Callable[[branch_layout.ArmTable], LimbTable] = field_reader(branch_layout.LIMB)

# Call
row_count_of: Callable[[branch_layout.CallTable], int] = field_reader(branch_layout.ROWS)
block_count_of: Callable[[branch_layout.CallTable], int] = field_reader(branch_layout.BLOCKS)
pose_of: Callable[[branch_layout.CallTable, int], branch_layout.Matrices] = member_reader(
    branch_layout.POSES, DOUBLE_BYTES * MATRIX_NUMBERS
)
near_of: Callable[[branch_layout.CallTable], Doubles] = field_reader(branch_layout.NEAR)
q_of: Callable[[branch_layout.CallTable], branch_layout.Lanes] = field_reader(branch_layout.Q)
real_of: Callable[[branch_layout.CallTable], int] = field_reader(branch_layout.REAL)
fits_of: Callable[[branch_layout.CallTable], int] = field_reader(branch_layout.FITS)
odd_of: Callable[[branch_layout.CallTable], int] = field_reader(branch_layout.ODD)
residuals_of: Callable[[branch_layout.CallTable], branch_layout.Lanes] = field_reader(branch_layout.RESIDUALS)
scratch_of: Callable[[branch_layout.CallTable], branch_layout.Lanes] = field_reader(branch_layout.SCRATCH)


@inlined
def number(arm: branch_layout.ArmTable, place: int) -> float:
    """One of the arm's numbers."""
    value: float = double_at(field(arm, branch_layout.NUMBERS), place)
    return value


@inlined
def slack_of(call: branch_layout.CallTable) -> float:
    """See `AnalyticSolver`."""
    value: float = double_at(field(call, branch_layout.SLACK), 0)
    return value


@inlined
def answer(call: branch_layout.CallTable, joint: int, branch: int, block: int) -> Any:
    """Place of a joint's values among the answers, in wide lanes."""
    return (BRANCHES * joint + branch) * block_count_of(call) + block


@inlined
def matrix_entry(pose: branch_layout.Matrices, row: int, column: int) -> Any:
    """An entry of a pose."""
    return double_at(pose, MATRIX_SIDE * row + column)


@inlined
def hint_of(call: branch_layout.CallTable, row: int, joint: int) -> Any:
    """A joint value of a target's hint."""
    return double_at(near_of(call), DOF * row + joint)


@inlined
def set_lane(scratch: branch_layout.Lanes, place: int, lane: int, value: float) -> None:
    """Set one lane of wide lanes."""
    set_double(scratch, WIDTH * place + lane, value)


@inlined
def load_target(scratch: branch_layout.Lanes, lane: int, row: int, column: int, value: float) -> None:
    """Set an entry of the rotation of a target as given."""
    set_lane(scratch, branch_layout.TARGET + branch_layout.ROTATION + 3 * row + column, lane, value)


@inlined
def load_target_origin(scratch: branch_layout.Lanes, lane: int, axis: int, value: float) -> None:
    """Set a coordinate of the origin of a target as given."""
    set_lane(scratch, branch_layout.TARGET + branch_layout.ORIGIN + axis, lane, value)


@inlined
def set_placed_entry(scratch: branch_layout.Lanes, row: int, column: int, value: Any) -> None:
    """Set an entry of the rotation of the targets as the closed form wants them."""
    set_wide_lanes(scratch, branch_layout.FRAME + branch_layout.ROTATION + 3 * row + column, value)


@inlined
def set_placed_origin(scratch: branch_layout.Lanes, axis: int, value: Any) -> None:
    """Set a coordinate of the origin of the targets as the closed form wants them."""
    set_wide_lanes(scratch, branch_layout.FRAME + branch_layout.ORIGIN + axis, value)


@inlined
def frame_row(frame: branch_layout.Frame, row: int) -> Any:
    """A row of a frame's rotation."""
    place = branch_layout.ROTATION + 3 * row
    return double_at(frame, place), double_at(frame, place + 1), double_at(frame, place + 2)


@inlined
def frame_column(frame: branch_layout.Frame, column: int) -> Any:
    """A column of a frame's rotation."""
    place = branch_layout.ROTATION + column
    return double_at(frame, place), double_at(frame, place + 3), double_at(frame, place + 6)


@inlined
def frame_origin(frame: branch_layout.Frame) -> Any:
    """A frame's origin."""
    place = branch_layout.ORIGIN
    return double_at(frame, place), double_at(frame, place + 1), double_at(frame, place + 2)


@inlined
def target_column(scratch: branch_layout.Lanes, column: int) -> Any:
    """A column of the rotation of the targets as given, in wide lanes."""
    place = branch_layout.TARGET + branch_layout.ROTATION + column
    return wide_lanes_at(scratch, place), wide_lanes_at(scratch, place + 3), wide_lanes_at(scratch, place + 6)


@inlined
def target_row(scratch: branch_layout.Lanes, row: int) -> Any:
    """A row of the rotation of the targets as given, in wide lanes."""
    place = branch_layout.TARGET + branch_layout.ROTATION + 3 * row
    return wide_lanes_at(scratch, place), wide_lanes_at(scratch, place + 1), wide_lanes_at(scratch, place + 2)


@inlined
def target_origin(scratch: branch_layout.Lanes, axis: int) -> Any:
    """A coordinate of the origin of the targets as given, in wide lanes."""
    return wide_lanes_at(scratch, branch_layout.TARGET + branch_layout.ORIGIN + axis)


@inlined
def placed_entry(call: branch_layout.CallTable, row: int, column: int) -> Any:
    """An entry of the rotation of the targets as the closed form wants them, in wide lanes."""
    return wide_lanes_at(scratch_of(call), branch_layout.FRAME + branch_layout.ROTATION + 3 * row + column)


@inlined
def placed_origin(call: branch_layout.CallTable, axis: int) -> Any:
    """A coordinate of the origin of the targets as the closed form wants them, in wide lanes."""
    return wide_lanes_at(scratch_of(call), branch_layout.FRAME + branch_layout.ORIGIN + axis)
