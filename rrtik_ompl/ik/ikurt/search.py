"""IKURT made fast and robust: the published idea on batches, with the Jacobian where the way is clear.

What differs from :mod:`rrtik_ompl.ik.ikurt.published`: CONNECT tries many directions at once, the cheap metric before
the collision check, takes the best free one, and lives through misses; directions are isotropic, so that joints reach
their limits; vertices that have failed are penalised; a failure is followed by a whole batch of exploration. With
``jacobian`` a descent looks for the goal configuration from every place where that is worth it; those found and not
yet reached keep drawing the exploration towards them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.ik.ikurt.descent import descend
from rrtik_ompl.ik.ikurt.metric import ConfigurationMetric, TipMetric
from rrtik_ompl.ik.ikurt.tree import Tree

DIRECTIONS = 16  # that CONNECT tries at once
MISSES = 6  # rounds of them without a better free one, after which CONNECT gives up
GROWN, SHRUNK, SHORTEST = 1.5, 0.7, 1e-4  # of CONNECT's step after a success and a miss, and its smallest [rad]
CHECKED = 4  # of the better directions, nearest to the goal first, whose motions are checked together
SAMPLES = 24  # of one batch of exploration
LENGTHS = (1.0, 0.5, 0.2)  # shares of the exploration's step that are tried together
TOWARDS_GOALS = 0.4  # share of the samples that are known goal configurations
DESCENTS = 4  # of a batch of exploration
MOST_GOALS = 32  # goal configurations kept
NEARER = 0.5  # a new descent from the way of CONNECT when the distance has fallen to this share


@dataclass(frozen=True, slots=True)
class Options:
    """How the search works.

    Attributes:
        step: First step of CONNECT [rad].
        stride: Longest step of the exploration [rad].
        jacobian: Whether descents by the Jacobian look for goal configurations.
        most_vertices: With more the tree is dropped and another one begun; known goal configurations stay.
    """

    step: float
    stride: float
    jacobian: bool
    most_vertices: int


@dataclass(frozen=True, slots=True, eq=False)
class Judge:
    """What the search asks: which configurations are free; which motions are; whether to stop."""

    free: Callable[[Matrix], Mask]
    motions_free: Callable[[Matrix, Matrix], Mask]
    stop: Callable[[], object]


class BatchedSearch:
    """One tree from the start; see the module.

    Args:
        metric: Distance from the goal.
        options: How to work.
        lower, upper: Bounds, shape (n,).
        judge: What is free.
        rng: Random numbers.
        starts: Roots, shape (k, n).

    Attributes:
        tree: The tree, the last one after restarts.
        goals: Free goal configurations known so far, shape (k, n).
        blocked: One in collision, if any was met, shape (0 or 1, n).
        nearest: The configuration nearest to the goal that was seen, in collision or not, shape (n,).
        connects, restarts, vertices: Counts.
    """

    def __init__(
        self,
        metric: TipMetric | ConfigurationMetric,
        options: Options,
        lower: Vector,
        upper: Vector,
        judge: Judge,
        rng: np.random.Generator,
        starts: Matrix,
    ) -> None:
        self._metric, self._options, self._radius, self._lower, self._upper = metric, options, metric.radius, lower, upper
        self._judge, self._rng, self._starts = judge, rng, starts
        self._distances = metric.distance(starts)
        self.tree = Tree(starts, self._distances)
        self.goals = metric.goals if isinstance(metric, ConfigurationMetric) else starts[:0]
        self.blocked = starts[:0]
        self.connects = self.restarts = self._dropped = 0
        self.nearest, self._least = starts[self._distances.argmin()], float(self._distances.min())

    @property
    def vertices(self) -> int:
        """Vertices of all trees."""
        return self.tree.size + self._dropped

    def run(self) -> int | None:
        """The vertex at the goal, or None if the time was up first."""
        if self._least <= self._radius:
            return int(self._distances.argmin())
        while not self._judge.stop():
            found = self._connect(self.tree.best())
            if found is None:
                found = self._explore()
            if found is not None:
                return found
            if self.tree.size > self._options.most_vertices:
                self._restart()
        return None

    def _connect(self, first: int) -> int | None:
        """From one vertex down the metric; the vertex at the goal, or None at the end of the patience."""
        self.connects += 1
        vertex, step, misses = first, self._options.step, 0
        found, tried_at = self._finish(np.array([vertex])), self.tree.distance[vertex]
        while found is None and misses < MISSES and not self._judge.stop():
            lower = self._downhill(vertex, step)
            misses = misses + 1 if lower is None else 0
            step = max(step * (SHRUNK if lower is None else GROWN), SHORTEST)
            if lower is None:
                continue
            vertex = lower
            arrived = self.tree.distance[vertex] <= self._radius
            if arrived or self.tree.distance[vertex] < NEARER * tried_at:
                found, tried_at = self._finish(np.array([vertex])), self.tree.distance[vertex]
            if arrived:
                return vertex if found is None else found
        if found is None:
            self.tree.penalise(first, vertex)
        return found

    def _downhill(self, vertex: int, step: float) -> int | None:
        """The best of some free steps that lower the distance, as a new vertex."""
        q = self.tree.q[vertex]
        directions = self._rng.normal(size=(DIRECTIONS, len(q)))
        directions *= step / np.linalg.norm(directions, axis=1, keepdims=True)
        candidates = np.clip(q + directions, self._lower, self._upper)
        distances = self._metric.distance(candidates)
        order = np.argsort(distances)[:CHECKED]
        order = order[distances[order] < self.tree.distance[vertex]]
        if len(order) == 0:
            return None
        free = self._judge.motions_free(np.broadcast_to(q, (len(order), len(q))), candidates[order])
        if not free.any():
            return None
        k = order[free.argmax()]
        return int(self.tree.add(candidates[k : k + 1], np.array([vertex]), distances[k : k + 1])[0])

    def _explore(self) -> int | None:
        """A batch of steps of a plain RRT, some towards known goal configurations, and from what it adds to the goal."""
        samples = self._rng.uniform(self._lower, self._upper, (SAMPLES, len(self._lower)))
        if len(self.goals):
            drawn = int(TOWARDS_GOALS * SAMPLES)
            samples[:drawn] = self.goals[self._rng.integers(len(self.goals), size=drawn)]
        near = self.tree.nearest(samples)
        origin = self.tree.q[near]
        away = samples - origin
        length = np.linalg.norm(away, axis=1)
        share = np.minimum(1.0, self._options.stride / np.maximum(length, 1e-12))
        ends = np.concatenate([origin + away * (share * part)[:, None] for part in LENGTHS])
        free = self._judge.motions_free(np.tile(origin, (len(LENGTHS), 1)), ends).reshape(len(LENGTHS), -1)
        grown = np.flatnonzero(free.any(axis=0) & (length > 0.0))
        if len(grown) == 0:
            return None
        q = ends[free.argmax(axis=0)[grown] * SAMPLES + grown]
        new = self.tree.add(q, near[grown], self._metric.distance(q))
        direct = self._reach_known(new)
        return direct if direct is not None else self._finish(self._worth_it(new))

    def _worth_it(self, new: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of new vertices those from which to descend: the nearest one in the workspace, and others by chance."""
        nearest = new[self.tree.distance[new].argmin()]
        others = self._rng.choice(new, min(DESCENTS - 1, len(new)), replace=False)
        return np.unique(np.append(others, nearest))

    def _reach_known(self, new: NDArray[np.int64]) -> int | None:
        """Straight from new vertices to the known goal configuration nearest to each."""
        if len(self.goals) == 0:
            return None
        square = np.einsum("ij,ij->i", self.goals, self.goals)
        goals = self.goals[(square - 2.0 * self.tree.q[new] @ self.goals.T).argmin(axis=1)]
        return self._straight(new, goals)

    def _finish(self, vertices: NDArray[np.int64]) -> int | None:
        """Descend from vertices, shape (k,), and go straight to what that finds."""
        if not self._options.jacobian or isinstance(self._metric, ConfigurationMetric):
            return self._reach_known(vertices)
        ends = descend(self._metric, self.tree.q[vertices], self._lower, self._upper)
        if ends.distance.min() < self._least:
            self.nearest, self._least = ends.q[ends.distance.argmin()], float(ends.distance.min())
        arrived = ends.distance <= self._radius
        if not arrived.any():
            return None
        found = self._straight(vertices[arrived], ends.q[arrived])
        if found is None:
            self._remember(ends.q[arrived])
        return found

    def _straight(self, vertices: NDArray[np.int64], goals: Matrix) -> int | None:
        """The first free motion from vertices to goal configurations, as a new vertex."""
        free = self._judge.motions_free(self.tree.q[vertices], goals)
        if not free.any():
            return None
        k = int(free.argmax())
        return int(self.tree.add(goals[k : k + 1], vertices[k : k + 1], self._metric.distance(goals[k : k + 1]))[0])

    def _remember(self, q: Matrix) -> None:
        free = self._judge.free(q)
        self.goals = np.vstack([self.goals, q[free]])[-MOST_GOALS:]
        self.blocked = np.vstack([self.blocked, q[~free]])[:1]

    def _restart(self) -> None:
        self._dropped += self.tree.size
        self.restarts += 1
        self.tree = Tree(self._starts, self._distances)
