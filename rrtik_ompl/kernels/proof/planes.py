"""A plane between two bodies at both ends of an interval, in float64.

A plane is found by GJK [35] on the difference of two hulls; its gap is computed over all corners at both ends, so that
a poor search can cost time but never a wrong proof.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rrtik_ompl.kernels.checks.gjk import dot, minus, nearest_on_triangle, scaled
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.accessors import (
    corners_of,
    end_block_of,
    first_block_of,
    size_at,
    sizes_at,
    solids_of,
    vector_at,
)
from rrtik_ompl.kernels.proof.frames import carried, turned_back
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    choose,
    double_at,
    first_bit,
    highest_of_wide,
    lowest_of_wide,
    rounded_sum,
    spread_wide,
    wide_lanes_at,
)

MOST_STEPS = 20
CONVERGED = 1e-7  # [m]
SHORTEST = 1e-9  # [m] of a vector that has a direction
UPRIGHT = 1e-12  # sine of the angle to a disc's axis, below which the disc has no height
LOWEST = -1e18
NO_BLOCK = 1e9  # more than there are


@inlined
def corner_at(corners: int, block: int, lane: int) -> Any:
    """One corner of a block."""
    place = 3 * WIDTH * block + lane
    return double_at(corners, place), double_at(corners, place + WIDTH), double_at(corners, place + 2 * WIDTH)


@inlined
def heights(corners: int, block: int, way: Any) -> Any:
    """How far the corners of a block are along a vector, a lane each."""
    x, y, z = (
        wide_lanes_at(corners, 3 * block),
        wide_lanes_at(corners, 3 * block + 1),
        wide_lanes_at(corners, 3 * block + 2),
    )
    return rounded_sum(rounded_sum(x * way[0], y * way[1]), z * way[2])


@inlined
def highest_corner(corners: int, first: int, end: int, way: Any) -> Any:
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


@kernel
def farthest(table: ProofTable, solid: int, seen: int, place: int, way: Any) -> Any:
    """The point of a solid's core that is farthest along a unit vector; the solid's frame is at a place of ``seen``."""
    corners, solids = corners_of(table), solids_of(table)
    own = turned_back(seen, place, way)
    p = highest_corner(corners, first_block_of(solids, solid), end_block_of(solids, solid), own)
    radius = size_at(table, solid, layout.DISC)
    if radius > 0.0:
        axis = sizes_at(table, solid, layout.DISC_AXIS)
        across = minus(own, scaled(axis, dot(axis, own)))
        length = sqrt(dot(across, across))
        if length > UPRIGHT:
            p = minus(p, scaled(across, -radius / length))
    return carried(seen, place, p)


@inlined
def farthest_of_two(table: ProofTable, solid: int, seen: int, begin: int, end: int, way: Any) -> Any:
    """As ``farthest``, of a solid at the two ends of an interval."""
    p = farthest(table, solid, seen, begin, way)
    if end == begin:
        return p
    q = farthest(table, solid, seen, end, way)
    return q if dot(q, way) > dot(p, way) else p


@kernel
def beyond_half_space(table: ProofTable, one: int, other: int, seen: int, places: Any) -> float:
    """The height of a solid over a half-space, at both ends of an interval."""
    normal = sizes_at(table, other, layout.DISC_AXIS)
    low = farthest_of_two(table, one, seen, places[0], places[1], scaled(normal, -1.0))
    height: float = dot(normal, low) - size_at(table, other, layout.DISC) - size_at(table, one, layout.ROUND)
    return height


@kernel
def best_plane(table: ProofTable, one: int, other: int, seen: int, places: Any, wanted: float, way: Any) -> Any:
    """Search a plane with a gap above ``wanted`` between two solids, each at the two ends of an interval.

    Args:
        table: The table.
        one: The solid above the plane.
        other: The one below.
        seen: Frames, all seen from the frame that the plane is fixed in.
        places: Of the first solid's frame at begin and end, of the second one's at begin and end.
        wanted: Where to end the search [m].
        way: Unit vector of the first plane that is tried.

    Returns:
        The gap of the best plane found [m] and its unit normal.
    """
    around = size_at(table, one, layout.ROUND) + size_at(table, other, layout.ROUND)
    best, best_way, size = LOWEST, way, -LOWEST
    a = b = c = way
    for used in range(MOST_STEPS):
        p = farthest_of_two(table, one, seen, places[0], places[1], scaled(way, -1.0))
        p = minus(p, farthest_of_two(table, other, seen, places[2], places[3], way))
        height = dot(p, way)
        if height - around > best:
            best, best_way = height - around, way
        if best > wanted or size - height < CONVERGED:
            break
        if used == 0:
            a, b, c, nearest = p, p, p, p
        else:
            u, v, w = nearest_on_triangle(a, b, p), nearest_on_triangle(b, c, p), nearest_on_triangle(c, a, p)
            to_u, to_v, to_w = dot(u, u), dot(v, v), dot(w, w)
            if to_u <= to_v and to_u <= to_w:
                c, nearest = p, u
            elif to_v <= to_w:
                a, nearest = p, v
            else:
                b, nearest = p, w
        size = sqrt(dot(nearest, nearest))
        if size - around <= wanted or size < SHORTEST:  # points are that near: no plane can do it
            break
        way = scaled(nearest, 1.0 / size)
    return best, best_way


@kernel
def ball_gap(table: ProofTable, one: int, other: int, seen: int, places: Any, wanted: float) -> Any:
    """A lower bound of the gap between the ball of one solid, on the chord between its ends, and another solid.

    Returns:
        The larger of two gaps, to the ball of the other solid on its chord and, if that stands still, to its box [m],
        or the first if it is above ``wanted``; and, if none is, a unit vector from the other solid to the first one.
    """
    centre = sizes_at(table, one, layout.BALL_CENTRE)
    p, q = carried(seen, places[0], centre), carried(seen, places[1], centre)
    still = places[2] == places[3]
    other_centre = sizes_at(table, other, layout.BALL_CENTRE)
    begin, end = carried(seen, places[2], other_centre), carried(seen, places[3], other_centre)
    # hulls of both balls: the difference of two points, one on each chord, is nearest to a parallelogram's plane at
    # a distance that the distance of the middles less the half chords bounds
    if still:
        from_other, chord = minus(p, begin), minus(q, p)
        share = -dot(from_other, chord) / max(1e-30, dot(chord, chord))
        apart = minus(from_other, scaled(chord, -min(1.0, max(0.0, share))))
        spread = 0.0
    else:
        apart = scaled(minus((p[0] + q[0], p[1] + q[1], p[2] + q[2]), minus(begin, scaled(end, -1.0))), 0.5)
        first_chord, second_chord = minus(q, p), minus(end, begin)
        spread = 0.5 * (sqrt(dot(first_chord, first_chord)) + sqrt(dot(second_chord, second_chord)))
    distance = sqrt(dot(apart, apart))
    gap, way = distance - spread - size_at(table, other, layout.BALL_RADIUS), apart
    if gap - size_at(table, one, layout.BALL_RADIUS) > wanted:
        return gap - size_at(table, one, layout.BALL_RADIUS), way
    if still:
        to_box = outside_box(table, other, turned_back_point(seen, places[2], p), turned_back_point(seen, places[2], q))
        length = sqrt(dot(to_box, to_box))
        gap = max(gap, length)
        if length > 0.0:
            way = along_box(table, other, seen, places[2], to_box)
    length = sqrt(dot(way, way))
    if length < SHORTEST:
        return gap - size_at(table, one, layout.BALL_RADIUS), (0.0, 0.0, 1.0)
    return gap - size_at(table, one, layout.BALL_RADIUS), scaled(way, 1.0 / length)


@inlined
def turned_back_point(seen: int, place: int, p: Any) -> Any:
    """A point in the frame at a place."""
    return turned_back(seen, place, minus(p, vector_at(seen, place + layout.SHIFT)))


@kernel
def outside_box(table: ProofTable, solid: int, p: Any, q: Any) -> Any:
    """How far the chord from p to q, in the solid's frame, stays outside its box, along each axis of the box."""
    x = outside_along(table, solid, 0, p, q)
    y = outside_along(table, solid, 1, p, q)
    return x, y, outside_along(table, solid, 2, p, q)


