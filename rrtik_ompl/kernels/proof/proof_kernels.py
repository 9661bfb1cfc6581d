"""Kernels that prove whole straight motions free of collision.

Schwarzer, Saha and Latombe cover a motion by intervals on which a distance exceeds what two bodies can approach each
other [16]. Here the bound is of second order. Seen from a frame that stands for both bodies, a point of one has at most
the acceleration C, so over an interval of width h it stays within C h^2 / 8 of the chord between its places at the two
ends. A plane that keeps both bodies apart at both ends by more than the sum of these sagittas keeps them apart in
between.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rrtik_ompl.kernels.checks.gjk import dot, scaled
from rrtik_ompl.kernels.checks.neighbour_kernels import apart_on_way
from rrtik_ompl.kernels.layout import CELLS_APART, JointValues
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.cloud_planes import cloud_apart
from rrtik_ompl.kernels.proof.frames import bound_bends, frame_at, node_frames, place_frames, seen_from, vector_at
from rrtik_ompl.kernels.proof.layout import Frame, PairRows, ProofTable
from rrtik_ompl.kernels.proof.planes import (
    ANY_WAY,
    SHORTEST,
    best_plane,
    between_middles,
    beyond_half_space,
    chord_at,
    chords_clear,
    clears,
    make_chord,
    near_in_block,
    put_vector,
    sizes_at,
    solid_at,
    way_to_chord,
)
from rrtik_ompl.kernels.record import Doubles, Ints
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import first_bit
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.simd.unaligned import unaligned_lanes

EAGER = 0.9  # of a ball's radius beyond the body's least half side, which planes may gain; else no plane is searched
BENT = 0.05  # of a ball's radius: up to this sagitta they are searched nevertheless, as halves would hardly bend less
SHARE = 0.25  # of a ball's radius: up to this sagitta planes are searched to the points of a cloud
NARROW = 0.01  # width of an interval from which on they are searched in any case
STILL = 2  # level at which what does not move is given up: by then groups of bodies have been taken apart
PATIENT = 0.1  # width of an interval down to which whole bodies are kept together, if only the sagitta is in the way
FORGET = 1 << 30  # motions or intervals, after which their numbers begin anew


@entry
def prove(proof: ProofTable, starts: JointValues, ends: JointValues, count: int, pairs: Ints, places: Doubles) -> int:
    """Prove motions between rows of joint values (float64); returns how many are not proven.

    Args:
        proof: The table.
        starts: Rows of joint values.
        ends: As many.
        count: How many.
        pairs: Gets for each motion -1, or the number of a pair that is not proven apart (int32).
        places: Gets where on the motion that is, from 0 to 1 (float64).
    """
    not_proven = 0
    joints = proof.joint_count
    for k in range(count):
        pair, place = prove_motion(proof, row_at(starts, joints, k), row_at(ends, joints, k))
        pairs[k] = pair
        places[k] = place
        if pair >= 0:
            not_proven += 1
    return not_proven


@kernel
def prove_motion(proof: ProofTable, start: JointValues, end: JointValues) -> Any:
    """Prove one motion. Returns a pair that is not proven, -1 if there is none, and where on the motion that is.

    Intervals are halved until no pair is left open on them, depth first, the first half first.
    """
    begin_motion(proof, start, end)
    moves = False
    for k in range(proof.joint_count):
        moves |= start[k] != end[k]

    stack = proof.stack
    stack[0] = 0
    stack[1] = 0
    height = 1
    while height > 0:
        height -= 1
        level = stack[2 * height]
        number = stack[2 * height + 1]
        nodes = (layout.NODES - 1) >> level  # from one end of the interval to the other
        visit(proof, start, end, number * nodes)
        visit(proof, start, end, number * nodes + nodes)
        if settle(proof, start, end, level, number) == 0:
            continue
        if level == layout.DEEPEST or (level == STILL and not moves):
            return proof.lists[proof.pair_count * (level + 1)], (number + 0.5) / (1 << level)
        for half in range(2):
            stack[2 * height] = level + 1
            stack[2 * height + 1] = 2 * number + 1 - half
            height += 1
    return -1, 0.0


@kernel
def begin_motion(proof: ProofTable, start: JointValues, end: JointValues) -> None:
    """Make what is computed once a motion: a number, as no node has its frames yet, and the bends of the sweeps."""
    proof.stamp += 1
    if proof.stamp >= FORGET:
        for node in range(layout.NODES):
            proof.stamps[node] = 0
        for pair in range(proof.pair_count):
            proof.way_stamps[pair] = min(proof.way_stamps[pair], 0)
        proof.stamp = 1
    bound_bends(proof, start, end)


@inlined
def begin_interval(proof: ProofTable) -> None:
    """Begin to compare pairs on another interval, or with other frames: no chord is made yet."""
    proof.interval += 1
    if proof.interval >= FORGET:
        for k in range(proof.chord_count):
            proof.chord_stamps[k] = 0
        proof.interval = 1


@kernel
def visit(proof: ProofTable, start: JointValues, end: JointValues, node: int) -> None:
    """Make the frames of a node, a multiple of 1 / 2**DEEPEST of the motion, if this motion has not had it yet."""
    if proof.stamps[node] != proof.stamp:
        proof.stamps[node] = proof.stamp
        place_frames(proof, start, end, node / (layout.NODES - 1), node)


@kernel
def open_first_pairs(
    proof: ProofTable, start: JointValues, end: JointValues, start_frames: Frame, end_frames: Frame
) -> None:
    """List the pairs that the whole motion begins with, but those that are known to be apart on it.

    Neighbours are looked up, and the balls of others are compared in lanes.

    The log is told of each body by planes: its reader knows neither groups nor neighbours.
    """
    if proof.log_room > 0:
        for k in range(proof.body_pair_count):
            proof.lists[k] = k
        proof.counts[0] = proof.body_pair_count
        return

    count = 0
    k = 0
    while k < proof.top_count:
        pair = proof.top_pairs[k]
        length = pair_at(proof, pair)[layout.RUN_LENGTH]
        if length > 1:
            count = list_near(proof, pair, start_frames, end_frames, 1.0, proof.lists, count)
            k += length
            continue
        number = proof.looked_up[k]
        k += 1
        if number >= 0 and proof.margins[pair] <= CELLS_APART and apart_on_way(proof.neighbours, number, start, end):
            continue
        proof.lists[count] = pair
        count += 1
    proof.counts[0] = count


@kernel
def settle(proof: ProofTable, start: JointValues, end: JointValues, level: int, number: int) -> int:
    """Go through the open pairs of an interval and list those that stay open for its halves; returns how many do.

    Where several bodies, or a whole one, cannot be proven apart, what they consist of joins the list.
    """
    nodes = (layout.NODES - 1) >> level
    width = 1.0 / (1 << level)
    begin_frames = node_frames(proof, number * nodes)
    end_frames = node_frames(proof, number * nodes + nodes)
    pairs = row_at(proof.lists, proof.pair_count, level)
    left_open = row_at(proof.lists, proof.pair_count, level + 1)
    telling = proof.log_room > 0
    begin_interval(proof)
    if level == 0:
        open_first_pairs(proof, start, end, begin_frames, end_frames)

    count = proof.counts[level]
    left = 0
    k = 0
    while k < count:
        pair = pairs[k]
        k += 1
        parts = pair_at(proof, pair)
        first = parts[layout.PARTS_FIRST]
        last = parts[layout.PARTS_END]
        if first == last or telling:
            if settled(proof, pair, begin_frames, end_frames, level, number):
                continue
            answer = 0 if first == last else -1
        else:
            answer = beyond(proof, pair, begin_frames, end_frames, width)
            if answer == 1:
                continue

        if answer == 0:
            left_open[left] = pair
            left += 1
            continue
        while first < last:
            length = parts_in_run(proof, first, telling)
            if length > 1:
                count = list_near(proof, first, begin_frames, end_frames, width, pairs, count)
            else:
                pairs[count] = first
                count += 1
            first += length
    proof.counts[level + 1] = left
    return left


@inlined
def parts_in_run(proof: ProofTable, first: int, telling: bool) -> int:
    """How many pairs are compared in lanes from one on, or 1; the log is told of each."""
    return 1 if telling else pair_at(proof, first)[layout.RUN_LENGTH]


@kernel
def list_near(proof: ProofTable, first: int, begin: Frame, end: Frame, width: float, pairs: Ints, count: int) -> int:
    """List the pairs of a run whose balls do not show them apart on an interval behind ``count`` others.

    Returns:
        How many are in the list.
    """
    run = pair_at(proof, first)
    number = run[layout.PAIR_CHORD]
    make_chord(proof, number, begin, end)
    wanted = unaligned_lanes(proof.margins, first) + sagitta(proof, run[layout.ONE_SWEEP], width)
    block = row_at(proof.still, layout.STILL_SIZE * WIDTH, run[layout.RUN_BLOCK])
    near = near_in_block(chord_at(proof, number), block, wanted) & ((1 << run[layout.RUN_LENGTH]) - 1)
    while near != 0:
        pairs[count] = first + first_bit(near)
        count += 1
        near &= near - 1  # without the lowest bit
    return count


@inlined
def pair_at(proof: ProofTable, number: int) -> PairRows:
    """What is said of a pair."""
    return row_at(proof.pairs, layout.PAIR_SIZE, number)


@kernel
def beyond(proof: ProofTable, number: int, begin: Frame, end: Frame, width: float) -> int:
    """Compare a pair of whole bodies: 1 if it is proven apart, 0 if shorter intervals may help, -1 if they will not."""
    pair = pair_at(proof, number)
    other_kind = kind_of(proof, pair[layout.PAIR_OTHER])
    if kind_of(proof, pair[layout.PAIR_ONE]) == layout.UNKNOWN or other_kind == layout.UNKNOWN:
        return -1  # neither has a ball
    if other_kind == layout.HALF_SPACE:
        return -1
    margin = proof.margins[number]
    if balls_clear(proof, pair, begin, end, margin + both_sagittas(proof, pair, width)):
        return 1
    return 0 if width > PATIENT and balls_clear(proof, pair, begin, end, margin) else -1


@inlined
def balls_clear(proof: ProofTable, pair: PairRows, begin: Frame, end: Frame, wanted: float) -> bool:
    """Whether the balls of two solids on their chords, or the box of one at rest, keep more than ``wanted`` [m]."""
    other = pair[layout.PAIR_OTHER]
    number = pair[layout.PAIR_CHORD]
    make_chord(proof, number, begin, end)
    other_number = pair[layout.OTHER_CHORD]
    if other_number >= 0:
        make_chord(proof, other_number, begin, end)
        return chords_clear(chord_at(proof, number), chord_at(proof, other_number), wanted)
    return clears(chord_at(proof, number), sizes_at(proof, other), wanted)


@inlined
def settled(proof: ProofTable, pair: int, begin: Frame, end: Frame, level: int, number: int) -> bool:
    """Whether a pair is proven apart on an interval; the log tells by what."""
    means = apart(proof, pair, begin, end, 1.0 / (1 << level))
    if means != layout.OPEN and proof.log_room > 0:
        log(proof, pair, level, number, means)
    return means != layout.OPEN


@kernel
def apart(proof: ProofTable, number: int, begin: Frame, end: Frame, width: float) -> int:
    """By what a pair is proven apart on an interval, whose ends' frames are given; ``OPEN`` (0) if it is not."""
    pair = pair_at(proof, number)
    one = pair[layout.PAIR_ONE]
    other = pair[layout.PAIR_OTHER]
    kind = kind_of(proof, one)
    other_kind = kind_of(proof, other)
    if kind == layout.UNKNOWN or other_kind == layout.UNKNOWN:
        return layout.OPEN

    margin = proof.margins[number]
    wanted = margin + both_sagittas(proof, pair, width)
    if other_kind == layout.HALF_SPACE:
        frames = pair_frames(proof, pair, begin, end)
        above = kind == layout.CONVEX_SOLID and beyond_half_space(proof, one, other, frames) > wanted
        return layout.BY_PLANE if above else layout.OPEN

    if balls_clear(proof, pair, begin, end, wanted):
        return layout.BY_BALL
    if kind != layout.CONVEX_SOLID or other_kind == layout.WHOLE_BODY:
        return layout.OPEN

    sizes = sizes_at(proof, one)
    bend = wanted - margin
    if other_kind >= layout.CLOUD:
        searching = bend <= SHARE * sizes[layout.BALL_RADIUS] or width <= NARROW
        frames = pair_frames(proof, pair, begin, end)
        return layout.BY_PLANE if cloud_apart(proof, one, other, frames, wanted, searching) else layout.OPEN
    hidden = EAGER * (sizes[layout.BALL_RADIUS] - least(vector_at(sizes, layout.BOX_HALF)))
    bent = width > NARROW and bend > BENT * sizes[layout.BALL_RADIUS]
    if bent and not balls_clear(proof, pair, begin, end, wanted - hidden):
        return layout.OPEN

    way = row_at(proof.ways, 3, number)
    first = vector_at(way, 0)
    frames = pair_frames(proof, pair, begin, end)
    stamp = proof.way_stamps[number]
    if dot(first, first) == 0.0 or (stamp != proof.stamp and stamp != layout.SUGGESTED):
        first = first_way(proof, pair)
    if stamp != layout.SUGGESTED:
        proof.way_stamps[number] = proof.stamp
    found, normal = best_plane(proof, one, other, frames, wanted, first)
    put_vector(way, 0, normal)
    return layout.BY_PLANE if found > wanted else layout.OPEN


