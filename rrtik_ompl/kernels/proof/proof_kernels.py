"""Kernels that prove whole straight motions free of collision.

Schwarzer, Saha and Latombe cover a motion by intervals on which a distance exceeds what two bodies can approach each
other [16]. Here the bound is of second order. Seen from a frame that stands for both bodies, a point of one has at most
the acceleration C, so over an interval of width h it stays within C h^2 / 8 of the chord between its places at the two
ends. A plane that keeps both bodies apart at both ends by more than the sum of these sagittas keeps them apart in
between.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.gjk import dot
from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.accessors import (
    base_of_pair,
    bends_of,
    body_pair_count_of,
    counts_of,
    end_part_of,
    first_part_of,
    frame_of_solid,
    frames_of,
    joint_count_of,
    kind_of_solid,
    last_stamp_of,
    lists_of,
    log_count_of,
    log_of,
    log_room_of,
    log_ways_of,
    margins_of,
    node_frames,
    one_of_pair,
    one_sweep_of,
    other_of_pair,
    other_sweep_of,
    pair_count_of,
    pairs_of,
    seen_of,
    size_at,
    sizes_at,
    solids_of,
    stack_of,
    stamps_of,
    top_count_of,
    top_pairs_of,
    vector_at,
    ways_of,
)
from rrtik_ompl.kernels.proof.cloud_planes import cloud_apart
from rrtik_ompl.kernels.proof.frames import bound_bends, place_frames, seen_from
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.proof.planes import ball_gap, best_plane, beyond_half_space
from rrtik_ompl.kernels.record import Doubles, Ints
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, int_at, set_double, set_int
from rrtik_ompl.kernels.simd.records import row_at

EAGER = 0.9  # of a ball's radius: bodies that are nearer than the sagitta less this are split at once, not compared
SHARE = 0.25  # of a ball's radius: up to this sagitta bodies are compared with the points of a cloud
NARROW = 0.01  # width of an interval from which on they are compared nevertheless
STILL = 2  # level at which what does not move is given up: by then groups of bodies have been taken apart
PATIENT = 0.1  # width of an interval down to which whole bodies are kept together, if only the sagitta is in the way
FORGET = 1 << 30  # stamps, after which they begin anew


@kernel
def begin_motion(table: ProofTable, start: JointValues, end: JointValues) -> None:
    """Make what is computed once a motion: the stamp of its nodes, the bends of the sweeps."""
    last, stamps = last_stamp_of(table), stamps_of(table)
    stamp = int_at(last, 0) + 1
    if stamp >= FORGET:
        for node in range(layout.NODES):
            set_int(stamps, node, 0)
        stamp = 1
    set_int(last, 0, stamp)
    bound_bends(table, start, end)


@kernel
def visit(table: ProofTable, start: JointValues, end: JointValues, node: int) -> None:
    """Make the frames of a node, a multiple of 1 / 2**DEEPEST of the motion, if this motion has not had it yet."""
    stamps, stamp = stamps_of(table), int_at(last_stamp_of(table), 0)
    if int_at(stamps, node) != stamp:
        set_int(stamps, node, stamp)
        place_frames(table, start, end, node / (layout.NODES - 1), node)


@inlined
def sagitta(table: ProofTable, sweep: int, width: float) -> float:
    """How far a body may leave its chord over an interval [m]."""
    if sweep < 0:
        return 0.0
    bend: float = double_at(bends_of(table), sweep)
    return 0.125 * bend * width * width


@inlined
def placed(table: ProofTable, pair: int, begin: int, end: int) -> Any:
    """The frames of a pair's two solids at both ends of an interval, seen from the pair's base, and their places."""
    pairs, solids, frames, seen = pairs_of(table), solids_of(table), frames_of(table), seen_of(table)
    base, size = base_of_pair(pairs, pair), layout.FRAME_SIZE
    mine = size * frame_of_solid(solids, one_of_pair(pairs, pair))
    other = size * frame_of_solid(solids, other_of_pair(pairs, pair))
    still = other_sweep_of(pairs, pair) < 0
    if base == 0:
        places = (begin + mine, end + mine, begin + other, begin + other if still else end + other)
        return frames, places
    seen_from(frames, begin + mine, begin + size * base, seen, 0)
    seen_from(frames, end + mine, end + size * base, seen, size)
    seen_from(frames, begin + other, begin + size * base, seen, 2 * size)
    if not still:
        seen_from(frames, end + other, end + size * base, seen, 3 * size)
    return seen, (0, size, 2 * size, 2 * size if still else 3 * size)


@kernel
def from_cloud(
    table: ProofTable, one: int, other: int, seen: int, places: Any, wanted: float, bend: float, width: float
) -> int:
    """By what a solid is proven apart from a cloud; not looked for where it bends away too far from its chord [m]."""
    near = bend <= SHARE * size_at(table, one, layout.BALL_RADIUS) or width <= NARROW
    return layout.BY_PLANE if near and cloud_apart(table, one, other, seen, places, wanted) else layout.OPEN


@kernel
def apart(table: ProofTable, pair: int, begin: int, end: int, width: float) -> int:
    """By what a pair is proven apart on an interval, whose ends' frames are given; ``OPEN`` (0) if it is not."""
    pairs, solids, ways = pairs_of(table), solids_of(table), ways_of(table)
    one, other = one_of_pair(pairs, pair), other_of_pair(pairs, pair)
    mine, others = kind_of_solid(solids, one), kind_of_solid(solids, other)
    if mine == layout.UNKNOWN or others == layout.UNKNOWN:
        return layout.OPEN
    kept = double_at(margins_of(table), pair)
    wanted = kept + sagitta(table, one_sweep_of(pairs, pair), width)
    wanted += sagitta(table, other_sweep_of(pairs, pair), width)
    seen, places = placed(table, pair, begin, end)
    if others == layout.HALF_SPACE:
        above = mine == layout.CONVEX_SOLID and beyond_half_space(table, one, other, seen, places) > wanted
        return layout.BY_PLANE if above else layout.OPEN
    gap, way = ball_gap(table, one, other, seen, places, wanted)
    if gap > wanted:
        return layout.BY_BALL
    if mine != layout.CONVEX_SOLID or others == layout.WHOLE_BODY:
        return layout.OPEN
    if others >= layout.CLOUD:
        return from_cloud(table, one, other, seen, places, wanted, wanted - kept, width)
    if width > NARROW and wanted > kept and gap + EAGER * size_at(table, one, layout.BALL_RADIUS) <= wanted:
        return layout.OPEN
    last = vector_at(ways, 3 * pair)
    found, normal = best_plane(table, one, other, seen, places, wanted, last if dot(last, last) > 0.0 else way)
    set_double(ways, 3 * pair, normal[0])
    set_double(ways, 3 * pair + 1, normal[1])
    set_double(ways, 3 * pair + 2, normal[2])
    return layout.BY_PLANE if found > wanted else layout.OPEN


