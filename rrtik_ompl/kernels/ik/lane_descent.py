"""Levenberg-Marquardt from many starts side by side: a lane is a start, and one that has ended takes the next start.

Each start goes the way that :func:`rrtik_ompl.kernels.ik.ik_kernels.descend` would lead it, up to rounding. Of the
starts that reach the goal the first counts, so the answer is that of one start after the other.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.ik_accessors import box_half, free_turn_of, next_pose
from rrtik_ompl.kernels.ik.ik_kinematics import HALF_TURN_COSINE
from rrtik_ompl.kernels.ik.ik_layout import (
    AGE,
    ANGULAR,
    BEFORE,
    COLUMNS,
    ERROR,
    LINEAR,
    MARK,
    MOVES,
    SHARE,
    SQUARE,
    TIPS,
    TWIST_NUMBERS,
    Aim,
    CallTable,
    LimbTable,
)
from rrtik_ompl.kernels.ik.lane_rows import first_row, row_after, slid
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    absolute,
    bits,
    choose,
    floor,
    larger,
    lowest_of_wide,
    set_wide_lanes,
    smaller,
    spread_wide,
    square_root,
    wide_lanes_at,
)
from rrtik_ompl.kernels.simd.lanes import first_bit as first_of
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.simd.wide_angles import wide_sine_and_cosine

UNBOUNDED = 1e300  # squared residual, without unit
SMALLEST_PIVOT = 1e-30


@inlined
def column(joint: int, axis: int) -> int:
    """Place of a number of the Jacobian's column of a coordinate."""
    return COLUMNS + TWIST_NUMBERS * joint + axis


@inlined
def value(limb: LimbTable, joint: int) -> int:
    """Place of a coordinate."""
    return COLUMNS + TWIST_NUMBERS * limb.dof + joint


@inlined
def axis_of(limb: LimbTable, joint: int) -> int:
    """Place of a joint's axis and, behind it, its origin."""
    return COLUMNS + (TWIST_NUMBERS + 1) * limb.dof + TWIST_NUMBERS * joint


@inlined
def entry_of(row: int, other: int) -> int:
    """Place of an entry of the lower half of the square."""
    return SQUARE + row * (row + 1) // 2 + other


@kernel
def move_tips(limb: LimbTable, call: CallTable) -> Any:
    """Set the axes and origins of the joints as seen from the goal; returns the rows of the tips."""
    lanes = call.lanes
    fixed = limb.fixed
    r0 = first_row(call.first, 0)
    r1 = first_row(call.first, 1)
    r2 = first_row(call.first, 2)
    for joint in range(limb.joints):
        fixed = next_pose(fixed)
        place = axis_of(limb, joint)
        set_wide_lanes(lanes, place, r0[2])
        set_wide_lanes(lanes, place + 1, r1[2])
        set_wide_lanes(lanes, place + 2, r2[2])
        set_wide_lanes(lanes, place + 3, r0[3])
        set_wide_lanes(lanes, place + 4, r1[3])
        set_wide_lanes(lanes, place + 5, r2[3])
        moved = wide_lanes_at(lanes, value(limb, limb.column[joint])) * limb.gain[joint] + limb.offset[joint]
        sine = spread_wide(0.0)
        cosine = spread_wide(1.0)
        if limb.sliding[joint] != 0:
            r0 = slid(moved, r0)
            r1 = slid(moved, r1)
            r2 = slid(moved, r2)
        else:
            sine, cosine = wide_sine_and_cosine(moved)
        r0 = row_after(fixed, cosine, sine, r0)
        r1 = row_after(fixed, cosine, sine, r1)
        r2 = row_after(fixed, cosine, sine, r2)
    return r0, r1, r2


