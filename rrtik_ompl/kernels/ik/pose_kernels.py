"""Inverse kinematics of one pose in one call: solved, held to the limits, verified and sorted.

Of a closed form, lanes are branches. Each branch is placed by the frames of the description, apart from the formulas
that gave it, and counts only if that is at the pose.
"""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.branch_layout import BRANCHES, DOF, MATRIX_SIDE, SINGULAR
from rrtik_ompl.kernels.ik.ik_accessors import next_pose, pose_origin, pose_row
from rrtik_ompl.kernels.ik.ik_kernels import search
from rrtik_ompl.kernels.ik.ik_layout import ANGULAR, LINEAR, Pose
from rrtik_ompl.kernels.ik.lane_rows import first_row, row_after
from rrtik_ompl.kernels.ik.parallel_axes import dot, elbow, joints_of, shoulder, vector_of, wrist, wrist_of
from rrtik_ompl.kernels.ik.pose_layout import ANGLE, AWAY, DISTANCE, SHARES, STEPS_UNIT, UNKNOWN, VALUES, PoseTable
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    choose,
    floor,
    lane_numbers,
    larger,
    set_wide_lanes,
    smaller,
    spread_wide,
    square_root,
    wide_lanes_at,
)
from rrtik_ompl.kernels.simd.wide_angles import TAU, arc_sine, wide_sine_and_cosine, within_half_turn

RIGID = 1e-12  # how far from orthonormal a rotation may be that is taken as it is
FLAT = 1e-8  # how far from 0 0 0 1 the last row of a pose may be
MOST = 1e9  # [m] or [rad]: more is left to others
SAME_POSTURE = 1e-3  # [rad]: solutions this near to each other count as one


@inlined
def spread_vector(v: Any) -> Any:
    """Three numbers in every lane."""
    return spread_wide(v[0]), spread_wide(v[1]), spread_wide(v[2])


@kernel
def begin(call: PoseTable) -> bool:
    """Write the aim of the pose; False if the pose or the hint is none, or needs mending first."""
    pose = call.pose
    aim = call.aim
    x = vector_of(pose, 0)
    y = vector_of(pose, MATRIX_SIDE)
    z = vector_of(pose, 2 * MATRIX_SIDE)
    off = max(abs(dot(x, x) - 1.0), abs(dot(y, y) - 1.0), abs(dot(z, z) - 1.0))
    off = max(off, abs(dot(x, y)), abs(dot(y, z)), abs(dot(z, x)))
    right = (x[1] * y[2] - x[2] * y[1]) * z[0] + (x[2] * y[0] - x[0] * y[2]) * z[1] + (x[0] * y[1] - x[1] * y[0]) * z[2]
    last = 3 * MATRIX_SIDE
    tilted = max(abs(pose[last]), abs(pose[last + 1]), abs(pose[last + 2]), abs(pose[last + 3] - 1.0))
    good: bool = off <= RIGID and right > 0.0 and tilted <= FLAT  # false of what is not a number

    for joint in range(call.arm.limb.dof):
        good = good and abs(call.near[joint]) < MOST
    for row in range(3):
        for column in range(3):
            aim[ik_layout.ROTATION + 3 * row + column] = pose[MATRIX_SIDE * row + column]
        place = pose[MATRIX_SIDE * row + 3]
        aim[ik_layout.ORIGIN + row] = place
        good = good and abs(place) < MOST
    return good


