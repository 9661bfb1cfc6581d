"""Inverse kinematics in kernels: Levenberg-Marquardt from many starts, for any row of joints from base to tip.

Source: T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE Transactions
on Robotics 27 (2011), 984-991. Everything is seen from the goal, so that the residual is where the tip is; joints at a
limit that would go on beyond it are left out of a step. :mod:`rrtik_ompl.ik.numeric.reference_descent` is the same in
numpy.
"""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.fast.ik import ik_layout as table
from rrtik_ompl.fast.ik.ik_kinematics import differentiate, measure, move_tip, number, see_from, weigh
from rrtik_ompl.fast.simd.compiled import entry, inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, set_double, set_field, set_int

UNBOUNDED_RESIDUAL = 1e300  # without unit


@inlined
def along(a: int, b: int) -> Any:
    """Dot product of six numbers."""
    total = double_at(a, 0) * double_at(b, 0)
    for k in range(1, 6):
        total += double_at(a, k) * double_at(b, k)
    return total


@kernel
def hold_at_limits(limb: int, call: int, q: int) -> None:
    """Leave joints out that are at a limit and would be driven beyond it: their columns become 0."""
    for k in range(field(limb, table.DOF)):
        column, value = field(call, table.COLUMNS) + 48 * k, double_at(q, k)
        pull = along(column, field(call, table.ERROR))
        low, high = value <= double_at(field(limb, table.LOWER), k), value >= double_at(field(limb, table.UPPER), k)
        if (low and pull < 0.0) or (high and pull > 0.0):
            for axis in range(6):
                set_double(column, axis, 0.0)


@kernel
def fill_square(limb: int, call: int, damping: float) -> None:
    """The lower half of J J^T + damping."""
    square = field(call, table.SQUARE)
    for a in range(6):
        for b in range(a + 1):
            set_double(square, 6 * a + b, damping if a == b else 0.0)
    for k in range(field(limb, table.DOF)):
        column = field(call, table.COLUMNS) + 48 * k
        for a in range(6):
            for b in range(a + 1):
                product = double_at(column, a) * double_at(column, b)
                set_double(square, 6 * a + b, double_at(square, 6 * a + b) + product)


@kernel
def solve_square(call: int) -> None:
    """Replace the residual e by (J J^T + damping)^-1 e: Cholesky's decomposition, the inverse of its diagonal kept."""
    square, error = field(call, table.SQUARE), field(call, table.ERROR)
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
    mark, before, share, patience = (
        UNBOUNDED_RESIDUAL,
        UNBOUNDED_RESIDUAL,
        number(limb, table.SHARE),
        field(call, table.PATIENCE),
    )
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
        hold_at_limits(limb, call, q)
        fill_square(limb, call, number(limb, table.DAMPING) + share * square)
        solve_square(call)
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
        tip = field(limb, table.SEED_TIPS) + table.FRAME_BYTES * seed
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
    set_double(farness, best, UNBOUNDED_RESIDUAL)
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
