"""IKURT made fast and robust: the idea of [1, ch. 5.1] on batches, with the Jacobian where the way is clear.

What differs from :mod:`rrtik_ompl.ik.ikurt.published`: CONNECT tries many directions at once, the cheap metric before
the collision check, takes the best free one, and lives through misses; directions are isotropic, so that joints reach
their limits; vertices that have failed are penalised; a failure is followed by a whole batch of exploration. With
``jacobian`` descents search for goal configurations from the vertices where that is worth it, and from anywhere; those
found and not reached at once become roots of a second tree, and the exploration joins the two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.ik.ikurt.metric import ConfigurationMetric, TipMetric, reach
from rrtik_ompl.ik.ikurt.tree import IkurtTree
from rrtik_ompl.ik.residual import shortened
from rrtik_ompl.model.robot import poses_and_jacobians

DIRECTIONS = 16  # that CONNECT tries at once
PATIENCE = 8  # CONNECT goes on as long as so many rounds bring the distance down
FALL = 0.8  # to this share,
SLOW_FALL = 0.97  # or to this one where there is no other way to the goal
GROWN = 1.5  # of CONNECT's step after a success,
SHRUNK = 0.7  # after a miss,
SHORTEST = 7e-4  # and at least, of the first step
CHECKED = 4  # of the better directions, nearest to the goal first, whose motions are checked together
NEARER = 0.5  # a new descent from the way of CONNECT when the distance has fallen to this share
MAX_EXPLORATIONS = 256  # batches of exploration between two CONNECTs; one before the first, then always twice as many,
MAX_EXPLORATIONS_WITH_CONNECT = 4  # but no more than these as long as CONNECT alone can reach the goal
SAMPLES = 24  # of one batch of exploration
PIECES = (0.2, 0.5, 1.0)  # shares of the exploration's step, tried one after the other as long as they are free
TOWARDS_OTHER = 0.5  # share of the samples that are the newest vertices of the other tree
DESCENTS = 2  # from vertices of a batch of exploration,
SCOUTS = 22  # and from samples anywhere, for other goal configurations
RARE = 32  # once a goal configuration is known, descents follow one batch in so many
MAX_GOALS = 64  # configurations that are known; further ones do not become roots

# Of a descent by the Jacobian:
ITERATIONS = 24
DAMPING = 1e-6  # the constant part, in units of the squared residual
LARGEST_STEP = 0.5  # [rad] or [m] of any joint in one iteration
ACCURACY = 1e-9  # of the reach; less where the goal wants that
SHARE = 0.1  # of the distance within which the goal counts as reached
STALE = 4  # iterations in which the distance has to fall to FALLS of what it was, or the row is given up
FALLS = 0.7


@dataclass(frozen=True, slots=True)
class Options:
    """How the search works.

    Attributes:
        step: First step of CONNECT [unit of the space].
        stride: Longest step of the exploration [unit of the space].
        jacobian: Whether descents by the Jacobian look for goal configurations.
        most_vertices: With more the tree is dropped and another one begun; known goal configurations stay.
    """

    step: float
    stride: float
    jacobian: bool
    most_vertices: int


@dataclass(frozen=True, slots=True, eq=False)
class IkurtValidity:
    """Callbacks of the search: which configurations are free; which straight motions are; whether to stop."""

    free: Callable[[Matrix], Mask]
    motions_free: Callable[[Matrix, Matrix], Mask]
    stop: Stop


@dataclass(eq=False)
class BatchedSearch:
    """The tree from the start, and the one from what is found at the goal; see the module.

    Attributes:
        metric: Distance from the goal.
        options: How to work.
        lower, upper: Bounds, shape (n,).
        validity: What is free.
        rng: Random numbers.
        starts: Roots, shape (k, n).
        tree: The tree from the start, the last one after restarts.
        back: The tree from goal configurations that are known, likewise.
        goals: Those, shape (k, n).
        blocked: One in collision, if any was met, shape (0 or 1, n).
        connects, restarts, vertices: Counts.
    """

    metric: TipMetric | ConfigurationMetric
    options: Options
    lower: Vector
    upper: Vector
    validity: IkurtValidity
    rng: np.random.Generator
    starts: Matrix

    def __post_init__(self) -> None:
        starts = self.starts
        metric = self.metric
        self._distances = metric.distance(starts)  # of the starts from the goal, shape (k,)
        self.goals = metric.goals if isinstance(metric, ConfigurationMetric) else starts[:0]
        self.tree = IkurtTree(starts, self._distances)
        self.back = IkurtTree(self.goals, np.zeros(len(self.goals)))

        # the vertices of the last batch of exploration, and the numbers of batches and of vertices of dropped trees
        self._newest = starts[:0]
        self._batches = 0
        self._dropped = 0
        self.connects = 0
        self.restarts = 0

        # the configuration nearest to the goal that was seen, and its distance
        self._nearest: Vector = starts[self._distances.argmin()]
        self._least_distance = float(self._distances.min())
        self.blocked = starts[:0]

    @property
    def nearest(self) -> Vector:
        """The configuration nearest to the goal that was seen, in collision or not, shape (n,)."""
        self._see(self.tree.q, self.tree.distance)
        return self._nearest

    @property
    def vertices(self) -> int:
        """Vertices of all trees, those of dropped ones too."""
        return self.tree.size + self.back.size + self._dropped

    def run(self) -> Matrix | None:
        """The path to the goal, shape (k, n), or None if the time was up first."""
        if self._least_distance <= self.metric.radius:
            return self.tree.branch(int(self._distances.argmin()))

        batches = 1  # of exploration before the next CONNECT
        path = self._finish(np.arange(self.tree.size))
        while path is None and not self.validity.stop():
            for _ in range(batches):
                path = self._explore()
                if path is not None or self.validity.stop():
                    return path

            path = self._connect(self.tree.best())
            max_batches = MAX_EXPLORATIONS if self.back.size else MAX_EXPLORATIONS_WITH_CONNECT
            batches = min(2 * batches, max_batches)
            if self.tree.size > self.options.most_vertices:
                self._restart()
                batches = 1
        return path

    def _connect(self, first: int) -> Matrix | None:
        """From one vertex down the metric; the path to the goal, or None at the end of the patience."""
        self.connects += 1
        vertex = first
        step = self.options.step
        shortest = SHORTEST * step
        path = self._finish(np.array([vertex]))
        distance_at_descent = self.tree.distance[vertex]
        distance_at_check = distance_at_descent

        for number in count(1):
            if path is not None or self.validity.stop():
                return path

            lower = self._downhill(vertex, step)
            if lower is None:
                step = max(step * SHRUNK, shortest)
            else:
                step = max(step * GROWN, shortest)
                vertex = lower

            distance = self.tree.distance[vertex]
            if distance <= self.metric.radius:
                path = self._finish(np.array([vertex]))
                return self.tree.branch(vertex) if path is None else path
            if distance < NEARER * distance_at_descent:
                path = self._finish(np.array([vertex]))
                distance_at_descent = distance

            if number % PATIENCE == 0:
                wanted_fall = FALL if self.options.jacobian else SLOW_FALL
                if distance > wanted_fall * distance_at_check:
                    break
                distance_at_check = distance
        self.tree.penalise(first, vertex)
        return path

    def _downhill(self, vertex: int, step: float) -> int | None:
        """The best of some free steps that lower the distance, as a new vertex."""
        q = self.tree.q[vertex]
        directions = self.rng.normal(size=(DIRECTIONS, len(q)))
        directions *= step / np.linalg.norm(directions, axis=1, keepdims=True)
        candidates = np.clip(q + directions, self.lower, self.upper)
        distances = self.metric.distance(candidates)

        order = np.argsort(distances)[:CHECKED]
        order = order[distances[order] < self.tree.distance[vertex]]
        free = self.validity.motions_free(np.broadcast_to(q, (len(order), len(q))), candidates[order])
        if not free.any():
            return None
        k = order[free.argmax()]
        return int(self.tree.add(candidates[k : k + 1], np.array([vertex]), distances[k : k + 1])[0])

    def _explore(self) -> Matrix | None:
        """A batch of steps of the trees, in turn; from what it adds straight to the other tree, or down to the goal."""
        self._batches += 1
        forward = self.back.size == 0 or self._batches % 2 == 0
        tree, other = (self.tree, self.back) if forward else (self.back, self.tree)

        new = self._grow(tree)
        if len(new) == 0:
            return None
        self._newest = tree.q[new]

        path = self._join(tree, new, other) if other.size else None
        if path is not None:
            return path if forward else path[::-1]

        if forward and (len(self.goals) == 0 or self._batches % RARE == 0):
            return self._finish(self._worth_it(new), scouts=SCOUTS)
        return None

    def _grow(self, tree: IkurtTree) -> NDArray[np.int64]:
        """Steps of a basic RRT, many at once; the new vertices."""
        samples = self.rng.uniform(self.lower, self.upper, (SAMPLES, len(self.lower)))
        drawn = min(int(TOWARDS_OTHER * SAMPLES), len(self._newest)) if self.back.size else 0
        samples[:drawn] = self._newest[:drawn]

        near = tree.nearest(samples)
        roots = tree.q[near]
        ends = roots.copy()
        towards = samples - roots
        length = np.linalg.norm(towards, axis=1)
        step = towards * np.minimum(1.0, self.options.stride / np.maximum(length, 1e-12))[:, None]
        going = np.flatnonzero(length > 0.0)
        moved = np.zeros(SAMPLES, dtype=bool)

        for piece in PIECES:
            further = roots[going] + piece * step[going]
            free = self.validity.motions_free(roots[going], further)  # from the vertex on: an edge is asked as a whole
            going = going[free]
            ends[going] = further[free]
            moved[going] = True

        return tree.add(ends[moved], near[moved], self.metric.distance(ends[moved]))

    def _worth_it(self, new: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of new vertices those from which to descend: the nearest one in the workspace, and others by chance."""
        nearest = new[self.tree.distance[new].argmin()]
        others = self.rng.choice(new, min(DESCENTS - 1, len(new)), replace=False)
        return np.unique(np.append(others, nearest))

    def _finish(self, vertices: NDArray[np.int64], scouts: int = 0) -> Matrix | None:
        """Descend from vertices, shape (k,), and go straight to what that finds; descend from some samples too."""
        if isinstance(self.metric, ConfigurationMetric):
            return self._join(self.tree, vertices, self.back)
        if not self.options.jacobian:
            return None

        samples = self.rng.uniform(self.lower, self.upper, (scouts, len(self.lower)))
        origins = np.vstack([self.tree.q[vertices], samples])
        ends = descend(self.metric, origins, self.lower, self.upper)
        self._see(ends.q, ends.distance)

        arrived = ends.distance <= self.metric.radius
        near = arrived[: len(vertices)]
        path = self._straight(vertices[near], ends.q[: len(vertices)][near])
        return self._remember(ends.q[arrived]) if path is None and arrived.any() else path

    def _join(self, tree: IkurtTree, vertices: NDArray[np.int64], other: IkurtTree) -> Matrix | None:
        """The path from the root of one tree to that of the other over the first free motion between two vertices."""
        near = other.nearest(tree.q[vertices])
        free = self.validity.motions_free(tree.q[vertices], other.q[near])
        if not free.any():
            return None
        k = int(free.argmax())
        return np.vstack([tree.branch(int(vertices[k])), other.branch(int(near[k]))[::-1]])

    def _straight(self, vertices: NDArray[np.int64], goals: Matrix) -> Matrix | None:
        """The path over the first free motion from vertices to goal configurations."""
        free = self.validity.motions_free(self.tree.q[vertices], goals)
        if not free.any():
            return None
        k = int(free.argmax())
        return np.vstack([self.tree.branch(int(vertices[k])), goals[k]])

    def _remember(self, q: Matrix) -> Matrix | None:
        """Make the free ones of goal configurations, shape (k, n), roots of the tree at the goal.

        Returns:
            The path from the start if one of them can be reached straight from the other tree, shape (m, n), or None.
        """
        free = self.validity.free(q)
        self.blocked = np.vstack([self.blocked, q[~free]])[:1]
        if len(self.goals) >= MAX_GOALS or not free.any():
            return None
        self.goals = np.vstack([self.goals, q[free]])
        roots = self.back.add(q[free], np.full(int(free.sum()), -1), np.zeros(int(free.sum())))
        path = self._join(self.back, roots, self.tree)
        return None if path is None else path[::-1]

    def _see(self, Q: Matrix, distances: Vector) -> None:
        """Remember the nearest to the goal of some configurations."""
        k = distances.argmin()
        if distances[k] < self._least_distance:
            self._nearest = Q[k].copy()
            self._least_distance = float(distances[k])

    def _restart(self) -> None:
        """Drop both trees and begin anew; goal configurations that are known stay."""
        self._see(self.tree.q, self.tree.distance)
        self._dropped += self.tree.size + self.back.size
        self.restarts += 1
        self.tree = IkurtTree(self.starts, self._distances)
        self.back = IkurtTree(self.goals, np.zeros(len(self.goals)))


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """Where some configurations have led to: the best of each row, shape (m, n), and its distance, shape (m,)."""

    q: Matrix
    distance: Vector


