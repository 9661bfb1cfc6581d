"""The workspace trees as published [3], grown level by level for many passes at once, and a baseline in joint space.

A pass adds one node to each level, joined to a node of the level before. Samples do not depend on the tree, and a level
depends only on the level before it. So a whole block of passes can be added to one level before the next, provided that
a node chooses its parent only among nodes of earlier passes and its own. The tree is the same, without a loop over
passes. The baseline is an RRT in the space of joint angles, where every vertex is compared with the goal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, finite_array
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.ik.mb_rrt.links import Links, directions, joints_to_chain

PASSES = 10_000
FIRST_BLOCK = 32  # passes of the first block; each later block is as large as all before it
SCORES = 1 << 15  # number of scores that are computed at once, so that they stay in the cache
MARGIN = 0.01  # share of the reach by which a node must lie outside its region to be counted
STEP = np.radians(3.0)  # step of the joint-space tree, the "3 units" of the published demonstration
VERTICES_AT_A_TIME = 500  # vertices of the joint-space tree between two comparisons with the goal

Draw = Callable[[Links, Vector, int, int, np.random.Generator], Matrix]
Rule = Callable[[Matrix, float], Matrix]


@dataclass(frozen=True, slots=True)
class Variant:
    """One configuration of the method.

    Attributes:
        name: Name by which it is chosen.
        title: Name that [3] uses.
        draw: Function of (links, goal, index, count, rng) that returns samples for the joint of an index, shape
            (count, dimension).
        rule: Function of squared distances to the sample and the link's length that returns the scores which the parent
            minimises.
    """

    name: str
    title: str
    draw: Draw
    rule: Rule


def square(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """Draw samples uniformly in the square, or cube, around the base that holds the whole reach."""
    return rng.uniform(-links.reach, links.reach, (count, links.dimension))


def square_then_goal(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """Draw samples as `square` does, but take the goal itself for the last index: the "*" option."""
    if index < links.count:
        return square(links, goal, index, count, rng)
    return np.broadcast_to(goal, (count, links.dimension))


def surface(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """Draw samples on the circle, or sphere, around the goal whose radius is the length of the remaining links."""
    circle: Matrix = goal + links.max_span[index] * directions(count, links.dimension, rng)
    return circle


def projected(links: Links, goal: Vector, index: int, count: int, rng: np.random.Generator) -> Matrix:
    """Draw samples as `square` does, then project them radially onto the circle of `surface` [3, section 4.3]."""
    from_goal = square(links, goal, index, count, rng) - goal
    distance = np.linalg.norm(from_goal, axis=1, keepdims=True)
    on_circle: Matrix = goal + links.max_span[index] * from_goal / np.maximum(distance, np.finfo(float).tiny)
    return on_circle


def nearest(squared: Matrix, length: float) -> Matrix:
    """Return the scores of rule A, which prefers the node nearest to the sample."""
    return squared


def one_link_away(squared: Matrix, length: float) -> Matrix:
    """Return the scores of rule B, which prefers a distance from the sample close to the link's length; in place."""
    off = np.sqrt(squared, out=squared)
    off -= length
    return np.abs(off, out=off)


VARIANTS: Mapping[str, Variant] = MappingProxyType(
    {
        each.name: each
        for each in (
            Variant("uniform-a", "RRT Uniforme A", square, nearest),
            Variant("uniform-b", "RRT Uniforme B", square, one_link_away),
            Variant("uniform-a-star", "RRT Uniforme A*", square_then_goal, nearest),
            Variant("uniform-b-star", "RRT Uniforme B*", square_then_goal, one_link_away),
            Variant("projected-a", "RRT, projected samples, A", projected, nearest),
            Variant("projected-b", "RRT, projected samples, B", projected, one_link_away),
            Variant("surface-a", "RRT Superficie A", surface, nearest),
            Variant("surface-b", "RRT Superficie B (MB-RRT)", surface, one_link_away),
        )
    }
)


def variant(name: str) -> Variant:
    """The variant of a name.

    Raises:
        UnknownNameError: If there is none.
    """
    if name not in VARIANTS:
        raise UnknownNameError("variant of MB-RRT", name, VARIANTS)
    return VARIANTS[name]


