"""Kernels of one ball against one primitive: whether it meets the ball, and how far it is away, in all lanes at once.

Which primitives are in reach of a ball at all: :mod:`rrtik_ompl.kernels.checks.broad_phase`. A set of lanes is an
integer, one bit a lane. Primitives: see :mod:`rrtik_ompl.kernels.layout`; a primitive of an unknown kind counts as met
everywhere, and :func:`kinds_known` says so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.clouds.primitive_kernels import cloud_gap, meets_cloud
from rrtik_ompl.kernels.layout import (
    KIND_COUNT,
    Marks,
    Plane,
    PrimitiveHead,
    PrimitiveList,
    PrimitiveShape,
    PrimitiveTable,
)
from rrtik_ompl.kernels.simd.access import float_reader, vector_reader
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import absolute, bits, choose, int_at, larger, set_int, smaller, spread, square_root
from rrtik_ompl.kernels.simd.records import exists
from rrtik_ompl.kernels.simd.vectors import along, squared
from rrtik_ompl.kernels.tables.accessors import (
    Vector,
    centre_of,
    end_plane_of,
    first_axis_of,
    first_plane_of,
    head_at,
    kind_of,
    normal_of,
    offset_of,
    plane_at,
    second_axis_of,
    shape_at,
    standing_body_of,
    third_axis_of,
)

# Numbers of the shapes of primitives
ball_radius_of: Callable[[PrimitiveShape], float] = float_reader(layout.BALL_RADIUS)
capsule_axis_of: Callable[[PrimitiveShape], Vector] = vector_reader(layout.CAPSULE_AXIS)
inverse_square_of: Callable[[PrimitiveShape], float] = float_reader(layout.CAPSULE_INVERSE_SQUARE)
capsule_radius_of: Callable[[PrimitiveShape], float] = float_reader(layout.CAPSULE_RADIUS)
half_sizes_of: Callable[[PrimitiveShape], Vector] = vector_reader(layout.BOX_HALF_SIZES)
cylinder_axis_of: Callable[[PrimitiveShape], Vector] = vector_reader(layout.CYLINDER_AXIS)
half_length_of: Callable[[PrimitiveShape], float] = float_reader(layout.CYLINDER_HALF_LENGTH)
cylinder_radius_of: Callable[[PrimitiveShape], float] = float_reader(layout.CYLINDER_RADIUS)
half_space_normal_of: Callable[[PrimitiveShape], Vector] = vector_reader(layout.HALF_SPACE_NORMAL)
half_space_offset_of: Callable[[PrimitiveShape], float] = float_reader(layout.HALF_SPACE_OFFSET)
share_of: Callable[[PrimitiveShape], float] = float_reader(layout.CONVEX_SHARE)

ALL_LANES = (1 << WIDTH) - 1
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
UNBOUNDED_DISTANCE = np.float32(1e18)  # [m] where there is nothing to measure; its square is a float32 still


@inlined
def kinds_known(primitives: PrimitiveTable) -> bool:
    """Whether every primitive has a formula; they are sorted by kind, so that the first and the last say it."""
    count = primitives.count
    known = count == 0
    if count > 0:
        first = head_at(primitives.heads, 0)
        last = head_at(primitives.heads, count - 1)
        known = kind_of(first) >= 0 and kind_of(last) < KIND_COUNT

    return known


@inlined
def to_capsule(capsule: PrimitiveShape, x: Any, y: Any, z: Any) -> Any:
    """Squared distance from a capsule's axis; x, y, z from its first end."""
    axis = capsule_axis_of(capsule)
    share = smaller(larger(along(axis, x, y, z) * inverse_square_of(capsule), ZERO), ONE)
    return squared(x - share * axis[0], y - share * axis[1], z - share * axis[2])


@inlined
def beyond_faces(box: PrimitiveShape, x: Any, y: Any, z: Any) -> Any:
    """How far a point lies beyond each pair of a box's faces; x, y, z from its centre."""
    half = half_sizes_of(box)
    return (
        absolute(along(first_axis_of(box), x, y, z)) - half[0],
        absolute(along(second_axis_of(box), x, y, z)) - half[1],
        absolute(along(third_axis_of(box), x, y, z)) - half[2],
    )


@inlined
def beyond_ends(cylinder: PrimitiveShape, x: Any, y: Any, z: Any) -> Any:
    """How far a point lies beyond a cylinder's ends, and beyond its side; x, y, z from its centre."""
    axis = cylinder_axis_of(cylinder)
    height = along(axis, x, y, z)
    across = squared(x - height * axis[0], y - height * axis[1], z - height * axis[2])
    return absolute(height) - half_length_of(cylinder), square_root(across) - cylinder_radius_of(cylinder)


@inlined
def plane_gap(planes: Plane, number: int, x: Any, y: Any, z: Any) -> Any:
    """Signed distance of a point from a plane, positive in front of it."""
    plane = plane_at(planes, number)
    return along(normal_of(plane), x, y, z) - offset_of(plane)


@inlined
def half_space_gap(half_space: PrimitiveShape, x: Any, y: Any, z: Any) -> Any:
    """Signed distance of a point from a half-space."""
    return along(half_space_normal_of(half_space), x, y, z) - half_space_offset_of(half_space)


@kernel
def meets_convex(planes: Plane, start: int, end: int, share: Any, x: Any, y: Any, z: Any, radius: float) -> Any:
    """Lanes in which no plane has a ball in front of it. Share 0 stands for the centre only."""
    meeting = bits(spread(ZERO) < ONE)
    for plane in range(start, end):
        meeting &= bits(plane_gap(planes, plane, x, y, z) < share * radius)
        if meeting == 0:
            break

    return meeting


