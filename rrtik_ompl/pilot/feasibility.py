"""What the arm could do from where it is: lamps, what is wrong with a grasp, how far a joint can go.

Each is worked out anew only when what it depends on has changed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.arrays import Vector
from rrtik_ompl.pilot.lamps import Lamp, fault_of, lamps
from rrtik_ompl.pilot.routes.manoeuvre import Room, room_of
from rrtik_ompl.pilot.surroundings import Surroundings


class Outlook:
    """Remembers its last answers."""

    def __init__(self, surroundings: Surroundings) -> None:
        """Know nothing yet."""
        self._surroundings = surroundings
        self._lamps: tuple[tuple[Any, ...], tuple[Lamp, ...]] = ((), ())
        self._fault: tuple[tuple[Any, ...], str] = ((), "")
        self._room: tuple[tuple[Any, ...], Room | None] = ((), None)

    def lamps(self, target: str | None, q: Vector) -> tuple[Lamp, ...]:
        """Lamps of an object where it is; none if it was never seen."""
        around = self._surroundings
        seen = None if target is None else around.named(target)
        if seen is None:
            return ()
        key = (target, around.version)
        if key != self._lamps[0]:
            holding = around.holding(seen.object.name)
            self._lamps = (key, lamps(around.world, seen.object, seen.T_base_object, q, holding=holding))
        return self._lamps[1]

    def fault(self, target: str, lamp: Lamp, q: Vector) -> str:
        """What is wrong with a grasp: how far out of reach it is, or what would touch; "" if it can be made."""
        around = self._surroundings
        seen = around.named(target)
        if seen is None or not lamp.reason:
            return ""
        key = (target, around.version, lamp.type, lamp.level)
        if key != self._fault[0]:
            worlds = around.world, around.holding(target)
            self._fault = (key, fault_of(lamp, seen.object, seen.T_base_object, q, *worlds))
        return self._fault[1]

    def room(self, q: Vector, joint: int) -> Room:
        """How far a joint can be driven now; the same while it alone moves."""
        key = (joint, np.delete(q, joint).tobytes(), self._surroundings.version)
        kept = self._room[1]
        if kept is None or key != self._room[0] or not kept.low <= q[joint] <= kept.high:
            kept = room_of(self._surroundings.world, q, joint)
            self._room = (key, kept)
        return kept
