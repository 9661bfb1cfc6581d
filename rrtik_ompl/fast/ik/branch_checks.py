"""Around a closed form in kernels: targets read and placed, branches turned into the limits, and measured."""

from __future__ import annotations

from typing import Any

from rrtik_ompl.fast.ik import branch_layout as table
from rrtik_ompl.fast.ik import ik_layout
from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    double_at,
    field,
    floor,
    int_at,
    lane_numbers,
    set_double,
    set_truths,
    set_wide_lanes,
    smaller,
    spread_wide,
    square_root,
    wide_lanes_at,
)
from rrtik_ompl.fast.simd.wide_angles import TAU, arc_sine, wide_sine_and_cosine, within_half_turn

POSE_BYTES = 128
MAX_COORDINATE = 1e9  # [m] squares of what is farther away could leave the numbers; it is out of reach all the same


@kernel
def load(arm: int, call: int, block: int) -> None:
    """Read a block of targets and place them; behind the last target come copies of it."""
    scratch = field(call, table.SCRATCH)
    for lane in range(WIDTH):
        row = min(WIDTH * block + lane, field(call, table.ROWS) - 1)
        pose = field(call, table.POSES) + POSE_BYTES * row
        for k in range(3):
            for column in range(3):
                set_double(scratch, WIDTH * (3 * k + column) + lane, double_at(pose, 4 * k + column))
            set_double(
                scratch, WIDTH * (9 + k) + lane, min(max(double_at(pose, 4 * k + 3), -MAX_COORDINATE), MAX_COORDINATE)
            )
        if field(call, table.NEAR) != 0:
            for joint in range(6):
                value = double_at(field(call, table.NEAR), 6 * row + joint)
                set_double(scratch, WIDTH * (table.HINT + joint) + lane, value)
    place(arm, scratch)


@inlined
def place(arm: int, scratch: int) -> None:
    """T_base_frame of T_world_tip."""
    before, after = field(arm, table.FROM_WORLD), field(arm, table.TO_FRAME)
    for row in range(3):
        a, b, c = turned_row(before, row, scratch)
        o = weighed(before, row, wide_lanes_at(scratch, 9), wide_lanes_at(scratch, 10), wide_lanes_at(scratch, 11))
        o = o + double_at(before, 9 + row)
        for k in range(3):
            entry = a * double_at(after, k) + b * double_at(after, 3 + k) + c * double_at(after, 6 + k)
            set_wide_lanes(scratch, table.FRAME + 3 * row + k, entry)
        lever = a * double_at(after, 9) + b * double_at(after, 10) + c * double_at(after, 11)
        set_wide_lanes(scratch, table.FRAME + 9 + row, o + lever)


@inlined
def weighed(frame: int, row: int, x: Any, y: Any, z: Any) -> Any:
    """A row of a frame's rotation times a vector in lanes."""
    return double_at(frame, 3 * row) * x + double_at(frame, 3 * row + 1) * y + double_at(frame, 3 * row + 2) * z


@inlined
def turned_row(frame: int, row: int, scratch: int) -> Any:
    """A row of a rotation times the rotation of the target as given."""
    x = weighed(frame, row, wide_lanes_at(scratch, 0), wide_lanes_at(scratch, 3), wide_lanes_at(scratch, 6))
    y = weighed(frame, row, wide_lanes_at(scratch, 1), wide_lanes_at(scratch, 4), wide_lanes_at(scratch, 7))
    z = weighed(frame, row, wide_lanes_at(scratch, 2), wide_lanes_at(scratch, 5), wide_lanes_at(scratch, 8))
    return x, y, z


@inlined
def answer(call: int, joint: int, branch: int, block: int) -> Any:
    """Place of a joint's values among the answers, in wide lanes."""
    return (table.BRANCHES * joint + branch) * field(call, table.BLOCKS) + block


@kernel
def check_branches(arm: int, call: int, block: int) -> None:
    """Turn the branches of a block into the limits, say which fit, and measure them."""
    for branch in range(table.BRANCHES):
        hold(arm, call, branch, block)
        if field(call, table.RESIDUALS) != 0:
            measure(arm, call, branch, block)


