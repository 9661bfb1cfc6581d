"""IKURT as published, one sample at a time [1, ch. 5.1, algorithms 4 and 5]."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.ik.ikurt.metric import Metric
from rrtik_ompl.ik.ikurt.tree import IkurtTree


@dataclass(frozen=True, slots=True)
class Steps:
    """The parameters of the published algorithm.

    Attributes:
        step: Growth step delta0 [rad].
        threshold: Distance in the metric below which the step shrinks, in proportion to the distance.
        accuracy: Distance in the metric at which the goal counts as reached, the published min_threshold.
        beyond: Share of a joint's range by which samples may lie beyond its limits; steps are then clipped to the
            limits. 0 as published.
        misses: Number of blocked steps in a row after which CONNECT still goes on; 0 as published.
        even: Whether CONNECT steps in isotropic random directions instead of towards samples; False as published.
    """

    step: float
    threshold: float
    accuracy: float
    beyond: float = 0.0
    misses: int = 0
    even: bool = False


@dataclass(eq=False)
class PublishedSearch:
    """One tree, greedy in the workspace, with one step of a basic RRT after every failure.

    Attributes:
        metric: Distance from the goal.
        steps: The parameters.
        lower, upper: Bounds of the samples, shape (n,).
        motion_free: Checks whether a straight motion is free and its end inside the limits.
        stop: Returns True when the time is up.
        rng: Source of random numbers.
        start: Start configuration, shape (n,).
        tree: The tree that grows from the start.
        connects: Number of times that CONNECT was tried.
    """

    metric: Metric
    steps: Steps
    lower: Vector
    upper: Vector
    motion_free: Callable[[Vector, Vector], bool]
    stop: Stop
    rng: np.random.Generator
    start: Vector

    def __post_init__(self) -> None:
        self.tree = IkurtTree(self.start[None], self.metric.distance(self.start[None]))
        self.connects = 0

    def run(self) -> int | None:
        """Run algorithm 4; return the vertex at the goal, or None if the time was up first."""
        while not self.stop():
            vertex = int(self.tree.distance.argmin())
            self.connects += 1
            vertex, reached = self._connect(vertex)
            if reached:
                return vertex

            # After every failure the tree makes one step of a basic RRT.
            q_rand = self._random()
            near = int(self.tree.nearest(q_rand[None])[0])
            q_new = self._inside(_extend(self.tree.q[near], q_rand, self.steps.step))
            if self.motion_free(self.tree.q[near], q_new):
                self._add(q_new, near, self._distance(q_new))
        return None

    def _connect(self, near: int) -> tuple[int, bool]:
        """Run algorithm 5: step from a vertex and keep those that lower the distance, until one is blocked.

        Returns:
            The last vertex, and whether it is at the goal.
        """
        delta = self.steps.step
        missed = 0
        q_near = self.tree.q[near].copy()
        while not self.stop():
            q_new = self._towards_any(q_near, delta)
            if not self.motion_free(q_near, q_new):
                missed += 1
                if missed > self.steps.misses:
                    break
                continue

            missed = 0
            distance = self._distance(q_new)
            if distance < self.tree.distance[near]:
                near = self._add(q_new, near, distance)
                q_near = q_new

            best = float(self.tree.distance[near])
            if best <= self.steps.accuracy:
                return near, True
            if best < self.steps.threshold:
                delta = best * self.steps.step / self.steps.threshold
        return near, False

    def _towards_any(self, q: Vector, delta: float) -> Vector:
        """Return a step of length ``delta`` from q in a random direction, or towards a sample, as ``even`` says."""
        if not self.steps.even:
            return self._inside(_extend(q, self._random(), delta))
        direction = self.rng.normal(size=len(q))
        return self._inside(q + direction * (delta / np.linalg.norm(direction)))

    def _inside(self, q: Vector) -> Vector:
        """Return a configuration clipped to the limits, if a step may leave them."""
        # As published, samples lie inside the limits, so steps towards samples do too.
        cannot_leave = self.steps.beyond == 0.0 and not self.steps.even
        return q if cannot_leave else np.clip(q, self.lower, self.upper)

    def _distance(self, q: Vector) -> float:
        return float(self.metric.distance(q[None])[0])

    def _random(self) -> Vector:
        """Return a uniform sample, shape (n,), in the limits widened by the share ``beyond`` of their range."""
        margin = self.steps.beyond * (self.upper - self.lower)
        return self.rng.uniform(self.lower - margin, self.upper + margin)

    def _add(self, q: Vector, parent: int, distance: float) -> int:
        return int(self.tree.add(q[None], np.array([parent]), np.array([distance]))[0])


def _extend(a: Vector, b: Vector, step: float) -> Vector:
    """Return the configuration at most ``step`` [rad] from a towards b."""
    towards = b - a
    length = float(np.linalg.norm(towards))
    moved: Vector = b if length <= step else a + towards * (step / length)
    return moved
