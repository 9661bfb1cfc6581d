"""What kernels of inverse kinematics read from their tables, by name; see :mod:`rrtik_ompl.kernels.tables.accessors`.

The places are those of :mod:`rrtik_ompl.kernels.ik.ik_layout`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.layout import DOUBLE_BYTES
from rrtik_ompl.kernels.simd.access import double_reader, double_row, field_reader, part_reader, record_reader
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.lanes import double_at, field, set_double, set_field

Vector: TypeAlias = Any  # three numbers

WORD_BYTES = 8

# Limb
joint_count_of: Callable[[ik_layout.LimbTable], int] = field_reader(ik_layout.JOINTS)
dof_of: Callable[[ik_layout.LimbTable], int] = field_reader(ik_layout.DOF)
fixed_of: Callable[[ik_layout.LimbTable], ik_layout.Pose] = field_reader(ik_layout.FIXED)
sliding_of: Callable[[ik_layout.LimbTable], ik_layout.Ints] = field_reader(ik_layout.SLIDING)
column_of: Callable[[ik_layout.LimbTable], ik_layout.Ints] = field_reader(ik_layout.COLUMN)
gain_of: Callable[[ik_layout.LimbTable], ik_layout.Doubles] = field_reader(ik_layout.GAIN)
offset_of: Callable[[ik_layout.LimbTable], ik_layout.Doubles] = field_reader(ik_layout.OFFSET)
lower_of: Callable[[ik_layout.LimbTable], ik_layout.Configuration] = field_reader(ik_layout.LOWER)
upper_of: Callable[[ik_layout.LimbTable], ik_layout.Configuration] = field_reader(ik_layout.UPPER)
seed_count_of: Callable[[ik_layout.LimbTable], int] = field_reader(ik_layout.SEED_COUNT)
seeds_of: Callable[[ik_layout.LimbTable], ik_layout.Configuration] = field_reader(ik_layout.SEEDS)
seed_tips_of: Callable[[ik_layout.LimbTable], ik_layout.Pose] = field_reader(ik_layout.SEED_TIPS)

# Call
row_count_of: Callable[[ik_layout.CallTable], int] = field_reader(ik_layout.ROWS)
aims_of: Callable[[ik_layout.CallTable], ik_layout.Aim] = field_reader(ik_layout.AIMS)
aim_bytes_of: Callable[[ik_layout.CallTable], int] = field_reader(ik_layout.AIM_BYTES)
near_of: Callable[[ik_layout.CallTable], ik_layout.Configuration] = field_reader(ik_layout.NEAR)
near_bytes_of: Callable[[ik_layout.CallTable], int] = field_reader(ik_layout.NEAR_BYTES)
q_of: Callable[[ik_layout.CallTable], ik_layout.Configuration] = field_reader(ik_layout.Q)
reached_of: Callable[[ik_layout.CallTable], ik_layout.Ints] = field_reader(ik_layout.REACHED)
next_of: Callable[[ik_layout.CallTable], ik_layout.NextStart] = field_reader(ik_layout.NEXT)
step_limit_of: Callable[[ik_layout.CallTable], int] = field_reader(ik_layout.STEPS)
patience_of: Callable[[ik_layout.CallTable], int] = field_reader(ik_layout.PATIENCE)
first_frame_of: Callable[[ik_layout.CallTable], ik_layout.Pose] = field_reader(ik_layout.FIRST)
frames_of: Callable[[ik_layout.CallTable], ik_layout.Pose] = field_reader(ik_layout.FRAMES)
columns_of: Callable[[ik_layout.CallTable], ik_layout.Columns] = field_reader(ik_layout.COLUMNS)
error_of: Callable[[ik_layout.CallTable], ik_layout.Twist] = field_reader(ik_layout.ERROR)
weights_of: Callable[[ik_layout.CallTable], ik_layout.Twist] = field_reader(ik_layout.WEIGHTS)
square_of: Callable[[ik_layout.CallTable], ik_layout.Square] = field_reader(ik_layout.SQUARE)
change_of: Callable[[ik_layout.CallTable], ik_layout.Configuration] = field_reader(ik_layout.CHANGE)
farness_of: Callable[[ik_layout.CallTable], ik_layout.Doubles] = field_reader(ik_layout.FARNESS)
steps_done_of: Callable[[ik_layout.CallTable], int] = field_reader(ik_layout.DONE)

# Aim
position_tolerance_of: Callable[[ik_layout.Aim], float] = double_reader(ik_layout.POSITION_TOLERANCE)
chord_tolerance_of: Callable[[ik_layout.Aim], float] = double_reader(ik_layout.CHORD_TOLERANCE)
_free_turn_of: Callable[[ik_layout.Aim], float] = double_reader(ik_layout.FREE_TURN)

# Records of arrays: array, number; rows: array, numbers in a row, number
pose_at: Callable[[ik_layout.Pose, int], ik_layout.Pose] = record_reader(DOUBLE_BYTES * ik_layout.POSE_NUMBERS)
next_pose: Callable[[ik_layout.Pose], ik_layout.Pose] = part_reader(DOUBLE_BYTES * ik_layout.POSE_NUMBERS)
column_at: Callable[[ik_layout.Columns, int], ik_layout.Twist] = record_reader(DOUBLE_BYTES * ik_layout.TWIST_NUMBERS)
next_start_at: Callable[[ik_layout.NextStart, int], ik_layout.NextStart] = record_reader(WORD_BYTES)
number_of_next: Callable[[ik_layout.NextStart], int] = field_reader(0)
configuration_at: Callable[[ik_layout.Configuration, int, int], ik_layout.Configuration] = double_row


@inlined
def number(limb: ik_layout.LimbTable, place: int) -> float:
    """One of the limb's numbers."""
    value: float = double_at(field(limb, ik_layout.NUMBERS), place)
    return value


