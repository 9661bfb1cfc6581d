"""The best way to one of several last parts: it forgives small errors of the pilot's hand, then it has few moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.path import JointPath
from rrtik_ompl.pilot.routes.clearance import executions, free_rows
from rrtik_ompl.pilot.routes.follower import slack, still_free
from rrtik_ompl.pilot.routes.moves import detours, direct_routes, moved_aside, planned
from rrtik_ompl.transitions import merge_moves, route_length
from rrtik_ompl.world import World

EXECUTIONS = 100  # with errors, of which the share that touches nothing is told
STEADY = 0.99  # less is warned of
TRIALS, FINALISTS = 40, 4  # executions with errors to compare ways by, and ways that are compared by all

Last = Sequence[Matrix]  # last parts of ways that begin alike, shape (moves + 1, dof) each, at least one


class Way(NamedTuple):
    """Single-joint moves, shape (moves + 1, dof), and the number of the first one that may touch the object."""

    rows: Matrix
    grasp_from: int


class WaySearch:
    """Looks for ways.

    Args:
        world: In which nothing may be touched.
        holding: In which the gripper may touch the object; the same where there is none.
        q: Where the arm is, shape (dof,).
        seed: Of the random numbers.
    """

    def __init__(self, world: World, holding: World, q: Vector, seed: int) -> None:
        self._world, self._holding, self._q, self._seed = world, holding, q, seed
        self._path = JointPath.of(world.robot, q[None])
        self._slack = slack(self._path)

    def find(self, lasts: Sequence[Last]) -> Way | str:
        """The best way, or the reason why there is none.

        Args:
            lasts: Last parts, grouped by where they begin; the best place to begin at first.

        Raises:
            ProblemError: If the arm stands in something, or the last parts begin in something.
        """
        best = self._best(way for last in lasts for way in self._direct(last)) or self._best(self._around(lasts[0]))
        if best is not None:
            return best
        first = planned(self._world, self._q, lasts[0][0][0], self._seed)
        if isinstance(first, str):
            return first
        best = self._best(_joined(first, part) for part in lasts[0])
        return best or "it comes too close to something to be sure"

    def steady(self, way: Way, count: int = EXECUTIONS) -> float:
        """Share of executions that touch nothing although every move ends a little beside its end."""
        made = executions(self._path.with_waypoints(way.rows), self._slack, count, np.random.default_rng(self._seed))
        before, after = made[:, : way.grasp_from + 1], made[:, way.grasp_from :]
        return float((free_rows(self._world, before) & free_rows(self._holding, after)).mean())

    def _direct(self, last: Last) -> Iterator[Way]:
        """Ways on which every joint moves once before the last part."""
        orders = [self._order(part) for part in last]
        for first in direct_routes(self._world, self._q, last[0][0], orders):
            yield from (_joined(first, part) for part in last)

    def _around(self, last: Last) -> Iterator[Way]:
        """Ways on which one joint makes a detour, narrow or wide."""
        rng = np.random.default_rng(self._seed)
        for route in detours(self._world, self._q, last[0][0], self._order(last[0]), rng):
            for first in (route, *moved_aside(self._world, route, self._slack)):
                yield min((_joined(first, part) for part in last), key=lambda way: len(way.rows))

    def _order(self, last: Matrix) -> list[int]:
        """All joints, first the one that a last part begins with: so that its move may join the one before."""
        joints = np.random.default_rng(self._seed).permutation(len(self._q)).tolist()
        return joints if len(last) < 2 else sorted(joints, key=lambda joint: last[0, joint] == last[1, joint])

    def _best(self, ways: Iterable[Way]) -> Way | None:
        finalists = sorted(ways, key=lambda way: self._rank(way, TRIALS))[:FINALISTS]
        ranked = sorted(finalists, key=lambda way: self._rank(way, EXECUTIONS))
        return next((way for way in ranked if not self._fault(way)), None)

    def _rank(self, way: Way, count: int) -> tuple[float, int, float, float]:
        """What is to be small: errors that do harm, as far as they matter; then moves, errors, travel."""
        touching = 1.0 - self.steady(way, count)
        tenths = max(round(10.0 * touching), int(touching > 1.0 - STEADY))
        return tenths, len(way.rows), touching, route_length(way.rows)

    def _fault(self, way: Way) -> str:
        """What a second, independent check has against a way; "" if nothing."""
        before, after = way.rows[: way.grasp_from + 1], way.rows[way.grasp_from :]
        parts = ((self._world, before), (self._holding, after))
        return next(filter(None, (still_free(w, self._path.with_waypoints(rows)) for w, rows in parts)), "")


def _joined(first: Matrix, last: Matrix) -> Way:
    """A first part and a last one; where one joint goes on they share a move, which may touch the object."""
    rows = merge_moves(np.vstack([first, last[1:]]), tolerance=0.0)
    shared = len(rows) < len(first) + len(last) - 1
    return Way(rows, len(first) - 1 - shared)
