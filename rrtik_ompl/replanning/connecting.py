"""RRT-Connect between two pieces of a path, in a kernel or in Python; all points of a piece are vertices at once.

Source: [1, ch. 5.2, algorithms 1 to 5]. The Python search follows the printed algorithms except for three slips in
them: EXTEND has reached a target when its new vertex is the target, the second tree is extended until it is trapped,
and samples are uniform.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.connect_layout import KERNELS as CONNECT_KERNELS
from rrtik_ompl.kernels.search.shortcut import ShortcutSearch
from rrtik_ompl.kernels.search.shortcut_layout import KERNELS as CUT_KERNELS
from rrtik_ompl.model.transitions import without_repeats
from rrtik_ompl.planning.search.rrt_connect import ConfigurationTree, ConnectRules, RrtConnect
from rrtik_ompl.world.motion_queries import KernelWorld, MotionFree, MotionQueries

KERNELS = (CONNECT_KERNELS, CUT_KERNELS)  # libraries that replanning in kernels needs
ITERATIONS = 4000  # samples of one search at most, so that the same seed gives the same run
SHORTCUT_TRIES = 100  # random shortcuts that are tried
SHORTCUT_PATIENCE = 40  # shortcuts without gain after which shortening ends


@dataclass(frozen=True, slots=True, eq=False)
class TreeOptions:
    """How the trees of a search grow.

    Attributes:
        lower, upper: Corners of the box to sample in, shape (n,).
        max_edge: The longest edge [unit of the space].
        seed: Seed of the samples.
        iterations: The largest number of samples of one search.
    """

    lower: Vector
    upper: Vector
    max_edge: float
    seed: int
    iterations: int = ITERATIONS

    @property
    def rules(self) -> ConnectRules:
        """These options as the search in Python takes them."""
        return ConnectRules(self.lower, self.upper, self.max_edge, max_iterations=self.iterations)


@dataclass(frozen=True, slots=True, eq=False)
class Connection:
    """Two pieces of a path and the connection between them.

    Attributes:
        path: Waypoints from the begin of the first piece to the end of the second, shape (k, n).
        begin, end: Indices of the waypoints between which the path is new.
    """

    path: Matrix
    begin: int
    end: int


class Connect(Protocol):
    """A search that connects two pieces of a path.

    Attributes:
        samples: Number of samples drawn so far, in all calls.
    """

    samples: int

    def __call__(
        self, first: Matrix, second: Matrix, motions: MotionQueries, stop: Stop, *, chain: bool = True
    ) -> Connection | None:
        """Connect the two pieces and return the whole path from ``first[0]``, or None if no connection is found.

        Args:
            first: Free path from the robot on, shape (a, n).
            second: Free path to the goal, shape (b, n); separate goals if ``chain`` is False.
            motions: Checks motions.
            stop: Ends the search when it returns True.
            chain: Whether the rows of ``second`` are a path, whose rest is followed behind the connection.
        """


class KernelConnect:
    """The search in a kernel, for worlds that have them (:mod:`rrtik_ompl.kernels.search.connect_kernels`)."""

    def __init__(self, world: KernelWorld, options: TreeOptions) -> None:
        self._search = ConnectSearch(world.motions, options.lower, options.upper, range_=options.max_edge)
        self._rng = np.random.default_rng(options.seed)
        self._iterations = options.iterations
        self.samples = 0

    def __call__(
        self, first: Matrix, second: Matrix, motions: MotionQueries, stop: Stop, *, chain: bool = True
    ) -> Connection | None:
        """Connect two pieces, see :class:`Connect`; motions that the kernel cannot prove free count as blocked."""
        seed = int(self._rng.integers(2**63))
        bridge = self._search.solve(first, second, seed, stop=stop, max_iterations=self._iterations)
        self.samples += int(self._search.statistics()["iterations"])
        return None if bridge is None else connected(first, bridge, second, chain=chain)


class PythonConnect:
    """The published search in Python, for any motion check.

    Attributes:
        trees: The trees of the last search, first and second; None before the first search.
    """

    def __init__(self, options: TreeOptions) -> None:
        self._rules = options.rules
        self._rng = np.random.default_rng(options.seed)
        self.samples = 0
        self.trees: tuple[ConfigurationTree, ConfigurationTree] | None = None

    def __call__(
        self, first: Matrix, second: Matrix, motions: MotionQueries, stop: Stop, *, chain: bool = True
    ) -> Connection | None:
        """See :class:`Connect`."""
        search = RrtConnect(first, second, self._rules, one_by_one(motions), self._rng)
        bridge = search.run(stop)
        self.trees = search.trees
        self.samples += search.iterations
        return None if bridge is None else connected(first, bridge, second, chain=chain)


class KernelCuts:
    """Random shortcuts of a route in a kernel, a fixed number of them (:mod:`rrtik_ompl.kernels.search.shortcut`)."""

    def __init__(self, world: KernelWorld, seed: int) -> None:
        self._world = world
        self._rng = np.random.default_rng(seed)

    def __call__(self, route: Matrix) -> Matrix:
        """Return the route, shape (k, n), shortened; all its edges must be free."""
        if len(route) < 3:
            return route
        search = ShortcutSearch(self._world.motions, route, seed=int(self._rng.integers(2**62)), asking=False)
        search.run(SHORTCUT_TRIES, patience=SHORTCUT_PATIENCE)
        return search.waypoints


def one_by_one(motions: MotionQueries) -> MotionFree:
    """Return a check of a single motion that calls the check of a batch."""
    return lambda a, b: bool(motions.motion_valid_batch(a[None], b[None])[0])


def connected(first: Matrix, bridge: Matrix, second: Matrix, *, chain: bool) -> Connection:
    """Join the first piece up to the bridge, the bridge, and the rest of the second piece, without repeated rows.

    Args:
        first: Waypoints of the first piece, shape (a, n).
        bridge: Waypoints from a row of ``first`` to a row of ``second``, shape (k, n).
        second: Waypoints of the second piece, shape (b, n), or separate goals.
        chain: Whether the rows of ``second`` are a path, whose rest is appended.
    """
    begin = int(np.flatnonzero((first == bridge[0]).all(axis=1))[0])
    end = int(np.flatnonzero((second == bridge[-1]).all(axis=1))[-1])
    bridge = without_repeats(bridge)
    path = np.vstack([first[:begin], bridge, second[end + 1 :] if chain else second[:0]])
    return Connection(path, begin, begin + len(bridge) - 1)
