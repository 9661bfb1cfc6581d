"""What a search brought: its tree, the pass that met the goal, and the published counters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.mb_rrt.links import Links

MARGIN = 0.01  # of the reach: how far outside its region a node must lie to be counted


@dataclass(frozen=True, slots=True, eq=False)
class TreeSearch:
    """A grown tree. Level i holds the nodes of index i, one for each pass; level 0 is the base alone.

    Attributes:
        links: The chain.
        goal: Shape (dimension,).
        nodes: For each level the positions, shapes (1, dimension) and n times (passes, dimension).
        parents: For each level but the first: rows of the level before, shape (passes,).
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
        """Nodes of index 1..n-1 farther from the goal than the length still to come.

        Args:
            margin: By how much at least, as a share of the reach; 0 counts strictly.
        """
        margin_distance = margin * self.links.reach
        beyond = (
            np.linalg.norm(level - self.goal, axis=1) > radius + margin_distance
            for level, radius in zip(self.nodes[1:-1], self.links.max_span[1:-1], strict=True)
        )
        return int(sum(np.count_nonzero(mask) for mask in beyond))

    def rho(self, margin: float = MARGIN) -> float:
        """The share of nodes of index 1..n-1 that are outside; see :meth:`outside`."""
        counted = self.passes * (self.links.count - 1)
        return self.outside(margin) / counted if counted else 0.0

    def until(self, passes: int) -> TreeSearch:
        """The tree as it was after some of its passes."""
        parents_until = tuple(rows[:passes] for rows in self.parents)
        solved = self.solved_in if self.solved_in <= passes else 0
        nodes = (self.nodes[0], *(level[:passes] for level in self.nodes[1:]))
        return TreeSearch(self.links, self.goal, nodes, parents_until, self.misses[:passes], solved)

    def edge_error(self) -> float:
        """The largest difference between an edge and its link."""
        worst = 0.0
        for level, before, parents, length in zip(
            self.nodes[1:], self.nodes, self.parents, self.links.lengths, strict=False
        ):
            off = np.abs(np.linalg.norm(level - before[parents], axis=1) - length)
            worst = max(worst, float(off.max(initial=0.0)))
        return worst


def first_hit(misses: Vector, tolerance: float) -> int:
    """The first pass, counted from 1, that misses by less than the tolerance; 0 if there is none."""
    hits = np.flatnonzero(misses < tolerance)
    return int(hits[0]) + 1 if len(hits) else 0
