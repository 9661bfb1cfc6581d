"""Planes between a body and the points of a cloud, at both ends of an interval.

What a box around the body at both ends keeps away needs no search: each point has one of the box's faces between itself
and the body. For the other points of a block one plane is searched, and if there is none, one for each of them.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rrtik_ompl.kernels.checks.gjk import dot, minus, scaled
from rrtik_ompl.kernels.clouds.accessors import PARTS, blocks_of, coordinates_at, point_at
from rrtik_ompl.kernels.clouds.kernels import next_block
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.accessors import (
    cloud_poses_of,
    clouds_of,
    corners_of,
    first_block_of,
    kind_of_solid,
    size_at,
    sizes_at,
    solids_of,
    vector_at,
)
from rrtik_ompl.kernels.proof.frames import carried, turned, turned_back
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.proof.planes import SHORTEST, best_plane, corner_at
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import bits, field, first_bit, set_double, set_int, set_wide_lanes, spread_wide
from rrtik_ompl.kernels.simd.vectors import along
from rrtik_ompl.kernels.tables.cloud_layout import CloudTable, PointBlocks

ALONG_X, ALONG_Y, ALONG_Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SINGLE_ROUNDING = 1e-6  # of a point's place in a box, in single precision, relative to the coordinates


@inlined
def box_axis(table: ProofTable, solid: int, axis: int) -> Any:
    """An axis of a solid's box in the solid's frame."""
    return sizes_at(table, solid, layout.BOX_AXES + 3 * axis)


@inlined
def box_middle(table: ProofTable, solid: int) -> Any:
    """The middle of a solid's box in the solid's frame."""
    m = sizes_at(table, solid, layout.BOX_MIDDLE)
    a, b, c = box_axis(table, solid, 0), box_axis(table, solid, 1), box_axis(table, solid, 2)
    return minus(minus(scaled(a, m[0]), scaled(b, -m[1])), scaled(c, -m[2]))


@inlined
def spread_along(table: ProofTable, solid: int, seen: int, place: int, way: Any) -> float:
    """Half the extent of a solid's box along a vector of the surroundings; its frame is at a place of ``seen``."""
    own, half = turned_back(seen, place, way), sizes_at(table, solid, layout.BOX_HALF)
    a = abs(dot(box_axis(table, solid, 0), own)) * half[0]
    b = abs(dot(box_axis(table, solid, 1), own)) * half[1]
    extent: float = a + b + abs(dot(box_axis(table, solid, 2), own)) * half[2]
    return extent


@inlined
def span_along(table: ProofTable, solid: int, seen: int, places: Any, way: Any, origin: Any) -> Any:
    """Middle and half extent along a vector of a solid's box at both ends, counted from an origin."""
    centre = box_middle(table, solid)
    p = dot(minus(carried(seen, places[0], centre), origin), way)
    q = dot(minus(carried(seen, places[1], centre), origin), way)
    a, b = spread_along(table, solid, seen, places[0], way), spread_along(table, solid, seen, places[1], way)
    low, high = min(p - a, q - b), max(p + a, q + b)
    return 0.5 * (low + high), 0.5 * (high - low)


@inlined
def single(p: Any) -> Any:
    """A vector in single precision."""
    return np.float32(p[0]), np.float32(p[1]), np.float32(p[2])


@inlined
def points_in_box(points: PointBlocks, block: int, axes: Any, middle: Any, half: Any) -> int:
    """The points of a block, as bits, that lie in a box, given along its axes. Here lanes hold points."""
    found = 0
    for part in range(PARTS):
        x, y = coordinates_at(points, block, 0, part), coordinates_at(points, block, 1, part)
        z = coordinates_at(points, block, 2, part)
        a, b, c = along(axes[0], x, y, z), along(axes[1], x, y, z), along(axes[2], x, y, z)
        inside = (a >= middle[0] - half[0]) & (a <= middle[0] + half[0])
        inside = inside & (b >= middle[1] - half[1]) & (b <= middle[1] + half[1])
        inside = inside & (c >= middle[2] - half[2]) & (c <= middle[2] + half[2])
        found |= bits(inside) << (WIDTH * part)
    return found


@inlined
def put_corner(table: ProofTable, other: int, number: int, poses: int, pose: int, p: Any) -> None:
    """Let a point of a cloud be a corner of the solid that stands for it, the only one if it is a block's first."""
    p = carried(poses, pose, (np.float64(p[0]), np.float64(p[1]), np.float64(p[2])))
    corners, block = corners_of(table), first_block_of(solids_of(table), other) + number // WIDTH
    lane = number % WIDTH
    for axis in range(3):
        if lane == 0:
            set_wide_lanes(corners, 3 * block + axis, spread_wide(p[axis]))
        else:
            set_double(corners, (3 * block + axis) * WIDTH + lane, p[axis])


