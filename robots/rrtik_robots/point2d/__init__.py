"""A disc that slides in the xy-plane: the smallest robot, for planning in two dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import finite_array, not_negative
from rrtik_ompl.description.robot_build import build_robot
from rrtik_ompl.description.tree import Joint, Link, Solid, Tree
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.shapes import Cylinder, Sphere

if TYPE_CHECKING:
    from rrtik_ompl.description.robot_source import BasePose


SMALLEST_RADIUS = 1e-4  # radius that is used in place of 0 [m]
SLATE = (0.36, 0.42, 0.49, 1.0)  # unlike the colours of start, goal and obstacles


def point2d(
    *,
    radius: float = 0.0,
    bounds: ArrayLike = ((0.0, 10.0), (0.0, 10.0)),
    tip: str = "disc",
    base_pose: BasePose = None,
) -> Robot:
    """Make a disc with the two sliding joints x and y.

    It is checked as a ball centred at z = 0, which touches an extruded polygon of at least its height exactly when the
    disc touches the polygon.

    Args:
        radius: Radius of the disc [m]; 0 stands for 1e-4.
        bounds: Lower and upper limit of x and of y [m], shape (2, 2).
        tip: Link that goals refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.

    Raises:
        InputError: If the radius is negative or a bound makes no sense.
    """
    size = max(not_negative(radius, "point2d: radius"), SMALLEST_RADIUS)
    (left, right), (bottom, top) = finite_array(bounds, (2, 2), "point2d: bounds").tolist()
    ball = Solid(Sphere(size), pin.SE3.Identity(), SLATE)
    disc = Solid(Cylinder(size, 0.1 * size), colour=SLATE)
    tree = Tree(
        "point2d",
        [Link("base"), Link("carriage"), Link("disc", (ball,), (disc,))],
        [
            Joint("x", "prismatic", "base", "carriage", axis=(1, 0, 0), lower=left, upper=right),
            Joint("y", "prismatic", "carriage", "disc", axis=(0, 1, 0), lower=bottom, upper=top),
        ],
    )
    return build_robot(
        "point2d",
        tree,
        joints=("x", "y"),
        tip=tip,
        base_pose=base_pose,
        postures={"centre": {"x": float(np.mean([left, right])), "y": float(np.mean([bottom, top]))}},
        self_collision=False,
        planar=True,
    )
