"""Where to cut a cell of a mesh: the volumes of the hulls on both sides of each possible cut, estimated.

On each side of a cut, the points that lie farthest in some directions are found, a lane a direction, and the hull of
these few points is made by adding one point after the other.
"""

from __future__ import annotations

import math

from numpy import float32

from rrtik_ompl.kernels.covers.cut_layout import FACE, MOST_FACES, MOST_POINTS, PLANE
from rrtik_ompl.kernels.record import Doubles, Floats, Ints, Wholes
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import choose, lanes_at, set_lanes, spread
from rrtik_ompl.kernels.simd.records import row_at

LOWEST = -1e30  # less than any height
SHIFT = 1e-6  # share of the size by which points are moved, so that no four lie in a plane
MULTIPLIER, INCREMENT, MODULUS = 1103515245, 12345, 1 << 31  # numbers without a pattern: points in a row leave it
FLATTEST = 1e-7  # least volume of the first tetrahedron, as a share of that of a cube of the points' size
VISIBLE = 1e-10  # height above a face, as a share of the size, from which the face is seen


@entry
def hull_volume_of(points: Doubles, count: int, planes: Doubles, faces: Ints, work: Ints, volume: Doubles) -> int:
    """The volume of the hull of at most ``MOST_POINTS`` points, rows of three, which are moved a little."""
    volume[0] = hull_volume(points, count, planes, faces, work)
    return 0


@entry
def cut_volumes(
    corners: Wholes, triangles: int, points: Doubles, count: int, boxes: Doubles, box_count: int, bounds: Doubles,
    shares: Doubles, share_count: int, directions: Floats, blocks: int, sides: Doubles, lists: Floats, tops: Floats,
    marks: Ints, chosen: Doubles, planes: Doubles, faces: Ints, work: Ints, most: int, volumes: Doubles,
) -> int:  # fmt: skip
    """Volumes of the hulls below and above each cut, rows of two; the cuts across x come first.

    A point in the plane of a cut counts below it only if an edge leads on below, as if the triangles were clipped.

    Args:
        corners: Three numbers of points for each triangle.
        triangles: How many.
        points: Rows of three numbers; those of boxes, which are no corners of triangles, come last.
        count: How many.
        boxes: Lowest and highest corner of each box, rows of six numbers.
        box_count: How many.
        bounds: Lowest and highest corner of the cell.
        shares: Where the cuts are, as shares of the cell's side.
        share_count: How many.
        directions: x, y and z of each block of directions.
        blocks: How many blocks of ``WIDTH`` directions.
        sides: Scratch, the points on each side: two lists of ``most`` rows of three numbers.
        lists: Scratch, the same in lower precision.
        tops: Scratch, one number for each direction.
        marks: Scratch, one number for each point and for each row of a side.
        chosen: Scratch, as many rows of three as there are directions.
        planes: Scratch of the hull, as the next two.
        faces: See above.
        work: See above.
        most: How many points a side has room for; more are left out.
        volumes: The answer.
    """
    above_sides = row_at(sides, 3, most)
    for axis in range(3):
        for share in range(share_count):
            place = (1.0 - shares[share]) * bounds[axis] + shares[share] * bounds[3 + axis]
            below, above = split(corners, triangles, points, count, axis, place, sides, above_sides, marks, most)
            below, above = split_boxes(boxes, box_count, axis, place, sides, above_sides, below, above, most)
            answer = row_at(volumes, 2, axis * share_count + share)
            taken = extreme(sides, below, bounds, directions, blocks, lists, tops, marks, chosen)
            answer[0] = hull_volume(chosen, taken, planes, faces, work)
            taken = extreme(above_sides, above, bounds, directions, blocks, lists, tops, marks, chosen)
            answer[1] = hull_volume(chosen, taken, planes, faces, work)
    return 0


@inlined
def add(side: Doubles, number: int, most: int, x: float, y: float, z: float) -> int:
    """Put a point into a list, if there is room; how many there are then."""
    if number >= most:
        return number
    row = row_at(side, 3, number)
    row[0], row[1], row[2] = x, y, z
    return number + 1


