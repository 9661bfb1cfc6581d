"""Sampling on the arc of intersection: every node inside its solution region, every pass exactly at the goal.

[3] proposes it and leaves it open. A node is useful if and only if the rest of the chain can span its
distance from the goal, ``min_span[i] <= |x - g| <= max_span[i]``. By the law of cosines that is an interval of the
cosine of the angle between the edge and the direction to the goal, in the plane and in space alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.mb_rrt.links import Links, directions
from rrtik_ompl.ik.mb_rrt.run import TreeSearch

MIN_DISTANCE = 1e-150  # a direction over a shorter distance loses digits: squares smaller than 1e-300 vanish


def grow_on_arcs(links: Links, goal: ArrayLike, *, rng: np.random.Generator, passes: int = 1) -> TreeSearch:
    """Passes that each start at the base and end at the goal.

    Args:
        links: The chain, base at the origin.
        goal: Shape (dimension,).
        rng: Random numbers.
        passes: Solutions wanted.

    Raises:
        InputError: If the goal is out of reach; it says by how much.
    """
    target = links.reachable(goal)
    chains = arc_chains(links, np.tile(target, (passes, 1)), rng)
    parents = (np.zeros(passes, dtype=np.int64), *(np.arange(passes),) * (links.count - 1))
    misses = np.linalg.norm(chains[:, -1] - target, axis=1)
    levels = (chains[:1, 0], *chains[:, 1:].transpose(1, 0, 2))
    return TreeSearch(links, target, levels, parents, misses, min(passes, 1))


def arc_chains(links: Links, goals: Matrix, rng: np.random.Generator) -> NDArray[np.float64]:
    """A random solution for each of many goals within reach, shape (m, dimension): nodes, (m, n + 1, dimension)."""
    node = np.zeros((len(goals), links.dimension))
    nodes = [node]
    for index in range(1, links.count + 1):
        node = node + links.lengths[index - 1] * _edge_directions(links, goals, node, index, rng)
        nodes.append(node)
    return np.stack(nodes, axis=1)


def cosine_interval(distance: Vector, length: float, min_distance: float, max_distance: float) -> tuple[Vector, Vector]:
    """Cosines of the angle between an edge and the direction to the goal that lead to a useful distance.

    Args:
        distance: Of the parents from the goal, shape (m,).
        length: Of the edge.
        min_distance: Distance from the goal that the new node must have at least.
        max_distance: At most.

    Returns:
        Lower and upper ends, shapes (m,), not clipped: the interval is empty where it lies beyond -1 or 1.
    """
    squares = distance**2 + length**2
    twice_the_product = 2.0 * np.maximum(distance, MIN_DISTANCE) * length
    return (squares - max_distance**2) / twice_the_product, (squares - min_distance**2) / twice_the_product


def _edge_directions(links: Links, goals: Matrix, parents: Matrix, index: int, rng: np.random.Generator) -> Matrix:
    """Unit vectors from the parents to useful nodes of an index, shape (m, dimension)."""
    towards = goals - parents
    distance = np.linalg.norm(towards, axis=1)
    arbitrary = directions(len(parents), links.dimension, rng)
    axis = np.where(distance[:, None] > MIN_DISTANCE, towards / np.maximum(distance, MIN_DISTANCE)[:, None], arbitrary)
    if index == links.count:  # the law of cosines says the same, to the square root of the rounding
        return axis

    length = float(links.lengths[index - 1])
    cosines = cosine_interval(distance, length, float(links.min_span[index]), float(links.max_span[index]))
    low, high = (np.clip(end, -1.0, 1.0) for end in cosines)
    share = rng.uniform(size=len(parents))

    if links.dimension == 2:  # uniform in the angle, on either side
        angle = np.arccos(low) + share * (np.arccos(high) - np.arccos(low))
        sign = rng.choice([-1.0, 1.0], len(parents))
        across = np.column_stack([-axis[:, 1], axis[:, 0]])
        turned: Matrix = np.cos(angle)[:, None] * axis + (sign * np.sin(angle))[:, None] * across
        return turned

    cosine = low + share * (high - low)  # uniform on the band of the sphere
    across = _perpendicular(axis, rng)
    tilted: Matrix = cosine[:, None] * axis + np.sqrt((1.0 - cosine) * (1.0 + cosine))[:, None] * across
    return tilted


def _perpendicular(axis: Matrix, rng: np.random.Generator) -> Matrix:
    """A random unit vector at right angles to each row, shape (m, 3)."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axis, first)
    turn = rng.uniform(-np.pi, np.pi, len(axis))[:, None]
    perpendicular: Matrix = np.cos(turn) * first + np.sin(turn) * second
    return perpendicular