@kernel
def solve_branches(call: PoseTable) -> Any:
    """Write the joint values of all branches; returns which are real, and how near to singular the nearest is.

    The measure is a length [m] or a sine.
    """
    numbers = call.arm.numbers
    pose = call.pose
    lanes = call.lanes
    turn, place = wrist_of(
        numbers,
        spread_vector(vector_of(pose, 0)),
        spread_vector(vector_of(pose, MATRIX_SIDE)),
        spread_vector(vector_of(pose, 2 * MATRIX_SIDE)),
        (spread_wide(pose[3]), spread_wide(pose[MATRIX_SIDE + 3]), spread_wide(pose[2 * MATRIX_SIDE + 3])),
    )
    lane = lane_numbers()
    lane = lane - BRANCHES * floor(lane * (1.0 / BRANCHES))
    half = lane - 4.0 * floor(lane * 0.25)
    quarter = half - 2.0 * floor(half * 0.5)
    one = spread_wide(1.0)

    first, seen, near, away = shoulder(numbers, turn, place, choose(lane < 4.0, one, -one))
    fifth, middle, sixth, bent, size = wrist(numbers, seen, choose(half < 2.0, one, -one))
    second, third, real = elbow(numbers, seen[0], middle, choose(quarter < 1.0, one, -one))
    q = joints_of(numbers, first, second, third, middle, fifth, sixth)
    set_wide_lanes(lanes, VALUES, q[0])
    set_wide_lanes(lanes, VALUES + 1, q[1])
    set_wide_lanes(lanes, VALUES + 2, q[2])
    set_wide_lanes(lanes, VALUES + 3, q[3])
    set_wide_lanes(lanes, VALUES + 4, q[4])
    set_wide_lanes(lanes, VALUES + 5, q[5])
    return bits(near & bent & real & (lane_numbers() < BRANCHES)), away, choose(near & bent, size, one)


@kernel
def hold(call: PoseTable) -> int:
    """Turn joints into their limits, towards the hint; which branches fit. Sets their distances from the hint."""
    arm = call.arm
    lanes = call.lanes
    fits = lane_numbers() < BRANCHES
    away = spread_wide(0.0)
    for joint in range(DOF):
        low = arm.lowest[joint]
        high = arm.highest[joint]
        near = call.near[joint]
        weight = arm.weights[joint]
        value = wide_lanes_at(lanes, VALUES + joint)
        if arm.turning[joint] != 0:
            value = near + within_half_turn(value - near)
            value = value + TAU * floor(smaller(high - value, 0.0) * (1.0 / TAU))
            value = value - TAU * floor(smaller(value - low, 0.0) * (1.0 / TAU))
        fits = fits & (value >= low) & (value <= high)
        value = smaller(larger(value, arm.limb.lower[joint]), arm.limb.upper[joint])
        set_wide_lanes(lanes, VALUES + joint, value)
        gap = (value - near) * weight
        away = away + gap * gap
    set_wide_lanes(lanes, DISTANCE, away)
    which: int = bits(fits)
    return which


@inlined
def missed(aim: Pose, number: int, row: Any) -> Any:
    """Squares of what the tip misses in one row: of the rotation, and of the position."""
    a, b, c = pose_row(aim, number)
    x = row[0] - a
    y = row[1] - b
    z = row[2] - c
    o = row[3] - pose_origin(aim, number)
    return x * x + y * y + z * z, o * o


@kernel
def verify(call: PoseTable) -> int:
    """Which branches are at the pose, by forward kinematics. Sets their residuals."""
    limb = call.arm.limb
    lanes = call.lanes
    aim = call.aim
    fixed = limb.fixed
    r0 = first_row(fixed, 0)
    r1 = first_row(fixed, 1)
    r2 = first_row(fixed, 2)
    for joint in range(DOF):
        fixed = next_pose(fixed)
        value = wide_lanes_at(lanes, VALUES + limb.column[joint]) * limb.gain[joint] + limb.offset[joint]
        sine, cosine = wide_sine_and_cosine(value)
        r0 = row_after(fixed, cosine, sine, r0)
        r1 = row_after(fixed, cosine, sine, r1)
        r2 = row_after(fixed, cosine, sine, r2)

    t0, p0 = missed(aim, 0, r0)
    t1, p1 = missed(aim, 1, r1)
    t2, p2 = missed(aim, 2, r2)
    away = square_root(p0 + p1 + p2)
    angle = 2.0 * arc_sine(smaller(square_root((t0 + t1 + t2) * 0.125), 1.0))
    set_wide_lanes(lanes, AWAY, away)
    set_wide_lanes(lanes, ANGLE, angle)
    near = aim[ik_layout.POSITION_TOLERANCE] * SHARES
    small = aim[ik_layout.CHORD_TOLERANCE] * SHARES
    which: int = bits((away <= near) & (angle <= small))
    return which


