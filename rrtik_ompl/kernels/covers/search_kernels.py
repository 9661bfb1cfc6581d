"""The loops of the search for a cover: reaches of balls, greedy set cover, the nearest points of a surface.

Most numbers are of 32 bits, as the search only looks for good centres: what a ball must hold is measured anew at last.
"""

from __future__ import annotations

import math
from typing import Any

from numpy import float32

from rrtik_ompl.kernels.covers.search_layout import BOX_POINTS, CENTRE, DEPTH, FAR, MOVED
from rrtik_ompl.kernels.record import Doubles, Floats, Ints, Wholes
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    first_bit,
    highest,
    lanes_at,
    larger,
    lowest,
    set_lanes,
    spread,
    square_root,
)
from rrtik_ompl.kernels.simd.records import row_at
from rrtik_ompl.kernels.simd.vectors import squared


@entry
def reach_table(points: Floats, start: Wholes, elements: int, centres: Floats, blocks: int, table: Floats) -> int:
    """The radius that a ball about each centre needs to hold each element, whose rows are blocks of centres.

    Args:
        points: Centre and radius of each ball of an element, rows of four.
        start: First ball of each element, and how many balls there are.
        elements: How many.
        centres: All x, all y, all z.
        blocks: How many blocks of ``WIDTH`` centres.
        table: Rows of a block of radii for each element.
    """
    for block in range(blocks):
        x = lanes_at(centres, block)
        y = lanes_at(centres, blocks + block)
        z = lanes_at(centres, 2 * blocks + block)
        for element in range(elements):
            reach = spread(float32(0.0))
            for k in range(start[element], start[element + 1]):
                ball = row_at(points, 4, k)
                reach = larger(reach, square_root(squared(x - ball[0], y - ball[1], z - ball[2])) + ball[3])
            set_lanes(table, element * blocks + block, reach)
    return 0


@entry
def greedy_cover(
    protrusions: Floats, columns: int, rows: int, allowed: Floats, gains: Ints, held: Ints, chosen: Ints,
    most: int,
) -> int:  # fmt: skip
    """Choose rows that together hold every column, always the one that adds most columns; how many they are.

    Args:
        protrusions: Of each row's ball if it holds a column, all those of a column together.
        columns: How many.
        rows: How many.
        allowed: The largest protrusion, one number.
        gains: Scratch, one for each row.
        held: Scratch, one for each column.
        chosen: The rows, room for ``most``.
        most: Where there would be more rows, there is no cover, and the answer is ``most + 1``.
    """
    limit = allowed[0]
    for row in range(rows):
        gains[row] = 0
    for column in range(columns):
        held[column] = 0
        of_column = row_at(protrusions, rows, column)
        for row in range(rows):
            gains[row] += of_column[row] <= limit

    count = 0
    missing = columns
    while missing > 0:
        best = 0
        for row in range(1, rows):
            if gains[row] > gains[best]:
                best = row
        if count == most or gains[best] == 0:
            return most + 1
        chosen[count] = best
        count += 1
        for column in range(columns):
            of_column = row_at(protrusions, rows, column)
            if held[column] == 0 and of_column[best] <= limit:
                held[column] = 1
                missing -= 1
                for row in range(rows):
                    gains[row] -= of_column[row] <= limit
    return count


@inlined
def to_box(boxes: Floats, blocks: int, block: int, x: Any, y: Any, z: Any) -> Any:
    """Squared distances of a point from a block of boxes."""
    dx = larger(larger(lanes_at(boxes, block) - x, x - lanes_at(boxes, 3 * blocks + block)), float32(0.0))
    dy = larger(larger(lanes_at(boxes, blocks + block) - y, y - lanes_at(boxes, 4 * blocks + block)), float32(0.0))
    dz = larger(larger(lanes_at(boxes, 2 * blocks + block) - z, z - lanes_at(boxes, 5 * blocks + block)), float32(0.0))
    return squared(dx, dy, dz)


@kernel
def nearest(x: Any, y: Any, z: Any, surface: Floats, boxes: Floats, blocks: int, bounds: Floats) -> tuple[Any, int]:
    """Squared distance of a point from the nearest of the surface's points, and the number of that."""
    least = FAR
    first = 0
    for block in range(blocks):
        gap = to_box(boxes, blocks, block, x, y, z)
        set_lanes(bounds, block, gap)
        low = lowest(gap)
        if low < least:
            least = low
            first = block

    first = first * WIDTH + first_bit(bits(lanes_at(bounds, first) <= least))
    best = FAR
    at = 0
    for turn in range(-1, blocks):
        if turn < 0:
            wanted = 1
            base = first
        else:
            wanted = bits(lanes_at(bounds, turn) < best)
            base = turn * WIDTH
        while wanted != 0:
            box = base + first_bit(wanted)
            wanted &= wanted - 1
            parts = BOX_POINTS // WIDTH
            for part in range(parts):
                place = 3 * parts * box + part
                gap = squared(
                    lanes_at(surface, place) - x,
                    lanes_at(surface, place + parts) - y,
                    lanes_at(surface, place + 2 * parts) - z,
                )
                low = lowest(gap)
                if low < best:
                    best = low
                    at = box * BOX_POINTS + part * WIDTH + first_bit(bits(gap <= low))
    return best, at


