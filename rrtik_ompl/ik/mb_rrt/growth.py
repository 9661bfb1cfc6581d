"""The tree in the workspace as published [3], grown index by index for many passes at a time.

A pass adds one node of each index, joined to a node of the index before. What is sampled does not depend on the tree,
and a level depends on the level before it alone. So a whole block of passes can be added to one level before the next
one is begun, as long as a node chooses among those that its pass could know: the same tree, without a loop over
passes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array
from rrtik_ompl.ik.mb_rrt.links import Links, directions
from rrtik_ompl.ik.mb_rrt.run import TreeSearch, first_hit
from rrtik_ompl.ik.mb_rrt.variants import Rule, Variant, variant

PASSES = 10_000
FIRST_BLOCK = 32  # passes; later blocks are as large as all before them
SCORES = 1 << 15  # of candidates at a time: they stay in the cache


def grow(
    links: Links,
    goal: ArrayLike,
    kind: Variant | str = "surface-b",
    *,
    tolerance: float,
    rng: np.random.Generator,
    passes: int = PASSES,
    stop: bool = True,
) -> TreeSearch:
    """Grow a tree until a pass ends within the tolerance of the goal, or to the limit.

    Args:
        links: The chain, base at the origin.
        goal: Shape (dimension,).
        kind: One of ``VARIANTS``, or its name.
        tolerance: Unit of the lengths; a miss must be smaller.
        rng: Random numbers.
        passes: Limit.
        stop: Whether to stop at the first success; if not, all passes are done (the published rho at 10,000).

    Raises:
        InputError: If the goal is out of reach; it says by how much.
        UnknownNameError: If there is no such variant.
    """
    target = links.reachable(goal)
    chosen = variant(kind) if isinstance(kind, str) else kind
    limit = float(finite_array(tolerance, (), "tolerance"))

    nodes: list[Matrix] = [np.zeros((1, links.dimension)), *(np.zeros((0, links.dimension)),) * links.count]
    parents = [np.zeros(0, dtype=np.int64)] * links.count
    misses = np.zeros(0)
    solved = 0
    done = 0

    while done < passes and not (stop and solved):
        count = min(max(FIRST_BLOCK, done), passes - done)
        _add_passes(links, target, chosen, nodes, parents, count, rng)
        misses = np.append(misses, np.linalg.norm(nodes[-1][done:] - target, axis=1))
        solved = first_hit(misses, limit)
        done += count

    run = TreeSearch(links, target, tuple(nodes), tuple(parents), misses, solved)
    return run.until(solved) if stop and solved else run


def _add_passes(
    links: Links,
    goal: Vector,
    kind: Variant,
    nodes: list[Matrix],
    parents: list[NDArray[np.int64]],
    count: int,
    rng: np.random.Generator,
) -> None:
    """Append ``count`` passes to every level of a tree."""
    for index in range(1, links.count + 1):
        length = float(links.lengths[index - 1])
        samples = kind.draw(links, goal, index, count, rng)
        chosen = best_parents(nodes[index - 1], samples, length, kind.rule)
        placed = one_link(nodes[index - 1][chosen], samples, length, rng)
        nodes[index] = np.vstack([nodes[index], placed])
        parents[index - 1] = np.append(parents[index - 1], chosen)


def best_parents(nodes: Matrix, samples: Matrix, length: float, rule: Rule) -> NDArray[np.int64]:
    """For each sample the node that a rule likes best, among those that were there in the sample's pass.

    Args:
        nodes: Of the index before, in the order of their passes, shape (k, d), k >= m; or the base alone, (1, d).
        samples: Of the last m passes, shape (m, d).
        length: Of the link.
        rule: See `Variant`.

    Returns:
        Rows of ``nodes``, shape (m,).
    """
    best = np.zeros(len(samples), dtype=np.int64)
    if len(nodes) == 1:
        return best

    columns = np.ascontiguousarray(nodes.T)
    num_before = len(nodes) - len(samples)
    rows = max(1, SCORES // len(nodes))
    for begin in range(0, len(samples), rows):
        block = samples[begin : begin + rows]
        num_known = num_before + begin + len(block)
        score = rule(_squared_distances(block, columns[:, :num_known]), length)
        later = np.triu_indices(len(block), 1)
        score[later[0], num_before + begin + later[1]] = np.inf  # nodes of later passes
        best[begin : begin + rows] = score.argmin(axis=1)
    return best


def one_link(parents: Matrix, samples: Matrix, length: float, rng: np.random.Generator) -> Matrix:
    """The points a link's length from each parent towards its sample; anywhere if the sample lies on the parent."""
    towards = samples - parents
    distance = np.linalg.norm(towards, axis=1)
    if not distance.all():
        lost = distance == 0.0
        towards[lost] = directions(int(lost.sum()), towards.shape[1], rng)
        distance[lost] = 1.0
    placed: Matrix = parents + length * (towards / distance[:, None])
    return placed


def _squared_distances(samples: Matrix, columns: Matrix) -> Matrix:
    """Between samples, shape (m, d), and nodes, shape (d, k): (m, k)."""
    total: Matrix = samples[:, :1] - columns[0]
    total *= total
    for axis in range(1, len(columns)):
        off = samples[:, axis : axis + 1] - columns[axis]
        off *= off
        total += off
    return total