@inlined
def least(p: Any) -> float:
    """The least of three numbers."""
    smallest: float = min(p[0], p[1], p[2])
    return smallest


@inlined
def first_way(proof: ProofTable, pair: PairRows) -> Any:
    """The normal of the first plane that is tried between two solids."""
    chord = chord_at(proof, pair[layout.PAIR_CHORD])
    other_number = pair[layout.OTHER_CHORD]
    if other_number < 0:
        return way_to_chord(chord, sizes_at(proof, pair[layout.PAIR_OTHER]))
    way = between_middles(chord, chord_at(proof, other_number))
    length = sqrt(dot(way, way))
    return ANY_WAY if length < SHORTEST else scaled(way, 1.0 / length)


@inlined
def kind_of(proof: ProofTable, solid: int) -> int:
    """What a solid is."""
    kind: int = solid_at(proof, solid)[layout.SOLID_KIND]
    return kind


@inlined
def both_sagittas(proof: ProofTable, pair: PairRows, width: float) -> float:
    """How far the solids of a pair may leave their chords over an interval, together [m]."""
    return sagitta(proof, pair[layout.ONE_SWEEP], width) + sagitta(proof, pair[layout.OTHER_SWEEP], width)


@inlined
def sagitta(proof: ProofTable, sweep: int, width: float) -> float:
    """How far a body may leave its chord over an interval [m]."""
    if sweep < 0:
        return 0.0
    bend: float = proof.bends[sweep]
    return 0.125 * bend * width * width


