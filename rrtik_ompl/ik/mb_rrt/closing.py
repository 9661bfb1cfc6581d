"""MB-RRT whose last two links are closed exactly: the elbow is where the two circles about node and goal meet.

Surface sampling and rule B up to index n - 2. Planar.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.mb_rrt.growth import PASSES, best_parents, one_link
from rrtik_ompl.ik.mb_rrt.links import Links
from rrtik_ompl.ik.mb_rrt.variants import one_link_away, surface


def grow_and_close(
    links: Links, goal: ArrayLike, *, rng: np.random.Generator, passes: int = PASSES
) -> tuple[Matrix | None, int]:
    """Grow until the last two links reach from a new node to the goal.

    Args:
        links: A planar chain of at least two links.
        goal: Shape (2,).
        rng: Random numbers.
        passes: Limit.

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
    """A point ``first`` away from the node and ``second`` from the goal, on a random side; None if there is none."""
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
    """Nodes from the base to the newest of the last level."""
    row = len(levels[-1]) - 1
    found = []
    for index in range(len(levels) - 1, 0, -1):
        found.append(levels[index][row])
        row = parents[index - 1][row]
    return [levels[0][0], *reversed(found)]
