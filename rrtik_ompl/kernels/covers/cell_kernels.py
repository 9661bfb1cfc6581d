"""Surfaces cut into the cells of a grid, and winding numbers at its corners, in kernels.

All coordinates are those of the grid, in which a cell has unit sides.
"""

from __future__ import annotations

import math

from rrtik_ompl.kernels.covers.cell_layout import CORNERS, EDGE_TOLERANCE, MOST_DOUBT, POLYGON
from rrtik_ompl.kernels.record import Doubles, Ints, Wholes
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at

# A polygon is the number of its corners, then their coordinates.


@entry
def cut_at_planes(
    triangles: Doubles, count: int, shape: Wholes, polygons: Doubles, points: Doubles, cells: Wholes, most: int
) -> int:
    """Cut triangles along all planes between cells; how many corners the pieces have, more than ``most`` if too many.

    A piece that lies in the plane between two cells belongs to both.

    Args:
        triangles: Rows of nine numbers.
        count: How many.
        shape: Number of cells along each axis.
        polygons: Scratch, three times two rows of ``POLYGON`` numbers and one more.
        points: The corners of all pieces, rows of three.
        cells: The number of the cell of each.
        most: How many corners there is room for.
    """
    found = 0
    whole = polygons
    for t in range(count):
        whole[0] = 3.0
        for k in range(9):
            whole[1 + k] = triangles[9 * t + k]
        found = in_slabs_of_x(whole, shape, row_at(polygons, POLYGON, 1), points, cells, found, most)
    return found


@kernel
def extent(polygon: Doubles, axis: int) -> tuple[float, float]:
    """Lowest and highest coordinate of a polygon along an axis."""
    low = polygon[1 + axis]
    high = low
    for k in range(1, int(polygon[0])):
        value = polygon[1 + 3 * k + axis]
        low = min(low, value)
        high = max(high, value)
    return low, high


@kernel
def cut_below(polygon: Doubles, axis: int, plane: float, below: Doubles, above: Doubles) -> None:
    """Divide a convex polygon by a plane across an axis that passes through it."""
    corners = int(polygon[0])
    low = 0
    high = 0
    for k in range(corners):
        here = row_at(polygon, 3, k)
        there = row_at(polygon, 3, (k + 1) % corners)
        p = here[1 + axis] - plane
        q = there[1 + axis] - plane
        if p <= 0.0:
            low = put(below, low, here[1], here[2], here[3])
        if p >= 0.0:
            high = put(above, high, here[1], here[2], here[3])
        if p * q < 0.0:
            share = p / (p - q)
            x = plane if axis == 0 else here[1] + share * (there[1] - here[1])
            y = plane if axis == 1 else here[2] + share * (there[2] - here[2])
            z = plane if axis == 2 else here[3] + share * (there[3] - here[3])
            low = put(below, low, x, y, z)
            high = put(above, high, x, y, z)
    below[0] = float(low)
    above[0] = float(high)


@inlined
def put(polygon: Doubles, number: int, x: float, y: float, z: float) -> int:
    """Add a corner, if there is room; how many there are."""
    if number >= CORNERS:
        return number
    row = row_at(polygon, 3, number)
    row[1], row[2], row[3] = x, y, z
    return number + 1


@inlined
def copy(polygon: Doubles, to: Doubles) -> None:
    """Copy a polygon."""
    for k in range(1 + 3 * int(polygon[0])):
        to[k] = polygon[k]


@kernel
def next_piece(rest: Doubles, axis: int, piece: Doubles, spare: Doubles) -> tuple[int, int, bool]:
    """Cut the lowest piece off a polygon; the cells that it belongs to, and whether that was all."""
    low, high = extent(rest, axis)
    plane = math.floor(low + EDGE_TOLERANCE) + 1.0
    last = not high > plane + EDGE_TOLERANCE
    if last:
        copy(rest, piece)
    else:
        cut_below(rest, axis, plane, piece, spare)
        copy(spare, rest)
        low, high = extent(piece, axis)
    middle = math.floor(0.5 * (low + high))
    near = math.floor(0.5 * (low + high) + 0.5)
    if abs(low - near) <= 2.0 * EDGE_TOLERANCE and abs(high - near) <= 2.0 * EDGE_TOLERANCE:
        return int(near) - 1, int(near), last
    return middle, middle, last


