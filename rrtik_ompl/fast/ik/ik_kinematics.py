"""Where a tip is, seen from its goal, what separates it from that, and how it moves: for kernels, in float64."""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.fast.ik import ik_layout as table
from rrtik_ompl.fast.simd.compiled import inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, int_at, set_double

HALF_TURN_COSINE = 1e-12  # cosine of half an angle, below which the turn is a half turn


@inlined
def number(limb: int, place: int) -> float:
    """One of the limb's numbers."""
    value: float = double_at(field(limb, table.NUMBERS), place)
    return value


@kernel
def see_from(limb: int, call: int, aim: int) -> None:
    """Set the frame before the first joint as seen from the goal, and whether turns count."""
    first, fixed = field(call, table.FIRST), field(limb, table.FIXED)
    for row in range(3):
        x, y, z = double_at(aim, row), double_at(aim, 3 + row), double_at(aim, 6 + row)
        for column in range(3):
            turned = x * double_at(fixed, column) + y * double_at(fixed, 3 + column) + z * double_at(fixed, 6 + column)
            set_double(first, 3 * row + column, turned)
        away = x * (double_at(fixed, 9) - double_at(aim, 9)) + y * (double_at(fixed, 10) - double_at(aim, 10))
        set_double(first, 9 + row, away + z * (double_at(fixed, 11) - double_at(aim, 11)))
    weights, turns = field(call, table.WEIGHTS), int(double_at(aim, table.FREE_TURN)) != table.ANY_TURN
    for k in range(3):
        set_double(weights, k, number(limb, table.PER_METRE))
        set_double(weights, 3 + k, number(limb, table.PER_CHORD) if turns else 0.0)


@kernel
def move_tip(limb: int, call: int, q: int) -> Any:
    """Frames of all joints, each after its own motion, and of the tip; returns where the tip's frame is."""
    frame, fixed, columns = field(call, table.FRAMES), field(limb, table.FIXED), field(limb, table.COLUMN)
    for k in range(12):
        set_double(frame, k, double_at(field(call, table.FIRST), k))
    for joint in range(field(limb, table.JOINTS)):
        value = double_at(field(limb, table.GAIN), joint) * double_at(q, int_at(columns, joint))
        value += double_at(field(limb, table.OFFSET), joint)
        fixed += table.FRAME_BYTES
        if int_at(field(limb, table.SLIDING), joint) != 0:
            move_joint(frame, fixed, value, 1.0, 0.0)
        else:
            move_joint(frame, fixed, 0.0, math.cos(value), math.sin(value))
        frame += table.FRAME_BYTES
    return frame


@kernel
def move_joint(frame: int, fixed: int, slide: float, cosine: float, sine: float) -> None:
    """Move a frame along its z and place the next one, a fixed frame away after a turn about z."""
    after = frame + table.FRAME_BYTES
    for row in range(3):
        a, b, z = double_at(frame, 3 * row), double_at(frame, 3 * row + 1), double_at(frame, 3 * row + 2)
        x, y = cosine * a + sine * b, cosine * b - sine * a
        origin = double_at(frame, 9 + row) + slide * z
        set_double(frame, 9 + row, origin)
        for k in range(3):
            turned = x * double_at(fixed, k) + y * double_at(fixed, 3 + k) + z * double_at(fixed, 6 + k)
            set_double(after, 3 * row + k, turned)
        lever = x * double_at(fixed, 9) + y * double_at(fixed, 10) + z * double_at(fixed, 11)
        set_double(after, 9 + row, origin + lever)


@inlined
def missing_turn(free: int, tip: int) -> Any:
    """Of the turn that a tip seen from the goal still needs: its axis times its sine, and its cosine."""
    x = 0.5 * (double_at(tip, 5) - double_at(tip, 7))
    y = 0.5 * (double_at(tip, 6) - double_at(tip, 2))
    z = 0.5 * (double_at(tip, 1) - double_at(tip, 3))
    cosine = 0.5 * (double_at(tip, 0) + double_at(tip, 4) + double_at(tip, 8) - 1.0)
    if free == table.ANY_TURN:
        x, y, z, cosine = 0.0, 0.0, 0.0, 1.0
    elif free == 0:
        x, y, z, cosine = 0.0, double_at(tip, 6), -double_at(tip, 3), double_at(tip, 0)
    elif free == 1:
        x, y, z, cosine = -double_at(tip, 7), 0.0, double_at(tip, 1), double_at(tip, 4)
    elif free == 2:
        x, y, z, cosine = double_at(tip, 5), -double_at(tip, 2), 0.0, double_at(tip, 8)
    return x, y, z, cosine


