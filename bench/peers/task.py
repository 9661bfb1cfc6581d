"""A planning problem as plain values and files, which a library can read that knows nothing of ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Rows: TypeAlias = NDArray[np.float64]
Search: TypeAlias = Callable[[int], "Rows | None"]  # from a seed to a path

RANGE = 1.0  # [rad], longest motion of a tree
PER_RADIAN = 32.0  # checks
GROUP, BASE, TIP = "arm", "link0", "tip"  # names in every description


@dataclass(frozen=True)
class Solid:
    """An obstacle.

    Attributes:
        name: Of its own.
        kind: ``box`` (size: three full sides), ``sphere`` (radius) or ``cylinder`` (radius, full length, along z).
        size: Lengths [m].
        pose: ``T_world_solid``, four rows of four numbers.
    """

    name: str
    kind: str
    size: list[float]
    pose: list[list[float]]


@dataclass(frozen=True)
class Task:
    """What to plan.

    Attributes:
        urdf, srdf: Files; the group is ``GROUP``, from link ``BASE`` to link ``TIP``, and all joints are of it.
        joints: Their names, in the order of start and goal.
        obstacles: May touch each other.
        start, goal: Configurations [rad, m].
        seconds: Time limit [s].
    """

    urdf: str
    srdf: str
    joints: list[str]
    obstacles: list[Solid]
    start: list[float]
    goal: list[float]
    seconds: float


def from_plain(data: dict[str, Any]) -> Task:
    """A task as ``dataclasses.asdict`` writes it."""
    return Task(**{**data, "obstacles": [Solid(**each) for each in data["obstacles"]]})
