"""Inverse kinematics in kernels: Levenberg-Marquardt from many starts, for any row of joints from base to tip.

Source: T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE Transactions
on Robotics 27 (2011), 984-991. Everything is seen from the goal, so that the residual is where the tip is; joints at a
limit that would go on beyond it are left out of a step. :mod:`rrtik_ompl.ik.plain_descent` is the same in numpy.
"""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.fast import ik_layout as table
from rrtik_ompl.fast.compiled import entry, inlined, kernel
from rrtik_ompl.fast.lanes import double_at, field, int_at, set_double, set_field, set_int

FRAME_BYTES = 96
TINY = 1e-12  # cosine of half an angle, below which the turn is a half turn
FAR = 1e300


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
    frame, gain, offset = field(call, table.FRAMES), field(limb, table.GAIN), field(limb, table.OFFSET)
    fixed, columns = field(limb, table.FIXED), field(limb, table.COLUMN)
    for k in range(12):
        set_double(frame, k, double_at(field(call, table.FIRST), k))
    for joint in range(field(limb, table.JOINTS)):
        value = double_at(gain, joint) * double_at(q, int_at(columns, joint)) + double_at(offset, joint)
        slide, cosine, sine = 0.0, 1.0, 0.0
        if int_at(field(limb, table.SLIDING), joint) != 0:
            slide = value
        else:
            cosine, sine = math.cos(value), math.sin(value)
        fixed += FRAME_BYTES
        after = frame + FRAME_BYTES
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
        frame = after
    return frame


@kernel
def measure(call: int, aim: int, tip: int) -> bool:
    """Set the residual [m; chord] of a tip seen from the goal; whether it is within the tolerances."""
    error, free = field(call, table.ERROR), int(double_at(aim, table.FREE_TURN))
    away = 0.0
    for k in range(3):
        place, room = double_at(tip, 9 + k), double_at(aim, table.BOX + k)
        outside = min(max(place, -room), room) - place
        set_double(error, k, outside)
        away += outside * outside
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
    half = math.sqrt(max(0.5 * (1.0 + cosine), 0.0))
    if half < TINY:  # half a turn about an axis that rounding hides: any will do, the next step sees better
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
    """Columns of the Jacobian, weighted like the residual: what one unit of each q does to the tip.

    A turn about an axis of the tip that may point anywhere in its own turn is not felt.
    """
    columns, weights, frame = field(call, table.COLUMNS), field(call, table.WEIGHTS), field(call, table.FRAMES)
    for k in range(6 * field(limb, table.DOF)):
        set_double(columns, k, 0.0)
    metre, chord, free = double_at(weights, 0), double_at(weights, 3), int(double_at(aim, table.FREE_TURN))
    for joint in range(field(limb, table.JOINTS)):
        gain = double_at(field(limb, table.GAIN), joint)
        x, y, z = gain * double_at(frame, 2), gain * double_at(frame, 5), gain * double_at(frame, 8)
        column = columns + 48 * int_at(field(limb, table.COLUMN), joint)
        if int_at(field(limb, table.SLIDING), joint) != 0:
            add(column, metre * x, metre * y, metre * z)
        else:
            a = double_at(tip, 9) - double_at(frame, 9)
            b = double_at(tip, 10) - double_at(frame, 10)
            c = double_at(tip, 11) - double_at(frame, 11)
            add(column, metre * (y * c - z * b), metre * (z * a - x * c), metre * (x * b - y * a))
            if free == 0 or free == 1 or free == 2:
                a, b, c = double_at(tip, free), double_at(tip, 3 + free), double_at(tip, 6 + free)
                own = x * a + y * b + z * c
                x, y, z = x - own * a, y - own * b, z - own * c
            add(column + 24, chord * x, chord * y, chord * z)
        frame += FRAME_BYTES


@inlined
def add(place: int, x: float, y: float, z: float) -> None:
    """Add to three numbers."""
    set_double(place, 0, double_at(place, 0) + x)
    set_double(place, 1, double_at(place, 1) + y)
    set_double(place, 2, double_at(place, 2) + z)


@inlined
def along(a: int, b: int) -> Any:
    """Dot product of six numbers."""
    total = double_at(a, 0) * double_at(b, 0)
    for k in range(1, 6):
        total += double_at(a, k) * double_at(b, k)
    return total


@kernel
def pin(limb: int, call: int, q: int) -> None:
    """Leave joints out that are at a limit and would be driven beyond it: their columns become 0."""
    for k in range(field(limb, table.DOF)):
        column, value = field(call, table.COLUMNS) + 48 * k, double_at(q, k)
        pull = along(column, field(call, table.ERROR))
        low, high = value <= double_at(field(limb, table.LOWER), k), value >= double_at(field(limb, table.UPPER), k)
        if (low and pull < 0.0) or (high and pull > 0.0):
            for axis in range(6):
                set_double(column, axis, 0.0)


@kernel
def solve_square(limb: int, call: int, damping: float) -> None:
    """Replace the residual e by (J J^T + damping)^-1 e: Cholesky's decomposition, inverse diagonal kept."""
    square, error = field(call, table.SQUARE), field(call, table.ERROR)
    for a in range(6):
        for b in range(a + 1):
            set_double(square, 6 * a + b, damping if a == b else 0.0)
    for k in range(field(limb, table.DOF)):
        column = field(call, table.COLUMNS) + 48 * k
        for a in range(6):
            for b in range(a + 1):
                product = double_at(column, a) * double_at(column, b)
                set_double(square, 6 * a + b, double_at(square, 6 * a + b) + product)
    for a in range(6):
        for b in range(a + 1):
            rest = double_at(square, 6 * a + b)
            for k in range(b):
                rest -= double_at(square, 6 * a + k) * double_at(square, 6 * b + k)
            inverse = 1.0 / math.sqrt(rest) if a == b else rest * double_at(square, 6 * b + b)
            set_double(square, 6 * a + b, inverse)
    for a in range(6):
        rest = double_at(error, a)
        for k in range(a):
            rest -= double_at(square, 6 * a + k) * double_at(error, k)
        set_double(error, a, rest * double_at(square, 6 * a + a))
    for a in range(5, -1, -1):
        rest = double_at(error, a)
        for k in range(a + 1, 6):
            rest -= double_at(square, 6 * k + a) * double_at(error, k)
        set_double(error, a, rest * double_at(square, 6 * a + a))


