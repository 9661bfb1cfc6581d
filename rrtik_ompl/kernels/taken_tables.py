"""Tables of a world that the next world takes over, in which one body stands elsewhere: a few rows are written anew."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.checks.fast_world import FastWorld
from rrtik_ompl.kernels.tables.moved_rows import MovedRows
from rrtik_ompl.kernels.tables.robot_tables import Spheres
from rrtik_ompl.kernels.tables.solid_tables import convex_solids


class TakenTables:
    """The tables of a world and of those that share them, until another world takes them.

    What another thread has asked for, or a search keeps for itself (:attr:`FastWorld.pinned`), is never taken: kernels
    may be reading it.

    Args:
        fast: The tables.
    """

    def __init__(self, fast: FastWorld) -> None:
        self._fast: FastWorld | None = fast
        self._rows: MovedRows | None = None
        self._places: dict[int, int] | None = None  # of bodies among the standing ones
        self._lent = False
        self._lock = threading.Lock()

    def get(self, make: Callable[[], FastWorld]) -> FastWorld:
        """The tables, made anew if they were taken."""
        fast = self._fast
        if fast is None:
            with self._lock:
                self._fast = fast = self._fast or make()
        return fast

    def for_thread(self, make: Callable[[], FastWorld]) -> TakenTables:
        """The same tables with memory of their own to compute in; none of them is ever taken from then on."""
        with self._lock:
            self._fast, self._lent = self._fast or make(), True
            other = TakenTables(self._fast.for_thread())
        other._lent = True
        return other

    def take(self, number: int, body: Body, spheres: tuple[Spheres, Spheres]) -> TakenTables | None:
        """The tables with a standing body elsewhere; None, and nothing is taken, where they must be made anew.

        Args:
            number: Of the body.
            body: Where it is now.
            spheres: Around and inside it, in its own frame.
        """
        with self._lock:
            fast = self._fast
            if fast is None or self._lent or fast.pinned or fast.address == 0:
                return None
            if self._rows is None or self._places is None:
                own = fast.table
                self._rows = MovedRows(own.outer_primitives, own.inner_primitives, own.standing_solids)
                self._places = {standing: place for place, standing in enumerate(fast.standing)}
            place = self._places.get(number)
            if place is not None and not self._rows.put(place, body, spheres, convex_solids(body.geometry)):
                return None
            other = TakenTables(fast)
            other._rows, other._places, self._fast, self._rows = self._rows, self._places, None, None
        return other
