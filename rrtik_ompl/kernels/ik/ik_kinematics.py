"""Forward kinematics, residual and Jacobian of a tip as seen from its goal: for kernels, in float64."""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.ik_accessors import (
    box_half,
    column_at,
    free_turn_of,
    next_pose,
    pose_column,
    pose_entry,
    pose_origin,
    pose_row,
    set_pose_entry,
    set_pose_origin,
)
from rrtik_ompl.kernels.ik.ik_layout import (
    ANGULAR,
    LINEAR,
    POSE_NUMBERS,
    TWIST_NUMBERS,
    Aim,
    CallTable,
    LimbTable,
    Pose,
    Twist,
)
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.simd.compiled import inlined, kernel

STEEPEST = 1e-3  # cosine of the pitch, at least
HALF_TURN_COSINE = 1e-12  # cosine of half an angle, below which the turn is a half turn


@inlined
def dot(vector: Any, x: float, y: float, z: float) -> float:
    """Dot product of three numbers with three others."""
    product: float = x * vector[0] + y * vector[1] + z * vector[2]
    return product


@kernel
def see_from(limb: LimbTable, call: CallTable, aim: Aim) -> None:
    """Set the frame before the first joint as seen from the goal, and whether turns count."""
    first = call.first
    fixed = limb.fixed
    for row in range(3):
        x, y, z = pose_column(aim, row)
        for column in range(3):
            set_pose_entry(first, row, column, dot(pose_column(fixed, column), x, y, z))
        away = x * (pose_origin(fixed, 0) - pose_origin(aim, 0)) + y * (pose_origin(fixed, 1) - pose_origin(aim, 1))
        set_pose_origin(first, row, away + z * (pose_origin(fixed, 2) - pose_origin(aim, 2)))
    turns = free_turn_of(aim) != ik_layout.ANY_TURN
    for k in range(3):
        call.weights[LINEAR + k] = limb.per_metre
        call.weights[ANGULAR + k] = limb.per_chord if turns else 0.0


@kernel
def move_tip(limb: LimbTable, call: CallTable, q: Configuration) -> Any:
    """Frames of all joints, each after its own motion, and of the tip; returns where the tip's frame is."""
    frame = call.frames
    fixed = limb.fixed
    for k in range(POSE_NUMBERS):
        frame[k] = call.first[k]
    for joint in range(limb.joints):
        value = limb.gain[joint] * q[limb.column[joint]] + limb.offset[joint]
        fixed = next_pose(fixed)
        if limb.sliding[joint] != 0:
            move_joint(frame, fixed, value, 1.0, 0.0)
        else:
            move_joint(frame, fixed, 0.0, math.cos(value), math.sin(value))
        frame = next_pose(frame)
    return frame


@kernel
def move_joint(frame: Pose, fixed: Pose, slide: float, cosine: float, sine: float) -> None:
    """Move a frame along its z and place the next one, a fixed frame away after a turn about z."""
    after = next_pose(frame)
    for row in range(3):
        a, b, z = pose_row(frame, row)
        x = cosine * a + sine * b
        y = cosine * b - sine * a
        origin = pose_origin(frame, row) + slide * z
        set_pose_origin(frame, row, origin)
        for k in range(3):
            set_pose_entry(after, row, k, dot(pose_column(fixed, k), x, y, z))
        lever = x * pose_origin(fixed, 0) + y * pose_origin(fixed, 1) + z * pose_origin(fixed, 2)
        set_pose_origin(after, row, origin + lever)


@inlined
def missing_turn(free: int, tip: Pose) -> Any:
    """Of the turn that a tip seen from the goal still needs: its axis times its sine, and its cosine."""
    x = 0.5 * (pose_entry(tip, 1, 2) - pose_entry(tip, 2, 1))
    y = 0.5 * (pose_entry(tip, 2, 0) - pose_entry(tip, 0, 2))
    z = 0.5 * (pose_entry(tip, 0, 1) - pose_entry(tip, 1, 0))
    cosine = 0.5 * (pose_entry(tip, 0, 0) + pose_entry(tip, 1, 1) + pose_entry(tip, 2, 2) - 1.0)
    if free == ik_layout.ANY_TURN:
        x, y, z, cosine = 0.0, 0.0, 0.0, 1.0
    elif free == 0:
        x, y, z, cosine = 0.0, pose_entry(tip, 2, 0), -pose_entry(tip, 1, 0), pose_entry(tip, 0, 0)
    elif free == 1:
        x, y, z, cosine = -pose_entry(tip, 2, 1), 0.0, pose_entry(tip, 0, 1), pose_entry(tip, 1, 1)
    elif free == 2:
        x, y, z, cosine = pose_entry(tip, 1, 2), -pose_entry(tip, 0, 2), 0.0, pose_entry(tip, 2, 2)
    return x, y, z, cosine