@inlined
def missing_turns(free: int, r0: Any, r1: Any, r2: Any) -> Any:
    """Of the turns that tips still need: axes times their sines, and cosines; see :func:`missing_turn`."""
    x = 0.5 * (r1[2] - r2[1])
    y = 0.5 * (r2[0] - r0[2])
    z = 0.5 * (r0[1] - r1[0])
    cosine = 0.5 * (r0[0] + r1[1] + r2[2] - 1.0)
    none = spread_wide(0.0)
    if free == ik_layout.ANY_TURN:
        x, y, z, cosine = none, none, none, spread_wide(1.0)
    elif free == 0:
        x, y, z, cosine = none, r2[0], -r1[0], r0[0]
    elif free == 1:
        x, y, z, cosine = -r2[1], none, r0[1], r1[1]
    elif free == 2:
        x, y, z, cosine = r1[2], -r0[2], none, r2[2]
    return x, y, z, cosine


@inlined
def outside(aim: Aim, axis: int, place: Any) -> Any:
    """How far a coordinate is from the box in which it is free."""
    slack = box_half(aim, axis)
    return larger(smaller(place, slack), -slack) - place


@kernel
def measure_lanes(limb: LimbTable, call: CallTable, aim: Aim, r0: Any, r1: Any, r2: Any) -> Any:
    """Set the residuals, without units; returns their squares, and which tips are within the tolerances."""
    lanes = call.lanes
    free = free_turn_of(aim)
    metre = call.weights[LINEAR]
    chord = call.weights[ANGULAR]
    u = outside(aim, 0, r0[3])
    v = outside(aim, 1, r1[3])
    w = outside(aim, 2, r2[3])
    away = u * u + v * v + w * w
    x, y, z, cosine = missing_turns(free, r0, r1, r2)
    half = square_root(larger(0.5 * (1.0 + cosine), 0.0))
    hidden = half < HALF_TURN_COSINE  # a half turn about an axis that rounding hides: any will do
    x = choose(hidden, spread_wide(1.0 if free != 0 else 0.0), x)
    y = choose(hidden, spread_wide(1.0 if free == 0 else 0.0), y)
    z = choose(hidden, spread_wide(0.0), z)
    scale = 1.0 / choose(hidden, spread_wide(0.5), half)
    x = x * scale
    y = y * scale
    z = z * scale
    turn = x * x + y * y + z * z

    set_wide_lanes(lanes, ERROR + LINEAR, u * metre)
    set_wide_lanes(lanes, ERROR + LINEAR + 1, v * metre)
    set_wide_lanes(lanes, ERROR + LINEAR + 2, w * metre)
    set_wide_lanes(lanes, ERROR + ANGULAR, x * chord)
    set_wide_lanes(lanes, ERROR + ANGULAR + 1, y * chord)
    set_wide_lanes(lanes, ERROR + ANGULAR + 2, z * chord)
    near = aim[ik_layout.POSITION_TOLERANCE]
    small = aim[ik_layout.CHORD_TOLERANCE]
    reached = (away <= near * near) & (turn <= small * small)
    return away * (metre * metre) + turn * (chord * chord), reached


@inlined
def held_weight(call: CallTable, aim: Aim, axis: int) -> Any:
    """The weight of a coordinate of the position: 0 inside the box, where moving along it changes no residual."""
    weight = call.weights[LINEAR + axis]
    inside = absolute(wide_lanes_at(call.lanes, ERROR + LINEAR + axis)) <= 0.0
    full = spread_wide(weight)
    if box_half(aim, axis) > 0.0:
        full = choose(inside, spread_wide(0.0), full)
    return full


