"""Mazes on a grid, an exhaustive search of them, and the proven optima of shipped problems."""

from __future__ import annotations

import numpy as np

OPTIMA = {"env_e": 4, "planar3_a": 4, "planar3_b": 4, "planar3_c": 3, "titan4_prisms": 3, "titan4_sdu": 6}


class GridWorld:
    """Cells of a grid, some blocked; a motion along an axis is free if all the cells it crosses are."""

    def __init__(self, blocked: set[tuple[int, ...]]) -> None:
        self.blocked = blocked

    def motion_valid_batch(self, tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        return np.array([self._free(a, b) for a, b in zip(tails, heads, strict=True)], dtype=bool)

    def _free(self, a: np.ndarray, b: np.ndarray) -> bool:
        steps = 2 * int(np.ceil(np.abs(b - a).max())) + 1
        cells = np.rint(a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a)).astype(int)
        return not any(tuple(cell) in self.blocked for cell in cells.tolist())
