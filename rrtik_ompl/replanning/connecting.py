"""RRT-Connect between two pieces of a path, each used as a tree from the beginning: in a kernel, or in Python.

Source: DRRT-Con paper, algorithms 1 to 5; in Python as printed but for three slips: EXTEND has reached a target when
its new vertex is the target, the second tree is extended until it is trapped, and samples are uniform.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.fast.search.connect import ConnectSearch
from rrtik_ompl.fast.search.connect_layout import KERNELS
from rrtik_ompl.fast.search.shortcut import ShortcutSearch
from rrtik_ompl.fast.search.shortcut_layout import KERNELS as CUT_KERNELS
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.transitions import without_repeats

Stop = Callable[[], Any]  # true when it is time to stop

ITERATIONS = 4000  # samples of one search at most, so that the same seed gives the same run
CUTS, PATIENCE = 100, 40  # tries of random shortcuts, and without gain


class Motions(Protocol):
    """Who judges configurations and straight motions: a world, or a planner's checker."""

    def valid_batch(self, Q: Matrix) -> Mask:
        """Which configurations Q, shape (m, n), are free, shape (m,)."""

    def motion_valid_batch(self, A: Matrix, B: Matrix) -> Mask:
        """Which straight motions A[k] -> B[k], shapes (m, n), are free, shape (m,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Joined:
    """Two pieces of a path and the way between them.

    Attributes:
        path: From the begin of one to the end of the other, shape (k, n).
        begin, end: Numbers of the waypoints between which the way is new.
    """

    path: Matrix
    begin: int
    end: int


class Connect(Protocol):
    """Looks for a way between two pieces of a path.

    Attributes:
        samples: Drawn so far.
    """

    samples: int

    def __call__(
        self, first: Matrix, second: Matrix, motions: Motions, stop: Stop, *, chain: bool = True
    ) -> Joined | None:
        """The whole path from ``first[0]`` by a way from one piece to the other, or None.

        Args:
            first: Configurations from the robot on, a free chain, shape (a, n).
            second: Configurations to the goal, a free chain, shape (b, n); with ``chain`` False separate goals.
            motions: Who judges.
            stop: True ends the search.
            chain: See ``second``.
        """


def never() -> bool:
    """It is not time to stop."""
    return False


class KernelConnect:
    """The search in a kernel, for worlds that have them (:mod:`rrtik_ompl.fast.search.connect_kernels`)."""

    def __init__(
        self, world: Any, lower: Vector, upper: Vector, eps: float, seed: int, iterations: int = ITERATIONS
    ) -> None:
        self._search = ConnectSearch(world.motions, lower, upper, range_=eps)
        self._rng, self._iterations, self.samples = np.random.default_rng(seed), iterations, 0

    def __call__(
        self, first: Matrix, second: Matrix, motions: Motions, stop: Stop, *, chain: bool = True
    ) -> Joined | None:
        """See :class:`Connect`; conservative: what the kernel cannot prove counts as blocked."""
        seed, most = int(self._rng.integers(2**63)), self._iterations
        bridge = self._search.solve(first, second, seed, stop=stop, max_iterations=most)
        self.samples += int(self._search.statistics()["iterations"])
        return None if bridge is None else joined(first, bridge, second, chain=chain)


class PlainConnect:
    """The published search in Python, for any judge."""

    def __init__(self, lower: Vector, upper: Vector, eps: float, seed: int, iterations: int = ITERATIONS) -> None:
        self._lower, self._upper, self._eps = lower, upper, eps
        self._rng, self._iterations, self.samples = np.random.default_rng(seed), iterations, 0

    def __call__(
        self, first: Matrix, second: Matrix, motions: Motions, stop: Stop, *, chain: bool = True
    ) -> Joined | None:
        """See :class:`Connect`."""
        trees, growing = (Tree(first), Tree(second)), 0
        for _ in range(self._iterations):
            if stop():
                return None
            self.samples += 1
            mine, other = trees[growing], trees[1 - growing]
            new = mine.extend(self._rng.uniform(self._lower, self._upper), self._eps, motions)
            if new is not None:
                met = other.reach(mine.rows[new], self._eps, motions, stop)
                if met is not None:
                    ends = (new, met) if growing == 0 else (met, new)
                    bridge = np.vstack([trees[0].branch(ends[0]), trees[1].branch(ends[1])[::-1]])
                    return joined(first, bridge, second, chain=chain)
            growing = 1 - growing
        return None


class KernelCuts:
    """Random shortcuts of a route in a kernel, a fixed number of them (:mod:`rrtik_ompl.fast.search.shortcut`)."""

    def __init__(self, world: Any, seed: int) -> None:
        self._world, self._rng = world, np.random.default_rng(seed)

    def __call__(self, route: Matrix) -> Matrix:
        """The route, shape (k, n), shortened; all its edges must be free."""
        if len(route) < 3:
            return route
        search = ShortcutSearch(self._world.motions, route, seed=int(self._rng.integers(2**62)), asking=False)
        search.run(CUTS, patience=PATIENCE)
        return search.waypoints


def has_kernels(world: Any) -> bool:
    """Whether searches can run in kernels in this world."""
    return getattr(world, "fast", None) is not None and None not in (library(KERNELS), library(CUT_KERNELS))


class Tree:
    """Vertices that hang on roots.

    Attributes:
        rows: The vertices, the roots first.
        parents: Number of each vertex's parent, -1 for a root.
    """

    def __init__(self, roots: Matrix) -> None:
        self.rows: list[Vector] = list(roots)
        self.parents = [-1] * len(roots)
        self._memory = np.array(roots)

    def extend(self, target: Vector, eps: float, motions: Motions) -> int | None:
        """EXTEND: a step of at most ``eps`` from the nearest vertex; the new vertex, or None if it is trapped."""
        near = self.nearest(target)
        return self._step(near, target, eps, motions)

    def reach(self, target: Vector, eps: float, motions: Motions, stop: Stop) -> int | None:
        """CONNECT: steps towards a target until it is reached; the vertex that is the target, or None."""
        vertex: int | None = self.nearest(target)
        while vertex is not None and not stop():
            if (self.rows[vertex] == target).all():
                return vertex
            vertex = self._step(vertex, target, eps, motions)
        return None

    def branch(self, vertex: int) -> Matrix:
        """Configurations from a root to a vertex, shape (k, n)."""
        rows = []
        while vertex >= 0:
            rows.append(self.rows[vertex])
            vertex = self.parents[vertex]
        return np.array(rows[::-1])

    def nearest(self, target: Vector) -> int:
        """The vertex nearest to a configuration."""
        gaps = self._memory[: len(self.rows)] - target
        return int(np.einsum("ij,ij->i", gaps, gaps).argmin())

    def add(self, row: Vector, parent: int) -> int:
        """Append a vertex; returns its number."""
        if len(self.rows) == len(self._memory):
            self._memory = np.vstack([self._memory, np.empty_like(self._memory)])
        self._memory[len(self.rows)] = row
        self.rows.append(row)
        self.parents.append(parent)
        return len(self.rows) - 1

    def _step(self, near: int, target: Vector, eps: float, motions: Motions) -> int | None:
        start = self.rows[near]
        length = float(np.linalg.norm(target - start))
        row = target if length <= eps else start + (target - start) * (eps / length)
        free = length > 0.0 and bool(motions.motion_valid_batch(start[None], row[None])[0])
        return self.add(row, near) if free else None


def joined(first: Matrix, bridge: Matrix, second: Matrix, *, chain: bool) -> Joined:
    """A piece up to the begin of a bridge, the bridge, and the other piece from its end on; no row twice running."""
    begin = int(np.flatnonzero((first == bridge[0]).all(axis=1))[0])
    end = int(np.flatnonzero((second == bridge[-1]).all(axis=1))[-1])
    bridge = without_repeats(bridge)
    path = np.vstack([first[:begin], bridge, second[end + 1 :] if chain else second[:0]])
    return Joined(path, begin, begin + len(bridge) - 1)