@inlined
def hold(arm: int, call: int, branch: int, block: int) -> None:
    """Turn joints by full turns into their limits, towards the hint if there is room; which configurations fit."""
    fits = lane_numbers() >= 0.0
    for joint in range(6):
        low, high = double_at(field(arm, table.LOWEST), joint), double_at(field(arm, table.HIGHEST), joint)
        place = answer(call, joint, branch, block)
        value = wide_lanes_at(field(call, table.Q), place)
        if int_at(field(arm, table.TURNING), joint) != 0:
            near = spread_wide(0.0)
            if field(call, table.NEAR) != 0:
                near = wide_lanes_at(field(call, table.SCRATCH), table.HINT + joint)
            value = near + within_half_turn(value - near)
            value = value + TAU * floor(smaller(high - value, 0.0) * (1.0 / TAU))
            value = value - TAU * floor(smaller(value - low, 0.0) * (1.0 / TAU))
            set_wide_lanes(field(call, table.Q), place, value)
        fits = fits & (value >= low) & (value <= high)
    set_truths(field(call, table.FITS), WIDTH * answer(call, 0, branch, block), fits)


@inlined
def measure(arm: int, call: int, branch: int, block: int) -> None:
    """Distance and angle between the target and where a branch brings the tip."""
    limb, scratch = field(arm, table.LIMB), field(call, table.SCRATCH)
    for joint in range(6):
        column = int_at(field(limb, ik_layout.COLUMN), joint)
        value = wide_lanes_at(field(call, table.Q), answer(call, column, branch, block))
        value = value * double_at(field(limb, ik_layout.GAIN), joint) + double_at(field(limb, ik_layout.OFFSET), joint)
        sine, cosine = wide_sine_and_cosine(value)
        set_wide_lanes(scratch, table.SINES + joint, sine)
        set_wide_lanes(scratch, table.COSINES + joint, cosine)
    away, turned = spread_wide(0.0), spread_wide(0.0)
    for row in range(3):
        x, y, z, o = row_of_tip(field(limb, ik_layout.FIXED), scratch, row)
        x, y = x - wide_lanes_at(scratch, 3 * row), y - wide_lanes_at(scratch, 3 * row + 1)
        z, o = z - wide_lanes_at(scratch, 3 * row + 2), o - wide_lanes_at(scratch, 9 + row)
        away, turned = away + o * o, turned + (x * x + y * y + z * z)
    angle = 2.0 * arc_sine(smaller(square_root(turned * 0.125), 1.0))
    set_wide_lanes(field(call, table.RESIDUALS), answer(call, 0, branch, block), square_root(away))
    set_wide_lanes(field(call, table.RESIDUALS), answer(call, 1, branch, block), angle)


@inlined
def row_of_tip(fixed: int, scratch: int, row: int) -> Any:
    """A row of the tip's frame: of its three axes and its origin. All joints turn about their z."""
    x, y = spread_wide(double_at(fixed, 3 * row)), spread_wide(double_at(fixed, 3 * row + 1))
    z, o = spread_wide(double_at(fixed, 3 * row + 2)), spread_wide(double_at(fixed, 9 + row))
    for joint in range(6):
        fixed += ik_layout.FRAME_BYTES
        sine, cosine = wide_lanes_at(scratch, table.SINES + joint), wide_lanes_at(scratch, table.COSINES + joint)
        a, b = cosine * x + sine * y, cosine * y - sine * x
        o = o + (a * double_at(fixed, 9) + b * double_at(fixed, 10) + z * double_at(fixed, 11))
        x = a * double_at(fixed, 0) + b * double_at(fixed, 3) + z * double_at(fixed, 6)
        y = a * double_at(fixed, 1) + b * double_at(fixed, 4) + z * double_at(fixed, 7)
        z = a * double_at(fixed, 2) + b * double_at(fixed, 5) + z * double_at(fixed, 8)
    return x, y, z, o
