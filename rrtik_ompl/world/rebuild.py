"""Worlds for other processes: what they are made of goes there, and their tables are made anew."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from operator import attrgetter
from typing import Any

from rrtik_ompl.errors import MeshWarning
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Scene

_PARTS = attrgetter("robot", "scene")
_SETTINGS = attrgetter("accuracy", "self_margin", "motion_resolution", "_room", "_proven_clearance")


def reduce_world(world: object) -> tuple[Any, ...]:
    """``World.__reduce__``: a copy answers as the world does, and may be used in another thread or process."""
    return _rebuilt, (type(world), *_PARTS(world), _SETTINGS(world))


def _rebuilt(kind: Callable[..., Any], robot: Robot, scene: Scene, settings: tuple[Any, ...]) -> object:
    accuracy, self_margin, resolution, room, proven = settings
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MeshWarning)  # said where the world was first made
        world = kind(robot, scene, accuracy=accuracy, self_margin=self_margin)
    world = world.with_resolution(resolution).with_clearance(room)
    return world if proven is None else world.proving(proven)
