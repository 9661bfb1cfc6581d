"""A route that is pulled taut in a kernel: the object that keeps it between two calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.taut import layout
from rrtik_ompl.kernels.search.taut.layout import TightenTable
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of

FIRST_STEP = 0.3  # of what straightens a bend
CHECKS_PER_CALL = 64  # of the kernel, until the caller may stop it


class Tightening:
    """Pulls a route taut; the same seed gives the same route, however it is interrupted.

    Every motion of the result that is not one of the input's is free, none is longer for it, and no waypoint is added.

    Args:
        motions: How motions are checked in a world.
        waypoints: A free route, shape (k, dof), k at least 2.
        seed: Of the steps.

    Raises:
        InputError: If the route has no motion, or the kernels cannot check it.
    """

    def __init__(self, motions: FastMotions, waypoints: Matrix, *, seed: int = 0) -> None:
        dof = motions.dof
        kernels = library(layout.KERNELS)
        if kernels is None or len(waypoints) < 2 or not motions.fast.covered(motions.joint_values(waypoints)):
            raise InputError("waypoints to pull taut: expected a route of two or more that kernels can check")
        self._kernels = kernels
        self._motions = motions
        self._dof = dof
        self._table = made = TightenTable(PlannedTable(_plan(len(waypoints), dof)))
        made.put(motions=motions.table, random=seed % 2**62)
        made.route[:] = waypoints.ravel()
        made.steps[:] = FIRST_STEP
        made.hints[:] = -1.0

    @property
    def waypoints(self) -> Matrix:
        """The route as it is now, shape (k, dof); a copy."""
        return self._table.route[: self._table.count * self._dof].reshape(-1, self._dof).copy()

    @property
    def checks(self) -> int:
        """How many motions have been checked."""
        return self._table.checks

    def run(self, checks: int, *, stop: Callable[[], bool] | None = None) -> bool:
        """Go on until so many motions have been checked since the beginning, nothing moves, or ``stop`` says so.

        Returns:
            Whether nothing moves any more.
        """
        until = self.checks
        while until < checks:
            until = min(until + CHECKS_PER_CALL, checks)
            self._motions.make_ready()
            if self._kernels.tighten(self._table.address, until) == layout.DONE:
                return True
            if stop is not None and stop():
                break
        return False

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the route or what it works on."""
        return self._table.intact() and self._motions.intact()


@lru_cache(maxsize=256)
def _plan(count: int, dof: int) -> TablePlan:
    """The table of a route of so many waypoints."""
    hints = 2 * layout.HINT_SIZE * count
    return sizes_of(TightenTable, route=count * dof, point=dof, steps=count, hints=hints, count=count, bend=1)