@dataclass(frozen=True, slots=True, eq=False)
class TreeSearch:
    """A grown tree. Level i holds the nodes of index i, one for each pass; level 0 holds only the base.

    Attributes:
        links: The chain.
        goal: Position of the goal, shape (dimension,).
        nodes: Positions of the nodes of each level, shape (1, dimension) for the first and (passes, dimension) for the
            n others.
        parents: For each level but the first, the rows of the parents in the level before, shape (passes,).
        misses: Distance of the end from the goal in each pass, shape (passes,).
        solved_in: The first pass, counted from 1, whose end is within the tolerance; 0 if there is none.
    """

    links: Links
    goal: Vector
    nodes: tuple[Matrix, ...]
    parents: tuple[NDArray[np.int64], ...]
    misses: Vector
    solved_in: int

    @property
    def passes(self) -> int:
        """Number of passes, the published count of iterations."""
        return len(self.misses)

    @property
    def chain(self) -> Matrix:
        """Nodes from the base to the solution, or to the end that came nearest to the goal; (n + 1, dimension)."""
        row = self.solved_in - 1 if self.solved_in else int(np.argmin(self.misses))
        return self.branch(row)

    def branch(self, row: int) -> Matrix:
        """Nodes from the base to the end of a pass, shape (n + 1, dimension)."""
        rows = [row]
        for parents in reversed(self.parents):
            rows.append(int(parents[rows[-1]]))
        return np.array([level[k] for level, k in zip(self.nodes, reversed(rows), strict=True)])

    def outside(self, margin: float = MARGIN) -> int:
        """Count the nodes of index 1..n-1 that are farther from the goal than the length of the remaining links.

        Args:
            margin: Least excess that counts, as a share of the reach.
        """
        margin_distance = margin * self.links.reach
        beyond = (
            np.linalg.norm(level - self.goal, axis=1) > radius + margin_distance
            for level, radius in zip(self.nodes[1:-1], self.links.max_span[1:-1], strict=True)
        )
        return int(sum(np.count_nonzero(mask) for mask in beyond))

    def rho(self, margin: float = MARGIN) -> float:
        """Return the share of nodes of index 1..n-1 that are outside, see :meth:`outside`."""
        counted = self.passes * (self.links.count - 1)
        return self.outside(margin) / counted if counted else 0.0

    def until(self, passes: int) -> TreeSearch:
        """Return the tree as it was after the given number of passes."""
        parents_until = tuple(rows[:passes] for rows in self.parents)
        solved = self.solved_in if self.solved_in <= passes else 0
        nodes = (self.nodes[0], *(level[:passes] for level in self.nodes[1:]))
        return TreeSearch(self.links, self.goal, nodes, parents_until, self.misses[:passes], solved)

    def edge_error(self) -> float:
        """Return the largest difference between the length of an edge and that of its link."""
        worst = 0.0
        for level, before, parents, length in zip(
            self.nodes[1:], self.nodes, self.parents, self.links.lengths, strict=False
        ):
            off = np.abs(np.linalg.norm(level - before[parents], axis=1) - length)
            worst = max(worst, float(off.max(initial=0.0)))
        return worst


def first_hit(misses: Vector, tolerance: float) -> int:
    """Return the first pass, counted from 1, that misses by less than the tolerance; 0 if there is none."""
    hits = np.flatnonzero(misses < tolerance)
    return int(hits[0]) + 1 if len(hits) else 0


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
        goal: Position of the goal, shape (dimension,).
        kind: One of ``VARIANTS``, or its name.
        tolerance: Distance from the goal that a miss must be below, in the unit of the lengths.
        rng: Source of random numbers.
        passes: Largest number of passes.
        stop: Whether to stop at the first success; if not, all passes are done (10,000 for the published rho).

    Raises:
        InputError: If the goal is out of reach; the message says by how much.
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
    """Append ``count`` passes to every level of a tree; the lists ``nodes`` and ``parents`` are changed in place."""
    for index in range(1, links.count + 1):
        length = float(links.lengths[index - 1])
        samples = kind.draw(links, goal, index, count, rng)
        chosen = best_parents(nodes[index - 1], samples, length, kind.rule)
        placed = one_link(nodes[index - 1][chosen], samples, length, rng)
        nodes[index] = np.vstack([nodes[index], placed])
        parents[index - 1] = np.append(parents[index - 1], chosen)


