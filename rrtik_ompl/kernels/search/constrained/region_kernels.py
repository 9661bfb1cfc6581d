"""Where a configuration is to a region: measures, residual, and the columns of its Jacobian, in kernels.

:mod:`rrtik_ompl.constraints.held_region` says what is measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.ik.ik_accessors import (
    column_at,
    next_pose,
    pose_column,
    pose_entry,
    pose_origin,
)
from rrtik_ompl.kernels.ik.ik_kinematics import add, felt, move_tip, moved_axis, swept
from rrtik_ompl.kernels.ik.ik_layout import ANGULAR, LINEAR, TWIST_NUMBERS, Pose
from rrtik_ompl.kernels.record import Wholes
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import HeldTable, RegionRecord, RegionTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.records import table_reader

TURN = 2.0 * math.pi
BEHIND = 2.0  # measure of an axis that points more than a quarter turn away
SMALL = 1e-12  # sine of an angle below which its axis is not known
STEEPEST = 1e-3  # cosine of the pitch, at least


_region_at: Callable[[Wholes, int], RegionTable] = table_reader(RegionTable)


@inlined
def region_at(held: HeldTable, number: int) -> RegionTable:
    """One of the regions."""
    return _region_at(held.regions, number)


@inlined
def place_frame(region: RegionTable, q: Any) -> Any:
    """Move the frame of a region to where q brings it; it is seen from the region's own frame."""
    return move_tip(region.limb, region.call, q)


@inlined
def beyond(record: RegionRecord, tip: Pose, axis: int) -> Any:
    """How far a coordinate of the origin is outside its bounds, with its sign [m]."""
    place = pose_origin(tip, axis)
    low, high = record[layout.LOW + axis], record[layout.HIGH + axis]
    return place - min(max(place, low), high)


@inlined
def sine_to_axis(record: RegionRecord, tip: Pose) -> Any:
    """Cross product and dot product of the frame's z axis and the direction where it has to point."""
    x, y, z = pose_column(tip, 2)
    a = record[layout.DIRECTION]
    b = record[layout.DIRECTION + 1]
    c = record[layout.DIRECTION + 2]
    return y * c - z * b, z * a - x * c, x * b - y * a, x * a + y * b + z * c


@inlined
def skew_part(tip: Pose) -> Any:
    """Axis times sine of the frame's turn, and its cosine."""
    x = 0.5 * (pose_entry(tip, 2, 1) - pose_entry(tip, 1, 2))
    y = 0.5 * (pose_entry(tip, 0, 2) - pose_entry(tip, 2, 0))
    z = 0.5 * (pose_entry(tip, 1, 0) - pose_entry(tip, 0, 1))
    return x, y, z, 0.5 * (pose_entry(tip, 0, 0) + pose_entry(tip, 1, 1) + pose_entry(tip, 2, 2) - 1.0)


@inlined
def angle_of(tip: Pose, k: int) -> Any:
    """Roll, pitch or yaw of the frame [rad]."""
    if k == 0:
        return math.atan2(pose_entry(tip, 2, 1), pose_entry(tip, 2, 2))
    if k == 1:
        a, b = pose_entry(tip, 0, 0), pose_entry(tip, 1, 0)
        return math.atan2(-pose_entry(tip, 2, 0), math.sqrt(a * a + b * b))
    return math.atan2(pose_entry(tip, 1, 0), pose_entry(tip, 0, 0))


@inlined
def angle_beyond(record: RegionRecord, tip: Pose, k: int) -> Any:
    """How far roll, pitch or yaw is outside its bounds, the short way round, with its sign [rad]."""
    low, high = record[layout.ANGLES_LOW + k], record[layout.ANGLES_HIGH + k]
    middle = 0.5 * (low + high)
    away = angle_of(tip, k) - middle
    away -= TURN * math.floor((away + math.pi) / TURN)
    half = 0.5 * (high - low)
    return away - min(max(away, -half), half)


@kernel
def origin_measure(region: RegionTable, tip: Pose) -> Any:
    """Distance of the origin from its bounds [m]."""
    record, square = region.record, 0.0
    for k in range(3):
        away = beyond(record, tip, k)
        square += away * away
    return math.sqrt(square)