@inlined
def outside_along(table: ProofTable, solid: int, axis: int, p: Any, q: Any) -> float:
    """See ``outside_box``; 0 if the chord comes between the two sides."""
    way = sizes_at(table, solid, layout.BOX_AXES + 3 * axis)
    middle, half = size_at(table, solid, layout.BOX_MIDDLE + axis), size_at(table, solid, layout.BOX_HALF + axis)
    one, other = dot(way, p) - middle, dot(way, q) - middle
    below, above = min(one, other), max(one, other)
    return max(0.0, below - half) + min(0.0, above + half)


@inlined
def along_box(table: ProofTable, solid: int, seen: int, place: int, p: Any) -> Any:
    """A vector along the axes of a solid's box, in the frame that the solid is seen from."""
    a, b = sizes_at(table, solid, layout.BOX_AXES), sizes_at(table, solid, layout.BOX_AXES + 3)
    c = sizes_at(table, solid, layout.BOX_AXES + 6)
    own = (
        a[0] * p[0] + b[0] * p[1] + c[0] * p[2],
        a[1] * p[0] + b[1] * p[1] + c[1] * p[2],
        a[2] * p[0] + b[2] * p[1] + c[2] * p[2],
    )
    x = dot(vector_at(seen, place), own)
    y = dot(vector_at(seen, place + 3), own)
    return x, y, dot(vector_at(seen, place + 6), own)
