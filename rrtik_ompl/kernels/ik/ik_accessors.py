"""What kernels of inverse kinematics read from their tables, by name; see :mod:`rrtik_ompl.kernels.tables.accessors`.

The places are those of :mod:`rrtik_ompl.kernels.ik.ik_layout`.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.records import row_at

Vector: TypeAlias = Any  # three numbers


@inlined
def pose_at(poses: ik_layout.Pose, number: int) -> ik_layout.Pose:
    """One of several poses."""
    return row_at(poses, ik_layout.POSE_NUMBERS, number)


@inlined
def next_pose(pose: ik_layout.Pose) -> ik_layout.Pose:
    """The pose behind one."""
    return row_at(pose, ik_layout.POSE_NUMBERS, 1)


@inlined
def column_at(columns: ik_layout.Twist, number: int) -> ik_layout.Twist:
    """A column of the Jacobian."""
    return row_at(columns, ik_layout.TWIST_NUMBERS, number)


@inlined
def aim_at(call: ik_layout.CallTable, row: int) -> Any:
    """The goal of a row, an aim."""
    return row_at(call.aims, call.aim_numbers, row)


@inlined
def near_at(call: ik_layout.CallTable, row: int) -> Any:
    """The posture of a row, a configuration."""
    return row_at(call.near, call.near_numbers, row)


@inlined
def free_turn_of(aim: ik_layout.Aim) -> int:
    """About which axis of the goal the tip may turn, or NO_TURN, or ANY_TURN."""
    return int(aim[ik_layout.FREE_TURN])


@inlined
def box_half(aim: ik_layout.Aim, axis: int) -> Any:
    """Half a side of the box in which the position is free [m]."""
    return aim[ik_layout.BOX + axis]


@inlined
def pose_entry(pose: ik_layout.Pose, row: int, column: int) -> Any:
    """An entry of a pose's rotation."""
    return pose[ik_layout.ROTATION + ik_layout.AXES * row + column]


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
    return pose[ik_layout.ORIGIN + axis]


@inlined
def set_pose_entry(pose: ik_layout.Pose, row: int, column: int, value: float) -> None:
    """Set an entry of a pose's rotation."""
    pose[ik_layout.ROTATION + ik_layout.AXES * row + column] = value


@inlined
def set_pose_origin(pose: ik_layout.Pose, axis: int, value: float) -> None:
    """Set a coordinate of a pose's origin."""
    pose[ik_layout.ORIGIN + axis] = value
