"""The record of one tick of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.choices import TickEvent
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.replanning.unavoidable import Unavoidable


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """What happened in one tick.

    Attributes:
        time: Begin of the tick [s].
        q: The robot's configuration then, shape (n,).
        event: "plan" (move along the first path, found just now), "repair" (move along another path, found just now),
            "walk" (move along the path of the tick before), "wait", "evade", or "arrive" (the last configuration).
        path: The path at the end of the tick, shape (k, n), free or blocked; None before the first one was found and in
            the last tick.
        poses: Poses by name of the obstacles that have moved since the first tick: x, y, z [m] and the quaternion
            x, y, z, w, shape (7,).
        seconds: Wall times of the parts of the tick [s]: "sense", "retarget", "look" (check of the path), "plan" or
            "repair" (search and shortening), "prove" (proof of the step), "all".
        checked: Number of configurations that were checked along the path.
        reason: Why the robot waits or evades, or "".
        proven: Whether the motion to the next tick's configuration is proven to keep margin and clearance, as long as
            no obstacle is faster than stated; None if there is no motion.
        safe_seconds: How long, from the begin of the tick, the arm can go on so that no obstacle can touch it, whatever
            obstacles do that are not faster than stated [s]; at most as long as is looked ahead, 0 if nothing is
            proven. None without a bound on speeds.
        unavoidable: The proof that no motion of the arm rules out a contact in this tick; None if there is none.
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
    safe_seconds: float | None = None
    unavoidable: Unavoidable | None = None

    __reduce__ = as_value
