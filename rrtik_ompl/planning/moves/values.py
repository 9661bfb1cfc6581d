"""Which joint values a lattice of moves is made of: those of a route, and further ones thinned out to fit a size."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import TypeAlias

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, distinct

MOST_VALUES = 64  # of one joint; with more of them the shift at random does more
STEPS_ASIDE = 4  # new values on each side of a known one

Values: TypeAlias = list[Vector]  # for each joint, ascending


def values_of(rows: Matrix) -> Values:
    """The values that each joint takes in rows, shape (k, n)."""
    return [distinct(column) for column in rows.T]


def lattice_size(values: Sequence[Vector]) -> int:
    """Number of configurations of a lattice."""
    return prod(len(v) for v in values)


def spread_values(lower: float, upper: float, count: int, rng: np.random.Generator) -> Vector:
    """``count`` values between two limits at equal distances, shifted at random."""
    values: Vector = lower + (np.arange(count) + rng.random()) / count * (upper - lower)
    return values


def with_spread(
    values: Values, joints: Sequence[int], lower: Vector, upper: Vector, most_nodes: int, rng: np.random.Generator
) -> Values:
    """The values, and for some joints as many more between their limits as the size of the lattice allows.

    Args:
        values: For each of the n joints.
        joints: Those that get more values.
        lower: Limits, shape (n,).
        upper: Limits, shape (n,).
        most_nodes: Largest size.
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
    """The values of a route, and on both sides of those that are free to change as many as the size allows.

    Args:
        route: Shape (k, n); the values of its ends are not free.
        width: The farthest new value [share of the joint's range]; the next ones are half, a quarter ... as far.
        lower: Limits, shape (n,).
        upper: Limits, shape (n,).
        most_nodes: Largest size.
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
    """The values that a route of no more than some travel can take; None if there is no such route.

    Args:
        values: For each joint; those of start and goal are among them.
        start: Where the route begins, shape (n,).
        goal: Where it ends.
        costs: Cost of each joint's travel, shape (n,).
        max_travel: Travel of the whole route, in the unit of the costs.
    """
    low = np.minimum(start, goal)
    high = np.maximum(start, goal)
    spare_travel = max_travel - float(costs @ (high - low))
    if spare_travel < 0.0:
        return None

    joints = zip(values, low, high, costs, strict=True)
    detour_costs = [2.0 * cost * np.maximum(a - v, v - b) for v, a, b, cost in joints]
    return [v[detour <= spare_travel] for v, detour in zip(values, detour_costs, strict=True)]
