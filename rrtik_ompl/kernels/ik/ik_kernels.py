"""Numeric inverse kinematics in kernels: Levenberg-Marquardt from many starts, for any row of joints from base to tip.

Source: [22]. Everything is seen from the goal, so that the residual is where the tip is; joints at a limit that would
go on beyond it are left out of a step. :mod:`rrtik_ompl.kernels.reference.descent` is the same in numpy.
"""

from __future__ import annotations

import math
from typing import Any

from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.damped_steps import ANY_PIVOT, move_by, solve_in_place
from rrtik_ompl.kernels.ik.ik_accessors import (
    aim_at,
    column_at,
    free_turn_of,
    near_at,
    pose_at,
    pose_entry,
    pose_origin,
)
from rrtik_ompl.kernels.ik.ik_kinematics import differentiate, measure, move_tip, see_from, weigh
from rrtik_ompl.kernels.ik.ik_layout import TWIST_NUMBERS, Aim, CallTable, ChoiceTable, LimbTable, Twist
from rrtik_ompl.kernels.ik.lane_descent import search_lanes, walk_lanes
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.records import exists, row_at
from rrtik_ompl.kernels.simd.wide_angles import TAU

UNBOUNDED_RESIDUAL = 1e300  # without unit


@inlined
def along(a: Twist, b: Twist) -> Any:
    """Dot product of six numbers."""
    total = a[0] * b[0]
    for k in range(1, TWIST_NUMBERS):
        total += a[k] * b[k]
    return total


@kernel
def hold_at_limits(limb: LimbTable, call: CallTable, q: Configuration) -> None:
    """Leave joints out that are at a limit and would be driven beyond it: their columns become 0."""
    for k in range(limb.dof):
        column = column_at(call.columns, k)
        pull = along(column, call.error)
        low = q[k] <= limb.lower[k]
        high = q[k] >= limb.upper[k]
        if (low and pull < 0.0) or (high and pull > 0.0):
            for axis in range(TWIST_NUMBERS):
                column[axis] = 0.0


@kernel
def fill_square(limb: LimbTable, call: CallTable, damping: float) -> None:
    """The lower half of J J^T + damping."""
    for a in range(TWIST_NUMBERS):
        row = row_at(call.square, TWIST_NUMBERS, a)
        for b in range(a + 1):
            row[b] = damping if a == b else 0.0
    for k in range(limb.dof):
        column = column_at(call.columns, k)
        for a in range(TWIST_NUMBERS):
            row = row_at(call.square, TWIST_NUMBERS, a)
            for b in range(a + 1):
                row[b] += column[a] * column[b]


@kernel
def solve_square(call: CallTable) -> None:
    """Replace the residual e by (J J^T + damping)^-1 e."""
    solve_in_place(call.square, TWIST_NUMBERS, call.error, ANY_PIVOT)


@kernel
def step(limb: LimbTable, call: CallTable, q: Configuration) -> None:
    """Move the joints by J^T times what :func:`solve_square` left, no joint too far, none beyond a limit."""
    for k in range(limb.dof):
        call.change[k] = along(column_at(call.columns, k), call.error)
    move_by(limb, call.change, q)


@kernel
def descend(limb: LimbTable, call: CallTable, aim: Aim, q: Configuration) -> bool:
    """Walk from q towards the goal as :func:`see_from` has it; whether it is reached."""
    share = limb.share
    mark = UNBOUNDED_RESIDUAL  # squared, some steps ago
    before = UNBOUNDED_RESIDUAL  # squared, one step ago
    for k in range(call.steps + 1):
        tip = move_tip(limb, call, q)
        if measure(call, aim, tip):
            return True

        square = weigh(call)
        if k > 0 and k % call.patience == 0:
            if square > limb.stalled * mark:
                return False
            mark = square
        if k == call.steps:
            return False
        if square > before:
            share *= limb.share_growth
        before = square

        differentiate(limb, call, aim, tip)
        hold_at_limits(limb, call, q)
        fill_square(limb, call, limb.damping + share * square)
        solve_square(call)
        step(limb, call, q)
        call.done += 1
    return False


