"""A route that is pulled taut in a kernel: the object that keeps it between two calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search import shortcut_layout
from rrtik_ompl.kernels.search.contacts import layout
from rrtik_ompl.kernels.search.contacts.layout import PullTable
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of

CUTS = 20  # random cuts before the route is pulled
WAYPOINT_SHARE = 0.5  # of the ends of cuts are waypoints
WORK = 130.0  # in proofs of free motions
LEAST_GAIN = 1e-2  # share of the length, see the table
FEWEST_CONTACTS, MOST_CONTACTS = 32, 128  # that there is room for
WORK_PER_CALL = 500  # of the kernel, about 10 ms, until the caller may stop it


class Pulling:
    """Makes a route short: jumps from waypoint to waypoint, random cuts, then pulls along what the route touches.

    The same seed gives the same route, however it is interrupted. Every motion of the result is proven free; the ends
    stay as they are to the bit.

    Attributes:
        table: What the kernels read.

    Args:
        motions: How motions are checked in a world, by proofs.
        waypoints: A free route, shape (k, dof), k at least 2.
        lower, upper: The box in which bends may move, shape (dof,).
        seed: Of the cuts.
        cuts: How many.
        work: What is done at most, in proofs of free motions.
        least_gain: Share of the length; steps that gain less lead to the end.

    Raises:
        InputError: If the route has no motion, or the kernels cannot prove it.
    """

    def __init__(
        self,
        motions: FastMotions,
        waypoints: Matrix,
        lower: Vector,
        upper: Vector,
        *,
        seed: int = 0,
        cuts: int = CUTS,
        work: float = WORK,
        least_gain: float = LEAST_GAIN,
    ) -> None:
        dof = motions.dof
        kernels = library(layout.KERNELS)
        if kernels is None or len(waypoints) < 2 or not motions.proves:
            raise InputError("waypoints to pull taut: expected a route of two or more that kernels can prove")
        self._kernels = kernels
        self._motions = motions
        self._dof = dof
        self.table = made = route_table(
            motions, len(waypoints), lower, upper, cuts=cuts, work=work, least_gain=least_gain
        )
        made.put(count=len(waypoints), random=seed % 2**62)
        made.route[: waypoints.size] = waypoints.ravel()

    @property
    def waypoints(self) -> Matrix:
        """The route as it is now, shape (k, dof); a copy."""
        return self.table.route[: self.table.count * self._dof].reshape(-1, self._dof).copy()

    @property
    def work(self) -> float:
        """What has been done, in proofs of free motions."""
        return self.table.work

    @property
    def proven(self) -> bool:
        """Whether every motion of the route could be proven; if not, it has not been pulled."""
        return self.table.unproven == 0

    def run(self, *, stop: Callable[[], bool] | None = None, work: int = WORK_PER_CALL) -> bool:
        """Go on until nothing moves any more, the work is spent, or ``stop`` says so.

        Args:
            stop: Asked between two calls of the kernel; True ends the work, which can be resumed.
            work: About so much is done in one call.

        Returns:
            Whether the work came to its end.
        """
        while True:
            self._motions.make_ready()
            if self._kernels.pull(self.table.address, work) != layout.RUNNING:
                return True
            if stop is not None and stop():
                return False

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the route or what it works on."""
        return self.table.intact() and self._motions.intact()


def route_table(
    motions: FastMotions,
    count: int,
    lower: Vector,
    upper: Vector,
    *,
    cuts: int,
    work: float = WORK,
    least_gain: float = LEAST_GAIN,
) -> PullTable:
    """A table with room for a route of so many waypoints; see :class:`Pulling`."""
    made = PullTable(PlannedTable(_plan(count, motions.dof)))
    made.put(motions=motions.table, max_tries=cuts, max_work=work, least_gain=least_gain)
    made.metric[:] = 1.0
    made.lower[:] = lower
    made.upper[:] = upper
    return made


@lru_cache(maxsize=256)
def _plan(count: int, dof: int) -> TablePlan:
    """The table of a route of so many waypoints."""
    capacity = max(count + 1, layout.MAX_BENDS + 2)
    contacts = min(max(2 * count, FEWEST_CONTACTS), MOST_CONTACTS)
    questions = shortcut_layout.MAX_QUESTIONS * dof
    return sizes_of(
        PullTable,
        metric=dof,
        route=capacity * dof,
        arc_lengths=capacity,
        ends=2 * dof,
        question_starts=questions,
        question_ends=questions,
        lower=dof,
        upper=dof,
        candidate=capacity * dof,
        arcs=capacity,
        edges=contacts,
        shares=contacts,
        pairs=contacts,
        ways=3 * contacts,
        points=3 * contacts,
        gaps=contacts,
        gradients=contacts * dof,
        bounds=contacts,
        pushes=contacts,
        lacks=contacts,
        products=contacts * contacts,
        couplings=contacts * contacts,
        measured=contacts,
        next_gaps=contacts,
        next_gradients=contacts * dof,
        capacity=capacity,
        contact_room=contacts,
        waypoint_share=WAYPOINT_SHARE,
        found_pair=-1,
    )