@kernel
def in_slabs_of_x(
    rest: Doubles, shape: Wholes, room: Doubles, points: Doubles, cells: Wholes, found: int, most: int
) -> int:
    """Put the corners of the pieces of a polygon into the lists; how many there are then."""
    piece = room
    spare = row_at(room, POLYGON, 1)
    last = False
    while not last:
        first, second, last = next_piece(rest, 0, piece, spare)
        first = min(max(first, 0), shape[0] - 1)
        second = min(max(second, 0), shape[0] - 1)
        found = in_slabs_of_y(piece, first, second, shape, row_at(room, POLYGON, 2), points, cells, found, most)
    return found


@kernel
def in_slabs_of_y(
    rest: Doubles, x: int, other_x: int, shape: Wholes, room: Doubles, points: Doubles, cells: Wholes, found: int,
    most: int,
) -> int:  # fmt: skip
    """The same for the part between two planes across x."""
    piece = room
    spare = row_at(room, POLYGON, 1)
    last = False
    while not last:
        first, second, last = next_piece(rest, 1, piece, spare)
        first = min(max(first, 0), shape[1] - 1)
        second = min(max(second, 0), shape[1] - 1)
        found = in_cells(piece, x, other_x, first, second, shape, row_at(room, POLYGON, 2), points, cells, found, most)
    return found


@kernel
def in_cells(
    rest: Doubles, x: int, other_x: int, y: int, other_y: int, shape: Wholes, room: Doubles, points: Doubles,
    cells: Wholes, found: int, most: int,
) -> int:  # fmt: skip
    """The same for the part between two planes across y too."""
    piece = room
    spare = row_at(room, POLYGON, 1)
    last = False
    while not last:
        first, second, last = next_piece(rest, 2, piece, spare)
        z = min(max(first, 0), shape[2] - 1)
        other_z = min(max(second, 0), shape[2] - 1)
        for choice in range(8):
            # each cell once: the second one of an axis only where it is another
            if (choice & 1 and x == other_x) or (choice & 2 and y == other_y) or (choice & 4 and z == other_z):
                continue
            cell_x = other_x if choice & 1 else x
            cell_y = other_y if choice & 2 else y
            cell_z = other_z if choice & 4 else z
            cell = (cell_x * shape[1] + cell_y) * shape[2] + cell_z
            for k in range(int(piece[0])):
                if found < most:
                    corner = row_at(piece, 3, k)
                    point = row_at(points, 3, found)
                    point[0], point[1], point[2] = corner[1], corner[2], corner[3]
                    cells[found] = cell
                found += 1
    return found