@entry
def walk(limb: LimbTable, call: CallTable) -> int:
    """Walk from every row of Q towards its goal; returns the most steps that one of them took."""
    most = 0
    if call.aim_numbers == 0 and call.rows > 1 and exists(call.lanes):
        aim = aim_at(call, 0)
        see_from(limb, call, aim)
        return walk_lanes(limb, call, aim)
    for row in range(call.rows):
        aim = aim_at(call, row)
        if row == 0 or call.aim_numbers > 0:
            see_from(limb, call, aim)
        call.done = 0
        reached = descend(limb, call, aim, row_at(call.q, limb.dof, row))
        call.reached[row] = 1 if reached else 0
        most = max(most, call.done)
    return most


@kernel
def measure_seeds(limb: LimbTable, call: CallTable, aim: Aim) -> None:
    """How far each seed's tip is from a goal, squared and without units."""
    free = free_turn_of(aim)
    metre = limb.per_metre
    chord = limb.per_chord
    for seed in range(limb.seed_count):
        tip = pose_at(limb.seed_tips, seed)
        away = 0.0
        turned = 0.0
        for k in range(3):
            way = pose_origin(tip, k) - pose_origin(aim, k)
            away += way * way
            if free == ik_layout.NO_TURN or free == k:
                for row in range(3):
                    turned += pose_entry(tip, row, k) * pose_entry(aim, row, k)
        whole = 1.0  # the largest that it can be
        if free == ik_layout.NO_TURN:
            whole = 3.0
        elif free == ik_layout.ANY_TURN:
            whole = 0.0
        call.farness[seed] = metre * metre * away + chord * chord * (whole - turned)


@kernel
def take_nearest(limb: LimbTable, call: CallTable) -> int:
    """The nearest seed that has not been taken."""
    farness = call.farness
    best = 0
    for seed in range(1, limb.seed_count):
        if farness[seed] < farness[best]:
            best = seed
    farness[best] = UNBOUNDED_RESIDUAL
    return best


@kernel
def search(limb: LimbTable, call: CallTable, row: int) -> bool:
    """Walk from the row's next starts until one reaches its goal; whether one does.

    The first start goes alone, as it mostly arrives; the seeds go side by side where there is memory for lanes.
    """
    dof = limb.dof
    aim = aim_at(call, row)
    q = row_at(call.q, dof, row)
    see_from(limb, call, aim)
    begin = call.next[row]
    if begin == 0:
        source = near_at(call, row)
        for k in range(dof):
            q[k] = source[k]
        call.next[row] = 1
        if descend(limb, call, aim, q):
            return True
        begin = 1

    if begin > limb.seed_count:
        return False
    measure_seeds(limb, call, aim)
    if exists(call.lanes):
        start = search_lanes(limb, call, aim, begin, q)
        call.next[row] = (start if start > 0 else limb.seed_count) + 1
        if start > 0:
            measure(call, aim, move_tip(limb, call, q))
        return start > 0

    for start in range(1, limb.seed_count + 1):
        source = row_at(limb.seeds, dof, take_nearest(limb, call))
        if start < begin:
            continue
        for k in range(dof):
            q[k] = source[k]
        call.next[row] = start + 1
        if descend(limb, call, aim, q):
            return True
    return False


@entry
def choose_apart(choice: ChoiceTable) -> int:
    """Choose rows that differ from each other and from those that are known; how many.

    The first half are those nearest to the start, each of the others the one farthest from all chosen so far.
    """
    dof = choice.dof
    apart = choice.apart
    for count in range(choice.most):
        best = -1
        for k in range(choice.rows):
            if apart[k] <= choice.least:
                continue
            if best < 0:
                best = k
            elif 2 * count < choice.most:
                best = k if choice.away[k] < choice.away[best] else best
            else:
                best = k if apart[k] > apart[best] else best
        if best < 0:
            return count

        choice.chosen[count] = best
        own = row_at(choice.q, dof, best)
        for k in range(choice.rows):
            other = row_at(choice.q, dof, k)
            far = 0.0
            for joint in range(dof):
                gap = other[joint] - own[joint]
                if choice.endless[joint] != 0:
                    gap -= TAU * math.floor(gap / TAU + 0.5)
                far = max(far, abs(gap))
            apart[k] = min(apart[k], far)
    return choice.most


@entry
def solve(limb: LimbTable, call: CallTable) -> int:
    """For every row go on with its starts until one reaches its goal; returns how many rows did."""
    solved = 0
    call.done = 0
    for row in range(call.rows):
        reached = 1 if search(limb, call, row) else 0
        call.reached[row] = reached
        solved += reached
    return solved
