"""IKURT made fast and robust: the idea of [1, ch. 5.1] on batches of configurations, with descents by the Jacobian.

It differs from :mod:`rrtik_ompl.ik.ikurt.published` as follows. CONNECT tries many directions at once, computes the
cheap metric before the collision check, takes the best free step, and goes on after a miss. Directions are isotropic,
so that joints reach their limits. Vertices from which CONNECT has failed are penalised. Each failure is followed by
batches of exploration. With ``jacobian``, descents look for goal configurations from promising vertices and from random
samples. Goal configurations that are found but not reached at once become roots of a second tree, and the exploration
joins the two trees.
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

DIRECTIONS = 16  # number of directions that CONNECT tries at once
PATIENCE = 8  # CONNECT goes on as long as so many rounds lower the distance to the share FALL,
FALL = 0.8
SLOW_FALL = 0.97  # or to this share if CONNECT alone can reach the goal.
GROWN = 1.5  # factor on CONNECT's step after a success
SHRUNK = 0.7  # factor on CONNECT's step after a miss
SHORTEST = 7e-4  # CONNECT's shortest step, as a share of the first one
CHECKED = 4  # number of the directions nearest to the goal whose motions are checked together
NEARER = 0.5  # CONNECT begins a new descent when the distance has fallen to this share.
# There is one batch of exploration before the first CONNECT. The number doubles after each CONNECT up to the first
# limit, or to the second one as long as no goal configuration is known.
MAX_EXPLORATIONS = 256
MAX_EXPLORATIONS_WITH_CONNECT = 4
SAMPLES = 24  # samples of one batch of exploration
PIECES = (0.2, 0.5, 1.0)  # shares of the exploration's step, tried one after the other as long as they are free
TOWARDS_OTHER = 0.5  # share of the samples that are the newest vertices of the other tree
DESCENTS = 2  # number of descents from vertices of a batch of exploration
SCOUTS = 22  # number of descents from random samples, for other goal configurations
RARE = 32  # Once a goal configuration is known, descents follow one batch in so many.
MAX_GOALS = 64  # number of known goal configurations above which further ones do not become roots

# Parameters of a descent by the Jacobian:
ITERATIONS = 24
DAMPING = 1e-6  # constant part of the damping, in units of the squared residual
LARGEST_STEP = 0.5  # largest step of any joint in one iteration [rad or m]
ACCURACY = 1e-9  # share of the reach at which a descent ends, or less if the goal demands it:
SHARE = 0.1  # at most this share of the distance within which the goal counts as reached.
STALE = 4  # iterations in which the distance has to fall to the share FALLS, or the row is given up
FALLS = 0.7


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the search.

    Attributes:
        step: First step of CONNECT [unit of the space].
        stride: Longest step of the exploration [unit of the space].
        jacobian: Whether descents by the Jacobian look for goal configurations.
        most_vertices: Number of vertices above which the trees are dropped and begun again; known goal configurations
            stay.
    """

    step: float
    stride: float
    jacobian: bool
    most_vertices: int


@dataclass(frozen=True, slots=True, eq=False)
class IkurtValidity:
    """Callbacks of the search.

    Attributes:
        free: Checks which configurations, shape (m, n), are free; returns shape (m,).
        motions_free: Checks which straight motions between rows, shapes (m, n), are free; returns shape (m,).
        stop: Returns True when the search has to stop.
    """

    free: Callable[[Matrix], Mask]
    motions_free: Callable[[Matrix, Matrix], Mask]
    stop: Stop


