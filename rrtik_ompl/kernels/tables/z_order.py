"""Points in an order in which neighbours in space are mostly near each other: Morton's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix

BITS = 10  # of each coordinate; three of them fit into an integer


def z_order(points: Matrix) -> NDArray[np.int64]:
    """The numbers of points, shape (n, 3), along a Z-order curve. Shape (n,).

    Example:
        >>> z_order(np.array([[0.0, 0, 0], [1, 1, 1], [0.1, 0, 0]])).tolist()
        [0, 2, 1]
    """
    ranks = np.argsort(np.argsort(points, axis=0, kind="stable"), axis=0)  # so that one far away does not matter
    cells = ranks * ((1 << BITS) - 1) // max(len(points) - 1, 1)
    codes = np.zeros(len(points), dtype=np.int64)

    for bit in range(BITS):
        for axis in range(3):
            codes |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)

    order: NDArray[np.int64] = np.argsort(codes, kind="stable")
    return order
