"""FewestMoves: paths of single-joint moves with as few moves as possible, and a lower bound on their number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

from rrtik_ompl.base.arrays import Matrix, not_negative, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.transitions import lower_bound, merge_moves, transitions
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SearchResult, Stop
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.motion_checker import WorldChecker
from rrtik_ompl.planning.moves.clearance_levels import Level, clearance_levels
from rrtik_ompl.planning.moves.fine_grids import FineGrids, rounds_before
from rrtik_ompl.planning.moves.lower_bounds import reach_bound, remembered
from rrtik_ompl.planning.moves.rules import Joints, PerJoint
from rrtik_ompl.planning.moves.search import MOST_NODES, MoveSearch, Proof
from rrtik_ompl.planning.moves.staircase import one_joint_moves
from rrtik_ompl.planning.shortening import Task, Wishes
from rrtik_ompl.planning.shortening.cuts import shortcut
from rrtik_ompl.world.motion_queries import has_kernels
from rrtik_ompl.world.world import World
from rrtik_planners.bicrdt import BiCRDT
from rrtik_planners.fast_rrt_connect import FastRRTConnect
from rrtik_planners.one_joint_planner import OneJointPlanner

SEARCHES = 5  # number of runs of BiCRDT, the best of which is improved
MAX_IMPROVEMENT_ROUNDS = 10
BRIEF_ITERATIONS = 1000  # iterations of one of these runs
BRIEF_IN_PYTHON = 100  # the same without kernels on a level whose clearance is a mere preference
SAMPLED_ITERATIONS = 20_000  # iterations of RRT-Connect
FEW_NODES = 256  # largest number of nodes of a lattice if there is no world, so that each motion is checked by itself


class _Question(NamedTuple):
    """The arguments of one search.

    Attributes:
        starts: Start configurations, shape (s, n).
        goals: Goal configurations, shape (g, n).
        checker: Checks motions, with the clearance of the level if there is one.
        stop: Returns True when it is time to stop.
        level: The clearance to keep; None for that of the world.
        known: A route that keeps the level, shape (k, n), to start from instead of quick ones; or None.
    """

    starts: Matrix
    goals: Matrix
    checker: MotionChecker
    stop: Stop
    level: Level | None = None
    known: Matrix | None = None

    @property
    def ends(self) -> tuple[Matrix, Matrix, MotionChecker, Stop]:
        """The arguments of a planner's ``search``: starts, goals, checker and stop."""
        return self.starts, self.goals, self.checker, self.stop


