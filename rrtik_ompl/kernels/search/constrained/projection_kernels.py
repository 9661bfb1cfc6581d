"""Regions in kernels: measures of a configuration, projection onto them, and whether straight motions keep them.

Sources: damped Gauss-Newton steps on all regions at once [22, 23]; the bound on motions is that of
:meth:`rrtik_ompl.constraints.held_regions.HeldRegions.motions_held`, with fewer halvings.
:mod:`rrtik_ompl.constraints.held_region` says what is measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from rrtik_ompl.kernels.ik.damped_steps import move_by, solve_in_place
from rrtik_ompl.kernels.ik.ik_accessors import column_at, pose_column, pose_entry, pose_origin
from rrtik_ompl.kernels.ik.ik_kinematics import move_tip, set_columns
from rrtik_ompl.kernels.ik.ik_layout import ANGULAR, AS_ANGLES, LINEAR, NO_TURN, TWIST_NUMBERS, Pose
from rrtik_ompl.kernels.record import Tables
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import HeldTable, RegionRecord, RegionTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at, table_reader

HALVINGS = 3  # of a motion, at most
PATIENCE, STALLED = 8, 0.5  # steps after which the squared residual must be down to this share
SHARE = 0.5  # of the squared residual, that is added to the damping
TURN = 2.0 * math.pi
BEHIND = 2.0  # measure of an axis that points more than a quarter turn away
SMALL = 1e-12  # sine of an angle below which its axis is not known
_region_at: Callable[[Tables, int], RegionTable] = table_reader(RegionTable)


# Projection.


@kernel
def project(held: HeldTable, q: Configuration, steps: int) -> bool:
    """Move q into all regions, in so many steps at most; whether it is there."""
    mark = 1e300
    for number in range(steps + 1):
        clear_sums(held)
        total = 0.0
        for k in range(held.count):
            region = region_at(held, k)
            tip = place_frame(region, q)
            set_origin_residual(held, region, tip)
            set_turn_residual(held, region, tip)
            total += add_rows(held, region, tip)
        if total == 0.0:
            return True
        if number == steps:
            return False
        if number % PATIENCE == 0:
            if total > STALLED * mark:
                return False
            mark = total
        solve_sums(held, held.damping + SHARE * total)
        move_by(held, held.change, q)
    return False


@kernel
def clear_sums(held: HeldTable) -> None:
    """Begin a step: no rows yet."""
    dof = held.dof
    for a in range(dof):
        held.change[a] = 0.0
        for b in range(a + 1):
            row_at(held.square, dof, a)[b] = 0.0


@kernel
def add_rows(held: HeldTable, region: RegionTable, tip: Pose) -> Any:
    """Add a region's rows to the sums J^T J and J^T e; returns |e|^2."""
    set_region_columns(held, region, tip)
    error = held.error
    total = 0.0
    for k in range(TWIST_NUMBERS):
        total += error[k] * error[k]
    for a in range(held.dof):
        column = column_at(held.columns, a)
        pull = held.change[a]
        for k in range(TWIST_NUMBERS):
            pull += column[k] * error[k]
        held.change[a] = pull
        row = row_at(held.square, held.dof, a)
        for b in range(a + 1):
            other = column_at(held.columns, b)
            product = row[b]
            for k in range(TWIST_NUMBERS):
                product += column[k] * other[k]
            row[b] = product
    return total


@kernel
def solve_sums(held: HeldTable, damping: float) -> None:
    """Replace J^T e by (J^T J + damping)^-1 J^T e."""
    for a in range(held.dof):
        row_at(held.square, held.dof, a)[a] += damping
    solve_in_place(held.square, held.dof, held.change, damping)


# Straight motions.


@kernel
def keeps(held: HeldTable, start: Configuration, end: Configuration) -> bool:
    """Whether a straight motion between configurations in all regions keeps them all."""
    kept = True
    for number in range(held.count):
        kept = kept and keeps_region(held, number, start, end)
    return kept


@kernel
def keeps_region(held: HeldTable, number: int, start: Configuration, end: Configuration) -> bool:
    """Whether a straight motion between configurations in a region keeps it: parts of it, ever smaller, are bounded."""
    region = region_at(held, number)
    node = held.node
    origin, turn = deviation(region, start, end)
    most_origin = region.record[layout.MOST]
    most_turn = region.record[layout.MOST + 1]
    first = measures(held, number, start)
    last = measures(held, number, end)
    parts = 1
    for _ in range(HALVINGS + 1):
        kept = True
        before = first
        for part in range(1, parts + 1):
            here = last
            if part < parts:
                share = float(part) / float(parts)
                for k in range(held.dof):
                    node[k] = (1.0 - share) * start[k] + share * end[k]
                here = measures(held, number, node)
            if here[0] > most_origin or here[1] > most_turn:
                return False
            kept = highest(before[0], here[0], origin) <= most_origin and highest(before[1], here[1], turn) <= most_turn
            if not kept:
                break
            before = here
        if kept:
            return True
        parts *= 2
        origin *= 0.25
        turn *= 0.25
    return False


@inlined
def highest(first: float, last: float, bend: float) -> Any:
    """The largest that a measure can be on a motion, from those of its ends and the deviation in between."""
    way = abs(last - first)
    if way >= 4.0 * bend:
        return max(first, last)
    return 0.5 * (first + last) + bend + way * way / (16.0 * bend)