@kernel
def split(
    corners: Wholes, triangles: int, points: Doubles, count: int, axis: int, place: float, below_side: Doubles,
    above_side: Doubles, marks: Ints, most: int,
) -> tuple[int, int]:  # fmt: skip
    """Put the points below and above a plane into two lists, and where edges cross it into both; their numbers."""
    below = 0
    above = 0
    for k in range(count):
        marks[k] = 0
    for t in range(triangles):
        for e in range(3):
            i = min(corners[3 * t + e], corners[3 * t + (e + 1) % 3])  # so that both triangles give the same point
            j = max(corners[3 * t + e], corners[3 * t + (e + 1) % 3])
            first = row_at(points, 3, i)
            second = row_at(points, 3, j)
            p = first[axis] - place
            q = second[axis] - place
            if p == 0.0 and q < 0.0:
                marks[i] = 1
            if q == 0.0 and p < 0.0:
                marks[j] = 1
            if p * q < 0.0:
                part = p / (p - q)
                x = first[0] + part * (second[0] - first[0])
                y = first[1] + part * (second[1] - first[1])
                z = first[2] + part * (second[2] - first[2])
                below = add(below_side, below, most, x, y, z)
                above = add(above_side, above, most, x, y, z)
    for k in range(count):
        point = row_at(points, 3, k)
        if point[axis] < place or marks[k] != 0:
            below = add(below_side, below, most, point[0], point[1], point[2])
        if point[axis] >= place:
            above = add(above_side, above, most, point[0], point[1], point[2])
    return below, above


@inlined
def put_corner(point: Doubles, box: Doubles, axis: int, place: float, corner: int) -> None:
    """One of the four corners of the section of a box."""
    second = (axis + 1) % 3
    third = (axis + 2) % 3
    point[axis] = place
    point[second] = box[3 * (corner & 1) + second]
    point[third] = box[3 * (corner >> 1) + third]


@kernel
def split_boxes(
    boxes: Doubles, box_count: int, axis: int, place: float, below_side: Doubles, above_side: Doubles, below: int,
    above: int, most: int,
) -> tuple[int, int]:  # fmt: skip
    """Add the corners of the sections of boxes by a plane to both lists; the numbers of their points."""
    for k in range(box_count):
        box = row_at(boxes, 6, k)
        if box[axis] < place < box[3 + axis]:
            for corner in range(4):
                if below < most and above < most:
                    put_corner(row_at(below_side, 3, below), box, axis, place, corner)
                    put_corner(row_at(above_side, 3, above), box, axis, place, corner)
                    below += 1
                    above += 1
    return below, above


@kernel
def extreme(
    side: Doubles, count: int, bounds: Doubles, directions: Floats, blocks: int, lists: Floats, tops: Floats,
    marks: Ints, chosen: Doubles,
) -> int:  # fmt: skip
    """Choose the points of a list that lie farthest in one of the directions, each once; how many."""
    for k in range(count):
        point = row_at(side, 3, k)
        for axis in range(3):
            lists[3 * k + axis] = float32(point[axis] - bounds[axis])
        marks[k] = 0

    for block in range(blocks):
        dx = lanes_at(directions, 3 * block)
        dy = lanes_at(directions, 3 * block + 1)
        dz = lanes_at(directions, 3 * block + 2)
        highest = spread(float32(LOWEST))
        which = spread(float32(0.0))
        for k in range(count):
            height = dx * lists[3 * k] + dy * lists[3 * k + 1] + dz * lists[3 * k + 2]
            is_higher = height > highest
            highest = choose(is_higher, height, highest)
            which = choose(is_higher, spread(float32(k)), which)
        set_lanes(tops, block, which)

    taken = 0
    if count > 0:
        for k in range(blocks * WIDTH):
            number = int(tops[k])
            if marks[number] == 0:
                marks[number] = 1
                point = row_at(side, 3, number)
                taken = add(chosen, taken, MOST_POINTS, point[0], point[1], point[2])
    return taken


