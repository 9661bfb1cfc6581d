"""A task as a user of Pinocchio and coal sets it up: model, geometry, and the pairs to check."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from bench.peers.task import Task

SHAPES = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder}


def model_and_geometry(task: Task) -> tuple[Any, Any]:
    """The model, and its geometry with the obstacles."""
    model = pin.buildModelFromUrdf(task.urdf)
    folder = str(Path(task.urdf).parent)
    geometry = pin.buildGeomFromUrdf(model, task.urdf, pin.GeometryType.COLLISION, package_dirs=[folder])
    geometry.addAllCollisionPairs()
    pin.removeCollisionPairs(model, geometry, task.srdf)
    moving = [k for k, item in enumerate(geometry.geometryObjects) if item.parentJoint > 0]
    for item in task.obstacles:
        place, solid = pin.SE3(np.array(item.pose)), SHAPES[item.kind](*item.size)
        number = geometry.addGeometryObject(pin.GeometryObject(item.name, 0, place, solid))
        for link in moving:
            geometry.addCollisionPair(pin.CollisionPair(link, number))
    return model, geometry
