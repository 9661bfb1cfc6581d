"""The scene of an MJCF file: what stands beside the robot, as obstacles."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.description.mjcf.read import read_mjcf
from rrtik_ompl.description.shapes.mesh import read_mesh
from rrtik_ompl.description.tree import MeshFile, Solid
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Mesh, Shape


def scene_from_mjcf(path: str | os.PathLike[str]) -> Scene:
    """Read what stands beside the robot in an MJCF file, where the file puts it.

    Obstacles are the solids of the world and those of bodies that no hinge or slide moves. Free bodies are among them,
    and can be attached to a link like any other obstacle. They have the names of their geoms, or else of their bodies
    ("cube", "cube_2"). What lies below a plane is filled. Pairs that masks or ``<exclude>`` keep from colliding may
    touch.

    Raises:
        InputError: If anything in the file cannot be used; one line names file, element and remedy.
    """
    things = read_mjcf(Path(path), scene=True).things
    try:
        obstacles = [_obstacle(thing.name, thing.solid) for thing in things]
        return Scene(obstacles, allowed_collisions=[(thing.name, link) for thing in things for link in thing.apart])
    except InputError as error:
        raise in_file(path, error) from None


def _obstacle(name: str, solid: Solid) -> Obstacle:
    color = None if solid.colour is None else solid.colour[:3]
    return Obstacle(name, _shape(solid.shape), solid.T_link_solid, color=color)


def _shape(shape: Shape | MeshFile) -> Shape:
    """Return a shape; that of a file is read."""
    if not isinstance(shape, MeshFile):
        return shape
    x, y, z = shape.scale
    if x == y == z > 0.0:
        return read_mesh(shape.path, x)
    mesh = read_mesh(shape.path)
    mirrored = x * y * z < 0.0
    return Mesh(mesh.vertices * np.array(shape.scale), mesh.triangles[:, ::-1] if mirrored else mesh.triangles)
