"""Solids made larger by how far they may be from where they were seen."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.arrays import Vector
from rrtik_ompl.scene import Obstacle
from rrtik_ompl.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Prism, Shape, Sphere


def grown(obstacle: Obstacle, margin: float) -> Obstacle:
    """An obstacle that contains every point within ``margin`` [m] of the given one.

    Prisms and meshes become the boxes around them, in their own axes; balls and capsules are exact, the others have
    corners where round ones would do.
    """
    shape, pose = obstacle.shape, obstacle.pose
    if isinstance(shape, (Box, Sphere, Cylinder, Capsule, HalfSpace)):
        return Obstacle(obstacle.name, _larger(shape, margin), pose)
    low, high = _bounds(shape)
    around = pin.SE3(pose.rotation, pose.act(0.5 * (low + high)))
    return Obstacle(obstacle.name, Box(high - low + 2.0 * margin), around)


def _bounds(shape: Prism | Mesh) -> tuple[Vector, Vector]:
    """Lowest and highest coordinates. Shape (3,) each."""
    if isinstance(shape, Mesh):
        return shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    half = 0.5 * shape.height
    return np.append(shape.polygon.min(axis=0), -half), np.append(shape.polygon.max(axis=0), half)


def _larger(shape: Box | Sphere | Cylinder | Capsule | HalfSpace, margin: float) -> Shape:
    if isinstance(shape, Box):
        return Box(shape.size + 2.0 * margin)
    if isinstance(shape, Sphere):
        return Sphere(shape.radius + margin)
    if isinstance(shape, Capsule):
        return Capsule(shape.radius + margin, shape.length)
    if isinstance(shape, Cylinder):
        return Cylinder(shape.radius + margin, shape.length + 2.0 * margin)
    return HalfSpace(shape.normal, shape.offset + margin)