@inlined
def cross(ux: float, uy: float, uz: float, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Vector product."""
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@inlined
def from_to(points: Doubles, i: int, j: int) -> tuple[float, float, float]:
    """The vector from one point to another."""
    first = row_at(points, 3, i)
    second = row_at(points, 3, j)
    return second[0] - first[0], second[1] - first[1], second[2] - first[2]


@kernel
def put_face(points: Doubles, planes: Doubles, faces: Ints, number: int, a: int, b: int, c: int) -> None:
    """A face of the hull with its plane."""
    ux, uy, uz = from_to(points, a, b)
    vx, vy, vz = from_to(points, a, c)
    x, y, z = cross(ux, uy, uz, vx, vy, vz)
    scale = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-300)
    face = row_at(faces, FACE, number)
    face[0], face[1], face[2], face[3] = a, b, c, 1
    plane = row_at(planes, PLANE, number)
    point = row_at(points, 3, a)
    plane[0], plane[1], plane[2] = x * scale, y * scale, z * scale
    plane[3] = scale * (x * point[0] + y * point[1] + z * point[2])


@kernel
def spread_out(points: Doubles, count: int) -> float:
    """Move each point a little, and return the longest side of their box."""
    size = 0.0
    for axis in range(3):
        low = points[axis]
        high = low
        for k in range(1, count):
            low = min(low, points[3 * k + axis])
            high = max(high, points[3 * k + axis])
        size = max(size, high - low)
    number = 1
    for k in range(3 * count):
        number = (number * MULTIPLIER + INCREMENT) & (MODULUS - 1)
        points[k] += SHIFT * size * (number / MODULUS - 0.5)
    return size


@kernel
def first_four(points: Doubles, count: int, size: float, planes: Doubles, faces: Ints) -> bool:
    """Begin the hull with a large tetrahedron; whether there is one."""
    a = 0
    b = 0
    least = 1e300
    most = -1e300
    for k in range(count):
        along = points[3 * k] + 0.37 * points[3 * k + 1] + 0.19 * points[3 * k + 2]
        if along < least:
            least = along
            a = k
        if along > most:
            most = along
            b = k

    ux, uy, uz = from_to(points, a, b)
    nx, ny, nz = 0.0, 0.0, 0.0
    c = a
    widest = 0.0
    for k in range(count):
        vx, vy, vz = from_to(points, a, k)
        x, y, z = cross(ux, uy, uz, vx, vy, vz)
        area = x * x + y * y + z * z
        if area > widest:
            widest = area
            c = k
            nx, ny, nz = x, y, z

    d = a
    height = 0.0
    for k in range(count):
        vx, vy, vz = from_to(points, a, k)
        own = nx * vx + ny * vy + nz * vz
        if abs(own) > abs(height):
            height = own
            d = k
    if abs(height) <= FLATTEST * size * size * size:
        return False
    if height > 0.0:
        b, c = c, b
    put_face(points, planes, faces, 0, a, b, c)
    put_face(points, planes, faces, 1, a, d, b)
    put_face(points, planes, faces, 2, b, d, c)
    put_face(points, planes, faces, 3, c, d, a)
    return True


@kernel
def hull_volume(points: Doubles, count: int, planes: Doubles, faces: Ints, work: Ints) -> float:
    """The volume of the hull of at most ``MOST_POINTS`` points, which are moved a little; 0 if they are flat.

    ``work`` has, for each pair of points, the last round in which a face that was removed had an edge from one to the
    other, and lists of the faces that are seen, and of the places that are free.
    """
    if count < 4:
        return 0.0
    size = spread_out(points, count)
    if not first_four(points, count, size, planes, faces):
        return 0.0

    seen_faces = row_at(work, MOST_POINTS * MOST_POINTS, 1)
    free_places = row_at(seen_faces, MOST_FACES, 1)
    for k in range(count * count):
        work[k] = 0
    used = 4
    free = 0
    for k in range(count):
        seen = remove_seen(points, count, k, VISIBLE * size, planes, faces, used, work, seen_faces)
        before = free
        for s in range(seen):
            face = row_at(faces, FACE, seen_faces[s])
            for e in range(3):
                g = face[e]
                h = face[(e + 1) % 3]
                if work[h * count + g] == k + 1:
                    continue  # not an edge of the horizon
                if before > 0:
                    before -= 1
                    put_face(points, planes, faces, free_places[before], g, h, k)
                elif used < MOST_FACES:
                    put_face(points, planes, faces, used, g, h, k)
                    used += 1
                else:
                    return 0.0
        free = before
        for s in range(seen):
            free_places[free] = seen_faces[s]
            free += 1
    return volume_inside(points, faces, used)


@kernel
def remove_seen(
    points: Doubles, count: int, k: int, height: float, planes: Doubles, faces: Ints, used: int, work: Ints,
    seen_faces: Ints,
) -> int:  # fmt: skip
    """Remove the faces that a point is above, and note their edges; how many they are."""
    x, y, z = points[3 * k], points[3 * k + 1], points[3 * k + 2]
    seen = 0
    for f in range(used):
        plane = row_at(planes, PLANE, f)
        face = row_at(faces, FACE, f)
        if face[3] != 0 and plane[0] * x + plane[1] * y + plane[2] * z - plane[3] > height:
            seen_faces[seen] = f
            seen += 1
            face[3] = 0
            for e in range(3):
                work[face[e] * count + face[(e + 1) % 3]] = k + 1
    return seen


@kernel
def volume_inside(points: Doubles, faces: Ints, used: int) -> float:
    """The volume inside the faces."""
    total = 0.0
    for f in range(used):
        face = row_at(faces, FACE, f)
        if face[3] != 0:
            ax, ay, az = from_to(points, 0, face[0])
            bx, by, bz = from_to(points, 0, face[1])
            cx, cy, cz = from_to(points, 0, face[2])
            x, y, z = cross(bx, by, bz, cx, cy, cz)
            total += ax * x + ay * y + az * z
    return total / 6.0