@dataclass(eq=False)
class BatchedSearch:
    """The search that the module describes, with a tree from the start and one from known goal configurations.

    Attributes:
        metric: Distance from the goal.
        options: Options of the search.
        lower, upper: Bounds, shape (n,).
        validity: Callbacks that check configurations and motions.
        rng: Source of random numbers.
        starts: Start configurations, the roots of the tree, shape (k, n).
        tree: The tree from the start; after restarts the last one.
        back: The tree from known goal configurations; after restarts the last one.
        goals: Known goal configurations, shape (g, n).
        blocked: A goal configuration in collision, if any was met, shape (0 or 1, n).
        connects, restarts, vertices: Numbers of runs of CONNECT, of restarts and of vertices.
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
        self._distances = metric.distance(starts)  # distances of the starts from the goal, shape (k,)
        self.goals = metric.goals if isinstance(metric, ConfigurationMetric) else starts[:0]
        self.tree = IkurtTree(starts, self._distances)
        self.back = IkurtTree(self.goals, np.zeros(len(self.goals)))

        # The vertices of the last batch of exploration, the number of batches, and that of vertices of dropped trees.
        self._newest = starts[:0]
        self._batches = 0
        self._dropped = 0
        self.connects = 0
        self.restarts = 0

        # The configuration nearest to the goal so far, and its distance.
        self._nearest: Vector = starts[self._distances.argmin()]
        self._least_distance = float(self._distances.min())
        self.blocked = starts[:0]

    @property
    def nearest(self) -> Vector:
        """The configuration nearest to the goal so far, in collision or not, shape (n,)."""
        self._see(self.tree.q, self.tree.distance)
        return self._nearest

    @property
    def vertices(self) -> int:
        """Number of vertices of all trees, dropped ones included."""
        return self.tree.size + self.back.size + self._dropped

    def run(self) -> Matrix | None:
        """Run the search and return the path to the goal, shape (k, n), or None if the time was up first."""
        if self._least_distance <= self.metric.radius:
            return self.tree.branch(int(self._distances.argmin()))

        batches = 1  # number of batches of exploration before the next CONNECT
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
        """Step from one vertex down the metric until the goal is reached or the distance no longer falls fast enough.

        The step grows after each success and shrinks after each miss. On the way, descents by the Jacobian begin
        whenever the distance has halved. A vertex from which this fails is penalised.

        Returns:
            The path to the goal, shape (k, n), or None.
        """
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
        """Try random steps of one length from a vertex, and add the free one with the least distance as a vertex.

        Returns:
            The new vertex, or None if no free step among the `CHECKED` best ones lowers the distance.
        """
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
        """Grow one tree, in turn, by a batch of steps, and try to join its new vertices to the other tree.

        While no goal configuration is known, descents from the new vertices look for one; later only rarely.

        Returns:
            The path from start to goal, shape (k, n), if one was found, or None.
        """
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
        """Grow a tree by many steps of a basic RRT at once, and return the new vertices, shape (k,).

        Up to half of the samples are the newest vertices of the other tree, which draws the trees together.
        """
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
            # The motion is checked from the vertex on, so that an edge is checked as a whole.
            free = self.validity.motions_free(roots[going], further)
            going = going[free]
            ends[going] = further[free]
            moved[going] = True

        return tree.add(ends[moved], near[moved], self.metric.distance(ends[moved]))

    def _worth_it(self, new: NDArray[np.int64]) -> NDArray[np.int64]:
        """Choose the new vertices to descend from: the nearest one in the workspace, and random others."""
        nearest = new[self.tree.distance[new].argmin()]
        others = self.rng.choice(new, min(DESCENTS - 1, len(new)), replace=False)
        return np.unique(np.append(others, nearest))

    def _finish(self, vertices: NDArray[np.int64], scouts: int = 0) -> Matrix | None:
        """Try to reach the goal from vertices: by a straight motion to a known goal, or by descents by the Jacobian.

        Args:
            vertices: Vertices of the tree from the start, shape (k,).
            scouts: Number of random samples from which descents begin too, to find further goal configurations.

        Returns:
            The path, shape (m, n), or None. Goal configurations that were found but not reached are remembered.
        """
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
        """Join two trees by the first free motion from given vertices to their nearest vertices in the other tree.

        Returns:
            The path from the root of ``tree`` to the root of ``other``, shape (k, n), or None.
        """
        near = other.nearest(tree.q[vertices])
        free = self.validity.motions_free(tree.q[vertices], other.q[near])
        if not free.any():
            return None
        k = int(free.argmax())
        return np.vstack([tree.branch(int(vertices[k])), other.branch(int(near[k]))[::-1]])

    def _straight(self, vertices: NDArray[np.int64], goals: Matrix) -> Matrix | None:
        """Return the path over the first free motion from a vertex to its goal configuration, or None."""
        free = self.validity.motions_free(self.tree.q[vertices], goals)
        if not free.any():
            return None
        k = int(free.argmax())
        return np.vstack([self.tree.branch(int(vertices[k])), goals[k]])

    def _remember(self, q: Matrix) -> Matrix | None:
        """Make the free ones among new goal configurations, shape (k, n), roots of the tree from the goal.

        Returns:
            The path from the start, shape (m, n), if one of them is joined straight to the other tree, or None.
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
        """Remember the configuration nearest to the goal, if it is nearer than all before."""
        k = distances.argmin()
        if distances[k] < self._least_distance:
            self._nearest = Q[k].copy()
            self._least_distance = float(distances[k])

    def _restart(self) -> None:
        """Drop both trees and begin again from the starts and the known goal configurations."""
        self._see(self.tree.q, self.tree.distance)
        self._dropped += self.tree.size + self.back.size
        self.restarts += 1
        self.tree = IkurtTree(self.starts, self._distances)
        self.back = IkurtTree(self.goals, np.zeros(len(self.goals)))


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """The result of a descent: the best configuration of each row, shape (m, n), and its distance, shape (m,)."""

    q: Matrix
    distance: Vector


def descend(metric: TipMetric, Q: Matrix, lower: Vector, upper: Vector, *, iterations: int = ITERATIONS) -> Descent:
    """Descend from each row of Q, shape (m, n), towards the goal inside bounds of shape (n,), by the Jacobian.

    This is Levenberg-Marquardt [22], as in :mod:`rrtik_ompl.kernels.reference.descent`: the damping is half the squared
    residual plus a small constant. Joints that a step would push through a bound are held, and the step is solved for
    again, so that goals on a limit are reached. Rows end when they are accurate enough or no longer fall fast enough.
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
    """Take one step of each row inside the bounds; joints that would leave them are held.

    Args:
        q: Configurations, shape (m, n).
        J: Scaled Jacobians, shape (m, 6, n).
        e: Scaled residuals, shape (m, 6).
        lower: Lower bounds, shape (n,).
        upper: Upper bounds, shape (n,).
    """
    dq = bounded_step(J, e)
    pinned = ((q <= lower) & (dq < 0.0)) | ((q >= upper) & (dq > 0.0))
    again = pinned.any(axis=1)
    if again.any():
        dq[again] = bounded_step(J[again] * ~pinned[again][:, None], e[again])
    stepped: Matrix = np.clip(q + dq, lower, upper)
    return stepped


def bounded_step(J: NDArray[np.float64], e: Matrix) -> Matrix:
    """Solve (J^T J + (e^T e / 2 + DAMPING) I) dq = J^T e for every row, and shorten dq to `LARGEST_STEP`.

    Args:
        J: Jacobians, shape (m, k, n).
        e: Residuals, shape (m, k).

    Returns:
        Steps, shape (m, n).
    """
    damping: Vector = 0.5 * np.einsum("mi,mi->m", e, e) + DAMPING
    normal = np.einsum("mki,mkj->mij", J, J) + damping[:, None, None] * np.eye(J.shape[2])
    step = np.linalg.solve(normal, np.einsum("mki,mk->mi", J, e)[..., None])[..., 0]
    return shortened(step, LARGEST_STEP)