def descend(metric: TipMetric, Q: Matrix, lower: Vector, upper: Vector, *, iterations: int = ITERATIONS) -> Descent:
    """Walk from each row of Q, shape (m, n), towards the goal, inside bounds of shape (n,): steps by the Jacobian.

    Levenberg-Marquardt [22], as in :mod:`rrtik_ompl.kernels.reference.descent`: the damping is half the squared
    residual plus a small constant. Joints that a step would push through a bound are held and the step is solved for
    again, so that goals on a limit are reached.
    """
    length = reach(metric.robot) * metric.unit
    enough = min(ACCURACY * length, SHARE * metric.radius)
    best = Q.copy()
    best_distance = np.full(len(Q), np.inf)
    history = np.full((STALE, len(Q)), np.inf)
    rows = np.arange(len(Q))
    q = Q

    for step in range(iterations):
        metric.evaluations += len(rows)
        tips, J = poses_and_jacobians(metric.robot, q)
        e, distance = metric.pull(tips)

        better = distance < best_distance[rows]
        best[rows[better]] = q[better]
        best_distance[rows[better]] = distance[better]

        going = (distance > enough) & (best_distance[rows] < FALLS * history[step % STALE, rows])
        history[step % STALE, rows] = best_distance[rows]
        if not going.any():
            break

        rows = rows[going]
        q = q[going]
        J = J[going]
        e = e[going] / length
        q = _stepped(q, J * (metric.scale / length)[:, None], e, lower, upper)

    return Descent(best, best_distance)


def _stepped(q: Matrix, J: NDArray[np.float64], e: Matrix, lower: Vector, upper: Vector) -> Matrix:
    """One step of each row inside the bounds; joints that would leave them are held."""
    dq = bounded_step(J, e)
    pinned = ((q <= lower) & (dq < 0.0)) | ((q >= upper) & (dq > 0.0))
    again = pinned.any(axis=1)
    if again.any():
        dq[again] = bounded_step(J[again] * ~pinned[again][:, None], e[again])
    stepped: Matrix = np.clip(q + dq, lower, upper)
    return stepped


def bounded_step(J: NDArray[np.float64], e: Matrix) -> Matrix:
    """Solve (J^T J + (e^T e / 2 + DAMPING) I) dq = J^T e for every row; shapes (m, k, n), (m, k) -> (m, n)."""
    damping: Vector = 0.5 * np.einsum("mi,mi->m", e, e) + DAMPING
    normal = np.einsum("mki,mkj->mij", J, J) + damping[:, None, None] * np.eye(J.shape[2])
    step = np.linalg.solve(normal, np.einsum("mki,mk->mi", J, e)[..., None])[..., 0]
    return shortened(step, LARGEST_STEP)