@kernel
def differentiate_lanes(limb: LimbTable, call: CallTable, aim: Aim, r0: Any, r1: Any, r2: Any) -> None:
    """Set the columns of the Jacobians, weighted like the residuals."""
    lanes = call.lanes
    free = free_turn_of(aim)
    chord = call.weights[ANGULAR]
    u = held_weight(call, aim, 0)
    v = held_weight(call, aim, 1)
    w = held_weight(call, aim, 2)
    for k in range(TWIST_NUMBERS * limb.dof):
        set_wide_lanes(lanes, COLUMNS + k, spread_wide(0.0))
    own = r0[0], r1[0], r2[0]  # the axis of the tip about which it may turn
    if free == 1:
        own = r0[1], r1[1], r2[1]
    elif free == 2:
        own = r0[2], r1[2], r2[2]

    for joint in range(limb.joints):
        place = axis_of(limb, joint)
        gain = limb.gain[joint]
        x = gain * wide_lanes_at(lanes, place)
        y = gain * wide_lanes_at(lanes, place + 1)
        z = gain * wide_lanes_at(lanes, place + 2)
        to = column(limb.column[joint], LINEAR)
        if limb.sliding[joint] != 0:
            add(lanes, to, u * x, v * y, w * z)
        else:
            a = r0[3] - wide_lanes_at(lanes, place + 3)
            b = r1[3] - wide_lanes_at(lanes, place + 4)
            c = r2[3] - wide_lanes_at(lanes, place + 5)
            add(lanes, to, u * (y * c - z * b), v * (z * a - x * c), w * (x * b - y * a))
            if free == 0 or free == 1 or free == 2:
                share = x * own[0] + y * own[1] + z * own[2]
                x = x - share * own[0]
                y = y - share * own[1]
                z = z - share * own[2]
            add(lanes, to + ANGULAR, chord * x, chord * y, chord * z)


@inlined
def add(lanes: Doubles, place: int, x: Any, y: Any, z: Any) -> None:
    """Add to three wide lanes."""
    set_wide_lanes(lanes, place, wide_lanes_at(lanes, place) + x)
    set_wide_lanes(lanes, place + 1, wide_lanes_at(lanes, place + 1) + y)
    set_wide_lanes(lanes, place + 2, wide_lanes_at(lanes, place + 2) + z)


@inlined
def pull_of(lanes: Doubles, joint: int) -> Any:
    """Dot product of a column with what stands in place of the residual."""
    total = wide_lanes_at(lanes, column(joint, 0)) * wide_lanes_at(lanes, ERROR)
    for axis in range(1, TWIST_NUMBERS):
        total = total + wide_lanes_at(lanes, column(joint, axis)) * wide_lanes_at(lanes, ERROR + axis)
    return total


@kernel
def hold_lanes(limb: LimbTable, lanes: Doubles) -> None:
    """Leave joints out that are at a limit and would be driven beyond it: their columns become 0."""
    for joint in range(limb.dof):
        pull = pull_of(lanes, joint)
        q = wide_lanes_at(lanes, value(limb, joint))
        stopped = ((q <= limb.lower[joint]) & (pull < 0.0)) | ((q >= limb.upper[joint]) & (pull > 0.0))
        if bits(stopped) != 0:
            for axis in range(TWIST_NUMBERS):
                place = column(joint, axis)
                set_wide_lanes(lanes, place, choose(stopped, spread_wide(0.0), wide_lanes_at(lanes, place)))


@kernel
def solve_lanes(limb: LimbTable, lanes: Doubles, damping: Any) -> None:
    """Replace the residuals e by (J J^T + damping)^-1 e, by Cholesky's decomposition."""
    for a in range(TWIST_NUMBERS):
        for b in range(a + 1):
            total = damping
            if a != b:
                total = spread_wide(0.0)
            for k in range(limb.dof):
                total = total + wide_lanes_at(lanes, column(k, a)) * wide_lanes_at(lanes, column(k, b))
            for k in range(b):
                total = total - wide_lanes_at(lanes, entry_of(a, k)) * wide_lanes_at(lanes, entry_of(b, k))
            if a == b:
                total = 1.0 / square_root(larger(total, SMALLEST_PIVOT))
            else:
                total = total * wide_lanes_at(lanes, entry_of(b, b))
            set_wide_lanes(lanes, entry_of(a, b), total)
    for a in range(TWIST_NUMBERS):
        rest = wide_lanes_at(lanes, ERROR + a)
        for k in range(a):
            rest = rest - wide_lanes_at(lanes, entry_of(a, k)) * wide_lanes_at(lanes, ERROR + k)
        set_wide_lanes(lanes, ERROR + a, rest * wide_lanes_at(lanes, entry_of(a, a)))
    for a in range(TWIST_NUMBERS - 1, -1, -1):
        rest = wide_lanes_at(lanes, ERROR + a)
        for k in range(a + 1, TWIST_NUMBERS):
            rest = rest - wide_lanes_at(lanes, entry_of(k, a)) * wide_lanes_at(lanes, ERROR + k)
        set_wide_lanes(lanes, ERROR + a, rest * wide_lanes_at(lanes, entry_of(a, a)))


