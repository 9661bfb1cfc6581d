"""The input of a method of shortening: a check of motions, a budget, wishes, and a listener."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.kernels.search.shortcut_layout import KERNELS
from rrtik_ompl.model.transitions import edge_keys, length_of, transitions
from rrtik_ompl.planning.moves.axis_cut import axis_moves
from rrtik_ompl.planning.moves.rules import MoveRules
from rrtik_ompl.world.motion_queries import HoldingQueries, KernelWorld, MotionQueries, has_kernels


@dataclass(frozen=True, slots=True, eq=False)
class Wishes:
    """How a route is to be shortened.

    Attributes:
        budget: Time limit, the seed of all random choices, and as iterations the limit of checked motions.
        one_joint: Whether every edge of the result must move one joint, as the edges of the given route do.
        rules: Rules that single-joint moves have to keep, or None.
        clearance: Clearance of new motions from obstacles [m], or None.
        on_better: Called with every better route, shape (k, n).
    """

    budget: Budget = field(default_factory=Budget)
    one_joint: bool = False
    rules: MoveRules | None = None
    clearance: float | None = None
    on_better: Callable[[Matrix], object] | None = None


class Task:
    """One request to shorten a route.

    When the time is up, no further motion counts as free. A method thus ends soon, with a free route that has all
    replacements made until then.

    Attributes:
        motions: The given check of motions.
        wishes: The given wishes.
        asked: How many straight motions have been checked, or tried in kernels.
        confirmed_again: How many motions of a result have been checked again, as parts of free ones.
        proven: The last route of which kernels have proven every motion, shape (k, n); None if there is none.

    Args:
        motions: A world, or another object that checks straight motions.
        wishes: Limits and conditions; None for the defaults.
    """

    def __init__(self, motions: MotionQueries, wishes: Wishes | None = None) -> None:
        self.motions = motions
        self.wishes = Wishes() if wishes is None else wishes
        self.asked = 0
        self.confirmed_again = 0
        self.proven: Matrix | None = None
        self._stopped = False
        self._known: set[tuple[bytes, bytes]] = set()
        self._reported = (np.inf, np.inf)

    @property
    def seed(self) -> int:
        """Seed of all random choices."""
        return self.wishes.budget.seed

    @property
    def one_joint(self) -> bool:
        """Whether every edge of the result must move one joint."""
        return self.wishes.one_joint

    @property
    def bounded(self) -> bool:
        """Whether time or checks are limited."""
        return self.wishes.budget.limited

    @property
    def listened(self) -> bool:
        """Whether there is a listener for better routes."""
        return self.wishes.on_better is not None

    @property
    def rest(self) -> Budget:
        """A budget for searches that do not know tasks; it ends with this task."""
        return Budget(self.seed, stop=self.expired)

    @property
    def kernel_world(self) -> KernelWorld | None:
        """The world if its kernels can search for random shortcuts, else None."""
        world = self.motions
        return world if not self.one_joint and has_kernels(world, KERNELS) else None

    @property
    def checks_left(self) -> float:
        """Number of motions that may still be checked; +inf without a limit."""
        checks = self.wishes.budget.iterations
        return np.inf if checks is None else max(checks - self.asked, 0)

    def expired(self) -> bool:
        """Check whether the time is up or the checks are used up."""
        budget = self.wishes.budget
        if budget.iterations is not None and self.asked >= budget.iterations:
            return True
        self._stopped = self._stopped or budget.over()
        return self._stopped

    def free_batch(self, A: Matrix, B: Matrix) -> Mask:
        """Check which straight motions from A to B, shapes (m, n), are free, shape (m,); none once the time is up."""
        if len(A) == 0 or self.expired():
            return np.zeros(len(A), dtype=bool)
        self.asked += len(A)
        return self._checked(A, B)

    def confirmed(self, new: Matrix, old: Matrix) -> bool:
        """Check whether every edge of a new route, shape (k, n), is free; edges known to be free are not checked again.

        Known edges are those of the old route and those found free before. A part of a free edge is checked at other
        configurations than the whole edge, so it counts as new. The check is completed even when the time is up.
        """
        known_free = self._known.union(edge_keys(old))
        fresh = [k for k, edge in enumerate(edge_keys(new)) if edge not in known_free and edge[::-1] not in known_free]
        self.confirmed_again += len(fresh)
        return not fresh or bool(self._checked(new[fresh], new[np.add(fresh, 1)]).all())

    def _checked(self, A: Matrix, B: Matrix) -> Mask:
        """Check which motions are free, even when the time is up, and remember the free ones."""
        free: Mask = self.motions.motion_valid_batch(A, B)
        self._known.update((A[k].tobytes(), B[k].tobytes()) for k in np.flatnonzero(free))
        return free

    def free(self, a: Vector, b: Vector) -> bool:
        """Check whether a straight motion is free; it is not when the time is up."""
        return bool(self.free_batch(a[None], b[None])[0])

    def moves(self, a: Vector, b: Vector) -> Matrix:
        """Return the waypoints after a of the path to b, shape (k, n): b alone, or those of single-joint moves."""
        if not self.one_joint:
            return b[None]
        return axis_moves(a, b, range(len(a))[::-1])

    def link(self, a: Vector, b: Vector) -> Matrix | None:
        """Return the waypoints after a of a free path to b, shape (k, n), or None."""
        found = self.first_link(a, b[None])
        return None if found is None else found[1]

    def first_link(self, a: Vector, goals: Matrix) -> tuple[int, Matrix] | None:
        """Find the first of the goals, shape (m, n), to which there is a free path from a.

        The first goal is checked alone, then twice as many together each time.

        Returns:
            The index of the goal, and the waypoints after a, shape (k, n); None if there is no free path.
        """
        first = 0
        count = 1
        while first < len(goals) and not self.expired():
            paths = [self.moves(a, goal) for goal in goals[first : first + count]]
            starts = [np.vstack([a[None], path])[:-1] for path in paths]
            free = self.free_batch(np.vstack(starts), np.vstack(paths))

            ends = np.cumsum([len(path) for path in paths])
            for number, (end, path) in enumerate(zip(ends.tolist(), paths, strict=True)):
                if free[end - len(path) : end].all():
                    return first + number, path
            first += count
            count *= 2
        return None

    def rank(self, route: Matrix) -> tuple[float, float]:
        """Return the rank of a route, smaller is better: number of moves (0 unless single-joint), then length."""
        return (float(transitions(route)) if self.one_joint else 0.0), length_of(route)

    def better(self, *routes: Matrix) -> Matrix:
        """Return the best of several routes, the first of equal ones."""
        return min(routes, key=self.rank)

    def report(self, route: Matrix) -> None:
        """Pass a route to the listener if it is better than those reported before."""
        if self.wishes.on_better is not None and self.rank(route) < self._reported:
            self._reported = self.rank(route)
            self.wishes.on_better(route)


def box_around(world: HoldingQueries | KernelWorld, route: Matrix) -> tuple[Vector, Vector]:
    """Return finite bounds around a route, half a turn beyond it and within the limits, shapes (n,)."""
    lower = np.maximum(world.robot.lower, route.min(axis=0) - np.pi)
    upper = np.minimum(world.robot.upper, route.max(axis=0) + np.pi)
    return lower, upper
