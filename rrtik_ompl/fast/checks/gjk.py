"""Kernels that compare two convex solids: apart, overlapping or neither.

Each verdict is a proof with a margin. Two solids are apart if a plane is found between them; they overlap if points of
their difference surround the origin or a point of both is found. How plane and points are found (Gilbert, Johnson and
Keerthi 1988) can then do no harm: a poor search only leaves a pair undecided. Solids: see ``solid_tables``.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rrtik_ompl.fast.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.fast.simd.lanes import (
    bits,
    choose,
    double_at,
    field,
    first_bit,
    float_at,
    highest,
    int_at,
    lanes_at,
    set_lanes,
    spread,
)
from rrtik_ompl.fast.tables import layout
from rrtik_ompl.fast.tables.layout import (
    COLLIDING,
    FREE,
    UNDECIDED,
)

MOST_STEPS = 24
CONVERGED = 1e-7  # [m]
SHORTEST = 1e-9  # [m] of a vector that has a direction
SMALLEST_AREA = 1e-10  # [m^2] of two faces that have a side
THINNEST = 1e-6  # [m] height of a tetrahedron that has an inside
LOWEST = np.float32(-1e18)


@inlined
def dot(a: Any, b: Any) -> float:
    """Scalar product."""
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@inlined
def cross(a: Any, b: Any) -> Any:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def minus(a: Any, b: Any) -> Any:
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scaled(a: Any, factor: float) -> Any:
    """A vector times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@inlined
def entry_of(frame: int, lane: int, place: int) -> float:
    """A number of a frame in one lane."""
    number: float = np.float64(float_at(frame, place * WIDTH + lane))
    return number


@inlined
def carried(frame: int, lane: int, p: Any) -> Any:
    """A point of a frame in the world."""
    x = entry_of(frame, lane, 0) * p[0] + entry_of(frame, lane, 1) * p[1] + entry_of(frame, lane, 2) * p[2]
    y = entry_of(frame, lane, 3) * p[0] + entry_of(frame, lane, 4) * p[1] + entry_of(frame, lane, 5) * p[2]
    z = entry_of(frame, lane, 6) * p[0] + entry_of(frame, lane, 7) * p[1] + entry_of(frame, lane, 8) * p[2]
    return x + entry_of(frame, lane, 9), y + entry_of(frame, lane, 10), z + entry_of(frame, lane, 11)


@kernel
def farthest(solids: int, number: int, frame: int, note: int, lane: int, way: Any) -> Any:
    """The point of a solid's core that lies farthest along a unit vector, in the world. Here lanes hold corners.

    ``note`` is the address of lanes to write to.
    """
    x = entry_of(frame, lane, 0) * way[0] + entry_of(frame, lane, 3) * way[1] + entry_of(frame, lane, 6) * way[2]
    y = entry_of(frame, lane, 1) * way[0] + entry_of(frame, lane, 4) * way[1] + entry_of(frame, lane, 7) * way[2]
    z = entry_of(frame, lane, 2) * way[0] + entry_of(frame, lane, 5) * way[1] + entry_of(frame, lane, 8) * way[2]
    a, b, c = np.float32(x), np.float32(y), np.float32(z)
    numbers, corners = field(solids, layout.SOLIDS) + 16 * number, field(solids, layout.CORNERS)
    best, where = spread(LOWEST), spread(np.float32(0.0))
    for block in range(int_at(numbers, 1), int_at(numbers, 2)):
        height = lanes_at(corners, 3 * block) * a + lanes_at(corners, 3 * block + 1) * b
        height = height + lanes_at(corners, 3 * block + 2) * c
        higher = height > best
        best = choose(higher, height, best)
        where = choose(higher, spread(np.float32(block)), where)
    first = first_bit(bits(best >= highest(best)))
    set_lanes(note, 0, where)
    corner = 3 * WIDTH * int(float_at(note, first)) + first
    p = (
        np.float64(float_at(corners, corner)),
        np.float64(float_at(corners, corner + WIDTH)),
        np.float64(float_at(corners, corner + 2 * WIDTH)),
    )
    sizes = field(solids, layout.SIZES) + 8 * layout.SIZE_COUNT * number
    radius = double_at(sizes, layout.DISC)
    if radius > 0.0:
        axis = double_at(sizes, layout.AXIS), double_at(sizes, layout.AXIS + 1), double_at(sizes, layout.AXIS + 2)
        across = minus((x, y, z), scaled(axis, dot(axis, (x, y, z))))
        length = sqrt(dot(across, across))
        if length > SHORTEST:
            p = minus(p, scaled(across, -radius / length))
    return carried(frame, lane, p)


