"""Numeric inverse kinematics in kernels: Levenberg-Marquardt from many starts, for any row of joints from base to tip.

Source: [22]. Everything is seen from the goal, so that the residual is where the tip is; joints at a limit that would
go on beyond it are left out of a step. :mod:`rrtik_ompl.ik.reference_descent` is the same in numpy.
"""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.ik_accessors import (
    aim_at,
    aim_bytes_of,
    change_of,
    column_at,
    columns_of,
    configuration_at,
    dof_of,
    error_of,
    farness_of,
    free_turn_of,
    lower_of,
    near_at,
    next_of,
    next_start_at,
    number,
    number_of_next,
    patience_of,
    pose_at,
    pose_entry,
    pose_origin,
    q_of,
    reached_of,
    row_count_of,
    seed_count_of,
    seed_tips_of,
    seeds_of,
    set_next,
    set_square,
    set_steps_done,
    square_at,
    square_of,
    step_limit_of,
    steps_done_of,
    upper_of,
)
from rrtik_ompl.kernels.ik.ik_kinematics import differentiate, measure, move_tip, see_from, weigh
from rrtik_ompl.kernels.ik.ik_layout import TWIST_NUMBERS, Aim, CallTable, Configuration, LimbTable, Twist
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, set_double, set_int

UNBOUNDED_RESIDUAL = 1e300  # without unit


@inlined
def along(a: Twist, b: Twist) -> Any:
    """Dot product of six numbers."""
    total = double_at(a, 0) * double_at(b, 0)
    for k in range(1, TWIST_NUMBERS):
        total += double_at(a, k) * double_at(b, k)
    return total


@kernel
def hold_at_limits(limb: LimbTable, call: CallTable, q: Configuration) -> None:
    """Leave joints out that are at a limit and would be driven beyond it: their columns become 0."""
    for k in range(dof_of(limb)):
        column, value = column_at(columns_of(call), k), double_at(q, k)
        pull = along(column, error_of(call))
        low, high = value <= double_at(lower_of(limb), k), value >= double_at(upper_of(limb), k)
        if (low and pull < 0.0) or (high and pull > 0.0):
            for axis in range(TWIST_NUMBERS):
                set_double(column, axis, 0.0)


@kernel
def fill_square(limb: LimbTable, call: CallTable, damping: float) -> None:
    """The lower half of J J^T + damping."""
    square = square_of(call)
    for a in range(TWIST_NUMBERS):
        for b in range(a + 1):
            set_square(square, a, b, damping if a == b else 0.0)
    for k in range(dof_of(limb)):
        column = column_at(columns_of(call), k)
        for a in range(TWIST_NUMBERS):
            for b in range(a + 1):
                product = double_at(column, a) * double_at(column, b)
                set_square(square, a, b, square_at(square, a, b) + product)


@kernel
def solve_square(call: CallTable) -> None:
    """Replace the residual e by (J J^T + damping)^-1 e: Cholesky's decomposition, the inverse of its diagonal kept."""
    square, error = square_of(call), error_of(call)
    for a in range(TWIST_NUMBERS):
        for b in range(a + 1):
            rest = square_at(square, a, b)
            for k in range(b):
                rest -= square_at(square, a, k) * square_at(square, b, k)
            inverse = 1.0 / math.sqrt(rest) if a == b else rest * square_at(square, b, b)
            set_square(square, a, b, inverse)
    for a in range(TWIST_NUMBERS):
        rest = double_at(error, a)
        for k in range(a):
            rest -= square_at(square, a, k) * double_at(error, k)
        set_double(error, a, rest * square_at(square, a, a))
    for a in range(TWIST_NUMBERS - 1, -1, -1):
        rest = double_at(error, a)
        for k in range(a + 1, TWIST_NUMBERS):
            rest -= square_at(square, k, a) * double_at(error, k)
        set_double(error, a, rest * square_at(square, a, a))


@kernel
def step(limb: LimbTable, call: CallTable, q: Configuration) -> None:
    """Move the joints by J^T times what :func:`solve_square` left, no joint too far, none beyond a limit."""
    change, largest = change_of(call), number(limb, ik_layout.LARGEST_STEP)
    most = largest
    for k in range(dof_of(limb)):
        value = along(column_at(columns_of(call), k), error_of(call))
        set_double(change, k, value)
        most = max(most, abs(value))
    for k in range(dof_of(limb)):
        value = double_at(q, k) + double_at(change, k) * (largest / most)
        low, high = double_at(lower_of(limb), k), double_at(upper_of(limb), k)
        set_double(q, k, min(max(value, low), high))