@inlined
def pair_frames(proof: ProofTable, pair: PairRows, begin: Frame, end: Frame) -> Any:
    """The frames of a pair's first solid at both ends of an interval, and of its second one, seen from the pair's base.

    If the second one stands still there, its two frames are one.
    """
    base = pair[layout.PAIR_BASE]
    one = solid_at(proof, pair[layout.PAIR_ONE])[layout.SOLID_FRAME]
    other = solid_at(proof, pair[layout.PAIR_OTHER])[layout.SOLID_FRAME]
    still = pair[layout.OTHER_SWEEP] < 0
    if base == 0:
        other_begin = frame_at(begin, other)
        return frame_at(begin, one), frame_at(end, one), other_begin, other_begin if still else frame_at(end, other)

    seen = proof.seen
    base_begin = frame_at(begin, base)
    base_end = frame_at(end, base)
    seen_from(base_begin, frame_at(begin, one), frame_at(seen, 0))
    seen_from(base_end, frame_at(end, one), frame_at(seen, 1))
    seen_from(base_begin, frame_at(begin, other), frame_at(seen, 2))
    if not still:
        seen_from(base_end, frame_at(end, other), frame_at(seen, 3))
    return frame_at(seen, 0), frame_at(seen, 1), frame_at(seen, 2), frame_at(seen, 2 if still else 3)


@kernel
def log(proof: ProofTable, pair: int, level: int, number: int, means: int) -> None:
    """Tell by what a pair is proven apart on an interval, as far as there is room."""
    count = proof.log_count
    proof.log_count = count + 1
    if count >= proof.log_room:
        return
    record = row_at(proof.log, layout.LOG_SIZE, count)
    record[layout.LOG_PAIR] = pair
    record[layout.LOG_LEVEL] = level
    record[layout.LOG_NUMBER] = number
    record[layout.LOG_MEANS] = means

    other = pair_at(proof, pair)[layout.PAIR_OTHER]
    way = vector_at(row_at(proof.ways, 3, pair), 0)
    if kind_of(proof, other) == layout.HALF_SPACE:
        way = vector_at(sizes_at(proof, other), layout.DISC_AXIS)
    log_way = row_at(proof.log_ways, 3, count)
    for k in range(3):
        log_way[k] = way[k] if means == layout.BY_PLANE else 0.0