@kernel
def step_lanes(limb: LimbTable, lanes: Doubles) -> None:
    """Move joints by J^T times what :func:`solve_lanes` left, none too far or beyond a limit."""
    largest = limb.largest_step
    most = spread_wide(largest)
    for joint in range(limb.dof):
        most = larger(most, absolute(pull_of(lanes, joint)))
    share = wide_lanes_at(lanes, MOVES) * (largest / most)
    for joint in range(limb.dof):
        place = value(limb, joint)
        q = wide_lanes_at(lanes, place) + pull_of(lanes, joint) * share
        set_wide_lanes(lanes, place, smaller(larger(q, limb.lower[joint]), limb.upper[joint]))


@kernel
def look(limb: LimbTable, call: CallTable, aim: Aim) -> Any:
    """Measure all lanes where they are; returns which are at the goal, and which have ended."""
    lanes = call.lanes
    r0, r1, r2 = move_tips(limb, call)
    set_row(lanes, 0, r0)
    set_row(lanes, 1, r1)
    set_row(lanes, 2, r2)
    square, reached = measure_lanes(limb, call, aim, r0, r1, r2)

    age = wide_lanes_at(lanes, AGE)
    mark = wide_lanes_at(lanes, MARK)
    left = age - call.patience * floor((age + 0.5) / float(call.patience))
    due = (left < 0.5) & (age > 0.5)
    stalled = due & (square > limb.stalled * mark)
    over = age > call.steps - 0.5
    set_wide_lanes(lanes, MARK, choose((left < 0.5), square, mark))

    share = wide_lanes_at(lanes, SHARE)
    share = choose(square > wide_lanes_at(lanes, BEFORE), share * limb.share_growth, share)
    set_wide_lanes(lanes, SHARE, share)
    set_wide_lanes(lanes, BEFORE, square)
    return bits(reached), bits(reached | stalled | over)


@inlined
def set_row(lanes: Doubles, number: int, row: Any) -> None:
    """Keep a row of the tips."""
    for k in range(4):
        set_wide_lanes(lanes, TIPS + 4 * number + k, row[k])


@inlined
def row_of(lanes: Doubles, number: int) -> Any:
    """A row of the tips."""
    place = TIPS + 4 * number
    return (
        wide_lanes_at(lanes, place),
        wide_lanes_at(lanes, place + 1),
        wide_lanes_at(lanes, place + 2),
        wide_lanes_at(lanes, place + 3),
    )


@kernel
def advance(limb: LimbTable, call: CallTable, aim: Aim) -> None:
    """Take a step in the lanes that move, from where :func:`look` has measured them."""
    lanes = call.lanes
    differentiate_lanes(limb, call, aim, row_of(lanes, 0), row_of(lanes, 1), row_of(lanes, 2))
    hold_lanes(limb, lanes)
    solve_lanes(limb, lanes, limb.damping + wide_lanes_at(lanes, SHARE) * wide_lanes_at(lanes, BEFORE))
    step_lanes(limb, lanes)
    set_wide_lanes(lanes, AGE, wide_lanes_at(lanes, AGE) + wide_lanes_at(lanes, MOVES))


@inlined
def put(lanes: Doubles, place: int, lane: int, number: float) -> None:
    """Set one of wide lanes."""
    lanes[WIDTH * place + lane] = number


@kernel
def begin_lane(limb: LimbTable, call: CallTable, lane: int, number: int, source: Configuration) -> None:
    """Begin a start in a lane; its number is remembered."""
    lanes = call.lanes
    for joint in range(limb.dof):
        put(lanes, value(limb, joint), lane, source[joint])
    put(lanes, SHARE, lane, limb.share)
    put(lanes, MARK, lane, UNBOUNDED)
    put(lanes, BEFORE, lane, UNBOUNDED)
    put(lanes, AGE, lane, 0.0)
    call.starts[lane] = number