@kernel
def descend(limb: LimbTable, call: CallTable, aim: Aim, q: Configuration) -> bool:
    """Walk from q towards the goal as :func:`see_from` has it; whether it is reached."""
    mark, before, share, patience = (
        UNBOUNDED_RESIDUAL,
        UNBOUNDED_RESIDUAL,
        number(limb, ik_layout.SHARE),
        patience_of(call),
    )
    for k in range(step_limit_of(call) + 1):
        tip = move_tip(limb, call, q)
        if measure(call, aim, tip):
            return True
        square = weigh(call)
        if k > 0 and k % patience == 0:
            if square > number(limb, ik_layout.STALLED) * mark:
                return False
            mark = square
        if k == step_limit_of(call):
            return False
        if square > before:
            share *= number(limb, ik_layout.SHARE_GROWTH)
        before = square
        differentiate(limb, call, aim, tip)
        hold_at_limits(limb, call, q)
        fill_square(limb, call, number(limb, ik_layout.DAMPING) + share * square)
        solve_square(call)
        step(limb, call, q)
        set_steps_done(call, steps_done_of(call) + 1)
    return False


@entry
def walk(limb: LimbTable, call: CallTable) -> int:
    """Walk from every row of Q towards its goal; returns the most steps that one of them took."""
    most = 0
    for row in range(row_count_of(call)):
        aim = aim_at(call, row)
        if row == 0 or aim_bytes_of(call) > 0:
            see_from(limb, call, aim)
        set_steps_done(call, 0)
        reached = descend(limb, call, aim, configuration_at(q_of(call), dof_of(limb), row))
        set_int(reached_of(call), row, 1 if reached else 0)
        most = max(most, steps_done_of(call))
    return most


@kernel
def measure_seeds(limb: LimbTable, call: CallTable, aim: Aim) -> None:
    """How far each seed's tip is from a goal, squared and without units."""
    free = free_turn_of(aim)
    metre, chord = number(limb, ik_layout.PER_METRE), number(limb, ik_layout.PER_CHORD)
    for seed in range(seed_count_of(limb)):
        tip = pose_at(seed_tips_of(limb), seed)
        away, turned = 0.0, 0.0
        for k in range(3):
            way = pose_origin(tip, k) - pose_origin(aim, k)
            away += way * way
            if free == ik_layout.NO_TURN or free == k:
                for row in range(3):
                    turned += pose_entry(tip, row, k) * pose_entry(aim, row, k)
        whole = 3.0 if free == ik_layout.NO_TURN else (0.0 if free == ik_layout.ANY_TURN else 1.0)
        set_double(farness_of(call), seed, metre * metre * away + chord * chord * (whole - turned))


@kernel
def take_nearest(limb: LimbTable, call: CallTable) -> int:
    """The nearest seed that has not been taken."""
    farness, best = farness_of(call), 0
    for seed in range(1, seed_count_of(limb)):
        if double_at(farness, seed) < double_at(farness, best):
            best = seed
    set_double(farness, best, UNBOUNDED_RESIDUAL)
    return best


@kernel
def search(limb: LimbTable, call: CallTable, row: int) -> bool:
    """Walk from the row's next starts until one reaches its goal; whether one does."""
    dof, aim = dof_of(limb), aim_at(call, row)
    q, follower = configuration_at(q_of(call), dof, row), next_start_at(next_of(call), row)
    see_from(limb, call, aim)
    begin, source = number_of_next(follower), near_at(call, row)
    for start in range(seed_count_of(limb) + 1):
        if start == 1:
            measure_seeds(limb, call, aim)
        if start > 0:
            source = configuration_at(seeds_of(limb), dof, take_nearest(limb, call))
        if start < begin:
            continue
        for k in range(dof):
            set_double(q, k, double_at(source, k))
        set_next(follower, start + 1)
        if descend(limb, call, aim, q):
            return True
    return False


@entry
def solve(limb: LimbTable, call: CallTable) -> int:
    """For every row go on with its starts until one reaches its goal; returns how many rows did."""
    solved = 0
    set_steps_done(call, 0)
    for row in range(row_count_of(call)):
        reached = 1 if search(limb, call, row) else 0
        set_int(reached_of(call), row, reached)
        solved += reached
    return solved
