"""Corners of solids in blocks, so that kernels compare a whole block at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.simd.processor import WIDTH


def block_count(corners: Matrix) -> int:
    """How many blocks the corners of a solid take, shape (k, 3)."""
    return -(-len(corners) // WIDTH)


def corner_blocks(solids: Sequence[Matrix]) -> NDArray[np.float64]:
    """The corners of solids, shapes (k, 3), in blocks, shape (blocks, 3, WIDTH).

    Each solid begins a block; its last one is filled up with its last corner.
    """
    counts = np.array([len(corners) for corners in solids], dtype=np.int64)
    lanes = WIDTH * -(-counts // WIDTH)
    numbers = np.arange(lanes.sum()) - np.repeat(np.cumsum(lanes) - lanes, lanes)
    numbers = np.minimum(numbers, np.repeat(counts - 1, lanes)) + np.repeat(np.cumsum(counts) - counts, lanes)
    corners = np.concatenate([np.zeros((0, 3)), *solids])[numbers]
    return np.ascontiguousarray(corners.reshape(-1, WIDTH, 3).transpose(0, 2, 1))


def corners_in(blocks: NDArray[np.float64]) -> Matrix:
    """The corners in blocks, shape (k, 3), those that fill up among them."""
    return np.asarray(blocks.transpose(0, 2, 1).reshape(-1, 3))