@entry
def merge(
    points: Doubles, cells: Wholes, count: int, places: Wholes, bounds: Doubles, sides: Doubles, shape: Wholes,
    detail: int, parts: Ints, radii: Doubles,
) -> int:  # fmt: skip
    """Find for each point the part of its cell, and for each part the box of its points and the ball in its middle.

    Args:
        points: Rows of three numbers.
        cells: The number of the cell of each point.
        count: How many.
        places: The number of each cell among those that have points; -1 for others.
        bounds: Lowest and highest corner of the box of each part, rows of six numbers, all infinite.
        sides: Lengths of a cell's sides.
        shape: Number of cells along each axis.
        detail: Parts of a cell along an axis.
        parts: The number of the part of each point.
        radii: Of the ball of each part, all zero.
    """
    for k in range(count):
        point = row_at(points, 3, k)
        cell = cells[k]
        x = part_of(point[0] - float(cell // (shape[1] * shape[2])), detail)
        y = part_of(point[1] - float((cell // shape[2]) % shape[1]), detail)
        z = part_of(point[2] - float(cell % shape[2]), detail)
        part = ((places[cell] * detail + x) * detail + y) * detail + z
        parts[k] = part
        box = row_at(bounds, 6, part)
        for axis in range(3):
            box[axis] = min(box[axis], point[axis])
            box[3 + axis] = max(box[3 + axis], point[axis])

    for k in range(count):
        point = row_at(points, 3, k)
        box = row_at(bounds, 6, parts[k])
        total = 0.0
        for axis in range(3):
            gap = (point[axis] - 0.5 * (box[axis] + box[3 + axis])) * sides[axis]
            total += gap * gap
        radii[parts[k]] = max(radii[parts[k]], math.sqrt(total))
    return 0


@inlined
def part_of(offset: float, detail: int) -> int:
    """The part of a cell along an axis, from the distance to the cell's lowest corner."""
    return min(max(math.floor(offset * detail), 0), detail - 1)


@entry
def winding_numbers(
    triangles: Doubles, count: int, corners: Wholes, crossings: Ints, doubtful: Ints, lines: Ints
) -> int:
    """Count how often rays along x through the corners of a grid cross a closed surface.

    Each crossing adds its sign to the last corner before it; sums from the far end are the winding numbers.

    Args:
        triangles: Rows of nine numbers.
        count: How many.
        corners: Number of corners along each axis.
        crossings: One for each corner, all zero.
        doubtful: The same: 1 where a corner lies close to the surface.
        lines: One for each line along x, all zero: 1 where it passes close to an edge.
    """
    for t in range(count):
        a = row_at(triangles, 9, t)
        low_y = max(math.ceil(min(a[1], a[4], a[7]) - EDGE_TOLERANCE), 0)
        high_y = min(math.floor(max(a[1], a[4], a[7]) + EDGE_TOLERANCE), corners[1] - 1)
        low_z = max(math.ceil(min(a[2], a[5], a[8]) - EDGE_TOLERANCE), 0)
        high_z = min(math.floor(max(a[2], a[5], a[8]) + EDGE_TOLERANCE), corners[2] - 1)
        for y in range(low_y, high_y + 1):
            for z in range(low_z, high_z + 1):
                cross_line(a, y, z, corners, crossings, doubtful, lines)
    return 0


@kernel
def cross_line(a: Doubles, y: int, z: int, corners: Wholes, crossings: Ints, doubtful: Ints, lines: Ints) -> None:
    """Where the line along x through y and z crosses a triangle."""
    first = from_edge(a, 0, 3, y, z)
    second = from_edge(a, 3, 6, y, z)
    third = from_edge(a, 6, 0, y, z)
    least = min(first, second, third)
    most = max(first, second, third)
    line = y * corners[2] + z
    if not (least > EDGE_TOLERANCE or most < -EDGE_TOLERANCE):
        if least >= -EDGE_TOLERANCE or most <= EDGE_TOLERANCE:
            lines[line] = 1
        return

    ux, uy, uz = a[3] - a[0], a[4] - a[1], a[5] - a[2]
    vx, vy, vz = a[6] - a[0], a[7] - a[1], a[8] - a[2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    x = a[0] - ((y - a[1]) * ny + (z - a[2]) * nz) / nx
    slope = abs(nx) / math.sqrt(nx * nx + ny * ny + nz * nz)
    uncertainty = EDGE_TOLERANCE / max(slope, 1e-12)

    lines_apart = corners[1] * corners[2]
    before = int(min(max(math.ceil(x), 0.0), float(corners[0])))  # corners with a smaller x see this crossing
    if before > 0:
        crossings[(before - 1) * lines_apart + line] += 1 if first > 0.0 else -1
    near = math.floor(x + 0.5)
    if abs(x - near) <= uncertainty and 0.0 <= near < corners[0]:
        doubtful[int(near) * lines_apart + line] = 1
    if uncertainty > MOST_DOUBT:
        lines[line] = 1


@inlined
def from_edge(a: Doubles, p: int, q: int, y: int, z: int) -> float:
    """Signed distance of a line along x from the edge between two corners, in projection along x."""
    side_y = a[q + 1] - a[p + 1]
    side_z = a[q + 2] - a[p + 2]
    length = math.sqrt(side_y * side_y + side_z * side_z)
    if not length > EDGE_TOLERANCE:
        return 0.0
    distance: float = (side_y * (z - a[p + 2]) - side_z * (y - a[p + 1])) / length
    return distance