@inlined
def in_lane(call: PoseTable, place: int, lane: int) -> Any:
    """One of wide lanes."""
    return call.lanes[WIDTH * place + lane]


@kernel
def nearest_of(call: PoseTable, left: int) -> int:
    """Of the branches that are left, the one nearest to the hint."""
    best = -1
    for lane in range(BRANCHES):
        if (left >> lane) & 1 == 0:
            continue
        if best < 0 or in_lane(call, DISTANCE, lane) < in_lane(call, DISTANCE, best):
            best = lane
    return best


@kernel
def is_new(call: PoseTable, lane: int, count: int) -> bool:
    """Whether a branch is none of the configurations written so far."""
    for k in range(count):
        far = 0.0
        for joint in range(DOF):
            far = max(far, abs(in_lane(call, VALUES + joint, lane) - call.rows[DOF * k + joint]))
        if far <= SAME_POSTURE:
            return False
    return True


@kernel
def write_branches(call: PoseTable, left: int, most: int) -> int:
    """Write the branches that are left, nearest first, without repeats; how many."""
    count = 0
    chosen = 0  # their lanes, four bits each
    while left != 0 and count < most:
        lane = nearest_of(call, left)
        left = left & ~(1 << lane)
        if is_new(call, lane, count):
            for joint in range(DOF):
                call.rows[DOF * count + joint] = in_lane(call, VALUES + joint, lane)
            chosen = chosen | (lane << (4 * count))
            count += 1

    for k in range(count):
        lane = (chosen >> (4 * k)) & 15
        call.rows[DOF * count + 2 * k] = in_lane(call, AWAY, lane)
        call.rows[DOF * count + 2 * k + 1] = in_lane(call, ANGLE, lane)
    return count


@inlined
def closed_form(call: PoseTable, most: int) -> int:
    """Solve by branches; those that are only within the tolerances of the pose count where no other is at it.

    What is singular is left to numpy, and so is what is nearly so if nothing else will do or all solutions are wanted.
    """
    if not begin(call):
        return UNKNOWN
    real, away, size = solve_branches(call)
    slack = call.slack
    nearly = bits((away < slack) | (size < slack)) != 0
    if (nearly and most > 1) or bits((away < SINGULAR) | (size < SINGULAR)) != 0:
        return UNKNOWN
    good = hold(call)
    good = good & verify(call)
    if good & real != 0:
        good = good & real
    if good == 0:
        return UNKNOWN if nearly else 0
    return write_branches(call, good, most)


@entry
def nearest_branch(call: PoseTable) -> int:
    """Write the solution nearest to the hint; 1, or 0 if there is none, or UNKNOWN."""
    return closed_form(call, 1)


@entry
def all_branches(call: PoseTable) -> int:
    """Write all solutions, nearest to the hint first; how many, or UNKNOWN."""
    return closed_form(call, BRANCHES)


@entry
def walk_to_pose(call: PoseTable) -> int:
    """Write the first solution that Levenberg-Marquardt comes to; see `pose_layout` for the answer."""
    if not begin(call):
        return UNKNOWN
    arm = call.arm
    limb = arm.limb
    walk = call.walk
    for k in range(ik_layout.AIM_FLOATS):
        walk.aims[k] = call.aim[k]
    for joint in range(limb.dof):
        walk.near[joint] = min(max(call.near[joint], limb.lower[joint]), limb.upper[joint])
    walk.next[0] = 0
    walk.done = 0
    if not search(limb, walk, 0):
        return STEPS_UNIT * walk.done

    for joint in range(limb.dof):
        value = walk.q[joint]
        if arm.endless[joint] != 0:
            value = value + TAU * math.floor(0.5 - (value - call.near[joint]) / TAU)
        call.rows[joint] = value
    p = vector_of(walk.error, LINEAR)
    turn = vector_of(walk.error, ANGULAR)
    call.rows[limb.dof] = math.sqrt(dot(p, p))
    call.rows[limb.dof + 1] = 2.0 * math.asin(min(0.5 * math.sqrt(dot(turn, turn)), 1.0))
    return STEPS_UNIT * walk.done + 1