@kernel
def measure(call: CallTable, aim: Aim, tip: Pose) -> bool:
    """Set the residual [m; chord] of a tip seen from the goal; whether it is within the tolerances."""
    error = call.error
    free = free_turn_of(aim)
    away = 0.0  # squared
    for k in range(3):
        place = pose_origin(tip, k)
        slack = box_half(aim, k)
        outside = min(max(place, -slack), slack) - place
        error[LINEAR + k] = outside
        away += outside * outside
    x, y, z, cosine = missing_turn(free, tip)
    half = math.sqrt(max(0.5 * (1.0 + cosine), 0.0))
    if half < HALF_TURN_COSINE:  # about an axis that rounding hides: any will do, the next step sees better
        x, y, z, half = (1.0 if free != 0 else 0.0), (1.0 if free == 0 else 0.0), 0.0, 0.5
    error[ANGULAR] = x / half
    error[ANGULAR + 1] = y / half
    error[ANGULAR + 2] = z / half
    turn = (x * x + y * y + z * z) / (half * half)
    near = aim[ik_layout.POSITION_TOLERANCE]
    small = aim[ik_layout.CHORD_TOLERANCE]
    reached: bool = away <= near * near and turn <= small * small
    return reached


@kernel
def weigh(call: CallTable) -> float:
    """Turn the residual into one without units; its square."""
    square = 0.0
    for k in range(TWIST_NUMBERS):
        value = call.error[k] * call.weights[k]
        call.error[k] = value
        square += value * value
    return square


@kernel
def differentiate(limb: LimbTable, call: CallTable, aim: Aim, tip: Pose) -> None:
    """Twist of the Jacobian, weighted like the residual: what one unit of each q does to the tip."""
    chord = call.weights[ANGULAR]
    weights = held(call, aim, 0), held(call, aim, 1), held(call, aim, 2), chord, chord, chord
    set_columns(limb, call.frames, tip, weights, free_turn_of(aim), call.columns)


@inlined
def set_columns(limb: LimbTable, frame: Pose, tip: Pose, weights: Any, free: int, columns: Twist) -> None:
    """Set the weighted columns of the Jacobian.

    Args:
        limb: The joints.
        frame: Of the first joint; those of the others stand behind it.
        tip: The frame that is moved.
        weights: Six numbers.
        free: What is felt of a turn, see :func:`felt`.
        columns: What is set.
    """
    u, v, w, r, s, t = weights
    for k in range(TWIST_NUMBERS * limb.dof):
        columns[k] = 0.0
    for joint in range(limb.joints):
        x, y, z = moved_axis(limb, frame, joint)
        column = column_at(columns, limb.column[joint])
        if limb.sliding[joint] != 0:
            add(column, LINEAR, u * x, v * y, w * z)
        else:
            a, b, c = swept(frame, tip, x, y, z)
            add(column, LINEAR, u * a, v * b, w * c)
            x, y, z = felt(free, tip, x, y, z)
            add(column, ANGULAR, r * x, s * y, t * z)
        frame = next_pose(frame)


@inlined
def moved_axis(limb: LimbTable, frame: Pose, joint: int) -> Any:
    """The axis of a joint's frame, as long as what one unit of q makes of the joint."""
    gain = limb.gain[joint]
    return gain * pose_entry(frame, 0, 2), gain * pose_entry(frame, 1, 2), gain * pose_entry(frame, 2, 2)


@inlined
def swept(frame: Pose, tip: Pose, x: float, y: float, z: float) -> Any:
    """How the tip's origin moves while a joint's frame turns, with the angular velocity given."""
    a = pose_origin(tip, 0) - pose_origin(frame, 0)
    b = pose_origin(tip, 1) - pose_origin(frame, 1)
    c = pose_origin(tip, 2) - pose_origin(frame, 2)
    return y * c - z * b, z * a - x * c, x * b - y * a


@inlined
def held(call: CallTable, aim: Aim, axis: int) -> Any:
    """The weight of a coordinate of the position: 0 inside the box, where moving along it changes no residual."""
    inside = box_half(aim, axis) > 0.0 and call.error[LINEAR + axis] == 0.0
    return 0.0 if inside else call.weights[LINEAR + axis]


@inlined
def felt(free: int, tip: Pose, x: float, y: float, z: float) -> Any:
    """A turn without its part about an axis of the tip, 0, 1 or 2, that may point anywhere in its own turn.

    AS_ANGLES: what it changes of the tip's roll, pitch and yaw. Anything else: all of it.
    """
    if free == 0 or free == 1 or free == 2:
        a, b, c = pose_column(tip, free)
        own = x * a + y * b + z * c
        x, y, z = x - own * a, y - own * b, z - own * c
    elif free == ik_layout.AS_ANGLES:
        a = pose_entry(tip, 0, 0)
        b = pose_entry(tip, 1, 0)
        level = max(math.sqrt(a * a + b * b), STEEPEST)
        a = a / level
        b = b / level
        roll = (a * x + b * y) / level
        x, y, z = roll, b * -x + a * y, z - pose_entry(tip, 2, 0) * roll
    return x, y, z


@inlined
def add(column: Twist, place: int, x: float, y: float, z: float) -> None:
    """Add to three numbers of a column."""
    column[place] += x
    column[place + 1] += y
    column[place + 2] += z
