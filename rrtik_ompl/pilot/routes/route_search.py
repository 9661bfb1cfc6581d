"""The best route to one of several last parts: robust to small errors of the pilot first, then of few moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import merge_moves, route_length
from rrtik_ompl.pilot.routes.clearance import executions, forgiving, free_rows, proven_clearance
from rrtik_ompl.pilot.routes.follower import path_fault, slack
from rrtik_ompl.pilot.routes.moves import detours, direct_routes, moved_aside, planned
from rrtik_ompl.pilot.routes.no_route import NoRoute
from rrtik_ompl.world.world import World

EXECUTIONS = 100  # with errors, that measure the robustness of a route
MIN_ROBUSTNESS = 0.99  # a smaller one is warned of
TRIALS = 40  # executions by which all routes are compared
FINALISTS = 4  # the best of them, which are compared by EXECUTIONS

Tail = Sequence[Matrix]  # last parts of routes from one configuration, shape (moves + 1, dof) each, at least one


class GraspRoute(NamedTuple):
    """Single-joint moves, shape (moves + 1, dof), and the number of the first one that may touch the object."""

    rows: Matrix
    grasp_from: int


class RouteSearch:
    """A search for the best route.

    Args:
        world: In which nothing may be touched.
        holding: In which the gripper may touch the object; the same where there is none.
        q: Where the arm is, shape (dof,).
        seed: Of the random numbers.
    """

    def __init__(self, world: World, holding: World, q: Vector, seed: int) -> None:
        self._world = world
        self._holding = holding
        self._q = q
        self._seed = seed
        self._forgiving = forgiving(holding)
        self._path = JointPath.of(world.robot, q[None])
        self._slack = slack(self._path)

    def find(self, tails: Sequence[Tail]) -> GraspRoute | NoRoute:
        """The best route; one that is not proven free only where no other is found, or none can be proven.

        Args:
            tails: Last parts, grouped by where they begin; the best beginning first.

        Raises:
            ProblemError: If the arm is in collision, or the last parts begin in collision.
        """
        unproven = None
        for routes in (self._all_direct(tails), self._around(tails[0])):
            best = self._best(routes)
            if best is not None and (self.proven(best) or not self._provable(tails[0])):
                return best
            unproven = unproven or best

        first = planned(self._world, self._q, tails[0][0][0], self._seed)
        if isinstance(first, NoRoute):
            return unproven or first

        best = self._best(_joined(first, part) for part in tails[0])
        if best is not None and self.proven(best):
            return best
        return unproven or best or NoRoute("it comes too close to something to be sure")

    def robustness(self, route: GraspRoute, count: int = EXECUTIONS) -> float:
        """Share of executions that touch nothing but what is grasped although every move ends with a small error."""
        made = executions(self._path.with_waypoints(route.rows), self._slack, count, np.random.default_rng(self._seed))
        before = made[:, : route.grasp_from + 1]
        after = made[:, route.grasp_from :]
        return float((free_rows(self._world, before) & free_rows(self._forgiving, after)).mean())

    def proven(self, route: GraspRoute) -> bool:
        """Whether all moves of a route are proven free for their whole length."""
        return all(world.prove(rows).proven for world, rows in self._parts(route) if len(rows) > 1)

    def clearance(self, route: GraspRoute) -> float:
        """What a route is proven to keep from obstacles [m]; see `proven_clearance`."""
        return proven_clearance(self._parts(route))

    def _provable(self, tail: Tail) -> bool:
        """Whether there may be a proven route: not without kernels, nor where an end cannot be proven."""
        end = tail[0][-1]
        return self._world.motion_proven(self._q, self._q) and self._holding.motion_proven(end, end)

    def _all_direct(self, tails: Sequence[Tail]) -> Iterator[GraspRoute]:
        return (route for tail in tails for route in self._direct(tail))

    def _direct(self, tail: Tail) -> Iterator[GraspRoute]:
        """Routes in which every joint moves once before the last part."""
        orders = [self._order(part) for part in tail]
        for first in direct_routes(self._world, self._q, tail[0][0], orders):
            yield from (_joined(first, part) for part in tail)

    def _around(self, tail: Tail) -> Iterator[GraspRoute]:
        """Routes in which one joint makes a detour, narrow or wide."""
        rng = np.random.default_rng(self._seed)
        for route in detours(self._world, self._q, tail[0][0], self._order(tail[0]), rng):
            for first in (route, *moved_aside(self._world, route, self._slack)):
                yield min((_joined(first, part) for part in tail), key=lambda joined: len(joined.rows))

    def _order(self, last: Matrix) -> list[int]:
        """All joints, first the one that a last part begins with: so that its move may join the one before."""
        joints = np.random.default_rng(self._seed).permutation(len(self._q)).tolist()
        return joints if len(last) < 2 else sorted(joints, key=lambda joint: last[0, joint] == last[1, joint])

    def _best(self, routes: Iterable[GraspRoute]) -> GraspRoute | None:
        finalists = sorted(routes, key=lambda route: self._rank(route, TRIALS))[:FINALISTS]

        ranked = sorted(finalists, key=lambda route: self._rank(route, EXECUTIONS))
        proven = next(filter(self.proven, ranked), None)
        return proven or next((route for route in ranked if not self._fault(route)), None)

    def _rank(self, route: GraspRoute, count: int) -> tuple[float, int, float, float]:
        """Sorting key, the best first: executions that touch something, in tenths; moves; their exact share; travel."""
        touching = 1.0 - self.robustness(route, count)
        tenths = max(round(10.0 * touching), int(touching > 1.0 - MIN_ROBUSTNESS))
        return tenths, len(route.rows), touching, route_length(route.rows)

    def _fault(self, route: GraspRoute) -> str:
        """Why a second, independent check refuses a route; "" if it does not."""
        faults = (path_fault(world, self._path.with_waypoints(rows)) for world, rows in self._parts(route))
        return next(filter(None, faults), "")

    def _parts(self, route: GraspRoute) -> tuple[tuple[World, Matrix], ...]:
        """What may touch nothing and what may touch the object, each with its world."""
        before = route.rows[: route.grasp_from + 1]
        after = route.rows[route.grasp_from :]
        return (self._world, before), (self._holding, after)


def _joined(first: Matrix, last: Matrix) -> GraspRoute:
    """A first and a last part; where the same joint moves on they share a move, which may touch the object."""
    rows = merge_moves(np.vstack([first, last[1:]]), tolerance=0.0)
    shared = len(rows) < len(first) + len(last) - 1
    return GraspRoute(rows, len(first) - 1 - shared)