@entry
def nearest_of_each(
    queries: Doubles, count: int, surface: Floats, boxes: Floats, blocks: int, bounds: Floats, distances: Doubles,
    places: Wholes,
) -> int:  # fmt: skip
    """Distance of each query, rows of three, from the nearest of the surface's points, and the number of that.

    Args:
        queries: Rows of three numbers.
        count: How many.
        surface: The points in boxes of ``BOX_POINTS``: all x, all y, all z of a box.
        boxes: Lowest x of all boxes, y, z, and the highest ones.
        blocks: How many blocks of ``WIDTH`` boxes.
        bounds: Scratch, one for each box.
        distances: One for each query.
        places: One for each query.
    """
    for k in range(count):
        query = row_at(queries, 3, k)
        gap, at = nearest(float32(query[0]), float32(query[1]), float32(query[2]), surface, boxes, blocks, bounds)
        distances[k] = math.sqrt(gap)
        places[k] = at
    return 0


@inlined
def surface_point(surface: Floats, number: int) -> tuple[float, float, float]:
    """A point of the surface."""
    box = row_at(surface, 3 * BOX_POINTS, number // BOX_POINTS)
    k = number % BOX_POINTS
    return float(box[k]), float(box[BOX_POINTS + k]), float(box[2 * BOX_POINTS + k])


@entry
def recentre(
    balls: Doubles, count: int, first: Wholes, points: Floats, reach: Floats, surface: Floats, boxes: Floats,
    blocks: int, bounds: Floats, steps: int,
) -> int:  # fmt: skip
    """Move each ball to where it protrudes least while it contains its points.

    A centre moves away from the nearest point of the surface and towards its farthest own point, in ever shorter steps.

    Args:
        balls: Centre, and depth in the solid, of each ball, rows of ``MOVED``; replaced by the best ones.
        count: How many.
        first: First block of ``WIDTH`` points of each ball, and how many blocks there are.
        points: x, y, z and radius of each block.
        reach: Scratch, one for each point of a ball.
        surface: See :func:`nearest_of_each`, as for all that follows.
        boxes: See there.
        blocks: See there.
        bounds: See there.
        steps: How often a ball is moved.
    """
    for k in range(count):
        ball = row_at(balls, MOVED, k)
        x, y, z = ball[CENTRE], ball[CENTRE + 1], ball[CENTRE + 2]
        side = 1.0 if ball[DEPTH] > 0.0 else -1.0
        least = float(FAR)
        stride = 0.0
        for step in range(steps + 1):
            gap, at = nearest(float32(x), float32(y), float32(z), surface, boxes, blocks, bounds)
            depth = side * math.sqrt(gap)
            radius = farthest(points, first[k], first[k + 1], reach, float32(x), float32(y), float32(z))
            if radius - depth < least:
                least = radius - depth
                ball[CENTRE], ball[CENTRE + 1], ball[CENTRE + 2], ball[DEPTH] = x, y, z, depth
            if step == 0:
                stride = 0.5 * max(least, 0.0)

            px, py, pz = own_point(points, first[k], first[k + 1], reach, radius)
            ox, oy, oz = px - x, py - y, pz - z
            sx, sy, sz = surface_point(surface, at)
            ix, iy, iz = x - sx, y - sy, z - sz
            length = min(stride / (step + 2.0), 0.25 * max(depth, 0.0))
            outward = length / max(math.sqrt(squared(ox, oy, oz)), 1e-300)
            inward = length / max(math.sqrt(squared(ix, iy, iz)), 1e-300)
            x += outward * ox + inward * ix
            y += outward * oy + inward * iy
            z += outward * oz + inward * iz
    return 0


@kernel
def farthest(points: Floats, begin: int, end: int, reach: Floats, x: Any, y: Any, z: Any) -> Any:
    """The radius that a ball about a place needs to hold blocks of points; that of each is put aside."""
    most = spread(float32(0.0))
    for block in range(begin, end):
        gap = squared(
            lanes_at(points, 4 * block) - x, lanes_at(points, 4 * block + 1) - y, lanes_at(points, 4 * block + 2) - z
        )
        own = square_root(gap) + lanes_at(points, 4 * block + 3)
        set_lanes(reach, block - begin, own)
        most = larger(most, own)
    return highest(most)


@kernel
def own_point(points: Floats, begin: int, end: int, reach: Floats, radius: Any) -> tuple[float, float, float]:
    """The first point that needs that radius."""
    for block in range(begin, end):
        found = bits(lanes_at(reach, block - begin) >= radius)
        if found != 0:
            row = row_at(points, 4 * WIDTH, block)
            k = first_bit(found)
            return float(row[k]), float(row[WIDTH + k]), float(row[2 * WIDTH + k])
    return 0.0, 0.0, 0.0
