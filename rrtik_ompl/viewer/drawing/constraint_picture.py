"""The regions of path constraints: a box, plane or line for the position, a cone for an axis that is kept."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.poses import turned_z
from rrtik_ompl.constraints.held_region import ANYWHERE, HeldRegion, Turning
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.framing import Frame
from rrtik_ompl.viewer.drawing.meshes import look_of_shape, look_of_triangles
from rrtik_ompl.viewer.drawing.nodes import Node
from rrtik_ompl.viewer.drawing.scene_picture import look_material

SIDES = 24  # of a cone
CONE = 0.3  # [diagonal of the arm] its length
THINNEST = 0.004  # [diagonal of the arm] of a plane or a line
OPACITY = 0.2


def draw_constraints(vis: Node, held: Iterable[tuple[HeldRegion, Vector]], frame: Frame) -> None:
    """Draw regions under ``constraints``: what bounds the position where it is, a cone where the frame starts.

    Args:
        vis: The page.
        held: Regions, and the configurations, shape (dof,), in which they begin to be held.
        frame: What the page shows.
    """
    for k, (region, start) in enumerate(held):
        node = vis["constraints"][f"{k}"]
        D = region.displacements(start[None])[0]

        if (np.abs(region.region.bounds[:3]) < ANYWHERE).any():
            low, high = _seen(region.region.bounds[:3], D[:3, 3], frame)
            look = look_of_shape(Box(np.maximum(high - low, THINNEST * frame.arm)))
            node["place"].set_object(look.geometry, look_material(palette.GOAL, OPACITY))
            node["place"].set_transform(region.T_world_w @ pin.SE3(np.eye(3), 0.5 * (low + high)).homogeneous)

        if region.turning == Turning.AXIS:
            length = CONE * frame.arm
            cone = _cone(length, length * np.tan(region.region.orientation_tolerance))
            node["axis"].set_object(look_of_triangles(*cone).geometry, look_material(palette.GOAL, 2.0 * OPACITY))
            node["axis"].set_transform(region.T_world_w @ pin.SE3(turned_z(region.direction), D[:3, 3]).homogeneous)


def _seen(bounds: Matrix, near: Vector, frame: Frame) -> tuple[Vector, Vector]:
    """Lowest and highest coordinates of what is drawn of a box that may have no end, around a point."""
    half = 0.75 * frame.arm
    return np.maximum(bounds[:, 0], near - half), np.minimum(bounds[:, 1], near + half)


def _cone(length: float, radius: float) -> tuple[Matrix, NDArray[np.int64]]:
    """A cone that opens along z from its tip: corners and faces, shapes (n, 3)."""
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(SIDES, length)])

    # Corner 0 is the tip, 1 to SIDES the rim, SIDES + 1 the middle of the lid.
    around = np.arange(SIDES) + 1
    following = np.roll(np.arange(SIDES) + 1, -1)
    faces = np.column_stack([np.zeros(SIDES, dtype=np.int64), following, around])
    lid = np.column_stack([np.full(SIDES, SIDES + 1), around, following])

    return np.vstack([np.zeros(3), rim, [0.0, 0.0, length]]), np.vstack([faces, lid])
