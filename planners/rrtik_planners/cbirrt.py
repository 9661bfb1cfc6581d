"""CBiRRT2: two trees that grow along path constraints, by projection, whole in kernels."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from ompl import base as ob

from rrtik_ompl.arrays import Matrix, Vector, positive
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast.search.constrained.layout import KERNELS
from rrtik_ompl.fast.search.constrained.search import ConstrainedSearch
from rrtik_ompl.fast.search.motions.motion_table import FastMotions
from rrtik_ompl.ik.held_tables import HeldTables, held_tables
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult, Stop
from rrtik_ompl.world.holding_world import HoldingWorld
from rrtik_ompl.world.motion_queries import has_kernels, is_conservative, turning_joints
from rrtik_planners.fast_rrt_connect import python_rules, search_in_python
from rrtik_planners.one_joint_options import iteration_limit

PLAIN_SAMPLES = 500  # before it is asked whether the constraints alone separate start and goal
EXPLORED = 6000  # samples of that question
SATURATED = 1500  # samples in which no tree came to where it was not, until it counts as grown out


class CBiRRT(SafePlanner):
    """CBiRRT2: each tree walks towards samples, and to the other tree, in short steps that are projected.

    In a world with path constraints it keeps them, by the bound of
    :class:`rrtik_ompl.constraints.held_regions.HeldRegions`; in any other it is an RRT-Connect. If no path is found
    after a while, the trees grow without obstacles: where they can grow no more and do not meet, start and goal lie on
    different components of what the constraints allow, and the reason says so.
    """

    kernels: ClassVar[tuple[str, ...]] = (KERNELS,)
    supports_iteration_limit: ClassVar[bool] = True
    keeps_constraints: ClassVar[bool] = True

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        range: float | None = None,
        max_iterations: int | None = None,
    ) -> None:
        """Make a planner.

        Args:
            si: ``ompl.base.SpaceInformation`` of a RealVectorStateSpace.
            world: Checks configurations and motions instead of ``si``, if given.
            seed: At least 0; drawn from OMPL's if None.
            range: Length of a step, at most [unit of the space]; what suits the bounds if None.
            max_iterations: Samples at most; without limit if None.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
        """
        super().__init__(si, "CBiRRT", world=world, seed=seed)
        self.range = None if range is None else positive(range, "range")
        self.max_iterations = iteration_limit(max_iterations)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        world = self._world
        motions, tables = None, None
        if isinstance(world, HoldingWorld):
            motions, tables = world.free_motions, held_tables(world.robot, world.constraints)
            if motions is None or tables is None:
                raise InputError("path constraints need searches in kernels: install numba")
        elif has_kernels(world, KERNELS):
            motions, tables = world.motions, held_tables(world.robot, HeldRegions(()))
        if motions is None or tables is None:
            rules = python_rules(
                self.bounds(), self.range, None, self.max_iterations, turning=turning_joints(self._world)
            )
            return search_in_python(starts, goals, rules, checker, ptc, self.rng)
        return self._in_kernels(starts, goals, checker, ptc, motions, tables)

    def _in_kernels(
        self,
        starts: Matrix,
        goals: Matrix,
        checker: MotionChecker,
        ptc: Stop,
        motions: FastMotions,
        tables: HeldTables,
    ) -> SearchResult:
        lower, upper = self._box(motions)
        search = ConstrainedSearch(motions, tables.address, lower, upper, range_=self.range)
        ask = None if is_conservative(self._world) else checker.motion_valid_batch
        limit = np.inf if self.max_iterations is None else self.max_iterations
        seed = self.rng.bit_generator.random_raw
        first = int(min(limit, PLAIN_SAMPLES))
        path = search.solve(starts, goals, seed(), ask=ask, stop=ptc, max_iterations=first)
        counts = search.statistics()
        if path is None and first == PLAIN_SAMPLES and not ptc():
            reason = self._separated(search, starts, goals, ptc) if tables.regions else ""
            if reason:
                return SearchResult(None, {**counts, "separated": 1}, reason=reason)
            rest = None if self.max_iterations is None else self.max_iterations - first
            path = search.solve(starts, goals, seed(), ask=ask, stop=ptc, max_iterations=rest)
            counts = {key: value + counts[key] for key, value in search.statistics().items()}
        checker.checked_motions += int(counts["motions"])
        return SearchResult(path, {**counts, "edges": counts["vertices"] - len(starts) - len(goals)})

    def _separated(self, search: ConstrainedSearch, starts: Matrix, goals: Matrix, ptc: Stop) -> str:
        """Why the constraints and limits alone keep start and goal apart, in a line; "" where that is not seen."""
        state = self.rng.bit_generator.random_raw()

        def done() -> bool:
            return bool(ptc()) or search.stale > SATURATED

        found = search.solve(starts, goals, state, stop=done, max_iterations=EXPLORED, unchecked=True)
        if found is not None or search.stale <= SATURATED:
            return ""
        near, far = search.sizes
        away = np.abs(goals[0] - starts[0])
        joint = int(away.argmax())
        return (
            f"start and goal lie on different components of what the path constraints allow: {near} and {far} "
            f"configurations grown from them without obstacles do not meet, and none is new in {SATURATED} samples; "
            f"joint {joint + 1} differs most, by {away[joint]:.3g}: take another branch of inverse kinematics"
        )

    def _box(self, motions: FastMotions) -> tuple[Vector, Vector]:
        lower, upper = self.bounds()
        if isinstance(self._world, HoldingWorld):
            robot = self._world.robot
            return np.maximum(lower, robot.lower), np.minimum(upper, robot.upper)
        return lower, upper