@kernel
def turn_measure(region: RegionTable, tip: Pose) -> Any:
    """The measure of the orientation."""
    turning, record = region.turning, region.record
    if turning == layout.AXIS:
        x, y, z, cosine = sine_to_axis(record, tip)
        return math.sqrt(x * x + y * y + z * z) if cosine > 0.0 else BEHIND
    if turning == layout.BALL:
        x, y, z, cosine = skew_part(tip)
        sine = math.sqrt(x * x + y * y + z * z)
        return sine / math.sqrt(2.0 * (1.0 + cosine)) if cosine > 0.0 else math.sqrt(0.5 * max(1.0 - cosine, 0.0))
    if turning == layout.RANGES:
        total = 0.0
        for k in range(3):
            total += abs(angle_beyond(record, tip, k))
        return total
    return 0.0


@kernel
def set_origin_residual(held: HeldTable, region: RegionTable, tip: Pose) -> None:
    """Set the residual of the position and its weights: 0 where the region is kept, or says nothing."""
    record, measure = region.record, origin_measure(region, tip)
    moves = measure > record[layout.KEPT]
    share = 1.0 - record[layout.AIMED] / measure if moves else 0.0
    for k in range(3):
        away = beyond(record, tip, k)
        weight = held.per_metre if moves and away != 0.0 else 0.0
        held.weights[LINEAR + k] = weight
        held.error[LINEAR + k] = -away * share * weight


@inlined
def set_turn(held: HeldTable, x: float, y: float, z: float, factor: float, weight: float) -> None:
    """Set the residual of the orientation, a vector times a factor, and one weight for it."""
    error, weights = held.error, held.weights
    error[ANGULAR] = x * factor * weight
    error[ANGULAR + 1] = y * factor * weight
    error[ANGULAR + 2] = z * factor * weight
    for k in range(3):
        weights[ANGULAR + k] = weight


@kernel
def set_turn_residual(held: HeldTable, region: RegionTable, tip: Pose) -> None:
    """Set the residual of the orientation and its weights, likewise."""
    turning, record, weight = region.turning, region.record, held.per_radian
    set_turn(held, 0.0, 0.0, 0.0, 0.0, 0.0)
    measure = turn_measure(region, tip)
    if measure <= record[layout.KEPT + 1]:
        return
    aimed = record[layout.AIMED + 1]
    if turning == layout.RANGES:
        for k in range(3):
            away = angle_beyond(record, tip, k)
            held.weights[ANGULAR + k] = weight if away != 0.0 else 0.0
            held.error[ANGULAR + k] = -away * (1.0 - aimed / measure) * weight
        return
    x, y, z, cosine = sine_to_axis(record, tip) if turning == layout.AXIS else skew_part(tip)
    sine = math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, cosine) - aimed
    if sine < SMALL:  # a half turn away: any axis will do
        x, y, z, sine = pose_entry(tip, 0, 0), pose_entry(tip, 1, 0), pose_entry(tip, 2, 0), 1.0
    set_turn(held, x, y, z, (angle if turning == layout.AXIS else -angle) / sine, weight)


@inlined
def felt_turn(region: RegionTable, tip: Pose, x: float, y: float, z: float) -> Any:
    """What a turn of the frame changes of the orientation's residual."""
    turning = region.turning
    if turning == layout.AXIS:
        x, y, z = felt(2, tip, x, y, z)
    elif turning == layout.RANGES:
        a, b = pose_entry(tip, 0, 0), pose_entry(tip, 1, 0)
        level = max(math.sqrt(a * a + b * b), STEEPEST)
        a, b = a / level, b / level
        roll = (a * x + b * y) / level
        x, y, z = roll, b * -x + a * y, z - pose_entry(tip, 2, 0) * roll
    return x, y, z


@kernel
def set_columns(held: HeldTable, region: RegionTable, tip: Pose) -> None:
    """Set the weighted columns of the Jacobian of a region's residual."""
    columns, weights, limb = held.columns, held.weights, region.limb
    for k in range(held.dof * TWIST_NUMBERS):
        columns[k] = 0.0
    frame = region.call.frames
    u, v, w = weights[LINEAR], weights[LINEAR + 1], weights[LINEAR + 2]
    r, s, t = weights[ANGULAR], weights[ANGULAR + 1], weights[ANGULAR + 2]
    for joint in range(limb.joints):
        x, y, z = moved_axis(limb, frame, joint)
        column = column_at(columns, limb.column[joint])
        if limb.sliding[joint] != 0:
            add(column, LINEAR, u * x, v * y, w * z)
        else:
            a, b, c = swept(frame, tip, x, y, z)
            add(column, LINEAR, u * a, v * b, w * c)
            x, y, z = felt_turn(region, tip, x, y, z)
            add(column, ANGULAR, r * x, s * y, t * z)
        frame = next_pose(frame)