@inlined
def count_corners(table: ProofTable, other: int, count: int) -> None:
    """Say how many corners the solid that stands for a cloud has."""
    solids = solids_of(table)
    end = first_block_of(solids, other) + (count + WIDTH - 1) // WIDTH
    set_int(solids, layout.SOLID_SIZE * other + layout.END_BLOCK, end)


@inlined
def towards(table: ProofTable, one: int, other: int, seen: int, places: Any) -> Any:
    """A unit vector from the first corner of the solid that stands for a cloud to the other solid."""
    corner = corner_at(corners_of(table), first_block_of(solids_of(table), other), 0)
    way = minus(carried(seen, places[0], box_middle(table, one)), corner)
    length = sqrt(dot(way, way))
    return scaled(way, 1.0 / length) if length > SHORTEST else (0.0, 0.0, 1.0)


@kernel
def points_apart(
    table: ProofTable, one: int, other: int, seen: int, places: Any, wanted: float, points: PointBlocks, found: Any
) -> bool:
    """Whether planes keep points of a block, given as bits, from a solid at both ends by more than ``wanted``."""
    poses, pose = cloud_poses_of(table), layout.FRAME_SIZE * (kind_of_solid(solids_of(table), other) - layout.CLOUD)
    block, left = found
    count, rest = 0, left
    while rest != 0:
        put_corner(table, other, count, poses, pose, point_at(points, block, first_bit(rest)))
        count += 1
        rest &= rest - 1
    count_corners(table, other, count)
    gap, _ = best_plane(table, one, other, seen, places, wanted, towards(table, one, other, seen, places))
    if gap > wanted:
        return True
    if count == 1:
        return False
    count_corners(table, other, 1)
    while left != 0:
        put_corner(table, other, 0, poses, pose, point_at(points, block, first_bit(left)))
        gap, _ = best_plane(table, one, other, seen, places, wanted, towards(table, one, other, seen, places))
        if gap <= wanted:
            return False
        left &= left - 1
    return True


@kernel
def cloud_apart(table: ProofTable, one: int, other: int, seen: int, places: Any, wanted: float) -> bool:
    """Whether every ball of a cloud is apart from a solid, at both ends of an interval, by more than ``wanted``.

    Args:
        table: The table.
        one: The solid.
        other: The solid that stands for the cloud.
        seen: Frames, all seen from the world.
        places: Of the first solid's frame at begin and end.
        wanted: See above [m].
    """
    number = kind_of_solid(solids_of(table), other) - layout.CLOUD
    cloud: CloudTable = field(clouds_of(table), number)
    poses, pose = cloud_poses_of(table), layout.FRAME_SIZE * number
    reach = wanted + size_at(table, other, layout.ROUND)
    origin = vector_at(poses, pose + layout.SHIFT)
    # around the solid at both ends, along the cloud's axes: where to look for points
    x, y, z = turned(poses, pose, ALONG_X), turned(poses, pose, ALONG_Y), turned(poses, pose, ALONG_Z)
    u, v = span_along(table, one, seen, places, x, origin), span_along(table, one, seen, places, y, origin)
    w = span_along(table, one, seen, places, z, origin)
    size = max(abs(u[0]) + u[1], abs(v[0]) + v[1], abs(w[0]) + w[1]) + reach
    around = reach + SINGLE_ROUNDING * (1.0 + size)
    middle, half = (u[0], v[0], w[0]), (u[1] + around, v[1] + around, w[1] + around)
    low, high = single(minus(middle, half)), single(minus(middle, scaled(half, -1.0)))
    # the same along the solid's own axes at the begin
    a = turned(seen, places[0], box_axis(table, one, 0))
    b = turned(seen, places[0], box_axis(table, one, 1))
    c = turned(seen, places[0], box_axis(table, one, 2))
    u, v = span_along(table, one, seen, places, a, origin), span_along(table, one, seen, places, b, origin)
    w = span_along(table, one, seen, places, c, origin)
    axes = (
        single(turned_back(poses, pose, a)),
        single(turned_back(poses, pose, b)),
        single(turned_back(poses, pose, c)),
    )
    around = reach + 8.0 * SINGLE_ROUNDING * (1.0 + size)
    middles, halves = single((u[0], v[0], w[0])), single((u[1] + around, v[1] + around, w[1] + around))
    points, block = blocks_of(cloud), -1
    while True:
        block = next_block(cloud, low, high, block)
        if block < 0:
            return True
        found = points_in_box(points, block, axes, middles, halves)
        if found != 0 and not points_apart(table, one, other, seen, places, wanted, points, (block, found)):
            return False
