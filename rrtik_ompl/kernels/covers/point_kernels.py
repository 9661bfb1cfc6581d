"""Points in kernels: those that lie farthest along directions, and their distances from triangles."""

from __future__ import annotations

import math

from numpy import float32

from rrtik_ompl.kernels.record import Doubles, Floats, Ints, Wholes
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import choose, lanes_at, set_lanes, spread
from rrtik_ompl.kernels.simd.records import row_at

LOWEST = -1e30  # less than any height
DOUBT = 2  # what is no number of crossings
SKEW_Y, SKEW_Z = 0.0137, 0.0391  # how far a ray goes along y and z while it goes 1 along x
CLOSE = 1e-15  # far below what the rounding of a hull of size 1 leaves beyond its planes
SMALLEST = 1e-300  # a length or area that is less counts as this


@entry
def farthest_points(points: Doubles, count: int, origin: Doubles, directions: Floats, blocks: int, tops: Floats) -> int:
    """Find for each direction the number of the first point that lies farthest.

    Args:
        points: Rows of three numbers, relative to the origin not too large for 32 bits.
        count: How many; at most 2^24, as numbers of 32 bits hold them.
        origin: Three numbers.
        directions: x, y and z of each block of directions.
        blocks: How many blocks.
        tops: The answer.
    """
    ox, oy, oz = origin[0], origin[1], origin[2]
    for block in range(blocks):
        dx = lanes_at(directions, 3 * block)
        dy = lanes_at(directions, 3 * block + 1)
        dz = lanes_at(directions, 3 * block + 2)
        highest = spread(float32(LOWEST))
        which = spread(float32(0.0))
        for k in range(count):
            point = row_at(points, 3, k)
            height = dx * float32(point[0] - ox) + dy * float32(point[1] - oy) + dz * float32(point[2] - oz)
            is_higher = height > highest
            highest = choose(is_higher, height, highest)
            which = choose(is_higher, spread(float32(k)), which)
        set_lanes(tops, block, which)
    return 0


