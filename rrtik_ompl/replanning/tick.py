"""What a record says of one tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.choices import TickEvent
from rrtik_ompl.base.copies import as_value


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """What happened in one tick.

    Attributes:
        time: Of its begin [s].
        q: The robot's configuration then, shape (n,).
        event: "plan" or "repair": move along a path found just now, the first one or another one; "walk": along the old
            one; "wait"; "evade"; "arrive": the last configuration.
        path: The path after the tick's work, shape (k, n), free or blocked; None before the first one was found and in
            the last tick.
        poses: Of the obstacles that have moved since the first tick: x, y, z and quaternion x, y, z, w.
        seconds: Wall time of its parts [s]: "sense", "retarget", "look" (check of the path), "plan" or
            "repair" (search and shortening), "prove" (of the step), "all".
        checked: Number of configurations that were checked along the path.
        reason: Why the robot waits or evades, or "".
        proven: Whether the motion to the next tick's configuration is proven to keep margin and clearance, as long as
            no obstacle is faster than stated; None if there is no motion.
    """

    time: float
    q: Vector
    event: TickEvent
    path: Matrix | None
    poses: Mapping[str, Vector]
    seconds: Mapping[str, float]
    checked: int = 0
    reason: str = ""
    proven: bool | None = None

    __reduce__ = as_value