@kernel
def nearest_on_triangle(a: Any, b: Any, c: Any) -> Any:
    """The point of a triangle that is nearest to the origin (Ericson 2005, 5.1.5); the corners may coincide.

    Whatever rounding does, it is a mean of the corners with weights that are not negative.
    """
    ab, ac = minus(b, a), minus(c, a)
    d1, d2, d3, d4, d5, d6 = -dot(ab, a), -dot(ac, a), -dot(ab, b), -dot(ac, b), -dot(ab, c), -dot(ac, c)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    if d3 >= 0.0 and d4 <= d3:
        return b
    if d6 >= 0.0 and d5 <= d6:
        return c
    of_c, of_b, of_a = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if of_c <= 0.0 and d1 >= 0.0 >= d3 and d1 > d3:
        return minus(a, scaled(ab, -d1 / (d1 - d3)))
    if of_b <= 0.0 and d2 >= 0.0 >= d6 and d2 > d6:
        return minus(a, scaled(ac, -d2 / (d2 - d6)))
    if of_a <= 0.0 and d4 >= d3 and d5 >= d6 and (d4 - d3) + (d5 - d6) > 0.0:
        return minus(b, scaled(minus(c, b), -(d4 - d3) / ((d4 - d3) + (d5 - d6))))
    whole = 1.0 / (of_a + of_b + of_c)
    v, w = of_b * whole, of_c * whole
    if not (v >= 0.0 and w >= 0.0 and v + w <= 1.0):
        return a
    return minus(minus(a, scaled(ab, -v)), scaled(ac, -w))


@inlined
def behind(a: Any, b: Any, c: Any, opposite: Any) -> float:
    """How far the origin lies behind the plane of three corners, on the side of the fourth; -1 if there is no side."""
    normal = cross(minus(b, a), minus(c, a))
    length = sqrt(dot(normal, normal))
    if length < SMALLEST_AREA:
        return -1.0
    side, height = dot(normal, minus(opposite, a)) / length, -dot(normal, a) / length
    if abs(side) < THINNEST:
        return -1.0
    return height if side > 0.0 else -height


@kernel
def depth_inside(a: Any, b: Any, c: Any, d: Any) -> float:
    """Distance of the origin from the faces of the tetrahedron that it lies in; negative if it lies outside.

    Where rounding could say which side of a face a corner is on, the origin counts as outside.
    """
    depth: float = min(behind(a, b, c, d), behind(a, b, d, c), behind(a, c, d, b), behind(b, c, d, a))
    return depth


@inlined
def difference(mine: int, first: int, others: int, second: int, frames: Any, lane: int, way: Any) -> Any:
    """The point of (first solid - second solid) that lies farthest against a unit vector."""
    p = farthest(mine, first, frames[0], frames[2], lane, scaled(way, -1.0))
    return minus(p, farthest(others, second, frames[1], frames[2], lane, way))


@inlined
def size_of(solids: int, number: int, place: int) -> float:
    """A number of a solid."""
    size: float = double_at(field(solids, layout.SIZES) + 8 * layout.SIZE_COUNT * number, place)
    return size


@kernel
def compare(mine: int, first: int, others: int, second: int, frames: Any, lane: int, way: Any) -> Any:
    """Compare two solids in one lane, beginning with a plane across the unit vector ``way``.

    Returns:
        FREE, UNDECIDED or COLLIDING, and the unit vector across the last plane, from the second solid to the first.
    """
    reach = size_of(mine, first, layout.ROUND) + size_of(others, second, layout.ROUND)
    slack = size_of(mine, first, layout.SLACK) + size_of(others, second, layout.SLACK)
    solid = int_at(field(mine, layout.SOLIDS), 4 * first + 3) & int_at(field(others, layout.SOLIDS), 4 * second + 3)
    a = difference(mine, first, others, second, frames, lane, way)
    if dot(way, a) > reach + slack:
        return FREE, way
    b, c, v = a, a, a
    for _ in range(MOST_STEPS):
        length = sqrt(dot(v, v))
        if length < reach - slack and solid:
            return COLLIDING, way
        if length < SHORTEST:
            break
        way = scaled(v, 1.0 / length)
        d = difference(mine, first, others, second, frames, lane, way)
        height = dot(way, d)
        if height > reach + slack:
            return FREE, way
        if height <= 0.0:
            depth = depth_inside(a, b, c, d)
            if depth > slack and solid:
                return COLLIDING, way
            if depth >= 0.0:
                break
        if length - height < CONVERGED:
            break
        p, q, r = nearest_on_triangle(a, b, d), nearest_on_triangle(b, c, d), nearest_on_triangle(c, a, d)
        to_p, to_q, to_r = dot(p, p), dot(q, q), dot(r, r)
        if to_p <= to_q and to_p <= to_r:
            c, v = d, p
        elif to_q <= to_r:
            a, v = d, q
        else:
            b, v = d, r
    return UNDECIDED, way