@inlined
def meets_primitive(
    primitives: PrimitiveTable,
    head: PrimitiveHead,
    shape: PrimitiveShape,
    x: Any,
    y: Any,
    z: Any,
    radius: float,
    bound: bool,
    wanted: int,
) -> Any:
    """Lanes in which a ball meets a primitive; ``bound``: the ball only stands for balls inside it.

    Of a cloud only lanes among ``wanted`` are looked at.
    """
    kind = kind_of(head)
    if kind < 0 or kind >= layout.CENTRED_KINDS:
        if kind == layout.HALF_SPACE:
            return bits(half_space_gap(shape, x, y, z) < radius)
        if kind == layout.CONVEX:
            share = ONE if bound else share_of(shape)
            planes = primitives.planes
            return meets_convex(planes, first_plane_of(head), end_plane_of(head), share, x, y, z, radius)

        if kind == layout.CLOUD:
            return meets_cloud(primitives, head, shape, x, y, z, radius, bound, wanted)
        return ALL_LANES

    centre = centre_of(shape)
    x = x - centre[0]
    y = y - centre[1]
    z = z - centre[2]
    if kind == layout.BOX:
        a, b, c = beyond_faces(shape, x, y, z)
        return bits(squared(larger(a, ZERO), larger(b, ZERO), larger(c, ZERO)) < radius * radius)

    if kind == layout.BALL:
        reach = radius + ball_radius_of(shape)
        return bits(squared(x, y, z) < reach * reach)

    if kind == layout.CAPSULE:
        reach = radius + capsule_radius_of(shape)
        return bits(to_capsule(shape, x, y, z) < reach * reach)

    beyond, outside = beyond_ends(shape, x, y, z)  # the last of the kinds with a centre: a cylinder
    beyond = larger(beyond, ZERO)
    outside = larger(outside, ZERO)
    return bits(beyond * beyond + outside * outside < radius * radius)


@kernel
def to_convex(planes: Plane, start: int, end: int, x: Any, y: Any, z: Any) -> Any:
    """Largest height over the planes of a convex primitive; no more than the distance from it."""
    height = plane_gap(planes, start, x, y, z)
    for plane in range(start + 1, end):
        height = larger(height, plane_gap(planes, plane, x, y, z))
    return height


@kernel
def primitive_gap(primitives: PrimitiveTable, number: int, x: Any, y: Any, z: Any, bound: bool) -> Any:
    """Signed distance of a point from a primitive, negative inside; ``bound``: the point stands for others near it."""
    shape = shape_at(primitives.shapes, number)
    head = head_at(primitives.heads, number)
    kind = kind_of(head)

    if kind < 0 or kind >= layout.CENTRED_KINDS:
        if kind == layout.HALF_SPACE:
            return half_space_gap(shape, x, y, z)
        if kind == layout.CONVEX:
            height = to_convex(primitives.planes, first_plane_of(head), end_plane_of(head), x, y, z)
            if bound or share_of(shape) != ZERO:
                return height
            # Outside, the height is too small for an inner primitive.
            return choose(height < ZERO, height, spread(UNBOUNDED_DISTANCE))

        if kind == layout.CLOUD:
            return cloud_gap(primitives, head, shape, x, y, z)
        return spread(-UNBOUNDED_DISTANCE)

    centre = centre_of(shape)
    x = x - centre[0]
    y = y - centre[1]
    z = z - centre[2]
    if kind == layout.BALL:
        return square_root(squared(x, y, z)) - ball_radius_of(shape)
    if kind == layout.CAPSULE:
        return square_root(to_capsule(shape, x, y, z)) - capsule_radius_of(shape)
    if kind == layout.BOX:
        a, b, c = beyond_faces(shape, x, y, z)
        outside = square_root(squared(larger(a, ZERO), larger(b, ZERO), larger(c, ZERO)))
        return outside + smaller(larger(larger(a, b), c), ZERO)

    a, b = beyond_ends(shape, x, y, z)  # the last of the kinds with a centre: a cylinder
    outside = square_root(larger(a, ZERO) * larger(a, ZERO) + larger(b, ZERO) * larger(b, ZERO))
    return outside + smaller(larger(a, b), ZERO)


@kernel
def meets_primitives(
    primitives: PrimitiveTable,
    x: Any,
    y: Any,
    z: Any,
    radius: float,
    bound: bool,
    wanted: int,
    source: PrimitiveList,
    count: int,
    sink: PrimitiveList,
    marks: Marks,
) -> Any:
    """Lanes among ``wanted`` in which a ball meets one of the primitives of a list; those that it meets go to ``sink``.

    Unless ``NO_MARKS``, ``marks`` are one number for each standing body, which collects the lanes that meet it.
    """
    heads = primitives.heads
    shapes = primitives.shapes
    meeting = 0
    kept = 0

    for k in range(count):
        number = int_at(source, k)
        head = head_at(heads, number)
        shape = shape_at(shapes, number)
        found = meets_primitive(primitives, head, shape, x, y, z, radius, bound, wanted) & wanted

        if found != 0:
            meeting |= found
            set_int(sink, kept, number)
            kept += 1
            if exists(marks):
                body = standing_body_of(head)
                set_int(marks, body, int_at(marks, body) | found)

    return meeting, kept
