"""GJK in kernels: whether two convex solids are apart, overlap, or neither is proven.

Each verdict is a proof with a margin. Two solids are apart if a plane is found between them; they overlap if points of
their difference surround the origin or a point of both is found. How plane and points are found [35] can then do no
harm: a poor search only leaves a pair undecided. Solids: see ``solid_tables``.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, TypeAlias

import numpy as np

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.layout import COLLIDING, FREE, UNDECIDED, Corners, Frame, SolidTable
from rrtik_ompl.kernels.record import Floats
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import bits, choose, first_bit, float_at, highest, set_lanes, spread
from rrtik_ompl.kernels.tables.accessors import (
    axis_of,
    corner_block,
    disc_of,
    end_block_of,
    first_block_of,
    is_inside,
    round_of,
    sizes_at,
    slack_of,
    solid_at,
)

Frames: TypeAlias = tuple[Frame, Frame, Floats]  # of the first and the second solid; lanes to write to

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
def entry_of(frame: Frame, lane: int, place: int) -> float:
    """A number of a frame in one lane."""
    number: float = np.float64(float_at(frame, place * WIDTH + lane))
    return number


@inlined
def frame_row(frame: Frame, lane: int, row: int) -> Any:
    """A row of a frame's rotation in one lane."""
    place = layout.ROTATION + layout.AXES * row
    return entry_of(frame, lane, place), entry_of(frame, lane, place + 1), entry_of(frame, lane, place + 2)


@inlined
def frame_origin(frame: Frame, lane: int) -> Any:
    """A frame's origin in one lane."""
    place = layout.ORIGIN
    return entry_of(frame, lane, place), entry_of(frame, lane, place + 1), entry_of(frame, lane, place + 2)


@inlined
def carried(frame: Frame, lane: int, p: Any) -> Any:
    """A point of a frame in the world."""
    x = dot(frame_row(frame, lane, 0), p)
    y = dot(frame_row(frame, lane, 1), p)
    z = dot(frame_row(frame, lane, 2), p)
    origin = frame_origin(frame, lane)
    return x + origin[0], y + origin[1], z + origin[2]


@inlined
def corner_at(corners: Corners, block: int, lane: int) -> Any:
    """One corner of a solid."""
    place = layout.AXES * WIDTH * block + lane
    return (
        np.float64(float_at(corners, place)),
        np.float64(float_at(corners, place + WIDTH)),
        np.float64(float_at(corners, place + 2 * WIDTH)),
    )


@kernel
def farthest(solids: SolidTable, number: int, frame: Frame, note: Floats, lane: int, direction: Any) -> Any:
    """The point of a solid's core that lies farthest along a unit vector, in the world. Here lanes hold corners.

    ``note`` is the address of lanes to write to.
    """
    first_row = frame_row(frame, lane, 0)
    second_row = frame_row(frame, lane, 1)
    third_row = frame_row(frame, lane, 2)
    x = first_row[0] * direction[0] + second_row[0] * direction[1] + third_row[0] * direction[2]
    y = first_row[1] * direction[0] + second_row[1] * direction[1] + third_row[1] * direction[2]
    z = first_row[2] * direction[0] + second_row[2] * direction[1] + third_row[2] * direction[2]
    a = np.float32(x)
    b = np.float32(y)
    c = np.float32(z)
    solid = solid_at(solids.solids, number)
    corners = solids.corners
    best = spread(LOWEST)
    where = spread(np.float32(0.0))

    for block in range(first_block_of(solid), end_block_of(solid)):
        along_x, along_y, along_z = corner_block(corners, block)
        height = along_x * a + along_y * b
        height = height + along_z * c
        higher = height > best
        best = choose(higher, height, best)
        where = choose(higher, spread(np.float32(block)), where)

    first = first_bit(bits(best >= highest(best)))
    set_lanes(note, 0, where)
    p = corner_at(corners, int(float_at(note, first)), first)
    sizes = sizes_at(solids.sizes, number)
    radius = disc_of(sizes)

    if radius > 0.0:
        axis = axis_of(sizes)
        across = minus((x, y, z), scaled(axis, dot(axis, (x, y, z))))
        length = sqrt(dot(across, across))
        if length > SHORTEST:
            p = minus(p, scaled(across, -radius / length))

    return carried(frame, lane, p)