@kernel
def log(table: ProofTable, pair: int, level: int, number: int, means: int) -> None:
    """Tell by what a pair is proven apart on an interval, as far as there is room."""
    count, solids = int_at(log_count_of(table), 0), solids_of(table)
    set_int(log_count_of(table), 0, count + 1)
    if count >= log_room_of(table):
        return
    record, to = log_of(table), layout.LOG_SIZE * count
    set_int(record, to + layout.LOG_PAIR, pair)
    set_int(record, to + layout.LOG_LEVEL, level)
    set_int(record, to + layout.LOG_NUMBER, number)
    set_int(record, to + layout.LOG_MEANS, means)
    other = other_of_pair(pairs_of(table), pair)
    way = vector_at(ways_of(table), 3 * pair)
    if kind_of_solid(solids, other) == layout.HALF_SPACE:
        way = sizes_at(table, other, layout.DISC_AXIS)
    for k in range(3):
        set_double(log_ways_of(table), 3 * count + k, way[k] if means == layout.BY_PLANE else 0.0)


@inlined
def settled(table: ProofTable, pair: int, begin: int, end: int, level: int, number: int) -> bool:
    """Whether a pair is proven apart on an interval; the log tells by what."""
    means = apart(table, pair, begin, end, 1.0 / (1 << level))
    if means != layout.OPEN and log_room_of(table) > 0:
        log(table, pair, level, number, means)
    return means != layout.OPEN


