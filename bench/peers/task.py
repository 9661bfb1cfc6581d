"""A planning problem as plain values and files, which a library can read that knows nothing of ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
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
class Region:
    """Where ``TIP`` has to be along the whole path: ranges of its displacement from a frame of the world.

    Attributes:
        pose: ``T_world_frame``, four rows of four numbers.
        lower, upper: Of x, y, z [m] and roll, pitch, yaw [rad]; None where there is no bound.
        position_tolerance, orientation_tolerance: Beyond the ranges [m, rad].
    """

    pose: list[list[float]]
    lower: list[float | None]
    upper: list[float | None]
    position_tolerance: float
    orientation_tolerance: float


@dataclass(frozen=True)
class Task:
    """What to plan.

    Attributes:
        urdf, srdf: Files; the group is ``GROUP``, from link ``BASE`` to link ``TIP``, and all joints are of it.
        joints: Their names, in the order of start and goal.
        obstacles: May touch each other.
        start, goal: Configurations [rad, m].
        seconds: Time limit [s].
        regions: Path constraints, for libraries that know some.
    """

    urdf: str
    srdf: str
    joints: list[str]
    obstacles: list[Solid]
    start: list[float]
    goal: list[float]
    seconds: float
    regions: list[Region] = field(default_factory=list)


def from_plain(data: dict[str, Any]) -> Task:
    """A task as ``dataclasses.asdict`` writes it."""
    obstacles, regions = [Solid(**each) for each in data["obstacles"]], [Region(**each) for each in data["regions"]]
    return Task(**{**data, "obstacles": obstacles, "regions": regions})