@kernel
def measure(call: int, aim: int, tip: int) -> bool:
    """Set the residual [m; chord] of a tip seen from the goal; whether it is within the tolerances."""
    error, free, away = field(call, table.ERROR), int(double_at(aim, table.FREE_TURN)), 0.0
    for k in range(3):
        place, room = double_at(tip, 9 + k), double_at(aim, table.BOX + k)
        outside = min(max(place, -room), room) - place
        set_double(error, k, outside)
        away += outside * outside
    x, y, z, cosine = missing_turn(free, tip)
    half = math.sqrt(max(0.5 * (1.0 + cosine), 0.0))
    if half < HALF_TURN_COSINE:  # half a turn about an axis that rounding hides: any will do, the next step sees better
        x, y, z, half = (1.0 if free != 0 else 0.0), (1.0 if free == 0 else 0.0), 0.0, 0.5
    set_double(error, 3, x / half)
    set_double(error, 4, y / half)
    set_double(error, 5, z / half)
    turn = (x * x + y * y + z * z) / (half * half)
    near, small = double_at(aim, table.POSITION_TOLERANCE), double_at(aim, table.CHORD_TOLERANCE)
    reached: bool = away <= near * near and turn <= small * small
    return reached


@kernel
def weigh(call: int) -> float:
    """Turn the residual into one without units; its square."""
    error, weights, square = field(call, table.ERROR), field(call, table.WEIGHTS), 0.0
    for k in range(6):
        value = double_at(error, k) * double_at(weights, k)
        set_double(error, k, value)
        square += value * value
    return square


@kernel
def differentiate(limb: int, call: int, aim: int, tip: int) -> None:
    """Columns of the Jacobian, weighted like the residual: what one unit of each q does to the tip."""
    columns, weights, frame = field(call, table.COLUMNS), field(call, table.WEIGHTS), field(call, table.FRAMES)
    for k in range(6 * field(limb, table.DOF)):
        set_double(columns, k, 0.0)
    u, v, w = held(call, aim, 0), held(call, aim, 1), held(call, aim, 2)
    chord, free = double_at(weights, 3), int(double_at(aim, table.FREE_TURN))
    for joint in range(field(limb, table.JOINTS)):
        gain = double_at(field(limb, table.GAIN), joint)
        x, y, z = gain * double_at(frame, 2), gain * double_at(frame, 5), gain * double_at(frame, 8)
        column = columns + 48 * int_at(field(limb, table.COLUMN), joint)
        if int_at(field(limb, table.SLIDING), joint) != 0:
            add(column, u * x, v * y, w * z)
        else:
            a = double_at(tip, 9) - double_at(frame, 9)
            b = double_at(tip, 10) - double_at(frame, 10)
            c = double_at(tip, 11) - double_at(frame, 11)
            add(column, u * (y * c - z * b), v * (z * a - x * c), w * (x * b - y * a))
            x, y, z = felt(free, tip, x, y, z)
            add(column + 24, chord * x, chord * y, chord * z)
        frame += table.FRAME_BYTES


@inlined
def held(call: int, aim: int, axis: int) -> Any:
    """The weight of a coordinate of the position: 0 inside the box, where moving along it changes no residual."""
    inside = double_at(aim, table.BOX + axis) > 0.0 and double_at(field(call, table.ERROR), axis) == 0.0
    return 0.0 if inside else double_at(field(call, table.WEIGHTS), axis)


@inlined
def felt(free: int, tip: int, x: float, y: float, z: float) -> Any:
    """A turn without its part about an axis of the tip that may point anywhere in its own turn."""
    if free == 0 or free == 1 or free == 2:
        a, b, c = double_at(tip, free), double_at(tip, 3 + free), double_at(tip, 6 + free)
        own = x * a + y * b + z * c
        x, y, z = x - own * a, y - own * b, z - own * c
    return x, y, z


@inlined
def add(place: int, x: float, y: float, z: float) -> None:
    """Add to three numbers."""
    set_double(place, 0, double_at(place, 0) + x)
    set_double(place, 1, double_at(place, 1) + y)
    set_double(place, 2, double_at(place, 2) + z)
