"""The table of a proof, which the prover of the next world takes over where some bodies stand elsewhere."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.proof.moving import MovedSolids
from rrtik_ompl.kernels.proof.packing import ProofPairs


class TakenProof:
    """The table of a proof, once it is made; what another thread has asked for is never taken.

    Attributes:
        packed: The table, None if there is none.
    """

    def __init__(self, packed: ProofPairs | None = None) -> None:
        self.packed = packed
        self._rows: MovedSolids | None = None
        self._moved: tuple[int, ...] = ()  # bodies that stand elsewhere than in the table
        self._bare: ProofPairs | None = None  # the table without contacts in whose memory it stands
        self._lent = False
        self._lock = threading.Lock()

    def get(self, bodies: Sequence[Body], make: Callable[[], ProofPairs]) -> ProofPairs:
        """The table, in which bodies stand where they are now.

        Args:
            bodies: All of them.
            make: Makes the table, if there is none or its rows do not fit any more.
        """
        packed = self.packed
        if packed is None or self._moved:
            with self._lock:
                packed = self.packed = self._brought_up(bodies) or make()
        return packed

    def beside(self, bare: ProofPairs, bodies: Sequence[Body]) -> ProofPairs:
        """The table of bodies in contact, which shares the places of solids with that of the bodies without contacts.

        When the other one was taken, its solids may be moved. So it is made again as soon as there is another one.

        Args:
            bare: The table without contacts, of the same thread.
            bodies: All bodies, with their contacts.
        """
        with self._lock:
            packed = self.packed
            if packed is None or self._bare is not bare:
                packed = bare.for_thread(same_thread=True).with_contacts(bodies)
                self.packed = packed
                self._bare = bare
        return packed

    def for_thread(self, bodies: Sequence[Body]) -> TakenProof:
        """The same table with memory of its own to compute in, if there is one."""
        other = TakenProof()
        if self._bare is not None:  # the other thread has a table without contacts of its own, too
            return other
        with self._lock:
            self.packed = self._brought_up(bodies)
            other.packed = None if self.packed is None else self.packed.for_thread()
            self._lent = other._lent = True
        return other

    def take(self, numbers: tuple[int, ...]) -> TakenProof:
        """The table for a prover of the same bodies, some of them elsewhere; there is none here from then on.

        Args:
            numbers: Of those that were moved; their rows are written when something is to be proven.
        """
        other = TakenProof()
        with self._lock:
            if self.packed is not None and not self._lent:
                other.packed, other._rows, other._moved = self.packed, self._rows, (*self._moved, *numbers)
                self.packed, self._rows, self._moved = None, None, ()
        return other

    def _brought_up(self, bodies: Sequence[Body]) -> ProofPairs | None:
        """The table as :meth:`get` gives it, None if it has to be made."""
        moved, self._moved = dict.fromkeys(self._moved), ()
        if self.packed is None or not moved:
            return self.packed
        self._rows = rows = self._rows or MovedSolids(self.packed)
        if all(rows.put(number, bodies[number]) for number in moved):
            return self.packed
        self._rows = None
        return None
