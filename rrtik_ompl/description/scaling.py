"""Links larger or smaller than a description says, each solid about its own middle: MoveIt's ``link_scale``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import coal
import pinocchio as pin

from rrtik_ompl.base.arrays import positive
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.description.named_numbers import by_name
from rrtik_ompl.geometry.collision.shape_table import resized
from rrtik_ompl.geometry.collision.solids import bvh, hull, is_mesh, mesh_arrays
from rrtik_ompl.model.robot import Robot


def scaled(robot: Robot, scale: Mapping[str, float]) -> Robot:
    """The robot whose links have collision solids of another size, for whatever they are checked against.

    Each solid of a link grows or shrinks about its own middle, a mesh about the mean of its corners, as those of
    MoveIt's ``link_scale`` do. What is drawn stays as it is.

    Args:
        robot: The robot. Factors multiply with those that it has already.
        scale: Factors by name of link, greater than 0; links that are not named stay as they are.

    Raises:
        UnknownNameError: If the robot has no link of a name.
        InputError: If a factor is not greater than 0, or a link has a solid that cannot be scaled.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.scaled(rrtik.load_robot("panda"), {"panda_hand": 1.1})
        >>> dict(arm.source["scale"])
        {'panda_hand': 1.1}
    """
    require(robot, Robot, "robot to scale", "use load_robot(name or file)")
    require(scale, Mapping, "scale of a robot", "give factors by name of link")
    factors = by_name(robot, "scale", "link", robot.link_names, scale, positive)

    model = pin.GeometryModel()
    for item in robot.collision.geometryObjects:
        link = robot.link_of(item)
        geometry = item.geometry
        if factors.get(link, 1.0) != 1.0:
            geometry = _scaled(geometry, factors[link], f"scale of robot '{robot.name}': {link}")
        model.addGeometryObject(
            pin.GeometryObject(
                item.name,
                item.parentJoint,
                item.parentFrame,
                item.placement,
                geometry,
                item.meshPath,
                item.meshScale,
                item.overrideMaterial,
                item.meshColor,
            )
        )

    earlier = dict(robot.source.get("scale", {}))
    combined = earlier | {link: factor * earlier.get(link, 1.0) for link, factor in factors.items()}
    return replace(robot, collision=model, source=MappingProxyType(dict(robot.source) | {"scale": combined}))


def _scaled(geometry: coal.CollisionGeometry, factor: float, what: str) -> coal.CollisionGeometry:
    """A coal solid of another size, in the same place."""
    simple_solid = resized(geometry, factor)
    if simple_solid is not None:
        return simple_solid
    if is_mesh(geometry):
        vertices, triangles = mesh_arrays(geometry)
        middle = vertices.mean(axis=0)
        return bvh(middle + factor * (vertices - middle), triangles)
    if isinstance(geometry, coal.ConvexBase):
        points = geometry.points()
        middle = points.mean(axis=0)
        return hull(middle + factor * (points - middle))
    raise InputError(f"{what}: a solid of type {type(geometry).__name__} cannot be scaled")
