"""A plane between two bodies at both ends of an interval, in float64.

A plane is found by GJK [35] on the difference of two hulls; its gap is computed over all corners at both ends, so that
a poor search can cost time but never a wrong proof.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rrtik_ompl.kernels.checks.gjk import dot, minus, nearest_on_triangle, scaled
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.frames import carried, frame_at, origin_of, turned_back, vector_at
from rrtik_ompl.kernels.proof.layout import (
    CarriedSolids,
    ChordRows,
    Corners,
    Frame,
    ProofTable,
    SizeRows,
    SolidRows,
    StillBlocks,
)
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    choose,
    first_bit,
    highest_of_wide,
    larger,
    lowest_of_wide,
    rounded_sum,
    smaller,
    spread_wide,
    wide_lanes_at,
)
from rrtik_ompl.kernels.simd.records import row_at, same_place

MOST_STEPS = 20
CONVERGED = 1e-7  # [m]
SHORTEST = 1e-9  # [m] of a vector that has a direction
SHORTEST_SQUARE = 1e-30  # [m^2] of a chord that has a length
UPRIGHT = 1e-12  # sine of the angle to a disc's axis, below which the disc has no height
LOWEST = -1e18
NO_BLOCK = 1e9  # more than there are
ANY_WAY = (0.0, 0.0, 1.0)  # unit vector, where none is better


@inlined
def solid_at(proof: CarriedSolids, number: int) -> SolidRows:
    """What is said of a solid."""
    return row_at(proof.solids, layout.SOLID_SIZE, number)


@inlined
def sizes_at(proof: CarriedSolids, number: int) -> SizeRows:
    """The sizes of a solid."""
    return row_at(proof.sizes, layout.SIZE_COUNT, number)


@kernel
def best_plane(proof: ProofTable, one: int, other: int, frames: Any, wanted: float, way: Any) -> Any:
    """Search a plane with a gap above ``wanted`` between two solids, each at the two ends of an interval.

    Args:
        proof: The table.
        one: The solid above the plane.
        other: The one below.
        frames: Of the first solid at begin and end, of the second one at begin and end; all seen from the frame that
            the plane is fixed in.
        wanted: Where to end the search [m].
        way: Unit vector of the first plane that is tried.

    Returns:
        The gap of the best plane found [m] and its unit normal.
    """
    around = sizes_at(proof, one)[layout.ROUND] + sizes_at(proof, other)[layout.ROUND]
    best = LOWEST
    best_way = way
    distance = -LOWEST  # of the simplex a, b, c from the origin
    a = b = c = way
    for step in range(MOST_STEPS):
        p = farthest_of_two(proof, one, frames[0], frames[1], scaled(way, -1.0))
        p = minus(p, farthest_of_two(proof, other, frames[2], frames[3], way))
        height = dot(p, way)
        if height - around > best:
            best = height - around
            best_way = way
        if best > wanted or distance - height < CONVERGED:
            break

        if step == 0:
            a, b, c, nearest = p, p, p, p
        else:  # p takes the place of one of the three corners
            u = nearest_on_triangle(a, b, p)
            v = nearest_on_triangle(b, c, p)
            w = nearest_on_triangle(c, a, p)
            to_u = dot(u, u)
            to_v = dot(v, v)
            to_w = dot(w, w)
            if to_u <= to_v and to_u <= to_w:
                c, nearest = p, u
            elif to_v <= to_w:
                a, nearest = p, v
            else:
                b, nearest = p, w
        distance = sqrt(dot(nearest, nearest))
        if distance - around <= wanted or distance < SHORTEST:  # points are that near: no plane can do it
            break
        way = scaled(nearest, 1.0 / distance)
    return best, best_way


@inlined
def farthest_of_two(proof: ProofTable, solid: int, begin: Frame, end: Frame, way: Any) -> Any:
    """As ``farthest``, of a solid at the two ends of an interval."""
    p = farthest(proof, solid, begin, way)
    if same_place(end, begin):
        return p
    q = farthest(proof, solid, end, way)
    return q if dot(q, way) > dot(p, way) else p


@kernel
def farthest(proof: CarriedSolids, number: int, frame: Frame, way: Any) -> Any:
    """The point of a solid's core, in its frame, that is farthest along a unit vector of the surroundings."""
    solid = solid_at(proof, number)
    sizes = sizes_at(proof, number)
    own = turned_back(frame, way)
    p = highest_corner(proof.corners, solid[layout.FIRST_BLOCK], solid[layout.END_BLOCK], own)
    radius = sizes[layout.DISC]
    if radius > 0.0:
        axis = vector_at(sizes, layout.DISC_AXIS)
        across = minus(own, scaled(axis, dot(axis, own)))
        length = sqrt(dot(across, across))
        if length > UPRIGHT:
            p = minus(p, scaled(across, -radius / length))
    return carried(frame, p)