@kernel
def beyond(table: ProofTable, pair: int, begin: int, end: int, width: float) -> int:
    """Compare a pair of whole bodies: 1 if it is proven apart, 0 if shorter intervals may help, -1 if they will not."""
    pairs, solids = pairs_of(table), solids_of(table)
    one, other = one_of_pair(pairs, pair), other_of_pair(pairs, pair)
    others = kind_of_solid(solids, other)
    if kind_of_solid(solids, one) == layout.UNKNOWN or others == layout.UNKNOWN or others == layout.HALF_SPACE:
        return -1  # neither has a ball
    kept = double_at(margins_of(table), pair)
    wanted = kept + sagitta(table, one_sweep_of(pairs, pair), width)
    wanted += sagitta(table, other_sweep_of(pairs, pair), width)
    seen, places = placed(table, pair, begin, end)
    gap, _ = ball_gap(table, one, other, seen, places, wanted)
    if gap > wanted:
        return 1
    return 0 if gap > kept and width > PATIENT else -1


@kernel
def settle(table: ProofTable, level: int, number: int) -> int:
    """Go through the open pairs of an interval and list those that stay open for its halves; returns how many do.

    Where several bodies, or a whole one, cannot be proven apart, what they consist of joins the list.
    """
    pairs, lists, total, step = pairs_of(table), lists_of(table), pair_count_of(table), (layout.NODES - 1) >> level
    begin, end = node_frames(table, number * step), node_frames(table, number * step + step)
    left, row, next_row = 0, total * level, total * (level + 1)
    telling = log_room_of(table) > 0
    count, k = int_at(counts_of(table), level), 0
    while k < count:
        pair = int_at(lists, row + k)
        k += 1
        first, last = first_part_of(pairs, pair), end_part_of(pairs, pair)
        if first == last or telling:
            if settled(table, pair, begin, end, level, number):
                continue
            answer = 0 if first == last else -1
        else:
            answer = beyond(table, pair, begin, end, 1.0 / (1 << level))
            if answer == 1:
                continue
        if answer == 0:
            set_int(lists, next_row + left, pair)
            left += 1
            continue
        for part in range(first, last):
            set_int(lists, row + count, part)
            count += 1
    set_int(counts_of(table), level + 1, left)
    return left


@kernel
def prove_motion(table: ProofTable, start: JointValues, end: JointValues) -> Any:
    """Prove one motion. Returns a pair that is not proven, -1 if there is none, and where on the motion that is."""
    begin_motion(table, start, end)
    lists, stack, full = lists_of(table), stack_of(table), layout.NODES - 1
    moves = False
    for k in range(joint_count_of(table)):
        moves |= double_at(start, k) != double_at(end, k)
    telling = log_room_of(table) > 0  # body by body: who verifies it knows no groups
    count = body_pair_count_of(table) if telling else top_count_of(table)
    for k in range(count):
        set_int(lists, k, k if telling else int_at(top_pairs_of(table), k))
    set_int(counts_of(table), 0, count)
    set_int(stack, 0, 0)
    set_int(stack, 1, 0)
    top = 1
    while top > 0:
        top -= 1
        level, number = int_at(stack, 2 * top), int_at(stack, 2 * top + 1)
        step = full >> level
        visit(table, start, end, number * step)
        visit(table, start, end, number * step + step)
        if settle(table, level, number) == 0:
            continue
        if level == layout.DEEPEST or (level == STILL and not moves):
            return int_at(lists, pair_count_of(table) * (level + 1)), (number + 0.5) / (1 << level)
        for half in range(2):
            set_int(stack, 2 * top, level + 1)
            set_int(stack, 2 * top + 1, 2 * number + 1 - half)
            top += 1
    return -1, 0.0


@entry
def prove(table: ProofTable, starts: JointValues, ends: JointValues, count: int, pairs: Ints, places: Doubles) -> int:
    """Prove motions between rows of joint values (float64); returns how many are not proven.

    Args:
        table: The table of the proof.
        starts: Rows of joint values.
        ends: As many.
        count: How many.
        pairs: Gets for each motion -1, or the number of a pair that is not proven apart (int32).
        places: Gets where on the motion that is, from 0 to 1 (float64).
    """
    open_, joints = 0, joint_count_of(table)
    for k in range(count):
        pair, place = prove_motion(table, row_at(starts, joints, k), row_at(ends, joints, k))
        pairs[k] = pair
        places[k] = place
        if pair >= 0:
            open_ += 1
    return open_
