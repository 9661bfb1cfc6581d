"""Kernels that check configurations and motions: free, undecided or colliding, ``WIDTH`` configurations at a time.

Joint values stay in float64 until they are reduced to an eighth of a turn, so that neither large angles nor long
motions cost precision: the configurations checked along a motion are those of :class:`rrtik_ompl.world.World`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.checks.narrow_phase import narrow_phase
from rrtik_ompl.fast.checks.obstacle_kernels import along
from rrtik_ompl.fast.checks.sphere_kernels import (
    FRAME_BYTES,
    prepare,
    recheck_last_hit,
    scene_collision,
    self_collision,
)
from rrtik_ompl.fast.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    absolute,
    bits,
    choose,
    double_at,
    field,
    float_at,
    floor,
    int_at,
    lane_numbers,
    lanes_at,
    nearest,
    set_double,
    set_int,
    set_lanes,
    set_wide_lanes,
    single,
    smaller,
    wide_lanes_at,
)
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.layout import (
    ARM,
    COLLIDING,
    FRAMES,
    FREE,
    INNER,
    INNER_LAST,
    INNER_PRIMITIVES,
    OUTER,
    OUTER_LAST,
    OUTER_PRIMITIVES,
    SCRATCH,
    UNDECIDED,
    VALUES,
    WAITING,
)

ALL_LANES = (1 << WIDTH) - 1

QUARTERS_PER_RADIAN = 2.0 / np.pi
QUARTER_HIGH = 1.5707963267948966  # pi / 2 in two parts: the second is what float64 cannot hold of it
QUARTER_LOW = 6.123233995736766e-17

# Polynomials in z = x^2 for |x| <= pi / 4, fitted to the smallest greatest error (Lawson 1961):
# sin x = x + x z S(z), error 1.8e-9; cos x = 1 - z / 2 + z^2 C(z), error 1e-10.
SINE = (np.float32(-0.16666651), np.float32(0.00833198), np.float32(-0.00019496))
COSINE = (np.float32(4.16666469e-02), np.float32(-1.38873672e-03), np.float32(2.44384155e-05))
HALF, ONE, TWO, ONE_AND_HALF = (np.float32(x) for x in (0.5, 1.0, 2.0, 1.5))


@inlined
def sine_and_cosine(angle: Any) -> Any:
    """Sine and cosine of wide lanes as lanes, within 1.5e-7 for angles up to 1e8 [rad]."""
    quarters = nearest(angle * QUARTERS_PER_RADIAN)
    x = single((angle - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW)
    quarter = single(quarters - floor(quarters * 0.25) * 4.0)  # 0, 1, 2 or 3
    z = x * x
    sine = x + x * z * (SINE[0] + z * (SINE[1] + z * SINE[2]))
    cosine = (ONE - HALF * z) + z * z * (COSINE[0] + z * (COSINE[1] + z * COSINE[2]))
    odd = absolute(absolute(quarter - TWO) - ONE) < HALF
    turned_sine, turned_cosine = choose(odd, cosine, sine), choose(odd, sine, cosine)
    return (
        choose(quarter > ONE_AND_HALF, -turned_sine, turned_sine),
        choose(absolute(quarter - ONE_AND_HALF) < ONE, -turned_cosine, turned_cosine),
    )


@kernel
def forward_kinematics(arm: int, scratch: int) -> None:
    """Frames of all joints from the joint values in the scratch memory (the world's own frame is there already)."""
    parents, sliding = field(arm, layout.PARENTS), field(arm, layout.SLIDING)
    values, frames = field(scratch, VALUES), field(scratch, FRAMES)
    for joint in range(field(arm, layout.JOINT_COUNT)):
        parent = frames + FRAME_BYTES * int_at(parents, joint)
        frame = frames + FRAME_BYTES * (joint + 1)
        fixed = field(arm, layout.PLACEMENTS) + 48 * joint
        value = wide_lanes_at(values, joint)
        if int_at(sliding, joint) != 0:
            slide(parent, frame, fixed, single(value))
        else:
            turn(parent, frame, fixed, value)


@inlined
def slide(parent: int, frame: int, fixed: int, value: Any) -> None:
    """Frame of a sliding joint: along its own z."""
    for row in range(3):
        a, b, c = lanes_at(parent, 3 * row), lanes_at(parent, 3 * row + 1), lanes_at(parent, 3 * row + 2)
        x, y, z = rotated(fixed, a, b, c)
        set_lanes(frame, 3 * row, x)
        set_lanes(frame, 3 * row + 1, y)
        set_lanes(frame, 3 * row + 2, z)
        origin = lanes_at(parent, 9 + row) + along(fixed, 9, a, b, c)
        set_lanes(frame, 9 + row, origin + z * value)


@inlined
def turn(parent: int, frame: int, fixed: int, value: Any) -> None:
    """Frame of a turning joint: about its own z."""
    sine, cosine = sine_and_cosine(value)
    for row in range(3):
        a, b, c = lanes_at(parent, 3 * row), lanes_at(parent, 3 * row + 1), lanes_at(parent, 3 * row + 2)
        x, y, z = rotated(fixed, a, b, c)
        set_lanes(frame, 3 * row, x * cosine + y * sine)
        set_lanes(frame, 3 * row + 1, y * cosine - x * sine)
        set_lanes(frame, 3 * row + 2, z)
        origin = lanes_at(parent, 9 + row) + along(fixed, 9, a, b, c)
        set_lanes(frame, 9 + row, origin)


@inlined
def rotated(fixed: int, a: Any, b: Any, c: Any) -> Any:
    """A row (a, b, c) times the rotation of a placement."""
    return (
        a * float_at(fixed, 0) + b * float_at(fixed, 3) + c * float_at(fixed, 6),
        a * float_at(fixed, 1) + b * float_at(fixed, 4) + c * float_at(fixed, 7),
        a * float_at(fixed, 2) + b * float_at(fixed, 5) + c * float_at(fixed, 8),
    )


@kernel
def in_collision(world: int, balls: int, primitives: int, wanted: int, last: int, one: bool) -> Any:
    """Lanes among ``wanted`` in which these balls meet these primitives or each other; just one lane if ``one``."""
    scratch = field(world, SCRATCH)
    if one:
        found = recheck_last_hit(balls, primitives, scratch, wanted, last)
        if found != 0:
            return found
    prepare(balls, scratch)
    found = scene_collision(balls, primitives, scratch, wanted, 0, one, last)
    if found != wanted and not (one and found != 0):
        found |= self_collision(balls, scratch, wanted & ~found, 0, one)
    return found


@inlined
def outer_collision(world: int, wanted: int, one: bool) -> Any:
    """Lanes that the outer balls cannot prove free, for the frames in the scratch memory."""
    last = field(field(world, SCRATCH), OUTER_LAST)
    return in_collision(world, field(world, OUTER), field(world, OUTER_PRIMITIVES), wanted, last, one)


@inlined
def inner_collision(world: int, wanted: int, one: bool) -> Any:
    """Lanes that the inner balls prove colliding, for the frames in the scratch memory."""
    last = field(field(world, SCRATCH), INNER_LAST)
    return in_collision(world, field(world, INNER), field(world, INNER_PRIMITIVES), wanted, last, one)


@inlined
def load_row(world: int, rows: int, row: int, lane: int) -> None:
    """Set the joint values of a lane to a row of an array of float64."""
    joints = field(field(world, ARM), layout.JOINT_COUNT)
    values = field(field(world, SCRATCH), VALUES)
    for joint in range(joints):
        set_double(values, joint * WIDTH + lane, double_at(rows, row * joints + joint))


@kernel
def resolve_doubtful(world: int, rows: int, waiting: int, answers: int) -> None:
    """Answer what a second look finds for the rows that wait: by their inner balls, then by their solids."""
    queue = field(field(world, SCRATCH), WAITING)
    for lane in range(WIDTH):
        load_row(world, rows, int_at(queue, min(lane, waiting - 1)), lane)
    forward_kinematics(field(world, ARM), field(world, SCRATCH))
    wanted = ALL_LANES >> (WIDTH - waiting)
    colliding, open_ = inner_collision(world, wanted, waiting < 0), 0
    if colliding != wanted:
        open_, overlapping = narrow_phase(world, wanted & ~colliding)
        colliding |= overlapping
    for lane in range(waiting):
        answer = COLLIDING if (colliding >> lane) & 1 else UNDECIDED if (open_ >> lane) & 1 else FREE
        set_int(answers, int_at(queue, lane), answer)


@entry
def classify(world: int, rows: int, count: int, answers: int, resolve: int) -> int:
    """Check ``count`` rows of joint values (float64) at an address; int32 answers go to another.

    Rows that are not proven free wait until there are enough of them to fill all lanes of a second look.
    """
    queue, waiting = field(field(world, SCRATCH), WAITING), 0
    for start in range(0, count, WIDTH):
        filled = min(WIDTH, count - start)
        for lane in range(WIDTH):
            load_row(world, rows, start + min(lane, filled - 1), lane)
        forward_kinematics(field(world, ARM), field(world, SCRATCH))
        doubtful = outer_collision(world, ALL_LANES >> (WIDTH - filled), filled < 0)
        for lane in range(filled):
            open_ = (doubtful >> lane) & 1
            set_int(answers, start + lane, open_)
            if open_ and resolve != 0:
                set_int(queue, waiting, start + lane)
                waiting += 1
                if waiting == WIDTH:
                    resolve_doubtful(world, rows, waiting, answers)
                    waiting = 0
    if waiting:
        resolve_doubtful(world, rows, waiting, answers)
    return count


@kernel
def check_part(world: int, start: int, end: int, last: int, first: int, count: int, resolve: bool) -> int:
    """Check ``count`` configurations of a motion between two rows of joint values: those at k / last, k = first, ...

    The lanes are spread over the whole part, so that a collision anywhere shows early.
    """
    joints = field(field(world, ARM), layout.JOINT_COUNT)
    scratch = field(world, SCRATCH)
    values, inner_last = field(scratch, VALUES), field(scratch, INNER_LAST)
    blocks = (count + WIDTH - 1) // WIDTH
    every = bits(lane_numbers() >= 0.0)  # a number: for a constant numba would compile all that is called apart
    answer = FREE
    for block in range(blocks):
        places = smaller(lane_numbers() * float(blocks) + float(block), float(count - 1)) + float(first)
        share = places / float(last)
        for joint in range(joints):
            set_wide_lanes(values, joint, (1.0 - share) * double_at(start, joint) + share * double_at(end, joint))
        forward_kinematics(field(world, ARM), scratch)
        if (
            resolve
            and recheck_last_hit(field(world, INNER), field(world, INNER_PRIMITIVES), scratch, every, inner_last) != 0
        ):
            answer = COLLIDING
            break
        doubtful = outer_collision(world, every, not resolve)
        if doubtful == 0:
            continue
        if not resolve:
            answer = UNDECIDED
            break
        if inner_collision(world, doubtful, resolve) != 0:
            answer = COLLIDING
            break
        open_, overlapping = narrow_phase(world, doubtful)
        if overlapping != 0:
            answer = COLLIDING
            break
        if open_ != 0:
            answer = UNDECIDED
    return answer


@kernel
def check_edge(world: int, start: int, end: int, last: int, resolve: bool) -> int:
    """Check the motion between two rows of joint values by its configurations at k / last, k = 0..last."""
    return check_part(world, start, end, last, 0, last + 1, resolve)


@entry
def classify_edges(world: int, starts: int, ends: int, steps: int, count: int, answers: int, resolve: int) -> int:
    """Check ``count`` motions between rows of two arrays in the given numbers of steps; int32 answers."""
    stride = 8 * field(field(world, ARM), layout.JOINT_COUNT)
    for k in range(count):
        answer = check_edge(world, starts + k * stride, ends + k * stride, int_at(steps, k), resolve != 0)
        set_int(answers, k, answer)
    return count


@entry
def mark_pairs(world: int, row: int, count: int) -> int:
    """For up to ``WIDTH`` rows of joint values: in which of them a pair is not proven free, as bits; see ``mark``."""
    scratch, wanted = field(world, SCRATCH), ALL_LANES >> (WIDTH - count)
    for lane in range(WIDTH):
        load_row(world, row, min(lane, count - 1), lane)
    forward_kinematics(field(world, ARM), scratch)
    narrow_phase(world, wanted)
    balls = field(world, OUTER)
    crossing = field(balls, layout.BODY_COUNT) * field(field(world, OUTER_PRIMITIVES), layout.STANDING_COUNT)
    total: int = crossing + field(balls, layout.PAIR_COUNT)
    return total
