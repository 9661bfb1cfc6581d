"""How far a shape reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.model.shapes import Shape

if TYPE_CHECKING:
    import pinocchio as pin


def farthest(shape: Shape, pose: pin.SE3) -> float:
    """An upper bound of the distance of a shape's points from the origin [m]; of a half-space that is infinite.

    Args:
        shape: What it is.
        pose: Where it is, ``pinocchio.SE3``.
    """
    if not shape.bounded:
        return float("inf")
    solids = [(piece.geometry, pose * piece.placement) for piece in pieces(shape)]
    return max(float(np.linalg.norm(place.act(s.aabb_center)) + s.aabb_radius) for s, place in solids)
