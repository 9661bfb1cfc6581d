"""A lattice of joint values, and the best single-joint moves on it: fewest moves first, least travel second.

Source: the level sets of free runs of [1, ch. 6.3], on values at any distance from each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, distinct
from rrtik_ompl.world.motion_queries import MotionsFree

Costs: TypeAlias = NDArray[np.float64]  # one number for each configuration of a lattice
Index: TypeAlias = tuple[int, ...]  # the place of a configuration in a lattice

ROUNDING = 1e-12  # of a sum of travels, relative


class MoveLattice:
    """All configurations whose every joint takes one of the values given for it.

    A run is a stretch of the lattice along one joint without collision; a move goes from any configuration of a run to
    any other.

    Attributes:
        values: For each joint the values it may take, ascending.
        size: Number of configurations.

    Args:
        values: For each joint the values it may take, in any order.
        motions_free: Which straight motions are free, for batches of shape (m, n). Checks
            all configurations, as motions of no length, and those between free neighbours.
        costs: Cost of each joint's travel, shape (n,).
    """

    def __init__(self, values: Sequence[Vector], motions_free: MotionsFree, costs: Vector) -> None:
        self.values = [distinct(v) for v in values]
        # Joints that rest have no axis: an array has 64 at most.
        self._joints = [joint for joint, v in enumerate(self.values) if len(v) > 1] or [0]
        self._varied = [self.values[joint] for joint in self._joints]
        self._shape = tuple(len(v) for v in self._varied)
        self.size = int(np.prod(self._shape))
        self._places = [self.values[joint] * costs[joint] for joint in self._joints]
        self._open = self._open_segments(motions_free)

    def best_route(self, start: Vector, goal: Vector, order: Sequence[int], most: int | None = None) -> Matrix | None:
        """The route with the fewest moves between two configurations of the lattice, the least travel among those.

        Args:
            start: Shape (n,).
            goal: Shape (n,).
            order: All joints; among equal routes the one whose last moves come first here.
            most: Moves that a route may have; any number if None.

        Returns:
            Shape (moves + 1, n), or None if there is no such route.
        """
        end = self._index(goal)
        steps = self._steps()

        levels = [np.full(self._shape, np.inf)]
        levels[0][self._index(start)] = 0.0

        while not np.isfinite(levels[-1][end]):
            if len(levels) - 1 == most:
                return None
            levels.append(_after_a_move(levels[-1], steps))
            if (np.isfinite(levels[-1]) == np.isfinite(levels[-2])).all():
                return None

        return self._traced(levels, end, [self._joints.index(joint) for joint in order if joint in self._joints])

    def closed_on(self, route: Matrix, motions_free: MotionsFree) -> int:
        """Check the segments of a route of the lattice anew, and close those that are not free; returns their number.

        Args:
            route: Shape (k, n).
            motions_free: Which straight motions are free, for batches of shape (m, n).
        """
        places = [np.array(self._index(q)) for q in route]
        closed = 0
        for one, other in pairwise(places):
            axis = int(np.flatnonzero(one != other)[0])
            low, high = sorted((int(one[axis]), int(other[axis])))
            line = np.repeat(one[:, None], high - low + 1, axis=1)
            line[axis] = np.arange(low, high + 1)
            rows = self._rows(line)

            hit = np.flatnonzero(~motions_free(rows[:-1], rows[1:]))
            _line(self._open[axis], tuple(one.tolist()), axis)[low + hit] = False
            closed += len(hit)
        return closed

    def _open_segments(self, motions_free: MotionsFree) -> list[Mask]:
        """For each axis which motions from one value to the next are free, in the shape of the lattice less one."""
        rows = self._rows(np.indices(self._shape).reshape(len(self._shape), -1))
        inside = motions_free(rows, rows).reshape(self._shape)
        numbers = np.arange(self.size).reshape(self._shape)

        found = [_both_ends(inside, joint) for joint in range(len(self._shape))]
        tails = [_without_last(numbers, joint)[open_] for joint, open_ in enumerate(found)]
        heads = [_without_first(numbers, joint)[open_] for joint, open_ in enumerate(found)]

        free = motions_free(rows[np.concatenate(tails)], rows[np.concatenate(heads)])

        parts = np.split(free, np.cumsum([len(part) for part in tails])[:-1])
        for open_, part in zip(found, parts, strict=True):
            open_[open_] = part
        return found

    def _rows(self, places: NDArray[np.int64]) -> Matrix:
        """The configurations at places given for each axis, shape (axes, m), as rows, shape (m, n)."""
        rows = np.repeat(np.array([[v[0] for v in self.values]]), places.shape[1], axis=0)
        rows[:, self._joints] = np.stack([v[k] for v, k in zip(self._varied, places, strict=True)], axis=1)
        return rows

    def _index(self, q: Vector) -> Index:
        return tuple(int(np.searchsorted(v, q[joint])) for v, joint in zip(self._varied, self._joints, strict=True))

    def _steps(self) -> list[tuple[int, Costs]]:
        """Axes with more than one value, and what each step along them costs, that axis first; infinite if closed."""
        axes = [axis for axis, count in enumerate(self._shape) if count > 1]
        opened = [self._open[axis].swapaxes(axis, 0) for axis in axes]
        gaps = [np.diff(self._places[axis]).reshape(-1, *[1] * (len(self._shape) - 1)) for axis in axes]
        return [(axis, np.where(open_, gap, np.inf)) for axis, open_, gap in zip(axes, opened, gaps, strict=True)]

    def _traced(self, levels: list[Costs], end: Index, order: Sequence[int]) -> Matrix:
        """The route to a configuration, from the last move to the first."""
        indices = [end]
        for level in range(len(levels) - 1, 0, -1):
            here = indices[-1]
            wanted = float(levels[level][here])
            indices.append(next(self._origins(levels[level - 1], here, wanted, order)))
        return self._rows(np.array(indices[::-1]).T)

    def _origins(self, before: Costs, here: Index, wanted: float, order: Sequence[int]) -> Iterator[Index]:
        """Where a move to a configuration may come from."""
        for joint in order:
            low, high = self._run(joint, here)
            travel = np.abs(self._places[joint][low : high + 1] - self._places[joint][here[joint]])
            sums = _line(before, here, joint)[low : high + 1] + travel
            for k in np.flatnonzero(sums <= wanted * (1.0 + ROUNDING) + ROUNDING):
                if low + k != here[joint]:
                    yield (*here[:joint], low + int(k), *here[joint + 1 :])

    def _run(self, joint: int, here: Index) -> tuple[int, int]:
        """First and last place of the run of a joint that contains a configuration."""
        open_ = _line(self._open[joint], here, joint)
        blocked = np.flatnonzero(~open_)
        after = int(np.searchsorted(blocked, here[joint]))
        low = int(blocked[after - 1]) + 1 if after > 0 else 0
        return low, int(blocked[after]) if after < len(blocked) else len(open_)


def _after_a_move(costs: Costs, steps: list[tuple[int, Costs]]) -> Costs:
    """The least costs after one more move, or as before where no move helps: carried along all runs, both ways."""
    best = costs.copy()
    for axis, step in steps:
        source = costs.swapaxes(axis, 0)
        sink = best.swapaxes(axis, 0)
        count = len(step)
        for forward in (True, False):
            carried = np.full(source.shape[1:], np.inf)
            for k in range(count) if forward else range(count - 1, -1, -1):
                tail, head = (k, k + 1) if forward else (k + 1, k)
                np.minimum(carried, source[tail], out=carried)
                carried += step[k]
                np.minimum(sink[head, ...], carried, out=sink[head, ...])
    return best


def _line(cells: NDArray[Any], here: Index, joint: int) -> NDArray[Any]:
    """The cells along a joint through a place."""
    place: tuple[Any, ...] = (*here[:joint], slice(None), *here[joint + 1 :])
    line: NDArray[Any] = cells[place]
    return line


def _without_last(cells: NDArray[Any], joint: int) -> NDArray[Any]:
    """All but the last of the cells along a joint."""
    return cells.take(range(cells.shape[joint] - 1), axis=joint)


def _without_first(cells: NDArray[Any], joint: int) -> NDArray[Any]:
    """All but the first of the cells along a joint."""
    return cells.take(range(1, cells.shape[joint]), axis=joint)


def _both_ends(inside: NDArray[np.bool_], joint: int) -> NDArray[np.bool_]:
    """Which segments along a joint have two free ends."""
    open_: NDArray[np.bool_] = _without_last(inside, joint) & _without_first(inside, joint)
    return open_
