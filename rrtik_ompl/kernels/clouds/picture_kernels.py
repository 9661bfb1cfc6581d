"""Depth pictures in kernels: in which cubes of a grid their pixels are."""

from __future__ import annotations

from numpy import float32

from rrtik_ompl.kernels.record import Doubles, Floats, Ints, Wholes
from rrtik_ompl.kernels.simd.compiled import entry, kernel
from rrtik_ompl.kernels.simd.records import row_at

ZERO = float32(0.0)
BOX_SIZE = 15  # numbers of a box: rows of the rotation to its frame, its shift, and half its sides


@entry
def find_cells(
    picture: Floats,
    count: int,
    used: Ints,
    is_masked: int,
    directions: Floats,
    numbers: Doubles,
    boxes: Doubles,
    box_count: int,
    keys: Wholes,
    measured: Wholes,
) -> int:
    """Find the cubes that pixels are in; returns how many numbers of cubes are written.

    The number of a cube is written again where pixels of another one come in between.

    Args:
        picture: A depth for each pixel.
        count: How many pixels.
        used: 0 for pixels that are left out; read only with a mask.
        is_masked: Whether there is a mask.
        directions: x, y and z of the rays, rows of ``count`` numbers: a depth [m] times one of them is in cubes.
        numbers: Metres per unit of the picture, least and largest depth, the camera's place in cubes, the number of
            cubes along each axis, the lowest corner of the grid [m], and the side of a cube [m].
        boxes: Rows of ``BOX_SIZE`` numbers; points in them are left out.
        box_count: How many boxes.
        keys: The answer, room for ``count`` numbers.
        measured: Gets the number of pixels with a valid depth.
    """
    scale = float32(numbers[0])
    nearest = float32(numbers[1])
    farthest = float32(numbers[2])
    start_x = float32(numbers[3])
    start_y = float32(numbers[4])
    start_z = float32(numbers[5])
    end_x = float32(numbers[6])
    end_y = float32(numbers[7])
    end_z = float32(numbers[8])
    across = int(numbers[6])
    up = int(numbers[7])
    along_x = directions
    along_y = row_at(directions, count, 1)
    along_z = row_at(directions, count, 2)

    valid = 0
    found = 0
    last = -1
    for k in range(count):
        depth = picture[k] * scale
        if not (depth >= nearest and depth <= farthest):  # also of what is no number
            continue
        valid += 1
        if is_masked != 0 and used[k] == 0:
            continue
        x = depth * along_x[k] + start_x
        y = depth * along_y[k] + start_y
        z = depth * along_z[k] + start_z
        if not (x >= ZERO and x < end_x and y >= ZERO and y < end_y and z >= ZERO and z < end_z):
            continue
        if box_count > 0 and in_a_box(row_at(numbers, 9, 1), boxes, box_count, x, y, z):
            continue
        key = int(x) + across * (int(y) + up * int(z))
        if key != last:
            keys[found] = key
            found += 1
            last = key
    measured[0] = valid
    return found


@kernel
def in_a_box(grid: Doubles, boxes: Doubles, count: int, x: float, y: float, z: float) -> bool:
    """Whether a point, in cubes of a grid whose lowest corner and side are given, is in one of some boxes."""
    px = grid[0] + grid[3] * x
    py = grid[1] + grid[3] * y
    pz = grid[2] + grid[3] * z
    for number in range(count):
        box = row_at(boxes, BOX_SIZE, number)
        inside = True
        for axis in range(3):
            place = box[3 * axis] * px + box[3 * axis + 1] * py + box[3 * axis + 2] * pz + box[9 + axis]
            inside &= abs(place) <= box[12 + axis]
        if inside:
            return True
    return False