def best_parents(nodes: Matrix, samples: Matrix, length: float, rule: Rule) -> NDArray[np.int64]:
    """Return for each sample the node with the best score, among those up to the sample's own pass.

    Args:
        nodes: Nodes of the index before, in the order of their passes, shape (k, d), k >= m; or only the base, (1, d).
        samples: Samples of the last m passes, shape (m, d).
        length: Length of the link.
        rule: Rule for the scores, see `Variant`.

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
        score[later[0], num_before + begin + later[1]] = np.inf  # Nodes of later passes cannot be parents.
        best[begin : begin + rows] = score.argmin(axis=1)
    return best


def _squared_distances(samples: Matrix, columns: Matrix) -> Matrix:
    """Return the squared distances between samples, shape (m, d), and nodes, shape (d, k); shape (m, k)."""
    total: Matrix = samples[:, :1] - columns[0]
    total *= total
    for axis in range(1, len(columns)):
        off = samples[:, axis : axis + 1] - columns[axis]
        off *= off
        total += off
    return total


def one_link(parents: Matrix, samples: Matrix, length: float, rng: np.random.Generator) -> Matrix:
    """Return the points at a link's length from each parent towards its sample, shapes (m, d).

    The direction is random if the sample lies on the parent.
    """
    towards = samples - parents
    distance = np.linalg.norm(towards, axis=1)
    if not distance.all():
        lost = distance == 0.0
        towards[lost] = directions(int(lost.sum()), towards.shape[1], rng)
        distance[lost] = 1.0
    placed: Matrix = parents + length * (towards / distance[:, None])
    return placed


def grow_in_joint_space(
    links: Links,
    goal: ArrayLike,
    *,
    tolerance: float,
    rng: np.random.Generator,
    passes: int = PASSES,
    stop: bool = True,
    step: float = STEP,
) -> TreeSearch:
    """Grow a classical RRT in [-pi, pi]^n from the stretched arm, with uniform samples, no goal bias and no wrapping.

    Args:
        links: A planar chain.
        goal: Position of the goal, shape (2,).
        tolerance: Distance from the goal that a miss must be below, in the unit of the lengths.
        rng: Source of random numbers.
        passes: Largest number of vertices; one vertex is one published iteration.
        stop: Whether to stop at the first success.
        step: Longest edge [rad, Euclidean].

    Raises:
        InputError: If the goal is out of reach, the chain is not planar or the step not above 0.
    """
    target = links.reachable(goal)
    if links.dimension != 2 or not step > 0.0:
        raise InputError("the joint-space tree needs a planar chain and a step greater than 0")
    limit = float(finite_array(tolerance, (), "tolerance"))

    Q = np.zeros((passes + 1, links.count))
    done = 0
    solved = 0
    chains = np.zeros((passes, links.count + 1, 2))
    misses = np.zeros(passes)

    while done < passes and not (stop and solved):
        fresh = slice(done, min(done + VERTICES_AT_A_TIME, passes))
        _extend(Q, fresh.start + 1, fresh.stop + 1, step, rng)
        chains[fresh] = joints_to_chain(links.lengths, Q[fresh.start + 1 : fresh.stop + 1])
        misses[fresh] = np.linalg.norm(chains[fresh, -1] - target, axis=1)
        done = fresh.stop
        solved = first_hit(misses[:done], limit)
    levels = (np.zeros((1, 2)), *(chains[:done, i] for i in range(1, links.count + 1)))
    parents = (np.zeros(done, dtype=np.int64), *(np.arange(done),) * (links.count - 1))
    run = TreeSearch(links, target, levels, parents, misses[:done], solved)
    return run.until(solved) if stop and solved else run


def _extend(Q: Matrix, begin: int, end: int, step: float, rng: np.random.Generator) -> None:
    """Extend a tree by the vertices begin..end-1, which are written to the rows of Q in place."""
    samples = rng.uniform(-np.pi, np.pi, (end - begin, Q.shape[1]))
    squares = np.einsum("ij,ij->i", Q[:end], Q[:end])
    for row, sample in zip(range(begin, end), samples, strict=True):
        near = Q[np.argmin(squares[:row] - 2.0 * (Q[:row] @ sample))]
        towards = sample - near
        Q[row] = near + towards * min(1.0, step / float(np.linalg.norm(towards)))
        squares[row] = Q[row] @ Q[row]
