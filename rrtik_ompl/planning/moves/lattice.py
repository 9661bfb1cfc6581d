"""A lattice of joint values, and the best route of single-joint moves on it: fewest moves first, least travel second.

Source: the level sets of free runs of [1, ch. 6.3], with values at any distance from each other. The values of a
lattice are those of a route, and further values, as many as its size allows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import prod
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, distinct
from rrtik_ompl.world.motion_queries import MotionsFree

ROUNDING = 1e-12  # relative rounding error of a sum of travels
MOST_VALUES = 64  # limit of the new values of a joint; beyond it a random shift gains more than more values
STEPS_ASIDE = 4  # limit of the new values on each side of a known one

Values: TypeAlias = list[Vector]  # for each joint the values of a lattice, ascending
Costs: TypeAlias = NDArray[np.float64]  # one number for each configuration, in the shape of the lattice
Index: TypeAlias = tuple[int, ...]  # of a configuration in a lattice: for each axis the index of its value


class MoveLattice:
    """All configurations whose joints take given values.

    A segment joins two neighbouring configurations along one joint. A run is a sequence of free segments along one
    joint. A move goes from any configuration of a run to any other.

    Attributes:
        values: For each joint the values that it may take, ascending.
        size: Number of configurations.

    Args:
        values: For each joint the values that it may take, in any order.
        motions_free: Returns which straight motions are free, for batches of shape (m, n). It is asked for all
            configurations, as motions of no length, and for the segments between free neighbours.
        costs: Cost of each joint's travel, shape (n,).
    """

    def __init__(self, values: Sequence[Vector], motions_free: MotionsFree, costs: Vector) -> None:
        self.values = [distinct(v) for v in values]
        # Joints with one value have no axis, because an array has 64 axes at most. The lists below have an entry for
        # each axis:
        # its joint, its values, its values times the cost of travel, and which segments between neighbours are free.
        self._axis_joints = [joint for joint, v in enumerate(self.values) if len(v) > 1] or [0]
        self._axis_values = [self.values[joint] for joint in self._axis_joints]
        self._shape = tuple(len(v) for v in self._axis_values)
        self.size = int(np.prod(self._shape))
        self._weighted_values = [self.values[joint] * costs[joint] for joint in self._axis_joints]
        self._segment_is_free = self._free_segments(motions_free)

    def best_route(
        self, start: Vector, goal: Vector, order: Sequence[int], max_moves: int | None = None
    ) -> Matrix | None:
        """Return the route with the fewest moves between two configurations, and the least travel among these.

        The search is breadth-first by moves: it computes the least travel with which each configuration is reached in
        at most 0, 1, 2, ... moves until the goal is reached, and then traces the route back.

        Args:
            start: A configuration of the lattice, shape (n,).
            goal: A configuration of the lattice, shape (n,).
            order: All joints. Of equally good routes, the one whose last moves come first in this order is returned.
            max_moves: Limit of the moves of a route; None for no limit.

        Returns:
            Shape (moves + 1, n), or None if there is no such route.
        """
        goal_index = self._index(goal)
        step_costs = self._step_costs()

        # costs_by_moves[k] is the least travel to each configuration in at most k moves, infinite if k moves are not
        # enough.
        costs_by_moves = [np.full(self._shape, np.inf)]
        costs_by_moves[0][self._index(start)] = 0.0

        while not np.isfinite(costs_by_moves[-1][goal_index]):
            if len(costs_by_moves) - 1 == max_moves:
                return None
            costs_by_moves.append(_costs_after_a_move(costs_by_moves[-1], step_costs))
            reached = np.isfinite(costs_by_moves[-1])
            reached_before = np.isfinite(costs_by_moves[-2])
            if (reached == reached_before).all():
                return None

        axis_order = [self._axis_joints.index(joint) for joint in order if joint in self._axis_joints]
        return self._route_back_from(costs_by_moves, goal_index, axis_order)

    def close_colliding_segments(self, route: Matrix, motions_free: MotionsFree) -> int:
        """Check the segments of a route of the lattice again, and close those that are not free, in place.

        Args:
            route: Shape (k, n).
            motions_free: Returns which straight motions are free, for batches of shape (m, n).

        Returns:
            How many segments were closed.
        """
        indices = [np.array(self._index(q)) for q in route]
        num_closed = 0
        for here, there in pairwise(indices):
            axis = int(np.flatnonzero(here != there)[0])
            low, high = sorted((int(here[axis]), int(there[axis])))
            run_indices = np.repeat(here[:, None], high - low + 1, axis=1)  # shape (axes, configurations)
            run_indices[axis] = np.arange(low, high + 1)
            configurations = self._configurations(run_indices)

            colliding = np.flatnonzero(~motions_free(configurations[:-1], configurations[1:]))
            _line(self._segment_is_free[axis], tuple(here.tolist()), axis)[low + colliding] = False
            num_closed += len(colliding)
        return num_closed

    def _free_segments(self, motions_free: MotionsFree) -> list[Mask]:
        """Check all segments of the lattice.

        Returns:
            For each axis a mask of the free segments along it, in the shape of the lattice with one cell less on that
            axis.
        """
        rows = self._configurations(np.indices(self._shape).reshape(len(self._shape), -1))
        is_free = motions_free(rows, rows).reshape(self._shape)
        row_numbers = np.arange(self.size).reshape(self._shape)

        # Only segments with two free ends are checked.
        candidates = [_both_ends_free(is_free, axis) for axis in range(len(self._shape))]
        tails = [_without_last(row_numbers, axis)[mask] for axis, mask in enumerate(candidates)]
        heads = [_without_first(row_numbers, axis)[mask] for axis, mask in enumerate(candidates)]
        motion_is_free = motions_free(rows[np.concatenate(tails)], rows[np.concatenate(heads)])

        answers = np.split(motion_is_free, np.cumsum([len(part) for part in tails])[:-1])
        for mask, answer in zip(candidates, answers, strict=True):
            mask[mask] = answer
        return candidates

    def _configurations(self, indices: NDArray[np.int64]) -> Matrix:
        """Return the configurations at indices given for each axis, shape (axes, m), as rows, shape (m, n)."""
        rows = np.repeat(np.array([[values[0] for values in self.values]]), indices.shape[1], axis=0)
        columns = [values[index] for values, index in zip(self._axis_values, indices, strict=True)]
        rows[:, self._axis_joints] = np.stack(columns, axis=1)
        return rows

    def _index(self, q: Vector) -> Index:
        """Return the index in the lattice of one of its configurations, shape (n,)."""
        pairs = zip(self._axis_values, self._axis_joints, strict=True)
        return tuple(int(np.searchsorted(values, q[joint])) for values, joint in pairs)

    def _step_costs(self) -> list[tuple[int, Costs]]:
        """Return the cost of each segment along each axis with more than one value.

        Returns:
            Pairs of an axis and its costs in the shape of the lattice, that axis moved to the front; infinite where
            closed.
        """
        found = []
        for axis, count in enumerate(self._shape):
            if count > 1:
                travel_costs = np.diff(self._weighted_values[axis]).reshape(-1, *[1] * (len(self._shape) - 1))
                is_free = self._segment_is_free[axis].swapaxes(axis, 0)
                found.append((axis, np.where(is_free, travel_costs, np.inf)))
        return found

    def _route_back_from(self, costs_by_moves: list[Costs], goal_index: Index, axis_order: Sequence[int]) -> Matrix:
        """Trace the route to a configuration from its last move to its first, and return it, shape (moves + 1, n)."""
        indices = [goal_index]
        for moves in range(len(costs_by_moves) - 1, 0, -1):
            here = indices[-1]
            cost = float(costs_by_moves[moves][here])
            indices.append(next(self._predecessors(costs_by_moves[moves - 1], here, cost, axis_order)))
        return self._configurations(np.array(indices[::-1]).T)

    def _predecessors(
        self, costs_before: Costs, here: Index, cost: float, axis_order: Sequence[int]
    ) -> Iterator[Index]:
        """Yield the configurations from which the last move of a best route to a configuration may come.

        Args:
            costs_before: Least costs with one move fewer.
            here: Index of the configuration.
            cost: Its least cost.
            axis_order: Axes in the order in which they are tried.
        """
        for axis in axis_order:
            low, high = self._free_run(axis, here)
            travel = np.abs(self._weighted_values[axis][low : high + 1] - self._weighted_values[axis][here[axis]])
            sums = _line(costs_before, here, axis)[low : high + 1] + travel
            # Equal to the least cost but for rounding.
            for k in np.flatnonzero(sums <= cost * (1.0 + ROUNDING) + ROUNDING):
                if low + k != here[axis]:
                    yield (*here[:axis], low + int(k), *here[axis + 1 :])

    def _free_run(self, axis: int, here: Index) -> tuple[int, int]:
        """Return the first and last index on an axis of the run that contains a configuration.

        Segment k joins the values k and k + 1.
        """
        is_free = _line(self._segment_is_free[axis], here, axis)
        blocked = np.flatnonzero(~is_free)
        next_blocked = int(np.searchsorted(blocked, here[axis]))
        low = int(blocked[next_blocked - 1]) + 1 if next_blocked > 0 else 0
        high = int(blocked[next_blocked]) if next_blocked < len(blocked) else len(is_free)
        return low, high


def _costs_after_a_move(costs: Costs, step_costs: list[tuple[int, Costs]]) -> Costs:
    """Return the least cost to reach each configuration with at most one more move.

    Costs are carried along each axis in both directions: at each step the carried cost grows by the cost of the
    segment, and is replaced by the cost so far of a configuration where that is less. A closed segment makes it
    infinite.

    Args:
        costs: Least costs so far, in the shape of the lattice.
        step_costs: See `MoveLattice._step_costs`.

    Returns:
        In the shape of the lattice.
    """
    best = costs.copy()
    for axis, cost_of_step in step_costs:
        before = costs.swapaxes(axis, 0)
        after = best.swapaxes(axis, 0)  # a view: writing to it changes `best`
        count = len(cost_of_step)
        for forward in (True, False):
            # Carry the least cost along the axis, from cell to cell.
            carried = np.full(before.shape[1:], np.inf)
            for k in range(count) if forward else range(count - 1, -1, -1):
                tail, head = (k, k + 1) if forward else (k + 1, k)
                np.minimum(carried, before[tail], out=carried)
                carried += cost_of_step[k]
                np.minimum(after[head, ...], carried, out=after[head, ...])
    return best


def _line(cells: NDArray[Any], here: Index, axis: int) -> NDArray[Any]:
    """Return the cells along an axis through an index, as a view."""
    selection: tuple[Any, ...] = (*here[:axis], slice(None), *here[axis + 1 :])
    line: NDArray[Any] = cells[selection]
    return line


def _without_last(cells: NDArray[Any], axis: int) -> NDArray[Any]:
    """Return all but the last of the cells along an axis."""
    return cells.take(range(cells.shape[axis] - 1), axis=axis)


def _without_first(cells: NDArray[Any], axis: int) -> NDArray[Any]:
    """Return all but the first of the cells along an axis."""
    return cells.take(range(1, cells.shape[axis]), axis=axis)


def _both_ends_free(is_free: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
    """Return a mask of the segments along an axis whose two ends are free."""
    both_free: NDArray[np.bool_] = _without_last(is_free, axis) & _without_first(is_free, axis)
    return both_free


def values_of(rows: Matrix) -> Values:
    """Return the values that each joint takes in rows, shape (k, n), ascending and distinct."""
    return [distinct(column) for column in rows.T]


def lattice_size(values: Sequence[Vector]) -> int:
    """Return the number of configurations of a lattice."""
    return prod(len(v) for v in values)


def spread_values(lower: float, upper: float, count: int, rng: np.random.Generator) -> Vector:
    """Return ``count`` equally spaced values between two limits, with a random shift."""
    values: Vector = lower + (np.arange(count) + rng.random()) / count * (upper - lower)
    return values


def with_spread(
    values: Values, joints: Sequence[int], lower: Vector, upper: Vector, most_nodes: int, rng: np.random.Generator
) -> Values:
    """Return values with as many more of some joints, between their limits, as the size of the lattice allows.

    Args:
        values: For each of the n joints.
        joints: The joints that get more values.
        lower: Limits, shape (n,).
        upper: Limits, shape (n,).
        most_nodes: Largest size of the lattice.
        rng: Shifts the new values.
    """
    size_of_others = lattice_size([v for joint, v in enumerate(values) if joint not in joints])
    values_per_joint = int((most_nodes / size_of_others) ** (1.0 / len(joints)))

    found = list(values)
    for joint in joints:
        count = min(values_per_joint - len(values[joint]), MOST_VALUES)
        if count > 0:
            more = spread_values(float(lower[joint]), float(upper[joint]), count, rng)
            found[joint] = distinct(np.append(values[joint], more))
    return found


def near_values(route: Matrix, width: float, lower: Vector, upper: Vector, most_nodes: int) -> Values:
    """Return the values of a route, with as many new ones around those that are free as the size allows.

    Args:
        route: Shape (k, n); the values of its ends are not free.
        width: Distance of the farthest new value [share of the joint's range]; the next ones are half, a quarter ... as
            far.
        lower: Limits, shape (n,).
        upper: Limits, shape (n,).
        most_nodes: Largest size of the lattice.
    """
    values = values_of(route)
    free = [v[(v != ends[0]) & (v != ends[1])] for v, ends in zip(values, route[[0, -1]].T, strict=True)]

    widest_that_fits = values
    for count in range(1, STEPS_ASIDE + 1):
        distances = width * 0.5 ** np.arange(count)
        steps = np.outer(upper - lower, np.concatenate([-distances, distances]))
        moved = [np.add.outer(f, step).ravel() for f, step in zip(free, steps, strict=True)]
        moved = [np.clip(m, low, high) for m, low, high in zip(moved, lower, upper, strict=True)]

        wider = [distinct(np.append(v, m)) for v, m in zip(values, moved, strict=True)]
        if lattice_size(wider) > most_nodes:
            break
        widest_that_fits = wider
    return widest_that_fits


def within_travel(values: Values, start: Vector, goal: Vector, costs: Vector, max_travel: float) -> Values | None:
    """Return the values that a route of limited travel can take; None if there is no such route.

    A value outside the interval between start and goal costs its joint a detour there and back.

    Args:
        values: For each joint; those of start and goal are among them.
        start: Begin of the route, shape (n,).
        goal: End of the route, shape (n,).
        costs: Cost of each joint's travel, shape (n,).
        max_travel: Limit of the travel of the whole route, in the unit of the costs.
    """
    low = np.minimum(start, goal)
    high = np.maximum(start, goal)
    spare_travel = max_travel - float(costs @ (high - low))
    if spare_travel < 0.0:
        return None

    joints = zip(values, low, high, costs, strict=True)
    detour_costs = [2.0 * cost * np.maximum(a - v, v - b) for v, a, b, cost in joints]
    return [v[detour <= spare_travel] for v, detour in zip(values, detour_costs, strict=True)]