@inlined
def aim_at(call: ik_layout.CallTable, row: int) -> Any:
    """The goal of a row, an aim."""
    return aims_of(call) + row * aim_bytes_of(call)


@inlined
def near_at(call: ik_layout.CallTable, row: int) -> Any:
    """The posture of a row, a configuration."""
    return near_of(call) + row * near_bytes_of(call)


@inlined
def free_turn_of(aim: ik_layout.Aim) -> int:
    """About which axis of the goal the tip may turn, or NO_TURN, or ANY_TURN."""
    return int(_free_turn_of(aim))


@inlined
def box_half(aim: ik_layout.Aim, axis: int) -> Any:
    """Half a side of the box in which the position is free [m]."""
    return double_at(aim, ik_layout.BOX + axis)


@inlined
def set_steps_done(call: ik_layout.CallTable, steps: int) -> None:
    """Set how many steps have been taken."""
    set_field(call, ik_layout.DONE, steps)


@inlined
def pose_entry(pose: ik_layout.Pose, row: int, column: int) -> Any:
    """An entry of a pose's rotation."""
    return double_at(pose, ik_layout.ROTATION + ik_layout.AXES * row + column)


@inlined
def pose_row(pose: ik_layout.Pose, row: int) -> Vector:
    """A row of a pose's rotation."""
    return pose_entry(pose, row, 0), pose_entry(pose, row, 1), pose_entry(pose, row, 2)


@inlined
def pose_column(pose: ik_layout.Pose, column: int) -> Vector:
    """A column of a pose's rotation: one of its axes."""
    return pose_entry(pose, 0, column), pose_entry(pose, 1, column), pose_entry(pose, 2, column)


@inlined
def pose_origin(pose: ik_layout.Pose, axis: int) -> Any:
    """A coordinate of a pose's origin."""
    return double_at(pose, ik_layout.ORIGIN + axis)


@inlined
def set_pose_entry(pose: ik_layout.Pose, row: int, column: int, value: float) -> None:
    """Set an entry of a pose's rotation."""
    set_double(pose, ik_layout.ROTATION + ik_layout.AXES * row + column, value)


@inlined
def set_pose_origin(pose: ik_layout.Pose, axis: int, value: float) -> None:
    """Set a coordinate of a pose's origin."""
    set_double(pose, ik_layout.ORIGIN + axis, value)


@inlined
def square_at(square: ik_layout.Square, row: int, column: int) -> Any:
    """An entry of the square matrix."""
    return double_at(square, ik_layout.TWIST_NUMBERS * row + column)


@inlined
def set_square(square: ik_layout.Square, row: int, column: int, value: float) -> None:
    """Set an entry of the square matrix."""
    set_double(square, ik_layout.TWIST_NUMBERS * row + column, value)


@inlined
def set_next(follower: ik_layout.NextStart, start: int) -> None:
    """Set the number of a row's next start."""
    set_field(follower, 0, start)
