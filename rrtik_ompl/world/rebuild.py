"""Worlds for other processes: what they are made of goes there, and their tables are made anew. What they doubt."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any

from rrtik_ompl.errors import MeshWarning
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import Scene
from rrtik_ompl.shapes import Mesh

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


def hollow_solids(robot: Robot, scene: Scene) -> Iterator[str]:
    """What a world does not take for a solid, where nobody was told when a file was read."""
    if not robot.collision.geometryObjects:
        yield f"robot '{robot.name}' has no collision geometry: all is free"
    for name, shape in ((item.name, item.shape) for items in (scene.obstacles, scene.attached) for item in items):
        if isinstance(shape, Mesh) and not (shape.closed or shape.source):
            yield f"the mesh of '{name}' has {shape.open_edges} open edges; it is treated as a surface, not as a solid"