@entry
def farthest_beyond(
    points: Doubles, count: int, boxes: Doubles, size: int, planes: Doubles, number: int, farthest: Doubles
) -> int:
    """Find the largest distance of a point beyond one of many planes, if it is more than what is given.

    Args:
        points: Rows of three numbers; ``size`` of them after the other are in one box.
        count: How many.
        boxes: Middle and half the sides of each box, rows of six numbers.
        size: How many points there are in a box; the last box may have fewer.
        planes: Unit normal and offset, rows of four numbers.
        number: How many.
        farthest: The answer.
    """
    for k in range(number):
        plane = row_at(planes, 4, k)
        x, y, z, offset = plane[0], plane[1], plane[2], plane[3]
        for b in range((count + size - 1) // size):
            box = row_at(boxes, 6, b)
            middle = box[0] * x + box[1] * y + box[2] * z - offset
            most = middle + box[3] * abs(x) + box[4] * abs(y) + box[5] * abs(z)
            if most > farthest[0] - CLOSE:  # the bound is rounded too
                for i in range(b * size, min(b * size + size, count)):
                    point = row_at(points, 3, i)
                    farthest[0] = max(farthest[0], point[0] * x + point[1] * y + point[2] * z - offset)
    return 0


@entry
def distances(points: Doubles, count: int, triangles: Doubles, balls: Doubles, number: int, found: Doubles) -> int:
    """Find the distance of each point from the nearest of the triangles.

    Args:
        points: Rows of three numbers.
        count: How many.
        triangles: Rows of nine numbers.
        balls: Centre and radius of a ball around each triangle, rows of four numbers.
        number: How many triangles.
        found: The answer.
    """
    for k in range(count):
        point = row_at(points, 3, k)
        x, y, z = point[0], point[1], point[2]
        best = 1e300
        for t in range(number):
            ball = row_at(balls, 4, t)
            reach = best + ball[3]
            if squared(ball[0] - x, ball[1] - y, ball[2] - z) < reach * reach:
                best = min(best, math.sqrt(to_triangle(row_at(triangles, 9, t), x, y, z)))
        found[k] = best
    return 0


@entry
def inside(points: Doubles, count: int, triangles: Doubles, number: int, close: Doubles, answers: Wholes) -> int:
    """Tell whether each point is inside a closed surface: 1, 0, or unchanged if that is in doubt.

    A ray goes along an axis that lies askew, as many surfaces have edges along the axes of their frame.

    Args:
        points: Rows of three numbers.
        count: How many.
        triangles: Rows of nine numbers.
        number: How many.
        close: Distance, one number, within which a ray is in doubt about an edge and a point about the surface.
        answers: One for each point.
    """
    for k in range(count):
        point = row_at(points, 3, k)
        total = 0
        doubtful = False
        for t in range(number):
            a = row_at(triangles, 9, t)
            if is_passed(a, point, 1, SKEW_Y, close[0]) or is_passed(a, point, 2, SKEW_Z, close[0]):
                continue
            sign = crossing(a, point, close[0])
            if sign == DOUBT:
                doubtful = True
                break
            total += sign
        if not doubtful:
            answers[k] = 0 if total == 0 else 1
    return 0


@inlined
def across(a: Doubles, corner: int, point: Doubles, axis: int, skew: float) -> float:
    """A coordinate across the ray of a triangle's corner."""
    offset: float = a[corner + axis] - point[axis] - skew * (a[corner] - point[0])
    return offset


@inlined
def is_passed(a: Doubles, point: Doubles, axis: int, skew: float, close: float) -> bool:
    """Whether a triangle lies on one side of the ray."""
    p = across(a, 0, point, axis, skew)
    q = across(a, 3, point, axis, skew)
    r = across(a, 6, point, axis, skew)
    return min(p, q, r) > close or max(p, q, r) < -close


@inlined
def turn(a: Doubles, i: int, j: int, point: Doubles) -> tuple[float, float]:
    """Signed area of the ray and an edge, and the length of that, seen along the ray."""
    y, z = across(a, i, point, 1, SKEW_Y), across(a, i, point, 2, SKEW_Z)
    sy, sz = across(a, j, point, 1, SKEW_Y) - y, across(a, j, point, 2, SKEW_Z) - z
    return sz * y - sy * z, math.sqrt(sy * sy + sz * sz)


@kernel
def crossing(a: Doubles, point: Doubles, close: float) -> int:
    """How a ray from a point crosses a triangle: 1, -1, 0, or ``DOUBT``."""
    first, first_length = turn(a, 0, 3, point)
    second, second_length = turn(a, 3, 6, point)
    third, third_length = turn(a, 6, 0, point)
    u, v, w = close * first_length, close * second_length, close * third_length
    is_left = first > u and second > v and third > w
    is_right = first < -u and second < -v and third < -w
    if not (is_left or is_right):
        may_be_left = first >= -u and second >= -v and third >= -w
        may_be_right = first <= u and second <= v and third <= w
        return DOUBT if may_be_left or may_be_right else 0

    ux, uy, uz = a[3] - a[0], a[4] - a[1], a[5] - a[2]
    vx, vy, vz = a[6] - a[0], a[7] - a[1], a[8] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    ahead = (a[0] - point[0]) * nx + (a[1] - point[1]) * ny + (a[2] - point[2]) * nz
    if abs(ahead) <= close * math.sqrt(squared(nx, ny, nz)):
        return DOUBT
    sign = 1 if nx + SKEW_Y * ny + SKEW_Z * nz > 0.0 else -1
    return sign if sign * ahead > 0.0 else 0


@entry
def choose_balls(gaps: Floats, balls: int, samples: int, gap: Floats, gains: Doubles, chosen: Ints, most: int) -> int:
    """Choose balls, always the one that reduces the samples' gaps to the nearest ball most; how many.

    A gain only falls while balls are chosen, so the one that was largest when it was last computed is looked at first.

    Args:
        gaps: Of each sample to each ball, rows of one ball.
        balls: How many.
        samples: How many.
        gap: Of each sample to the nearest ball that is chosen; more than all gaps at first.
        gains: Scratch, one for each ball.
        chosen: The balls in their order, room for ``most``.
        most: How many balls are wanted.
    """
    for ball in range(balls):
        gains[ball] = gain_of(row_at(gaps, samples, ball), samples, gap)
    count = 0
    while count < most:
        best = 0
        for ball in range(1, balls):
            if gains[ball] > gains[best]:
                best = ball
        if not gains[best] > 0.0:
            break
        row = row_at(gaps, samples, best)
        gain = gain_of(row, samples, gap)
        if gain < gains[best]:
            gains[best] = gain
            continue
        chosen[count] = best
        count += 1
        gains[best] = 0.0
        for k in range(samples):
            gap[k] = min(gap[k], row[k])
    return count


@kernel
def gain_of(row: Floats, samples: int, gap: Floats) -> float:
    """How much a ball reduces the samples' gaps."""
    total = 0.0
    for k in range(samples):
        total += max(gap[k] - row[k], float32(0.0))
    return total


@inlined
def squared(x: float, y: float, z: float) -> float:
    """Squared length."""
    return x * x + y * y + z * z


@kernel
def to_edge(first: Doubles, second: Doubles, x: float, y: float, z: float) -> float:
    """Squared distance of a point from an edge."""
    sx, sy, sz = second[0] - first[0], second[1] - first[1], second[2] - first[2]
    ox, oy, oz = x - first[0], y - first[1], z - first[2]
    share = (ox * sx + oy * sy + oz * sz) / max(squared(sx, sy, sz), SMALLEST)
    share = min(max(share, 0.0), 1.0)
    return squared(ox - share * sx, oy - share * sy, oz - share * sz)


@inlined
def is_beside(
    first: Doubles, second: Doubles, nx: float, ny: float, nz: float, x: float, y: float, z: float
) -> bool:  # fmt: skip
    """Whether a point is on the outer side of an edge, seen along the normal."""
    sx, sy, sz = second[0] - first[0], second[1] - first[1], second[2] - first[2]
    ox, oy, oz = x - first[0], y - first[1], z - first[2]
    turned: float = (sy * oz - sz * oy) * nx + (sz * ox - sx * oz) * ny + (sx * oy - sy * ox) * nz
    return turned < 0.0


@kernel
def to_triangle(triangle: Doubles, x: float, y: float, z: float) -> float:
    """Squared distance of a point from a triangle, which may have no area."""
    a = triangle
    b = row_at(triangle, 3, 1)
    c = row_at(triangle, 3, 2)
    nearest = min(to_edge(a, b, x, y, z), to_edge(b, c, x, y, z), to_edge(c, a, x, y, z))

    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area = squared(nx, ny, nz)
    if not area > 0.0:
        return nearest
    if is_beside(a, b, nx, ny, nz, x, y, z) or is_beside(b, c, nx, ny, nz, x, y, z):
        return nearest
    if is_beside(c, a, nx, ny, nz, x, y, z):
        return nearest
    height: float = (x - a[0]) * nx + (y - a[1]) * ny + (z - a[2]) * nz
    return min(nearest, height * height / max(area, SMALLEST))
