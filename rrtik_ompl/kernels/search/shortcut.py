"""Random shortcuts of a route in a kernel: the object that keeps the search between two calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search import shortcut_layout
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT, FastMotions
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan

SPARE_WAYPOINTS = 256  # room for more than at the beginning
TRIES_PER_CALL = 256  # of the kernel, until the caller may stop it
_GIVEN = [shortcut_layout.MOTIONS, shortcut_layout.COUNT, shortcut_layout.RANDOM, shortcut_layout.RESOLVE]


class ShortcutSearch:
    """Shortens a route by random shortcuts; the same seed gives the same route, however it is interrupted.

    Every edge of the result that is not one of the input's is free: proven by the kernels or answered by ``ask``. The
    ends stay as they are to the bit, and no try makes the route longer.

    Attributes:
        table: What the kernels read.

    Args:
        motions: How motions are checked in a world.
        waypoints: A route whose edges are free, shape (k, dof), k at least 2.
        seed: Of the random places.
        share: Probability that an end of a shortcut is a waypoint; 0 for the published random cut.
        pull: Probability that a try pulls a waypoint; 0 for the published random cut.
        metric: Weights of the joints in the length, shape (dof,); all 1 if None.
        asking: Whether shortcuts that the kernels cannot decide are asked about, or count as colliding.

    Raises:
        InputError: If the route has no motion, or the kernels cannot check it.
    """

    def __init__(
        self,
        motions: FastMotions,
        waypoints: Matrix,
        *,
        seed: int = 0,
        share: float = 0.5,
        pull: float = 0.3,
        metric: Vector | None = None,
        asking: bool = True,
    ) -> None:
        dof = motions.dof
        rows = waypoints
        lengths = np.ones(dof) if metric is None else metric
        kernels = library(shortcut_layout.KERNELS)
        if kernels is None or len(rows) < 2 or not motions.fast.covered(motions.joint_values(rows)):
            raise InputError("waypoints to shorten: expected a route of two or more that kernels can check")
        self._kernels = kernels
        self._motions, self._dof = motions, dof  # its tables live as long as this search
        plan = _plan(len(rows) + SPARE_WAYPOINTS, dof)
        self.table = made = PlannedTable(plan)
        for place in plan.spans if plan.blank is None else ():  # a page's file shall be the same each time
            made[place][:] = 0.0
        made.header[_GIVEN] = motions.address, len(rows), seed % 2**62, int(asking)
        made[shortcut_layout.METRIC][:] = lengths * lengths
        made[shortcut_layout.PROBABILITIES][:] = share, pull
        made[shortcut_layout.ROUTE][: rows.size] = rows.ravel()

    @property
    def address(self) -> int:
        """Of the table, for other kernels; valid as long as this object lives."""
        return self.table.address

    @property
    def capacity(self) -> int:
        """Waypoints that there is room for."""
        return self._number(shortcut_layout.CAPACITY)

    @property
    def waypoints(self) -> Matrix:
        """The route as it is now, shape (k, dof); a copy."""
        return self._rows(shortcut_layout.ROUTE, self._number(shortcut_layout.COUNT))

    @property
    def tries(self) -> int:
        """How many shortcuts have been tried."""
        return self._number(shortcut_layout.TRIES)

    @property
    def gains(self) -> int:
        """How many of them have been taken."""
        return self._number(shortcut_layout.GAINS)

    @property
    def questions(self) -> tuple[Matrix, Matrix]:
        """Starts and ends of the motions that must be answered before the search can go on, shape (k, dof) each."""
        count = self._number(shortcut_layout.QUESTIONS)
        return self._rows(shortcut_layout.QUESTION_STARTS, count), self._rows(shortcut_layout.QUESTION_ENDS, count)

    def answer(self, free: bool) -> None:
        """Answer whether all of the questions are free."""
        self.table.header[shortcut_layout.ANSWERED] = shortcut_layout.ANSWER_YES if free else shortcut_layout.ANSWER_NO

    def run(
        self,
        tries: int,
        *,
        patience: int = NO_LIMIT,
        ask: Callable[[Matrix, Matrix], Mask] | None = None,
        stop: Callable[[], bool] | None = None,
        chunk: int = TRIES_PER_CALL,
    ) -> bool:
        """Go on until all tries are made, ``patience`` of them in a row gained nothing, or ``stop`` says so.

        Args:
            tries: Number of tries since the beginning.
            patience: Tries without gain that end the search.
            ask: Answers which straight motions A[k] -> B[k] are free; without it undecided ones count as colliding.
            stop: Asked from time to time; True ends the search, which can be resumed.
            chunk: Tries between two of these questions.

        Returns:
            Whether the search came to its end.
        """
        self.table.header[shortcut_layout.MAX_TRIES] = min(tries, NO_LIMIT)
        self.table.header[shortcut_layout.PATIENCE] = min(patience, NO_LIMIT)
        while True:
            self._motions.make_ready()
            status = self._kernels.resume(self.table.address, chunk)
            if status == shortcut_layout.DONE:
                return True
            if status == shortcut_layout.ASKING:
                self.answer(ask is not None and bool(np.all(ask(*self.questions))))
            if stop is not None and stop():
                return False

    def intact(self) -> bool:
        """Whether no kernel has written beyond the memory of the search or what it works on."""
        return self.table.intact() and self._motions.intact()

    def _number(self, place: int) -> int:
        return int(self.table.header[place])

    def _rows(self, place: int, count: int) -> Matrix:
        flat: Vector = self.table[place]
        return flat[: count * self._dof].reshape(-1, self._dof).copy()


@lru_cache(maxsize=256)
def _plan(capacity: int, dof: int) -> TablePlan:
    """The table of a search with room for so many waypoints."""
    questions = shortcut_layout.MAX_QUESTIONS * dof
    arrays = {
        shortcut_layout.METRIC: dof,
        shortcut_layout.PROBABILITIES: 2,
        shortcut_layout.ROUTE: capacity * dof,
        shortcut_layout.ARC_LENGTHS: capacity,
        shortcut_layout.ENDS: 2 * dof,
        shortcut_layout.QUESTION_STARTS: questions,
        shortcut_layout.QUESTION_ENDS: questions,
    }
    numbers = dict.fromkeys({*range(shortcut_layout.CUTS + 1)} - arrays.keys(), 0)
    numbers |= dict.fromkeys((shortcut_layout.MAX_TRIES, shortcut_layout.PATIENCE), NO_LIMIT)
    numbers |= {shortcut_layout.CAPACITY: capacity, shortcut_layout.ANSWERED: shortcut_layout.NO_ANSWER}
    return TablePlan(arrays, numbers)