@kernel
def take_lane(limb: LimbTable, call: CallTable, lane: int, q: Configuration) -> None:
    """Copy where a lane is."""
    for joint in range(limb.dof):
        q[joint] = call.lanes[WIDTH * value(limb, joint) + lane]


@kernel
def set_moves(call: CallTable, moving: int) -> int:
    """Say which lanes move; how many."""
    count = 0
    for lane in range(WIDTH):
        moves = (moving >> lane) & 1
        put(call.lanes, MOVES, lane, float(moves))
        count += moves
    return count


@kernel
def take_nearest_seed(limb: LimbTable, call: CallTable) -> int:
    """The nearest seed that has not been taken."""
    farness = call.farness
    blocks = limb.seed_count // WIDTH
    least = wide_lanes_at(farness, 0)
    for block in range(1, blocks):
        least = smaller(least, wide_lanes_at(farness, block))
    lowest = lowest_of_wide(least)
    best = 0
    for block in range(blocks):
        which = bits(wide_lanes_at(farness, block) <= lowest)
        if which != 0:
            best = WIDTH * block + first_of(which)
            break
    farness[best] = UNBOUNDED
    return best


@kernel
def search_lanes(limb: LimbTable, call: CallTable, aim: Aim, first: int, q: Configuration) -> int:
    """Walk from seeds, the nearest first, until one reaches the goal; the number of its start, or 0.

    Args:
        limb: The arm.
        call: Its memory; how far the seeds are has been measured.
        aim: The goal, from which :func:`see_from` has seen the arm.
        first: Number of the first start, from 1: those before it are left out.
        q: Where the first that reaches the goal has come to.
    """
    for _ in range(first - 1):
        take_nearest_seed(limb, call)
    number = first
    best = limb.seed_count + 1
    active = 0
    for lane in range(WIDTH):
        seed = 0
        if number <= limb.seed_count:
            seed = take_nearest_seed(limb, call)
            active = active | (1 << lane)
        begin_lane(limb, call, lane, number, row_at(limb.seeds, limb.dof, seed))
        number += 1

    while active != 0:
        reached, ended = look(limb, call, aim)
        moving = active & ~ended
        for lane in range(WIDTH):
            if (active & ended) >> lane & 1 == 0:
                continue
            if (reached >> lane) & 1 != 0 and call.starts[lane] < best:
                best = call.starts[lane]
                take_lane(limb, call, lane, q)
            if best > limb.seed_count and number <= limb.seed_count:
                begin_lane(limb, call, lane, number, row_at(limb.seeds, limb.dof, take_nearest_seed(limb, call)))
                number += 1
            else:
                active = active & ~(1 << lane)
        if best <= limb.seed_count:  # starts behind it no longer matter
            for lane in range(WIDTH):
                if call.starts[lane] > best:
                    active = active & ~(1 << lane)
        call.done += set_moves(call, moving & active)
        advance(limb, call, aim)
    return best if best <= limb.seed_count else 0


@kernel
def walk_lanes(limb: LimbTable, call: CallTable, aim: Aim) -> int:
    """Walk from every row to the one goal of all; returns the most steps that one of them took."""
    most = 0.0
    number = 0
    active = 0
    for lane in range(WIDTH):
        row = min(number, call.rows - 1)
        if number < call.rows:
            active = active | (1 << lane)
        begin_lane(limb, call, lane, row, row_at(call.q, limb.dof, row))
        number += 1

    while active != 0:
        reached, ended = look(limb, call, aim)
        moving = active & ~ended
        for lane in range(WIDTH):
            if (active & ended) >> lane & 1 == 0:
                continue
            row = call.starts[lane]
            take_lane(limb, call, lane, row_at(call.q, limb.dof, row))
            call.reached[row] = (reached >> lane) & 1
            most = max(most, call.lanes[WIDTH * AGE + lane])
            if number < call.rows:
                begin_lane(limb, call, lane, number, row_at(call.q, limb.dof, number))
                number += 1
            else:
                active = active & ~(1 << lane)
        set_moves(call, moving)
        advance(limb, call, aim)
    return int(most)