@kernel
def nearest_on_triangle(a: Any, b: Any, c: Any) -> Any:
    """The point of a triangle that is nearest to the origin [36, section 5.1.5]; the corners may coincide.

    Whatever rounding does, it is a mean of the corners with weights that are not negative.
    """
    ab = minus(b, a)
    ac = minus(c, a)
    d1 = -dot(ab, a)
    d2 = -dot(ac, a)
    d3 = -dot(ab, b)
    d4 = -dot(ac, b)
    d5 = -dot(ab, c)
    d6 = -dot(ac, c)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    if d3 >= 0.0 and d4 <= d3:
        return b
    if d6 >= 0.0 and d5 <= d6:
        return c

    of_c = d1 * d4 - d3 * d2
    of_b = d5 * d2 - d1 * d6
    of_a = d3 * d6 - d5 * d4
    if nearest_to_edge(of_c, d1, d3):
        return minus(a, scaled(ab, -d1 / (d1 - d3)))
    if nearest_to_edge(of_b, d2, d6):
        return minus(a, scaled(ac, -d2 / (d2 - d6)))
    if of_a <= 0.0 and d4 >= d3 and d5 >= d6 and (d4 - d3) + (d5 - d6) > 0.0:
        return minus(b, scaled(minus(c, b), -(d4 - d3) / ((d4 - d3) + (d5 - d6))))
    return mean_of_corners(a, ab, ac, of_a, of_b, of_c)


@inlined
def nearest_to_edge(outside: float, begin: float, end: float) -> bool:
    """Whether the origin lies beyond an edge of a triangle and between its ends, given its projections on the edge."""
    return outside <= 0.0 and begin >= 0.0 >= end and begin > end


@inlined
def mean_of_corners(a: Any, ab: Any, ac: Any, of_a: float, of_b: float, of_c: float) -> Any:
    """The point of a triangle with barycentric coordinates in proportion to three numbers; a corner where they fail."""
    whole = 1.0 / (of_a + of_b + of_c)
    v = of_b * whole
    w = of_c * whole
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
    side = dot(normal, minus(opposite, a)) / length
    height = -dot(normal, a) / length
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
def difference(
    mine: SolidTable, first: int, others: SolidTable, second: int, frames: Frames, lane: int, direction: Any
) -> Any:
    """The point of (first solid - second solid) that lies farthest against a unit vector."""
    p = farthest(mine, first, frames[0], frames[2], lane, scaled(direction, -1.0))
    return minus(p, farthest(others, second, frames[1], frames[2], lane, direction))


@inlined
def slack_between(mine: SolidTable, first: int, others: SolidTable, second: int) -> float:
    """How far rounding may misplace two solids towards each other [m]."""
    return slack_of(sizes_at(mine.sizes, first)) + slack_of(sizes_at(others.sizes, second))


@kernel
def compare(
    mine: SolidTable, first: int, others: SolidTable, second: int, frames: Frames, lane: int, direction: Any
) -> Any:
    """Compare two solids in one lane, beginning with a plane across the unit vector ``direction``.

    Returns:
        FREE, UNDECIDED or COLLIDING, and the unit vector across the last plane, from the second solid to the first.
    """
    reach = round_of(sizes_at(mine.sizes, first)) + round_of(sizes_at(others.sizes, second))
    slack = slack_between(mine, first, others, second)
    solid = is_inside(solid_at(mine.solids, first)) & is_inside(solid_at(others.solids, second))
    a = difference(mine, first, others, second, frames, lane, direction)
    if dot(direction, a) > reach + slack:
        return FREE, direction

    b = a
    c = a
    v = a

    for _ in range(MOST_STEPS):
        length = sqrt(dot(v, v))
        if length < reach - slack and solid:
            return COLLIDING, direction
        if length < SHORTEST:
            break
        direction = scaled(v, 1.0 / length)
        d = difference(mine, first, others, second, frames, lane, direction)
        height = dot(direction, d)
        if height > reach + slack:
            return FREE, direction
        if height <= 0.0:
            depth = depth_inside(a, b, c, d)
            if depth > slack and solid:
                return COLLIDING, direction
            if depth >= 0.0:
                break

        if length - height < CONVERGED:
            break
        p = nearest_on_triangle(a, b, d)
        q = nearest_on_triangle(b, c, d)
        r = nearest_on_triangle(c, a, d)
        to_p = dot(p, p)
        to_q = dot(q, q)
        to_r = dot(r, r)

        if to_p <= to_q and to_p <= to_r:
            c = d
            v = p
        elif to_q <= to_r:
            a = d
            v = q
        else:
            b = d
            v = r

    return UNDECIDED, direction