@kernel
def step(limb: int, call: int, q: int) -> None:
    """Move the joints by J^T times what :func:`solve_square` left, no joint too far, none beyond a limit."""
    change, largest = field(call, table.CHANGE), number(limb, table.LARGEST_STEP)
    most = largest
    for k in range(field(limb, table.DOF)):
        value = along(field(call, table.COLUMNS) + 48 * k, field(call, table.ERROR))
        set_double(change, k, value)
        most = max(most, abs(value))
    for k in range(field(limb, table.DOF)):
        value = double_at(q, k) + double_at(change, k) * (largest / most)
        low, high = double_at(field(limb, table.LOWER), k), double_at(field(limb, table.UPPER), k)
        set_double(q, k, min(max(value, low), high))


@kernel
def descend(limb: int, call: int, aim: int, q: int) -> bool:
    """Walk from q towards the goal as :func:`see_from` has it; whether it is reached."""
    mark, before, share, patience = FAR, FAR, number(limb, table.SHARE), field(call, table.PATIENCE)
    for k in range(field(call, table.STEPS) + 1):
        tip = move_tip(limb, call, q)
        if measure(call, aim, tip):
            return True
        square = weigh(call)
        if k > 0 and k % patience == 0:
            if square > number(limb, table.STALLED) * mark:
                return False
            mark = square
        if k == field(call, table.STEPS):
            return False
        if square > before:
            share *= number(limb, table.SHARE_GROWTH)
        before = square
        differentiate(limb, call, aim, tip)
        pin(limb, call, q)
        solve_square(limb, call, number(limb, table.DAMPING) + share * square)
        step(limb, call, q)
        set_field(call, table.DONE, field(call, table.DONE) + 1)
    return False


@entry
def walk(limb: int, call: int) -> int:
    """Walk from every row of Q towards its goal; returns the most steps that one of them took."""
    most = 0
    for row in range(field(call, table.ROWS)):
        aim = field(call, table.AIMS) + row * field(call, table.AIM_BYTES)
        if row == 0 or field(call, table.AIM_BYTES) > 0:
            see_from(limb, call, aim)
        set_field(call, table.DONE, 0)
        reached = descend(limb, call, aim, field(call, table.Q) + 8 * field(limb, table.DOF) * row)
        set_int(field(call, table.REACHED), row, 1 if reached else 0)
        most = max(most, field(call, table.DONE))
    return most


@kernel
def measure_seeds(limb: int, call: int, aim: int) -> None:
    """How far each seed's tip is from a goal, squared and without units."""
    free = int(double_at(aim, table.FREE_TURN))
    metre, chord = number(limb, table.PER_METRE), number(limb, table.PER_CHORD)
    for seed in range(field(limb, table.SEED_COUNT)):
        tip = field(limb, table.SEED_TIPS) + FRAME_BYTES * seed
        away, turned = 0.0, 0.0
        for k in range(3):
            way = double_at(tip, 9 + k) - double_at(aim, 9 + k)
            away += way * way
            if free == table.NO_TURN or free == k:
                for row in range(0, 9, 3):
                    turned += double_at(tip, row + k) * double_at(aim, row + k)
        whole = 3.0 if free == table.NO_TURN else (0.0 if free == table.ANY_TURN else 1.0)
        set_double(field(call, table.FARNESS), seed, metre * metre * away + chord * chord * (whole - turned))


@kernel
def take_nearest(limb: int, call: int) -> int:
    """The nearest seed that has not been taken."""
    farness, best = field(call, table.FARNESS), 0
    for seed in range(1, field(limb, table.SEED_COUNT)):
        if double_at(farness, seed) < double_at(farness, best):
            best = seed
    set_double(farness, best, FAR)
    return best


@kernel
def search(limb: int, call: int, row: int) -> bool:
    """Walk from the row's next starts until one reaches its goal; whether one does."""
    dof, aim = field(limb, table.DOF), field(call, table.AIMS) + row * field(call, table.AIM_BYTES)
    q, follower = field(call, table.Q) + 8 * dof * row, field(call, table.NEXT) + 8 * row
    see_from(limb, call, aim)
    begin, source = field(follower, 0), field(call, table.NEAR) + row * field(call, table.NEAR_BYTES)
    for start in range(field(limb, table.SEED_COUNT) + 1):
        if start == 1:
            measure_seeds(limb, call, aim)
        if start > 0:
            source = field(limb, table.SEEDS) + 8 * dof * take_nearest(limb, call)
        if start < begin:
            continue
        for k in range(dof):
            set_double(q, k, double_at(source, k))
        set_field(follower, 0, start + 1)
        if descend(limb, call, aim, q):
            return True
    return False


@entry
def solve(limb: int, call: int) -> int:
    """For every row go on with its starts until one reaches its goal; returns how many rows did."""
    solved = 0
    set_field(call, table.DONE, 0)
    for row in range(field(call, table.ROWS)):
        reached = 1 if search(limb, call, row) else 0
        set_int(field(call, table.REACHED), row, reached)
        solved += reached
    return solved
