"""Points in a tree that kernels walk with vector lanes: sorted along a Morton curve [67], in blocks of ``LEAF`` points.

A block has a box around it; ``LEAF`` boxes that follow each other are a group, and a group has a box too, in a group of
the next level, until one group has all. Where things stand follows from their numbers alone: child c of group g of a
level is group ``LEAF * g + c`` of the level below, or that block of points below the lowest level.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEAF = 16  # points of a block, boxes of a group
FAR = 1e18  # [m] where the sides of boxes lie that stand for nothing; its square is a float32 still
CURVE_BITS = 10  # of each coordinate along the curve


@dataclass(frozen=True, slots=True, eq=False)
class PointTree:
    """The tree.

    Attributes:
        blocks: Points x, y and z, shape (blocks, 3, LEAF), float32; the last point fills up its block.
        boxes: Sides low x, high x, low y, ... of boxes, shape (groups, 6, LEAF), float32, level after level.
        firsts: Number of the first group of each level, those around blocks of points first, int32.
    """

    blocks: NDArray[np.float32]
    boxes: NDArray[np.float32]
    firsts: NDArray[np.int32]

    @property
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest coordinates of the points, shape (3,) each."""
        whole = self.boxes[-1]
        return whole[::2].min(axis=1), whole[1::2].max(axis=1)

    def within(self, low: NDArray[Any], high: NDArray[Any]) -> NDArray[np.float32]:
        """Return points of the blocks whose boxes meet a box, shape (k, 3)."""
        groups = np.zeros(1, dtype=np.int64)
        for first in self.firsts[::-1].tolist():
            boxes = self.boxes[first + groups]
            inside = (boxes[:, ::2] <= high[:, None]).all(axis=1) & (boxes[:, 1::2] >= low[:, None]).all(axis=1)
            group, child = np.nonzero(inside)
            groups = LEAF * groups[group] + child
        return self.blocks[groups].transpose(0, 2, 1).reshape(-1, 3)


def extremes(points: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Lowest and highest coordinates of points, shape (n, 3): column by column, which numpy does ten times faster."""
    columns = [points[:, k] for k in range(points.shape[1])]
    return np.array([column.min() for column in columns]), np.array([column.max() for column in columns])


def point_tree(points: NDArray[np.float32]) -> PointTree:
    """Return the tree of points, shape (n, 3), at least one."""
    count = -(-len(points) // LEAF)
    order = np.argsort(_places(points))
    order = np.append(order, np.full(count * LEAF - len(points), order[-1]))
    blocks = points[order.reshape(count, LEAF).T]  # the first points of all blocks, the second ones, ...

    low = blocks.min(axis=0)
    high = blocks.max(axis=0)
    levels = []
    firsts = [0]

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


def _places(points: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return where points lie along the curve: the bits of their coordinates in turn, shape (n,)."""
    low, high = extremes(points)
    extent = float((high - low).max())
    scale = np.float32(((1 << CURVE_BITS) - 0.5) / extent if extent > 0.0 else 0.0)
    x, y, z = (_apart(((points[:, k] - low[k]) * scale).astype(np.uint32)) for k in range(3))
    return np.asarray(x | (y << np.uint32(1)) | (z << np.uint32(2)))


def _apart(cells: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return numbers of ``CURVE_BITS`` bits with two zeros between each two of them."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        cells = (cells | (cells << np.uint32(shift))) & np.uint32(mask)
    return cells
