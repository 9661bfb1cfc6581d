"""A path's look and repair in kernels: the object that keeps their memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast import FastWorld
from rrtik_ompl.fast.search import repair_layout as layout
from rrtik_ompl.fast.search.connect import FIRST_BUDGET, ConnectSearch
from rrtik_ompl.fast.search.shortcut import ShortcutSearch
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.fast.tables.robot_tables import table
from rrtik_ompl.robot import Chain

FIRST_ROOM = 256  # rows
NEAR = 4.0  # gaps; narrower, new paths pass closer to what moves and are hit more often


class PathRepair:
    """Looks at paths, and repairs the one that it has looked at last: one call of a kernel each.

    A repair cuts the path at the first blocked edge seen from either end, joins the two pieces by RRT-Connect that
    uses them as trees, and shortens what is new by random shortcuts. The same seed gives the same path.

    Attributes:
        checked: Configurations that the last look asked for.

    Args:
        fast: The checks; must have kernels. It may be moved between two calls.
        chain: The robot's, which turns configurations into joint values.
        lower, upper: The box to sample in, shape (n,), finite.
        weights, resolution: See :class:`ConnectSearch`.
        eps: Longest motion of the trees [unit of the box]; a path is cut at points half as far apart.
        iterations: Samples of a repair at most.
        tries, patience: Random shortcuts of a repair at most, and how many without gain end them.

    Raises:
        InputError: If there are no kernels, shapes do not fit, or a number is out of range.
    """

    def __init__(
        self,
        fast: FastWorld,
        chain: Chain,
        lower: Vector,
        upper: Vector,
        *,
        weights: Vector,
        resolution: float,
        eps: float,
        iterations: int,
        tries: int,
        patience: int,
    ) -> None:
        kernels = library(layout.KERNELS)
        if kernels is None:
            raise InputError("repair in kernels: there are none; install numba")
        self._kernels, self._fast, self._chain = kernels, fast, chain
        self._reach: dict[str, Any] = {"weights": weights, "resolution": resolution}
        self._search = ConnectSearch(
            fast, lower, upper, **self._reach, gain=chain.gain, offset=chain.offset, range_=eps
        )
        self._iterations, self._dof = iterations, len(weights)
        fields: dict[int, Any] = dict.fromkeys(range(layout.FIELD_COUNT), 0)
        fields |= {layout.TRIES: tries, layout.PATIENCE: patience, layout.NUMBERS: np.array([0.5 * eps, NEAR])}
        self._table = table(fields)
        self._points = np.zeros((0, self._dof))
        self._make_room(FIRST_ROOM)
        self.checked = 0

    def look(self, path: Matrix) -> bool:
        """Whether all of a path, shape (k, n), is proven free."""
        rows = np.vstack([path, path]) if len(path) == 1 else path
        if len(rows) > len(self._given):
            self._make_room(2 * len(rows))
        while True:
            self._given[: len(rows)] = rows
            found = self._kernels.look(self._table.address, len(rows))
            if found != layout.NO_ROOM:
                break
            self._make_room(2 * int(self._table.header[layout.COUNT]))
        self.checked = int(self._table.header[layout.CHECKED])
        return found == layout.FREE_PATH

    def repair(self, seed: int, stop: Callable[[], Any], *, forgetting: bool = False) -> Matrix | None:
        """Another path between the same ends, free all along, or None.

        Args:
            seed: Any whole number.
            stop: Asked about every millisecond; True gives up.
            forgetting: Whether to plan from scratch, as to compare with: the pieces of the path are not used.
        """
        rows = self._kernels.repair(self._table.address, seed, forgetting, FIRST_BUDGET)
        if rows == layout.NOT_YET:
            rows = self._kernels.finish(self._table.address, seed) if self._search.go_on(stop) else layout.NO_WAY
        while rows == layout.LONG:
            self._make_room(2 * len(self._given))
            rows = self._kernels.finish(self._table.address, seed)
        return self._path[:rows].copy() if rows > 0 else None

    def _make_room(self, rows: int) -> None:
        """Memory for paths of so many rows; the points stay."""
        header, old = self._table.header, self._points
        self._given, self._points = np.zeros((rows, self._dof)), np.zeros((rows, self._dof))
        self._points[: len(old)] = old
        self._cuts = ShortcutSearch(self._fast, self._chain, self._given, **self._reach, asking=False)
        self._path = np.zeros((2 * rows + self._cuts.capacity, self._dof))
        header[layout.SEARCH] = self._search.serve(rows, self._iterations)
        header[layout.CUTS], header[layout.ROOM] = self._cuts.address, rows
        for place, memory in ((layout.GIVEN, self._given), (layout.POINTS, self._points), (layout.PATH, self._path)):
            header[place] = memory.ctypes.data
