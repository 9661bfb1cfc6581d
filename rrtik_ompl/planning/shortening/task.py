"""What a method of shortening is given: a check of motions, its budget, what is wished for, and a listener."""

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
from rrtik_ompl.world.motion_queries import KernelWorld, MotionQueries, has_kernels


@dataclass(frozen=True, slots=True, eq=False)
class Wishes:
    """How a route is to be shortened.

    Attributes:
        budget: Time, the seed of all random choices, and as its iterations the motions that are checked at most.
        one_joint: Whether every edge of the result must move one joint, as the edges of the given route do.
        rules: What single-joint moves have to keep to, or None.
        clearance: What new motions keep from obstacles [m], or None.
        on_better: Called with every better route, shape (k, n).
    """

    budget: Budget = field(default_factory=Budget)
    one_joint: bool = False
    rules: MoveRules | None = None
    clearance: float | None = None
    on_better: Callable[[Matrix], object] | None = None


class Task:
    """One request to shorten a route.

    When the time is up, nothing else counts as free, so that a method ends soon with a free
    route: whatever it has replaced by then stays replaced.

    Attributes:
        motions: As given.
        wishes: As given.
        asked: How many straight motions have been checked, or tried in kernels.
        confirmed_again: How many motions of a result have been checked on top of that, as parts of free ones.

    Args:
        motions: A world, or anything else that checks straight motions.
        wishes: What is asked for; none in particular if None.
    """

    def __init__(self, motions: MotionQueries, wishes: Wishes | None = None) -> None:
        self.motions = motions
        self.wishes = Wishes() if wishes is None else wishes
        self.asked = 0
        self.confirmed_again = 0
        self._stopped = False
        self._known: set[tuple[bytes, bytes]] = set()
        self._reported = (np.inf, np.inf)

    @property
    def seed(self) -> int:
        """Of all random choices."""
        return self.wishes.budget.seed

    @property
    def one_joint(self) -> bool:
        """Whether every edge of the result must move one joint."""
        return self.wishes.one_joint

    @property
    def bounded(self) -> bool:
        """Whether there is an end to the time, or to the checks."""
        return self.wishes.budget.limited

    @property
    def listened(self) -> bool:
        """Whether anybody is told of better routes."""
        return self.wishes.on_better is not None

    @property
    def rest(self) -> Budget:
        """The budget of a search that knows no task: it ends with this one."""
        return Budget(self.seed, stop=self.expired)

    @property
    def kernel_world(self) -> KernelWorld | None:
        """The world, if random shortcuts can be searched for in its kernels, else None."""
        world = self.motions
        return world if not self.one_joint and has_kernels(world, KERNELS) else None

    @property
    def checks_left(self) -> float:
        """Motions that may still be checked; +inf without a limit."""
        checks = self.wishes.budget.iterations
        return np.inf if checks is None else max(checks - self.asked, 0)

    def expired(self) -> bool:
        """Whether the time is up, or the checks are spent."""
        budget = self.wishes.budget
        if budget.iterations is not None and self.asked >= budget.iterations:
            return True
        self._stopped = self._stopped or budget.over()
        return self._stopped

    def free_batch(self, A: Matrix, B: Matrix) -> Mask:
        """Which straight motions are free, shapes (m, n) and (m,); none when the time is up."""
        if len(A) == 0 or self.expired():
            return np.zeros(len(A), dtype=bool)
        self.asked += len(A)
        return self._checked(A, B)

    def confirmed(self, new: Matrix, old: Matrix) -> bool:
        """Whether every edge of a route, shape (k, n), is free; those of the old route and those found free are known.

        Parts of free edges are checked at other configurations than the whole, so they count as new. They are checked
        even when the time is up.
        """
        known_free = self._known.union(edge_keys(old))
        fresh = [k for k, edge in enumerate(edge_keys(new)) if edge not in known_free and edge[::-1] not in known_free]
        self.confirmed_again += len(fresh)
        return not fresh or bool(self._checked(new[fresh], new[np.add(fresh, 1)]).all())

    def _checked(self, A: Matrix, B: Matrix) -> Mask:
        """Which motions are free, whatever time it is; the free ones are remembered."""
        free: Mask = self.motions.motion_valid_batch(A, B)
        self._known.update((A[k].tobytes(), B[k].tobytes()) for k in np.flatnonzero(free))
        return free

    def free(self, a: Vector, b: Vector) -> bool:
        """Whether a straight motion is free; not when the time is up."""
        return bool(self.free_batch(a[None], b[None])[0])

    def moves(self, a: Vector, b: Vector) -> Matrix:
        """The waypoints after a on the path to b, shape (k, n): b alone, or those of single-joint moves."""
        if not self.one_joint:
            return b[None]
        return axis_moves(a, b, range(len(a))[::-1])

    def link(self, a: Vector, b: Vector) -> Matrix | None:
        """The waypoints after a of a free path to b, shape (k, n), or None."""
        found = self.first_link(a, b[None])
        return None if found is None else found[1]

    def first_link(self, a: Vector, goals: Matrix) -> tuple[int, Matrix] | None:
        """The first of the goals, shape (m, n), to which there is a free path, and its waypoints after a; or None.

        The first goal is checked alone, then twice as many together each time.
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
        """What is to be made small: the length, after the number of moves where one joint moves at a time."""
        return (float(transitions(route)) if self.one_joint else 0.0), length_of(route)

    def better(self, *routes: Matrix) -> Matrix:
        """The best of several routes, the first of equal ones."""
        return min(routes, key=self.rank)

    def report(self, route: Matrix) -> None:
        """Pass a route to the listener if it is better than those before."""
        if self.wishes.on_better is not None and self.rank(route) < self._reported:
            self._reported = self.rank(route)
            self.wishes.on_better(route)
