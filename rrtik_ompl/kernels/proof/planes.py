"""A plane between two bodies at both ends of an interval, in float64.

A plane is found by GJK [35] on the difference of two hulls; its gap is computed over all corners at both ends, so that
a poor search can cost time but never a wrong proof.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rrtik_ompl.kernels.checks.gjk import dot, minus, nearest_on_triangle, scaled
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.frames import carried, origin_of, turned, turned_back, vector_at
from rrtik_ompl.kernels.proof.layout import Corners, Frame, ProofTable, SizeRows, SolidRows
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    choose,
    first_bit,
    highest_of_wide,
    lowest_of_wide,
    rounded_sum,
    spread_wide,
    wide_lanes_at,
)
from rrtik_ompl.kernels.simd.records import row_at, same_place

MOST_STEPS = 20
CONVERGED = 1e-7  # [m]
SHORTEST = 1e-9  # [m] of a vector that has a direction
UPRIGHT = 1e-12  # sine of the angle to a disc's axis, below which the disc has no height
LOWEST = -1e18
NO_BLOCK = 1e9  # more than there are
ANY_WAY = (0.0, 0.0, 1.0)  # unit vector, where none is better


@inlined
def solid_at(proof: ProofTable, number: int) -> SolidRows:
    """What is said of a solid."""
    return row_at(proof.solids, layout.SOLID_SIZE, number)


@inlined
def sizes_at(proof: ProofTable, number: int) -> SizeRows:
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
def farthest(proof: ProofTable, number: int, frame: Frame, way: Any) -> Any:
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


@kernel
def ball_gap(proof: ProofTable, one: int, other: int, frames: Any, wanted: float) -> Any:
    """A lower bound of the gap between the ball of one solid, on the chord between its ends, and another solid.

    Returns:
        The larger of two gaps, to the ball of the other solid on its chord and, if that stands still, to its box [m],
        or the first if it is above ``wanted``; and, if none is, a unit vector from the other solid to the first one.
    """
    sizes = sizes_at(proof, one)
    other_sizes = sizes_at(proof, other)
    radius = sizes[layout.BALL_RADIUS]
    still = same_place(frames[2], frames[3])
    centre = vector_at(sizes, layout.BALL_CENTRE)
    other_centre = vector_at(other_sizes, layout.BALL_CENTRE)
    p = carried(frames[0], centre)
    q = carried(frames[1], centre)
    begin = carried(frames[2], other_centre)
    end = carried(frames[3], other_centre)
    # hulls of both balls: the difference of two points, one on each chord, is nearest to a parallelogram's plane at
    # a distance that the distance of the middles less the half chords bounds
    if still:
        from_other = minus(p, begin)
        chord = minus(q, p)
        share = -dot(from_other, chord) / max(1e-30, dot(chord, chord))
        apart = minus(from_other, scaled(chord, -min(1.0, max(0.0, share))))
        half_chords = 0.0
    else:
        apart = scaled(minus((p[0] + q[0], p[1] + q[1], p[2] + q[2]), minus(begin, scaled(end, -1.0))), 0.5)
        chord = minus(q, p)
        other_chord = minus(end, begin)
        half_chords = 0.5 * (sqrt(dot(chord, chord)) + sqrt(dot(other_chord, other_chord)))
    distance = sqrt(dot(apart, apart))
    gap = distance - half_chords - other_sizes[layout.BALL_RADIUS]
    way = apart
    if gap - radius > wanted:
        return gap - radius, way

    if still:
        to_box = outside_box(other_sizes, point_in(frames[2], p), point_in(frames[2], q))
        length = sqrt(dot(to_box, to_box))
        gap = max(gap, length)
        if length > 0.0:
            way = turned(frames[2], along_box(other_sizes, to_box))
    length = sqrt(dot(way, way))
    if length < SHORTEST:
        return gap - radius, ANY_WAY
    return gap - radius, scaled(way, 1.0 / length)


@inlined
def point_in(frame: Frame, p: Any) -> Any:
    """A point of the surroundings in a frame."""
    return turned_back(frame, minus(p, origin_of(frame)))


@kernel
def outside_box(sizes: SizeRows, p: Any, q: Any) -> Any:
    """How far the chord from p to q, in a solid's frame, stays outside its box, along each axis of the box."""
    return outside_along(sizes, 0, p, q), outside_along(sizes, 1, p, q), outside_along(sizes, 2, p, q)


@inlined
def outside_along(sizes: SizeRows, axis: int, p: Any, q: Any) -> float:
    """See ``outside_box``; 0 if the chord comes between the two sides."""
    way = vector_at(sizes, layout.BOX_AXES + 3 * axis)
    middle = sizes[layout.BOX_MIDDLE + axis]
    half = sizes[layout.BOX_HALF + axis]
    one = dot(way, p) - middle
    other = dot(way, q) - middle
    below = min(one, other)
    above = max(one, other)
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