@inlined
def highest_corner(corners: Corners, first: int, end: int, way: Any) -> Any:
    """The first corner of some blocks that is farthest along a vector. Here lanes hold corners."""
    best = heights(corners, first, way)
    if end - first == 1:
        return corner_at(corners, first, first_bit(bits(best >= highest_of_wide(best))))
    where = spread_wide(float(first))
    for block in range(first + 1, end):
        height = heights(corners, block, way)
        higher = height > best
        best = choose(higher, height, best)
        where = choose(higher, spread_wide(float(block)), where)
    top = best >= highest_of_wide(best)
    block = lowest_of_wide(choose(top, where, spread_wide(NO_BLOCK)))
    return corner_at(corners, int(block), first_bit(bits(top & (where <= block))))


@inlined
def heights(corners: Corners, block: int, way: Any) -> Any:
    """How far the corners of a block are along a vector, a lane each."""
    x = wide_lanes_at(corners, 3 * block)
    y = wide_lanes_at(corners, 3 * block + 1)
    z = wide_lanes_at(corners, 3 * block + 2)
    return rounded_sum(rounded_sum(x * way[0], y * way[1]), z * way[2])


@inlined
def corner_at(corners: Corners, block: int, lane: int) -> Any:
    """One corner of a block."""
    place = 3 * WIDTH * block + lane
    return corners[place], corners[place + WIDTH], corners[place + 2 * WIDTH]


@kernel
def beyond_half_space(proof: ProofTable, one: int, other: int, frames: Any) -> float:
    """The height of a solid over a half-space, at both ends of an interval."""
    half_space = sizes_at(proof, other)
    normal = vector_at(half_space, layout.DISC_AXIS)
    low = farthest_of_two(proof, one, frames[0], frames[1], scaled(normal, -1.0))
    height: float = dot(normal, low) - half_space[layout.DISC] - sizes_at(proof, one)[layout.ROUND]
    return height


@inlined
def chord_at(proof: ProofTable, number: int) -> ChordRows:
    """A chord."""
    return row_at(proof.chords, layout.CHORD_SIZE, number)


@kernel
def make_chord(proof: ProofTable, number: int, begin: Frame, end: Frame) -> None:
    """Make a chord, if this interval has not had it yet, of all frames at begin and end."""
    if proof.chord_stamps[number] == proof.interval:
        return
    proof.chord_stamps[number] = proof.interval
    key = row_at(proof.chord_keys, layout.CHORD_KEY_SIZE, number)
    base = key[layout.CHORD_BASE]
    frame = solid_at(proof, key[layout.CHORD_SOLID])[layout.SOLID_FRAME]
    sizes = sizes_at(proof, key[layout.CHORD_SOLID])
    centre = vector_at(sizes, layout.BALL_CENTRE)
    p = carried(frame_at(begin, frame), centre)
    q = carried(frame_at(end, frame), centre)
    if base != 0:
        p = point_in(frame_at(begin, base), p)
        q = point_in(frame_at(end, base), q)

    chord = chord_at(proof, number)
    way = minus(q, p)
    put_vector(chord, layout.CHORD_BEGIN, p)
    put_vector(chord, layout.CHORD_WAY, way)
    square = dot(way, way)
    chord[layout.CHORD_INVERSE] = 1.0 / max(SHORTEST_SQUARE, square)
    chord[layout.CHORD_HALF] = 0.5 * sqrt(square)
    chord[layout.CHORD_RADIUS] = sizes[layout.BALL_RADIUS]


@inlined
def put_vector(numbers: Any, place: int, p: Any) -> None:
    """Write three numbers from a place of an array on."""
    numbers[place] = p[0]
    numbers[place + 1] = p[1]
    numbers[place + 2] = p[2]


@inlined
def point_in(frame: Frame, p: Any) -> Any:
    """A point of the surroundings in a frame."""
    return turned_back(frame, minus(p, origin_of(frame)))


@kernel
def clears(chord: ChordRows, other: SizeRows, wanted: float) -> bool:
    """Whether a ball on a chord keeps more than ``wanted`` [m] from the ball, or else the box, of a solid at rest.

    Squares are compared, which takes no root.
    """
    apart = from_chord(chord, vector_at(other, layout.BALL_CENTRE))
    square = dot(apart, apart)
    reach = wanted + chord[layout.CHORD_RADIUS]
    far = reach + other[layout.BALL_RADIUS]
    if far < 0.0 or square > far * far:
        return True
    if square <= reach * reach:  # the box is no farther than its middle
        return False
    to_box = outside_box(chord, other)
    return bool(dot(to_box, to_box) > reach * reach)


@kernel
def near_in_block(chord: ChordRows, block: StillBlocks, wanted: Any) -> int:
    """The solids of a block, as bits, from which ``clears`` does not show a ball on a chord. Here lanes hold solids."""
    way = vector_at(chord, layout.CHORD_WAY)
    apart = minus(vector_at(chord, layout.CHORD_BEGIN), lanes_from(block, layout.BALL_CENTRE))
    share = smaller(larger(dot(apart, way) * -chord[layout.CHORD_INVERSE], 0.0), 1.0)
    apart = ahead(apart, (share * way[0], share * way[1], share * way[2]))
    square = dot(apart, apart)
    reach = wanted + chord[layout.CHORD_RADIUS]
    far = reach + wide_lanes_at(block, layout.BALL_RADIUS)
    clear = (far < 0.0) | (square > far * far)

    x = lanes_outside(chord, block, 0)
    y = lanes_outside(chord, block, 1)
    z = lanes_outside(chord, block, 2)
    square_to_box = x * x + y * y + z * z
    near: int = ~bits(clear | (square_to_box > reach * reach))
    return near


