"""Around a closed form in kernels: targets read and placed, branches turned into the limits, and measured."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.ik import branch_layout, ik_layout
from rrtik_ompl.kernels.ik.branch_accessors import (
    answer,
    frame_column,
    frame_origin,
    frame_row,
    hint_of,
    load_target,
    load_target_origin,
    matrix_entry,
    pose_of,
    set_lane,
    set_placed_entry,
    set_placed_origin,
    target_column,
    target_origin,
    target_row,
)
from rrtik_ompl.kernels.ik.branch_layout import ArmTable, CallTable, Frame
from rrtik_ompl.kernels.ik.ik_accessors import (
    next_pose,
    pose_column,
    pose_origin,
    pose_row,
)
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
from rrtik_ompl.kernels.simd.records import exists
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
    before, after = arm.from_world, arm.to_frame
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
def along(vector: Any, x: Any, y: Any, z: Any) -> Any:
    """Dot product of lanes of vectors with three numbers."""
    return x * vector[0] + y * vector[1] + z * vector[2]


@inlined
def turned_row(frame: Frame, row: int, scratch: Doubles) -> Any:
    """A row of a rotation times the rotation of the target as given."""
    own = frame_row(frame, row)
    first, second, third = target_column(scratch, 0), target_column(scratch, 1), target_column(scratch, 2)
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
        low, high = arm.lowest[joint], arm.highest[joint]
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
    limb, scratch = arm.limb, call.scratch
    for joint in range(branch_layout.DOF):
        column = limb.column[joint]
        value = wide_lanes_at(call.q, answer(call, column, branch, block))
        value = value * limb.gain[joint] + limb.offset[joint]
        sine, cosine = wide_sine_and_cosine(value)
        set_wide_lanes(scratch, branch_layout.SINES + joint, sine)
        set_wide_lanes(scratch, branch_layout.COSINES + joint, cosine)
    away, turned = spread_wide(0.0), spread_wide(0.0)
    for row in range(3):
        x, y, z, o = row_of_tip(limb.fixed, scratch, row)
        a, b, c = target_row(scratch, row)
        x, y, z, o = x - a, y - b, z - c, o - target_origin(scratch, row)
        away, turned = away + o * o, turned + (x * x + y * y + z * z)
    angle = 2.0 * arc_sine(smaller(square_root(turned * 0.125), 1.0))
    set_wide_lanes(call.residuals, answer(call, 0, branch, block), square_root(away))
    set_wide_lanes(call.residuals, answer(call, 1, branch, block), angle)


@inlined
def row_of_tip(fixed: ik_layout.Pose, scratch: Doubles, row: int) -> Any:
    """A row of the tip's frame: of its three axes and its origin. All joints turn about their z."""
    first, start = pose_row(fixed, row), pose_origin(fixed, row)
    x, y, z, o = spread_wide(first[0]), spread_wide(first[1]), spread_wide(first[2]), spread_wide(start)
    for joint in range(branch_layout.DOF):
        fixed = next_pose(fixed)
        sine = wide_lanes_at(scratch, branch_layout.SINES + joint)
        cosine = wide_lanes_at(scratch, branch_layout.COSINES + joint)
        a, b = cosine * x + sine * y, cosine * y - sine * x
        o = o + (a * pose_origin(fixed, 0) + b * pose_origin(fixed, 1) + z * pose_origin(fixed, 2))
        x, y, z = (
            along(pose_column(fixed, 0), a, b, z),
            along(pose_column(fixed, 1), a, b, z),
            along(pose_column(fixed, 2), a, b, z),
        )
    return x, y, z, o
