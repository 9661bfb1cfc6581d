"""Around a closed form in kernels: targets read and placed, branches turned into the limits, and measured.

Targets and answers are read and written by named functions; their places are those of
:mod:`rrtik_ompl.kernels.ik.branch_layout`.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.ik import branch_layout, ik_layout
from rrtik_ompl.kernels.ik.branch_layout import BRANCHES, DOF, MATRIX_NUMBERS, MATRIX_SIDE, ArmTable, CallTable, Frame
from rrtik_ompl.kernels.ik.ik_accessors import next_pose, pose_column, pose_origin, pose_row
from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    floor,
    lane_numbers,
    set_truths,
    set_wide_lanes,
    smaller,
    spread_wide,
    square_root,
    wide_lanes_at,
)
from rrtik_ompl.kernels.simd.records import exists, row_at
from rrtik_ompl.kernels.simd.vectors import along
from rrtik_ompl.kernels.simd.wide_angles import TAU, arc_sine, wide_sine_and_cosine, within_half_turn

MAX_COORDINATE = 1e9  # [m] squares of what is farther away could leave the numbers; it is out of reach all the same


@kernel
def load(arm: ArmTable, call: CallTable, block: int) -> None:
    """Read a block of targets and place them; behind the last target come copies of it."""
    scratch = call.scratch
    for lane in range(WIDTH):
        row = min(WIDTH * block + lane, call.rows - 1)
        pose = pose_of(call, row)
        for k in range(3):
            for column in range(3):
                load_target(scratch, lane, k, column, matrix_entry(pose, k, column))
            value = min(max(matrix_entry(pose, k, 3), -MAX_COORDINATE), MAX_COORDINATE)
            load_target_origin(scratch, lane, k, value)
        if exists(call.near):
            for joint in range(branch_layout.DOF):
                set_lane(scratch, branch_layout.HINT + joint, lane, hint_of(call, row, joint))
    place_targets(arm, scratch)


@inlined
def place_targets(arm: ArmTable, scratch: Doubles) -> None:
    """T_base_frame of T_world_tip."""
    before = arm.from_world
    after = arm.to_frame
    for row in range(3):
        a, b, c = turned_row(before, row, scratch)
        o = along(
            frame_row(before, row), target_origin(scratch, 0), target_origin(scratch, 1), target_origin(scratch, 2)
        )
        o = o + before[branch_layout.ORIGIN + row]
        for k in range(3):
            set_placed_entry(scratch, row, k, along(frame_column(after, k), a, b, c))
        lever = along(frame_origin(after), a, b, c)
        set_placed_origin(scratch, row, o + lever)


@inlined
def turned_row(frame: Frame, row: int, scratch: Doubles) -> Any:
    """A row of a rotation times the rotation of the target as given."""
    own = frame_row(frame, row)
    first = target_column(scratch, 0)
    second = target_column(scratch, 1)
    third = target_column(scratch, 2)
    return (
        along(own, first[0], first[1], first[2]),
        along(own, second[0], second[1], second[2]),
        along(own, third[0], third[1], third[2]),
    )


@kernel
def check_branches(arm: ArmTable, call: CallTable, block: int) -> None:
    """Turn the branches of a block into the limits, say which fit, and measure them."""
    for branch in range(branch_layout.BRANCHES):
        hold(arm, call, branch, block)
        if exists(call.residuals):
            measure(arm, call, branch, block)


@inlined
def hold(arm: ArmTable, call: CallTable, branch: int, block: int) -> None:
    """Turn joints by full turns into their limits, towards the hint where they allow it; which configurations fit."""
    fits = lane_numbers() >= 0.0
    for joint in range(branch_layout.DOF):
        low = arm.lowest[joint]
        high = arm.highest[joint]
        place = answer(call, joint, branch, block)
        value = wide_lanes_at(call.q, place)
        if arm.turning[joint] != 0:
            near = spread_wide(0.0)
            if exists(call.near):
                near = wide_lanes_at(call.scratch, branch_layout.HINT + joint)
            value = near + within_half_turn(value - near)
            value = value + TAU * floor(smaller(high - value, 0.0) * (1.0 / TAU))
            value = value - TAU * floor(smaller(value - low, 0.0) * (1.0 / TAU))
            set_wide_lanes(call.q, place, value)
        fits = fits & (value >= low) & (value <= high)
    set_truths(call.fits, WIDTH * answer(call, 0, branch, block), fits)


@inlined
def measure(arm: ArmTable, call: CallTable, branch: int, block: int) -> None:
    """Distance and angle between the target and where a branch brings the tip."""
    limb = arm.limb
    scratch = call.scratch
    for joint in range(branch_layout.DOF):
        column = limb.column[joint]
        value = wide_lanes_at(call.q, answer(call, column, branch, block))
        value = value * limb.gain[joint] + limb.offset[joint]
        sine, cosine = wide_sine_and_cosine(value)
        set_wide_lanes(scratch, branch_layout.SINES + joint, sine)
        set_wide_lanes(scratch, branch_layout.COSINES + joint, cosine)
    away = spread_wide(0.0)
    turned = spread_wide(0.0)
    for row in range(3):
        x, y, z, o = row_of_tip(limb.fixed, scratch, row)
        a, b, c = target_row(scratch, row)
        x = x - a
        y = y - b
        z = z - c
        o = o - target_origin(scratch, row)
        away = away + o * o
        turned = turned + (x * x + y * y + z * z)
    angle = 2.0 * arc_sine(smaller(square_root(turned * 0.125), 1.0))
    set_wide_lanes(call.residuals, answer(call, 0, branch, block), square_root(away))
    set_wide_lanes(call.residuals, answer(call, 1, branch, block), angle)


@inlined
def row_of_tip(fixed: ik_layout.Pose, scratch: Doubles, row: int) -> Any:
    """A row of the tip's frame: of its three axes and its origin. All joints turn about their z."""
    first = pose_row(fixed, row)
    start = pose_origin(fixed, row)
    x = spread_wide(first[0])
    y = spread_wide(first[1])
    z = spread_wide(first[2])
    o = spread_wide(start)
    for joint in range(branch_layout.DOF):
        fixed = next_pose(fixed)
        sine = wide_lanes_at(scratch, branch_layout.SINES + joint)
        cosine = wide_lanes_at(scratch, branch_layout.COSINES + joint)
        a = cosine * x + sine * y
        b = cosine * y - sine * x
        o = o + (a * pose_origin(fixed, 0) + b * pose_origin(fixed, 1) + z * pose_origin(fixed, 2))
        x = along(pose_column(fixed, 0), a, b, z)
        y = along(pose_column(fixed, 1), a, b, z)
        z = along(pose_column(fixed, 2), a, b, z)
    return x, y, z, o


# What stands in the tables.


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
