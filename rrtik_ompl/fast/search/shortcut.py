"""Random shortcuts of a route in a kernel: the object that keeps the search between two calls."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.arrays import Mask, Matrix, Vector, finite_array
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast import FastWorld
from rrtik_ompl.fast.search import shortcut_layout as layout
from rrtik_ompl.fast.simd.library import library
from rrtik_ompl.fast.tables.robot_tables import table
from rrtik_ompl.robot import Chain

ROOM = 256  # more waypoints than at the beginning
WHOLE = 2**62
CHUNK = 256  # tries between two looks at the clock


class ShortcutSearch:
    """Shortens a route by random shortcuts; the same seed gives the same route, however it is interrupted.

    Every edge of the result that is not one of the input's is free: proven by the kernels or answered by ``ask``. The
    ends stay as they are to the bit, and no try makes the route longer.

    Args:
        world: Packed for the kernels.
        chain: The robot's, which turns configurations into joint values.
        waypoints: A route whose edges are free, shape (k, dof), k at least 2.
        weights: No point of the arm moves farther than ``weights @ |b - a|`` [m] from a to b, shape (dof,).
        resolution: Largest step of any point of the arm between two checked configurations [m].
        seed: Of the random places.
        share: Probability that an end of a shortcut is a waypoint; 0 for the published random cut.
        pull: Probability that a try pulls a waypoint; 0 for the published random cut.
        metric: Weights of the joints in the length, shape (dof,); all 1 if None.
        asking: Whether shortcuts that the kernels cannot decide are asked about, or count as colliding.

    Raises:
        InputError: If the route is none, a weight is negative, or the kernels cannot check the route.
    """

    def __init__(
        self,
        world: FastWorld,
        chain: Chain,
        waypoints: ArrayLike,
        *,
        weights: ArrayLike,
        resolution: float,
        seed: int = 0,
        share: float = 0.5,
        pull: float = 0.3,
        metric: ArrayLike | None = None,
        asking: bool = True,
    ) -> None:
        rows = finite_array(waypoints, (None, chain.gain.shape[1]), "waypoints to shorten")
        dof = rows.shape[1]
        lengths = finite_array(np.ones(dof) if metric is None else metric, (dof,), "metric of a shortcut search")
        kernels = library(layout.KERNELS)
        if (
            kernels is None
            or len(rows) < 2
            or not world.address
            or not world.covered(rows @ chain.gain.T + chain.offset)
        ):
            raise InputError("waypoints to shorten: expected a route of two or more that kernels can check")
        if lengths.min(initial=0.0) < 0.0 or resolution <= 0.0:
            raise InputError("shortcut search: weights of the length and the resolution must not be negative")
        capacity = len(rows) + ROOM
        route = np.zeros((capacity, dof))
        route[: len(rows)] = rows
        joints = len(chain.parent)
        self._kernels = kernels
        self._world, self._dof = world, dof  # its tables live as long as this search
        self._table = table(
            {
                layout.WORLD: world.address,
                layout.DOF: dof,
                layout.GAIN: np.ascontiguousarray(chain.gain, dtype=np.float64),
                layout.OFFSET: np.ascontiguousarray(chain.offset, dtype=np.float64),
                layout.REACH: np.append(finite_array(weights, (dof,), "weights"), resolution),
                layout.METRIC: lengths * lengths,
                layout.SHARE: np.array([share, pull]),
                layout.ROUTE: route,
                layout.PLACES: np.zeros(capacity),
                layout.ENDS: np.zeros((2, dof)),
                layout.VALUES: np.zeros((2, joints)),
                layout.STARTS: np.zeros((3, dof)),
                layout.GOALS: np.zeros((3, dof)),
                layout.COUNT: len(rows),
                layout.CAPACITY: capacity,
                layout.RANDOM: seed % 2**62,
                layout.TRIES: 0,
                layout.MOST_TRIES: WHOLE,
                layout.FAILURES: 0,
                layout.PATIENCE: WHOLE,
                layout.GAINS: 0,
                layout.ASKS: int(asking),
                layout.QUESTIONS: 0,
                layout.ANSWERED: layout.NO_ANSWER,
                layout.FIRST: 0,
                layout.SECOND: 0,
                layout.CUTS: 0,
            }
        )

    @property
    def address(self) -> int:
        """Of the table, for other kernels; valid as long as this object lives."""
        return self._table.address

    @property
    def capacity(self) -> int:
        """Waypoints that there is room for."""
        return self._number(layout.CAPACITY)

    @property
    def waypoints(self) -> Matrix:
        """The route as it is now, shape (k, dof); a copy."""
        return self._rows(layout.ROUTE, self._number(layout.COUNT))

    @property
    def tries(self) -> int:
        """How many shortcuts have been tried."""
        return self._number(layout.TRIES)

    @property
    def gains(self) -> int:
        """How many of them have been taken."""
        return self._number(layout.GAINS)

    @property
    def questions(self) -> tuple[Matrix, Matrix]:
        """Starts and ends of the motions that must be answered before the search can go on, shape (k, dof) each."""
        count = self._number(layout.QUESTIONS)
        return self._rows(layout.STARTS, count), self._rows(layout.GOALS, count)

    def answer(self, free: bool) -> None:
        """Answer whether all of the questions are free."""
        self._table.header[layout.ANSWERED] = layout.ANSWER_YES if free else layout.ANSWER_NO

    def run(
        self,
        tries: int,
        *,
        patience: int = WHOLE,
        ask: Callable[[Matrix, Matrix], Mask] | None = None,
        stop: Callable[[], bool] | None = None,
        chunk: int = CHUNK,
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
        self._table.header[layout.MOST_TRIES] = min(tries, WHOLE)
        self._table.header[layout.PATIENCE] = min(patience, WHOLE)
        while True:
            status = self._kernels.resume(self._table.address, chunk)
            if status == layout.DONE:
                return True
            if status == layout.ASKING:
                self.answer(ask is not None and bool(np.all(ask(*self.questions))))
            if stop is not None and stop():
                return False

    def _number(self, place: int) -> int:
        return int(self._table.header[place])

    def _rows(self, place: int, count: int) -> Matrix:
        flat: Vector = self._table[place]
        return flat[: count * self._dof].reshape(-1, self._dof).copy()
