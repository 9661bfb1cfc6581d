"""A tree of points for kernels with vector lanes: sorted along a Morton curve [67], in blocks of ``LEAF`` points.

Each block has a bounding box. ``LEAF`` consecutive boxes form a group, which has a bounding box in a group of the next
level, and so on until one group contains all. No pointers are stored: child c of group g of a level is group ``LEAF * g
+ c`` of the level below, or the block of points with this index below the lowest level.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEAF = 16  # number of points in a block, and of boxes in a group
FAR = 1e18  # [m] position of the sides of empty boxes; its square is still a float32
CURVE_BITS = 10  # number of bits of each coordinate along the curve


@dataclass(frozen=True, slots=True, eq=False)
class PointTree:
    """The arrays of a tree.

    Attributes:
        blocks: Points x, y and z, shape (blocks, 3, LEAF), float32; an incomplete block is filled with its last point.
        boxes: Sides low x, high x, low y, ... of the boxes around points or cubes, shape (groups, 6, LEAF), float32,
            level after level.
        firsts: Index of the first group of each level, int32; the level of boxes around points is first.
    """

    blocks: NDArray[np.float32]
    boxes: NDArray[np.float32]
    firsts: NDArray[np.int32]

    @property
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates of the points or cubes, shape (3,) each."""
        whole = self.boxes[-1]
        return whole[::2].min(axis=1), whole[1::2].max(axis=1)

    def within(self, low: NDArray[Any], high: NDArray[Any]) -> NDArray[np.float32]:
        """Return the points of all blocks whose boxes intersect a box, shape (k, 3)."""
        groups = np.zeros(1, dtype=np.int64)
        for first in self.firsts[::-1].tolist():
            boxes = self.boxes[first + groups]
            inside = (boxes[:, ::2] <= high[:, None]).all(axis=1) & (boxes[:, 1::2] >= low[:, None]).all(axis=1)
            group, child = np.nonzero(inside)
            groups = LEAF * groups[group] + child
        return self.blocks[groups].transpose(0, 2, 1).reshape(-1, 3)


def extremes(points: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the lowest and highest coordinates of points, shape (n, 3), as arrays of shape (3,).

    It works column by column, which is ten times faster in numpy.
    """
    columns = [points[:, k] for k in range(points.shape[1])]
    return np.array([column.min() for column in columns]), np.array([column.max() for column in columns])


def point_tree(points: NDArray[np.float32], half: float = 0.0) -> PointTree:
    """Build the tree of one or more points, shape (n, 3), or of cubes around them with half a side ``half``."""
    # Sort the points along the curve and repeat the last one to fill its block.
    count = -(-len(points) // LEAF)
    order = np.argsort(curve_places(points))
    order = np.append(order, np.full(count * LEAF - len(points), order[-1]))
    blocks = points[order.reshape(count, LEAF).T]  # shape (LEAF, blocks, 3)

    low = blocks.min(axis=0)
    high = blocks.max(axis=0)
    if half > 0.0:  # with the cubes, rounded outwards
        low = np.nextafter(low - np.float32(half), np.float32(-np.inf))
        high = np.nextafter(high + np.float32(half), np.float32(np.inf))
    levels = []
    firsts = [0]

    # Group the boxes of each level until a single group is left; missing boxes are empty.
    while True:
        groups = -(-len(low) // LEAF)
        sides = np.empty((2, groups * LEAF, 3), dtype=np.float32)
        sides[0] = FAR
        sides[1] = -FAR
        sides[0, : len(low)] = low
        sides[1, : len(high)] = high
        grouped = sides.reshape(2, groups, LEAF, 3)
        levels.append(grouped.transpose(1, 3, 0, 2).reshape(groups, 6, LEAF))
        if groups == 1:
            break

        firsts.append(firsts[-1] + groups)
        low = grouped[0].min(axis=1)
        high = grouped[1].max(axis=1)

    packed = np.ascontiguousarray(blocks.transpose(1, 2, 0))
    return PointTree(packed, np.concatenate(levels), np.array(firsts, dtype=np.int32))


def curve_places(points: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Compute the positions of points along the Morton curve, which interleaves the bits of coordinates, shape (n,)."""
    low, high = extremes(points)
    extent = float((high - low).max())
    scale = np.float32(((1 << CURVE_BITS) - 0.5) / extent if extent > 0.0 else 0.0)
    x, y, z = (_apart(((points[:, k] - low[k]) * scale).astype(np.uint32)) for k in range(3))
    return np.asarray(x | (y << np.uint32(1)) | (z << np.uint32(2)))


def _apart(cells: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Spread numbers of ``CURVE_BITS`` bits so that two zeros stand between any two bits."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        cells = (cells | (cells << np.uint32(shift))) & np.uint32(mask)
    return cells
