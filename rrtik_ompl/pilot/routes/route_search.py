"""The best route to one of several last parts: robust to small errors of the pilot first, then of few moves.

Routes are searched for on small lattices of joint values: the corners between start and goal, then further values of
one joint after the other. Only where those hold no route a planner is called. They are compared by their executions.
Source: [1, ch. 6 and 6.3] (lists of single-joint moves).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import merge_moves, route_length
from rrtik_ompl.ompl_bridge.planner_traits import planners_with
from rrtik_ompl.pilot.routes.follower import path_fault, slack
from rrtik_ompl.planning.moves.lattice import MoveLattice, Values, lattice_size, spread_values, values_of
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.shortening.fewest_moves import turning_limits
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

EXECUTIONS = 100  # with errors, that measure the robustness of a route
MIN_ROBUSTNESS = 0.99  # a smaller one is warned of
TRIALS = 40  # executions by which all routes are compared
FINALISTS = 4  # the best of them, which are compared by EXECUTIONS

Tail = Sequence[Matrix]  # last parts of routes from one configuration, shape (moves + 1, dof) each, at least one

FARTHEST = 256  # [mm] of a proven clearance; what is farther away is not near
PLANNER_SECONDS = 5.0
MAX_CORNERS = 256  # of a lattice of moves
FURTHER_VALUES = 24  # of a joint
DETOUR_STEPS = (-16.0, -8.0, -4.0, 4.0, 8.0, 16.0)  # small errors by which a detour is made larger or smaller


@dataclass(frozen=True, slots=True)
class NoRoute:
    """There is no route.

    Attributes:
        reason: Why, in words for a person.
        stage: The part of the route that cannot be made; "" for the whole route.
    """

    reason: str
    stage: str = ""

    def __str__(self) -> str:
        return f"{self.stage}: {self.reason}" if self.stage else self.reason


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


# --- routes of few moves between two configurations ------------------------------------------------------------------


def direct_routes(world: World, start: Vector, goal: Vector, orders: Sequence[Sequence[int]]) -> list[Matrix]:
    """Routes in which every joint moves once at most, shape (moves + 1, dof); none if that is not free.

    Args:
        world: In which they are to be free.
        start: Shape (dof,).
        goal: Shape (dof,).
        orders: For each route all joints; of several equally good routes the one whose last moves come first here.
    """
    values = values_of(np.array([start, goal]))
    return _routes(world, start, goal, values, orders) if lattice_size(values) <= MAX_CORNERS else []


def detours(world: World, start: Vector, goal: Vector, order: Sequence[int], rng: np.random.Generator) -> list[Matrix]:
    """Routes in which one joint takes further values in between, for each joint the best; see `direct_routes`."""
    ends = np.array([start, goal])
    if lattice_size(values_of(ends)) > MAX_CORNERS:
        return []

    lower, upper = turning_limits(world.robot, ends)

    routes: list[Matrix] = []
    for joint in range(world.robot.dof):
        values = values_of(ends)
        further = spread_values(float(lower[joint]), float(upper[joint]), FURTHER_VALUES, rng)
        values[joint] = np.union1d(values[joint], further)
        routes += _routes(world, start, goal, values, [order])
    return routes


def planned(world: World, start: Vector, goal: Vector, seed: int) -> Matrix | NoRoute:
    """A planner's route, shape (moves + 1, dof), or the reason why there is none.

    Raises:
        ProblemError: If the start or the goal is not free.
        InputError: If no package offers a planner that suits.
    """
    planner, options = _planner()
    result = plan(Problem(world, start, goal), planner, seconds=PLANNER_SECONDS, seed=seed, parameters=options)
    return NoRoute(result.reason) if result.path is None else result.path.waypoints


def moved_aside(world: World, route: Matrix, slack: Vector) -> Iterator[Matrix]:
    """The same route with another value where a joint makes a detour, as far as it is free. Shape (moves + 1, dof).

    Args:
        world: In which they are to be free.
        route: Shape (moves + 1, dof).
        slack: Small errors of the joints, shape (dof,) [rad or m].
    """
    for joint, column in enumerate(route.T):
        for value in np.setdiff1d(column, column[[0, -1]]):
            for step in DETOUR_STEPS:
                other = route.copy()
                other[column == value, joint] = value + step * slack[joint]
                if world.motion_valid_batch(other[:-1], other[1:]).all():
                    yield other


@cache
def _planner() -> tuple[str, dict[str, Any]]:
    """The planner of single-joint moves that can be told to be brief, and the options that tell it.

    Raises:
        InputError: If no package offers one.
    """
    for name, traits in planners_with(lambda traits: traits.one_joint and traits.brief_options).items():
        return name, dict(traits.brief_options)
    raise InputError("no installed planner moves one joint at a time and has brief_options; install rrtik-ompl whole")


def _routes(world: World, start: Vector, goal: Vector, values: Values, orders: Sequence[Sequence[int]]) -> list[Matrix]:
    lattice = MoveLattice(values, world.motion_valid_batch, np.ones(world.robot.dof))
    best_routes = [lattice.best_route(start, goal, order) for order in orders]

    different = {route.tobytes(): route for route in best_routes if route is not None}
    return list(different.values())


# --- what is proven of a route, and whether it forgives small errors -------------------------------------------------


def proven_clearance(parts: Iterable[tuple[World, Matrix]]) -> float:
    """What the motions of a route are proven to keep from every obstacle beside its margin, in whole millimetres [m].

    0 also if the motions are not proven free; +inf if everything is more than a quarter of a metre away. Obstacles that
    may be touched, as what is grasped, do not count.

    Args:
        parts: Waypoints, shape (k, dof), each with the world that they are proven in.
    """
    parts = [(world, rows) for world, rows in parts if len(rows) > 1]

    def is_proven(millimetres: int) -> bool:
        return all(world.prove(rows, clearance=1e-3 * millimetres).proven for world, rows in parts)

    if is_proven(FARTHEST):
        return float("inf")

    low = 0
    high = FARTHEST
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if is_proven(middle) else (low, middle)
    return 1e-3 * low


def executions(path: JointPath, slack: Vector, count: int, rng: np.random.Generator) -> Matrix:
    """Corners of a path of single-joint moves as a pilot makes them: every move ends with an error up to ``slack``.

    Args:
        path: One joint at a time.
        slack: Largest error of each joint, shape (dof,) [rad or m].
        count: How many executions.
        rng: For the errors, which are uniform.

    Returns:
        Shape (count, moves + 1, dof).
    """
    names = list(path.joint_names)
    moves = path.moves()

    rows = np.tile(path.start, (count, len(moves) + 1, 1))
    for number, move in enumerate(moves, start=1):
        joint = names.index(move.joint)
        errors = rng.uniform(-slack[joint], slack[joint], (count, 1))
        rows[:, number:, joint] = move.end + errors
    return rows


def forgiving(world: World) -> World:
    """The same world where what is in contact is not compared: only to count what else errors would touch."""
    scene = world.scene
    pairs = (*scene.allowed_collisions, *(contact.names for contact in scene.contacts))
    return world.with_scene(replace(scene, contacts=(), allowed_collisions=pairs)) if scene.contacts else world


def free_rows(world: World, rows: Matrix) -> NDArray[np.bool_]:
    """Which of some `executions` touch nothing; a joint that stops at its limit is no fault. Shape (count,)."""
    if rows.shape[1] < 2:
        return np.ones(len(rows), dtype=bool)

    within_limits = world.robot.clamp(rows.reshape(-1, rows.shape[-1])).reshape(rows.shape)
    starts, ends = (part.reshape(-1, rows.shape[-1]) for part in (within_limits[:, :-1], within_limits[:, 1:]))
    return np.asarray(world.motion_valid_batch(starts, ends).reshape(len(rows), -1).all(axis=1))
