"""Random shortcuts of a route in a kernel: the object that keeps the search between two calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search import shortcut_layout
from rrtik_ompl.kernels.search.motions.motion_table import NO_LIMIT, FastMotions
from rrtik_ompl.kernels.search.shortcut_layout import ShortcutTable
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of

SPARE_WAYPOINTS = 256  # room for more than at the beginning
TRIES_PER_CALL = 256  # of the kernel, until the caller may stop it


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
        self._motions = motions  # its tables live as long as this search
        self._dof = dof
        plan = _plan(len(rows) + SPARE_WAYPOINTS, dof)
        self.table = made = ShortcutTable(PlannedTable(plan))
        if plan.blank is None:
            for array in made.memory.arrays.values():
                array[:] = 0.0  # a page's file shall be the same each time
        made.put(motions=motions.table, count=len(rows), random=seed % 2**62, resolve=int(asking))
        made.put(waypoint_share=share, pull_share=pull)
        made.metric[:] = lengths * lengths
        made.route[: rows.size] = rows.ravel()

    @property
    def address(self) -> int:
        """Of the table, for other kernels; valid as long as this object lives."""
        return self.table.address

    @property
    def capacity(self) -> int:
        """Waypoints that there is room for."""
        return self.table.capacity

    @property
    def waypoints(self) -> Matrix:
        """The route as it is now, shape (k, dof); a copy."""
        return self._rows(self.table.route, self.table.count)

    @property
    def tries(self) -> int:
        """How many shortcuts have been tried."""
        return self.table.tries

    @property
    def gains(self) -> int:
        """How many of them have been taken."""
        return self.table.gains

    @property
    def questions(self) -> tuple[Matrix, Matrix]:
        """Starts and ends of the motions that must be answered before the search can go on, shape (k, dof) each."""
        count = self.table.questions
        return self._rows(self.table.question_starts, count), self._rows(self.table.question_ends, count)

    def answer(self, free: bool) -> None:
        """Answer whether all of the questions are free."""
        self.table.answered = shortcut_layout.ANSWER_YES if free else shortcut_layout.ANSWER_NO

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
        self.table.max_tries = min(tries, NO_LIMIT)
        self.table.patience = min(patience, NO_LIMIT)
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

    def _rows(self, rows: Vector, count: int) -> Matrix:
        return rows[: count * self._dof].reshape(-1, self._dof).copy()


@lru_cache(maxsize=256)
def _plan(capacity: int, dof: int) -> TablePlan:
    """The table of a search with room for so many waypoints."""
    questions = shortcut_layout.MAX_QUESTIONS * dof
    return sizes_of(
        ShortcutTable,
        metric=dof,
        route=capacity * dof,
        arc_lengths=capacity,
        ends=2 * dof,
        question_starts=questions,
        question_ends=questions,
        capacity=capacity,
        max_tries=NO_LIMIT,
        patience=NO_LIMIT,
        answered=shortcut_layout.NO_ANSWER,
    )