@kernel
def deviation(region: RegionTable, start: Configuration, end: Configuration) -> Any:
    """How far the measures of a straight motion exceed those of its ends, at most: of the origin and of the turn."""
    limb = region.limb
    record = region.record
    origin = 0.0
    before = 0.0  # turn of the joints before
    for joint in range(limb.joints):
        k = limb.column[joint]
        way = abs(limb.gain[joint] * (end[k] - start[k]))
        turned = way if limb.sliding[joint] == 0 else 0.0
        origin += way * record[layout.LEVERS + joint] * (turned + 2.0 * before)
        before += turned
    return origin * 0.125, record[layout.CURVATURE] * before * before * 0.125


@kernel
def measures(held: HeldTable, number: int, q: Configuration) -> Any:
    """The measures of a configuration: of the origin and of the turn."""
    region = region_at(held, number)
    tip = place_frame(region, q)
    return origin_measure(region, tip), turn_measure(region, tip)


# A region: its measures, residual, and the columns of its Jacobian.


@inlined
def region_at(held: HeldTable, number: int) -> RegionTable:
    """One of the regions."""
    return _region_at(held.regions, number)


@inlined
def place_frame(region: RegionTable, q: Any) -> Any:
    """Move the frame of a region to where q brings it; it is seen from the region's own frame."""
    return move_tip(region.limb, region.call, q)


@kernel
def origin_measure(region: RegionTable, tip: Pose) -> Any:
    """Distance of the origin from its bounds [m]."""
    square = 0.0
    for k in range(3):
        away = beyond(region.record, tip, k)
        square += away * away
    return math.sqrt(square)


@kernel
def turn_measure(region: RegionTable, tip: Pose) -> Any:
    """The measure of the orientation."""
    turning = region.turning
    record = region.record
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


@inlined
def beyond(record: RegionRecord, tip: Pose, axis: int) -> Any:
    """How far a coordinate of the origin is outside its bounds, with its sign [m]."""
    place = pose_origin(tip, axis)
    return place - min(max(place, record[layout.LOW + axis]), record[layout.HIGH + axis])


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
        a = pose_entry(tip, 0, 0)
        b = pose_entry(tip, 1, 0)
        return math.atan2(-pose_entry(tip, 2, 0), math.sqrt(a * a + b * b))
    return math.atan2(pose_entry(tip, 1, 0), pose_entry(tip, 0, 0))


@inlined
def angle_beyond(record: RegionRecord, tip: Pose, k: int) -> Any:
    """How far roll, pitch or yaw is outside its bounds, the short way round, with its sign [rad]."""
    low = record[layout.ANGLES_LOW + k]
    high = record[layout.ANGLES_HIGH + k]
    middle = 0.5 * (low + high)
    away = angle_of(tip, k) - middle
    away -= TURN * math.floor((away + math.pi) / TURN)
    half = 0.5 * (high - low)
    return away - min(max(away, -half), half)


@kernel
def set_origin_residual(held: HeldTable, region: RegionTable, tip: Pose) -> None:
    """Set the residual of the position and its weights: 0 where the region is kept, or says nothing."""
    record = region.record
    measure = origin_measure(region, tip)
    moves = measure > record[layout.KEPT]
    share = 1.0 - record[layout.AIMED] / measure if moves else 0.0
    for k in range(3):
        away = beyond(record, tip, k)
        weight = held.per_metre if moves and away != 0.0 else 0.0
        held.weights[LINEAR + k] = weight
        held.error[LINEAR + k] = -away * share * weight


@kernel
def set_turn_residual(held: HeldTable, region: RegionTable, tip: Pose) -> None:
    """Set the residual of the orientation and its weights, likewise."""
    turning = region.turning
    record = region.record
    weight = held.per_radian
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
        x = pose_entry(tip, 0, 0)
        y = pose_entry(tip, 1, 0)
        z = pose_entry(tip, 2, 0)
        sine = 1.0
    set_turn(held, x, y, z, (angle if turning == layout.AXIS else -angle) / sine, weight)


@inlined
def set_turn(held: HeldTable, x: float, y: float, z: float, factor: float, weight: float) -> None:
    """Set the residual of the orientation, a vector times a factor, and one weight for it."""
    held.error[ANGULAR] = x * factor * weight
    held.error[ANGULAR + 1] = y * factor * weight
    held.error[ANGULAR + 2] = z * factor * weight
    for k in range(3):
        held.weights[ANGULAR + k] = weight


@kernel
def set_region_columns(held: HeldTable, region: RegionTable, tip: Pose) -> None:
    """Set the weighted columns of the Jacobian of a region's residual."""
    w = held.weights
    weights = (
        w[LINEAR],
        w[LINEAR + 1],
        w[LINEAR + 2],
        w[ANGULAR],
        w[ANGULAR + 1],
        w[ANGULAR + 2],
    )
    set_columns(region.limb, region.call.frames, tip, weights, felt_of(region), held.columns)


@inlined
def felt_of(region: RegionTable) -> int:
    """What turn of the frame changes the orientation's residual, for ``felt``."""
    turning = region.turning
    if turning == layout.AXIS:
        return 2  # of the frame; the region says where it points
    return AS_ANGLES if turning == layout.RANGES else NO_TURN
