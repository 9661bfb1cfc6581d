"""Proofs of motions among obstacles that are moved, from where they are at the moment."""

from __future__ import annotations

from collections.abc import Sequence

from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels.proof.moving import MovedObstacles
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.world.proof import Prover


class MovingProver(Prover):
    """As :class:`Prover`; obstacles are moved in its table, which is packed once."""

    _fixed = False
    _room: Sequence[float] | None = None
    _moved: MovedObstacles | None = None

    def place(self, bodies: Sequence[Body], room: Sequence[float], *, always_colliding: bool) -> None:
        """Put obstacles where they are now; it costs nothing until something is to be proven.

        Args:
            bodies: As at the beginning, obstacles with other placements and margins.
            room: For each body what is to be kept from it beside its margin [m]; read for obstacles.
            always_colliding: Whether an obstacle touches what never moves: then nothing is proven.
        """
        self.bodies = tuple(bodies)
        self._room = room
        self.always_colliding = always_colliding

    def _packed_for(self, clearance: float, slack: float) -> ProofPairs:
        if self._moved is None:
            self._moved = MovedObstacles(super()._packed_for(clearance, slack), self.bodies)
        if self._room is not None:
            self._moved.put(self.bodies, self._room)
            self._room = None
        return super()._packed_for(clearance, slack)