class FewestMoves(OneJointPlanner):
    """Minimises the number of moves first and joint travel second.

    The search starts from the best of several quick runs of BiCRDT and looks for better routes on lattices of joint
    values. Where BiCRDT finds nothing, it starts from a path of RRT-Connect turned into single-joint moves. It ends
    when the lower bound is met, its rounds are over or time is up. ``statistics`` has the lower bound of the number of
    moves, and the gap, by which the path exceeds it. If more than 12 joints differ, the bound is their number.

    The path keeps a clearance from obstacles where that costs no move.
    """

    ompl_name: ClassVar[str] = "FewestMoves"
    kernels: ClassVar[tuple[str, ...]] = ()
    anytime: ClassVar[bool] = True
    leaves_room: ClassVar[bool] = True
    path_statistics: ClassVar[tuple[str, ...]] = ("lower_bound", "gap")
    brief_options: ClassVar[Mapping[str, Any]] = MappingProxyType({"searches": 1, "rounds": 0})

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        searches: int = SEARCHES,
        rounds: int = MAX_IMPROVEMENT_ROUNDS,
        joint_costs: PerJoint | None = None,
        frozen_joints: Joints = (),
        smallest_move: PerJoint = 0.0,
        last_joints: Joints = (),
        clearance: float | None = None,
    ) -> None:
        """Make a planner with options beside those of :class:`~rrtik_planners.one_joint_planner.OneJointPlanner`.

        Args:
            world: With a ``rrtik_ompl.World`` the bound can be raised by proofs.
            searches: Number of runs of BiCRDT at the beginning, at least 1.
            rounds: Number of rounds of improvement after the first, at least 0. If there is enough time, the result
                depends on this number only, not on the time.
            last_joints: Joints that move last; the bound counts their moves too.
            clearance: Wanted distance to obstacles in addition to their margins [m]; None for a centimetre. Needs a
                ``rrtik_ompl.World``.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(
            si,
            world=world,
            seed=seed,
            joint_costs=joint_costs,
            frozen_joints=frozen_joints,
            smallest_move=smallest_move,
            last_joints=last_joints,
        )
        self.searches = whole_number(searches, "searches:", least=1)
        self.rounds = whole_number(rounds, "rounds:")
        self._prove: Proof | None = None
        self.clearance = None if clearance is None else not_negative(clearance, "clearance")

    def completed(self, found: SearchResult, path: Matrix) -> SearchResult:
        """Return the result with the last moves added to path and bound, see :meth:`OneJointPlanner.completed`."""
        assert found.path is not None
        bound = found.statistics["lower_bound"] + transitions(path) - transitions(found.path)
        return replace(found, path=path, statistics={**found.statistics, "lower_bound": bound})

    def between(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """Look for a path, see :meth:`OneJointPlanner.between`.

        In a ``World`` one search is made for each level of clearance, the largest first, until one meets its lower
        bound. If none does, fine grids follow.
        """
        world = self._world
        if not isinstance(world, World):
            return self._found(_Question(starts, goals, checker, ptc))

        self._prove = remembered(world, self._movable(starts), ptc)
        best: SearchResult | None = None
        levels = clearance_levels(world, starts[:1], self.clearance)
        for number in range(len(levels)):
            asked = self._asked(starts, goals, levels, number, ptc)
            settled = best is not None and best.path is not None and (best.statistics["gap"] == 0 or ptc())
            if settled or len(asked.goals) == 0:
                continue
            found = self._bounded(asked, starts, goals, checker, patient=number == len(levels) - 1)
            best = found if best is None else _fewer(best, found)

        assert best is not None
        if best.path is None or best.statistics["gap"] == 0 or self.rounds == 0 or ptc():
            return best
        return self._finer(best, levels, starts, goals, checker, ptc)

    def _asked(self, starts: Matrix, goals: Matrix, levels: list[Level], number: int, ptc: Stop) -> _Question:
        """Return the arguments of the search on a level, with the goals that keep its clearance.

        The last level, with the least clearance, has all goals.
        """
        proving = levels[number].proving
        aims = goals if number == len(levels) - 1 else goals[proving.motion_valid_batch(goals, goals)]
        return _Question(starts, aims, WorldChecker(proving), ptc, levels[number])

    def _finer(
        self,
        best: SearchResult,
        levels: list[Level],
        starts: Matrix,
        goals: Matrix,
        checker: MotionChecker,
        ptc: Stop,
    ) -> SearchResult:
        """Raise the lower bound of the best result, and look for a route with fewer moves on fine grids.

        Args:
            best: The best result so far, which has a path.
            levels: All levels of clearance.
            starts: Start configurations, shape (s, n).
            goals: Goal configurations, shape (g, n).
            checker: Checks motions and counts them.
            ptc: Returns True when it is time to stop.
        """
        path = best.path
        assert path is not None
        assert isinstance(self._world, World)
        grids = FineGrids(
            self._movable(starts),
            *self.bounds(),
            self.options.joint_costs,
            self.options.smallest_move,
            levels,
            Budget(int(self.rng.integers(2**63)), stop=ptc),
        )
        pairs = [(start, goal) for start in starts for goal in goals]

        bound = int(best.statistics["lower_bound"])
        if len(starts) == len(goals) == 1:
            moves = transitions(path)
            bound = max(bound, reach_bound(self._world, self._movable(starts), starts[0], goals[0], moves, ptc))
            best = replace(best, statistics={**best.statistics, "lower_bound": bound, "gap": moves - bound})

        found = grids.route(pairs, merge_moves(path, tolerance=0.0), bound)
        if found is None:
            return best

        route, number = found
        asked = self._asked(starts, goals, levels, number, ptc)._replace(known=route)
        return _fewer(best, self._bounded(asked, starts, goals, checker))

    def _bounded(
        self, asked: _Question, starts: Matrix, goals: Matrix, checker: MotionChecker, *, patient: bool = True
    ) -> SearchResult:
        """Search on a level, count its motions, and lower the bound so that it holds for all goals.

        Args:
            asked: Arguments of the search, perhaps without goals that do not keep the level's clearance.
            starts: Start configurations, shape (s, n).
            goals: All goal configurations, shape (g, n).
            checker: Counts the motions.
            patient: See :meth:`_found`.
        """
        found = self._found(asked, patient=patient)
        checker.checked_motions += asked.checker.checked_motions
        if found.path is None or len(asked.goals) == len(goals):
            return found

        plain = min(lower_bound(start, goal) for start in starts for goal in goals)
        bound = min(int(found.statistics["lower_bound"]), plain)
        counts = {"lower_bound": bound, "gap": transitions(found.path) - bound}
        return replace(found, statistics={**found.statistics, **counts})

    def _movable(self, starts: Matrix) -> list[int]:
        return [joint for joint in range(starts.shape[1]) if joint not in self.options.staying]

    def _found(self, asked: _Question, *, patient: bool = True) -> SearchResult:
        """Run one search: find first routes, then improve them on lattices.

        Args:
            asked: Arguments of the search.
            patient: Whether to run BiCRDT without a limit of iterations if the quick runs find no route.
        """
        world = self._world
        moves = MoveSearch(
            asked.starts,
            asked.goals,
            *self.bounds(),
            asked.checker.motion_valid_batch,
            budget=Budget(int(self.rng.integers(2**63)), stop=asked.stop),
            costs=self.options.joint_costs,
            frozen=self.options.staying,
            smallest_move=self.options.smallest_move,
            most_nodes=FEW_NODES if world is None else MOST_NODES,
            prove=self._prove,
            all_free=None if asked.level is None or world is None else world.motion_valid_batch,
        )

        moves.try_corner_routes()
        iterations = 0
        if asked.known is None:
            iterations = self._quick_routes(moves, asked, patient=patient)
        else:
            moves.offer(asked.known)
        if moves.route is None:
            return SearchResult(None, {"iterations": iterations})

        grids_follow = asked.level is not None
        rounds = rounds_before(self.rounds, self._movable(asked.starts)) if grids_follow else self.rounds
        moves.improve(rounds)
        counts = {"iterations": iterations, "rounds": moves.rounds, "lower_bound": moves.bound}
        return SearchResult(moves.route, {**counts, "gap": moves.moves - moves.bound})

    def _quick_routes(self, moves: MoveSearch, asked: _Question, *, patient: bool) -> int:
        """Offer the routes of several quick runs of BiCRDT, or of RRT-Connect where these find none.

        Args:
            moves: The search that takes the routes.
            asked: Arguments of the search.
            patient: Whether BiCRDT is run without a limit of iterations if there is still no route.

        Returns:
            Number of iterations of BiCRDT.
        """
        level = asked.level
        world = self._world if level is None else level.searched
        iterations = 0
        seeds = self.rng.integers(2**31, size=self.searches).tolist()
        if not patient and not has_kernels(world):  # the time is for the last level
            found = self._bicrdt(world, seeds[0], BRIEF_IN_PYTHON).search(*asked.ends)
            if found.path is not None:
                _offer(moves, found.path, level)
            return int(found.statistics.get("iterations", 0))

        for seed in seeds:
            if moves.proven or asked.stop():
                return iterations

            found = self._bicrdt(world, seed, BRIEF_ITERATIONS).search(*asked.ends)
            iterations += int(found.statistics.get("iterations", 0))
            if found.path is not None:
                _offer(moves, found.path, level)
            elif moves.route is None:
                route = self._converted(world, seed, asked)
                if route is not None:
                    _offer(moves, route, level)

        if moves.route is None and patient:
            found = self._bicrdt(world, seeds[0], None).search(*asked.ends)
            iterations += int(found.statistics.get("iterations", 0))
            if found.path is not None:
                moves.offer(found.path)
        return iterations

    def _bicrdt(self, world: MotionQueries | None, seed: int, iterations: int | None) -> BiCRDT:
        return BiCRDT(
            self.getSpaceInformation(),
            world=world,
            seed=seed,
            joint_costs=self.options.joint_costs.tolist(),
            frozen_joints=self.options.staying,
            smallest_move=self.options.smallest_move.tolist(),
            max_iterations=iterations,
        )

    def _converted(self, world: MotionQueries | None, seed: int, asked: _Question) -> Matrix | None:
        """Return RRT-Connect's path, shortened and turned into single-joint moves, shape (k, n); None if there is none.

        Joints that must stay are not supported, and the world must be a ``World``.
        """
        if not isinstance(world, World) or self.options.staying:
            return None
        sampled = FastRRTConnect(
            self.getSpaceInformation(), world=world, seed=seed, max_iterations=SAMPLED_ITERATIONS
        ).search(*asked.ends)
        if sampled.path is None:
            return None
        short = shortcut(sampled.path, Task(world, Wishes(Budget(seed, stop=asked.stop))))
        try:
            return one_joint_moves(JointPath.of(world.robot, short), world).waypoints
        except InputError:  # The path is so close to an obstacle that no single-joint moves can follow it.
            return None


def _offer(moves: MoveSearch, route: Matrix, level: Level | None) -> None:
    """Offer a route, shape (k, n), that was checked in steps; on a level only if it is proven to keep its clearance."""
    if level is None or level.proving.motion_valid_batch(route[:-1], route[1:]).all():
        moves.offer(route)


def _fewer(one: SearchResult, other: SearchResult) -> SearchResult:
    """Return the result with fewer moves (the first of equal ones), with the sum of their work and the larger bound."""
    if one.path is None or other.path is None:
        return other if one.path is None else one
    best = other if transitions(other.path) < transitions(one.path) else one
    assert best.path is not None
    counts = {key: one.statistics[key] + other.statistics[key] for key in ("iterations", "rounds")}
    bound = max(one.statistics["lower_bound"], other.statistics["lower_bound"])
    return SearchResult(best.path, {**counts, "lower_bound": bound, "gap": transitions(best.path) - bound})
