"""Trees of free links that end exactly on the goal: grown on arcs of intersection, or closed by the last two links.

[3] proposes the arcs without working them out. A node is useful if and only if the rest of the chain can span its
distance from the goal, ``min_span[i] <= |x - g| <= max_span[i]``. By the law of cosines this is an interval of the
cosine of the angle between the edge and the direction to the goal, in the plane and in space alike. So every node is
inside its solution region, and every pass ends at the goal.

The alternative is a planar tree that grows by surface sampling and rule B up to index n - 2; the elbow of the last two
links is then where the circles about node and goal intersect.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.mb_rrt.links import Links, directions
from rrtik_ompl.ik.mb_rrt.published import PASSES, TreeSearch, best_parents, one_link, one_link_away, surface

MIN_DISTANCE = 1e-150  # A direction over a shorter distance is inaccurate, since squares below 1e-300 lose digits.


def grow_on_arcs(links: Links, goal: ArrayLike, *, rng: np.random.Generator, passes: int = 1) -> TreeSearch:
    """Grow passes on arcs of intersection; each starts at the base and ends at the goal.

    Args:
        links: The chain, base at the origin.
        goal: Position of the goal, shape (dimension,).
        rng: Source of random numbers.
        passes: Number of solutions wanted.

    Raises:
        InputError: If the goal is out of reach; the message says by how much.
    """
    target = links.reachable(goal)
    chains = arc_chains(links, np.tile(target, (passes, 1)), rng)
    parents = (np.zeros(passes, dtype=np.int64), *(np.arange(passes),) * (links.count - 1))
    misses = np.linalg.norm(chains[:, -1] - target, axis=1)
    levels = (chains[:1, 0], *chains[:, 1:].transpose(1, 0, 2))
    return TreeSearch(links, target, levels, parents, misses, min(passes, 1))


def arc_chains(links: Links, goals: Matrix, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a random solution for each of many goals in reach, shape (m, dimension).

    Nodes from base to goal, shape (m, n + 1, dimension).
    """
    node = np.zeros((len(goals), links.dimension))
    nodes = [node]
    for index in range(1, links.count + 1):
        node = node + links.lengths[index - 1] * _edge_directions(links, goals, node, index, rng)
        nodes.append(node)
    return np.stack(nodes, axis=1)


def cosine_interval(distance: Vector, length: float, min_distance: float, max_distance: float) -> tuple[Vector, Vector]:
    """Return the interval of the cosine between an edge and the direction to the goal that gives a useful distance.

    Args:
        distance: Distances of the parents from the goal, shape (m,).
        length: Length of the edge.
        min_distance: Least distance of the new node from the goal.
        max_distance: Largest distance of the new node from the goal.

    Returns:
        Lower and upper ends, shape (m,) each, not clipped: the interval is empty if it lies outside -1..1.
    """
    squares = distance**2 + length**2
    twice_the_product = 2.0 * np.maximum(distance, MIN_DISTANCE) * length
    return (squares - max_distance**2) / twice_the_product, (squares - min_distance**2) / twice_the_product


def _edge_directions(links: Links, goals: Matrix, parents: Matrix, index: int, rng: np.random.Generator) -> Matrix:
    """Draw unit vectors from the parents, shape (m, dimension), to useful nodes of an index; same shape."""
    towards = goals - parents
    distance = np.linalg.norm(towards, axis=1)
    arbitrary = directions(len(parents), links.dimension, rng)
    axis = np.where(distance[:, None] > MIN_DISTANCE, towards / np.maximum(distance, MIN_DISTANCE)[:, None], arbitrary)
    # The last edge points at the goal; the law of cosines would give this only to the square root of rounding.
    if index == links.count:
        return axis

    length = float(links.lengths[index - 1])
    cosines = cosine_interval(distance, length, float(links.min_span[index]), float(links.max_span[index]))
    low, high = (np.clip(end, -1.0, 1.0) for end in cosines)
    share = rng.uniform(size=len(parents))

    if links.dimension == 2:  # In the plane, draw uniformly in the angle, on a random side.
        angle = np.arccos(low) + share * (np.arccos(high) - np.arccos(low))
        sign = rng.choice([-1.0, 1.0], len(parents))
        across = np.column_stack([-axis[:, 1], axis[:, 0]])
        turned: Matrix = np.cos(angle)[:, None] * axis + (sign * np.sin(angle))[:, None] * across
        return turned

    cosine = low + share * (high - low)  # A uniform cosine is uniform on the band of the sphere.
    across = _perpendicular(axis, rng)
    tilted: Matrix = cosine[:, None] * axis + np.sqrt((1.0 - cosine) * (1.0 + cosine))[:, None] * across
    return tilted


def _perpendicular(axis: Matrix, rng: np.random.Generator) -> Matrix:
    """Draw a random unit vector perpendicular to each row, shape (m, 3)."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axis, first)
    turn = rng.uniform(-np.pi, np.pi, len(axis))[:, None]
    perpendicular: Matrix = np.cos(turn) * first + np.sin(turn) * second
    return perpendicular


def grow_and_close(
    links: Links, goal: ArrayLike, *, rng: np.random.Generator, passes: int = PASSES
) -> tuple[Matrix | None, int]:
    """Grow a planar tree until the last two links reach from a new node to the goal.

    Args:
        links: A planar chain of at least two links.
        goal: Position of the goal, shape (2,).
        rng: Source of random numbers.
        passes: Largest number of passes.

    Returns:
        The chain of nodes, shape (n + 1, 2), or None; and the number of passes done.

    Raises:
        InputError: If the goal is out of reach, or the chain is of another kind.
    """
    target = links.reachable(goal)
    if links.dimension != 2 or links.count < 2:
        raise InputError("closing the last two links needs a planar chain of at least two")

    levels: list[list[Vector]] = [[np.zeros(2)]] + [[] for _ in range(links.count - 2)]
    parents: list[list[int]] = [[] for _ in range(links.count - 2)]

    for done in range(1, passes + 1):
        for index in range(1, links.count - 1):
            sample = surface(links, target, index, 1, rng)
            length = float(links.lengths[index - 1])
            before = np.array(levels[index - 1])
            chosen = best_parents(before, sample, length, one_link_away)
            levels[index].append(one_link(before[chosen], sample, length, rng)[0])
            parents[index - 1].append(int(chosen[0]))

        elbow = _elbow(levels[-1][-1], target, float(links.lengths[-2]), float(links.lengths[-1]), rng)
        if elbow is not None:
            return np.array([*_walk(levels, parents), elbow, target]), done

    return None, passes


def _elbow(node: Vector, goal: Vector, first: float, second: float, rng: np.random.Generator) -> Vector | None:
    """Return a point at distance ``first`` from the node and ``second`` from the goal, on a random side.

    None if the two circles do not intersect.
    """
    towards = goal - node
    distance = float(np.linalg.norm(towards))
    if not abs(first - second) <= distance <= first + second or distance == 0.0:
        return None

    along = (distance**2 + first**2 - second**2) / (2.0 * distance)
    across = rng.choice([-1.0, 1.0]) * np.sqrt(max(first**2 - along**2, 0.0))
    unit = towards / distance
    elbow: Vector = node + along * unit + across * np.array([-unit[1], unit[0]])
    return elbow


def _walk(levels: list[list[Vector]], parents: list[list[int]]) -> list[Vector]:
    """Return the nodes from the base to the newest one of the last level."""
    row = len(levels[-1]) - 1
    found = []
    for index in range(len(levels) - 1, 0, -1):
        found.append(levels[index][row])
        row = parents[index - 1][row]
    return [levels[0][0], *reversed(found)]