@inlined
def lanes_from(block: StillBlocks, row: int) -> Any:
    """Three rows of a block."""
    return wide_lanes_at(block, row), wide_lanes_at(block, row + 1), wide_lanes_at(block, row + 2)


@inlined
def lanes_outside(chord: ChordRows, block: StillBlocks, axis: int) -> Any:
    """As ``outside_along``, of solids in lanes."""
    along = lanes_from(block, layout.BOX_AXES + 3 * axis)
    half = wide_lanes_at(block, layout.BOX_HALF + axis)
    one = dot(along, vector_at(chord, layout.CHORD_BEGIN)) - wide_lanes_at(block, layout.BOX_MIDDLE + axis)
    way = dot(along, vector_at(chord, layout.CHORD_WAY))
    below = one + smaller(way, 0.0)
    above = one + larger(way, 0.0)
    return larger(below - half, 0.0) + smaller(above + half, 0.0)


@inlined
def chords_clear(chord: ChordRows, other: ChordRows, wanted: float) -> bool:
    """Whether two balls, each on a chord, keep more than ``wanted`` [m], wherever they are on them.

    No point of a chord is farther from its middle than half its length.
    """
    apart = between_middles(chord, other)
    reach = wanted + chord[layout.CHORD_RADIUS] + other[layout.CHORD_RADIUS]
    reach += chord[layout.CHORD_HALF] + other[layout.CHORD_HALF]
    return bool(reach < 0.0 or dot(apart, apart) > reach * reach)


@inlined
def between_middles(chord: ChordRows, other: ChordRows) -> Any:
    """The vector from the middle of the second chord to that of the first one."""
    begin = minus(vector_at(chord, layout.CHORD_BEGIN), vector_at(other, layout.CHORD_BEGIN))
    way = minus(vector_at(chord, layout.CHORD_WAY), vector_at(other, layout.CHORD_WAY))
    return ahead(begin, scaled(way, 0.5))


@kernel
def way_to_chord(chord: ChordRows, other: SizeRows) -> Any:
    """A unit vector from a solid at rest, or its box, to a chord."""
    to_box = outside_box(chord, other)
    way = along_box(other, to_box)
    if dot(to_box, to_box) == 0.0:
        way = from_chord(chord, vector_at(other, layout.BALL_CENTRE))
    length = sqrt(dot(way, way))
    return ANY_WAY if length < SHORTEST else scaled(way, 1.0 / length)


@inlined
def from_chord(chord: ChordRows, p: Any) -> Any:
    """The shortest vector from a point to a chord."""
    apart = minus(vector_at(chord, layout.CHORD_BEGIN), p)
    way = vector_at(chord, layout.CHORD_WAY)
    share = -dot(apart, way) * chord[layout.CHORD_INVERSE]
    return ahead(apart, scaled(way, min(1.0, max(0.0, share))))


@inlined
def ahead(p: Any, way: Any) -> Any:
    """The sum of two vectors."""
    return p[0] + way[0], p[1] + way[1], p[2] + way[2]


@inlined
def outside_box(chord: ChordRows, sizes: SizeRows) -> Any:
    """How far a chord, in a solid's frame, stays outside its box, along each axis of the box."""
    return outside_along(chord, sizes, 0), outside_along(chord, sizes, 1), outside_along(chord, sizes, 2)


@inlined
def outside_along(chord: ChordRows, sizes: SizeRows, axis: int) -> float:
    """See ``outside_box``; 0 if the chord comes between the two sides."""
    along = vector_at(sizes, layout.BOX_AXES + 3 * axis)
    half = sizes[layout.BOX_HALF + axis]
    one = dot(along, vector_at(chord, layout.CHORD_BEGIN)) - sizes[layout.BOX_MIDDLE + axis]
    way = dot(along, vector_at(chord, layout.CHORD_WAY))
    below = one + min(0.0, way)
    above = one + max(0.0, way)
    outside: float = max(0.0, below - half) + min(0.0, above + half)
    return outside


@inlined
def along_box(sizes: SizeRows, p: Any) -> Any:
    """A vector that is given along the axes of a solid's box, in the solid's frame."""
    a = vector_at(sizes, layout.BOX_AXES)
    b = vector_at(sizes, layout.BOX_AXES + 3)
    c = vector_at(sizes, layout.BOX_AXES + 6)
    return (
        a[0] * p[0] + b[0] * p[1] + c[0] * p[2],
        a[1] * p[0] + b[1] * p[1] + c[1] * p[2],
        a[2] * p[0] + b[2] * p[1] + c[2] * p[2],
    )
