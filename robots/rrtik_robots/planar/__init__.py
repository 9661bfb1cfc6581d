"""Arms of revolute joints in the xy-plane, with any number of links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.description.tree import MOST_JOINTS
from rrtik_ompl.model.robot import Robot

if TYPE_CHECKING:
    from rrtik_ompl.description.robot_source import BasePose


LIMITS_PLANAR3_DEG = ((-45.0, 270.0), (-180.0, 180.0), (-180.0, 180.0))
SLATE = (0.36, 0.42, 0.49, 1.0)  # unlike the colours of start, goal and obstacles


def planar(
    *,
    lengths: Sequence[float] = (1.0, 1.0, 1.0),
    limits_deg: ArrayLike | None = None,
    radius: float = 0.0,
    tip: str = "tip",
    base_pose: BasePose = None,
) -> Robot:
    """Make a planar arm, stretched along x at zero, whose links do not collide with each other.

    Args:
        lengths: Lengths of the links, base first [m], all above 0.
        limits_deg: Lower and upper limit of each joint [deg], shape (dof, 2); -180 .. 180 if None.
        radius: Radius of the links, which are capsules [m]; 0 stands for 1e-4.
        tip: Link that goals refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.

    Raises:
        InputError: If a length is not above 0, a limit is missing, or a number is not finite.
    """
    return _arm("planar", lengths, limits_deg, radius, tip, base_pose)


def planar3(*, radius: float = 0.0, tip: str = "tip", base_pose: BasePose = None) -> Robot:
    """Make an arm of three links of 1 m with the limits of the planar test of [1, ch. 6.3]."""
    return _arm("planar3", (1.0,) * 3, LIMITS_PLANAR3_DEG, radius, tip, base_pose)


def planar6(*, radius: float = 0.0, tip: str = "tip", base_pose: BasePose = None) -> Robot:
    """Make an arm of six links of 0.7 m, whose joints turn by 150 degrees to either side."""
    return _arm("planar6", (0.7,) * 6, [(-150.0, 150.0)] * 6, radius, tip, base_pose)


def planar10(*, radius: float = 0.0, tip: str = "tip", base_pose: BasePose = None) -> Robot:
    """Make an arm of ten links of 0.1 m, whose joints turn by 180 degrees to either side."""
    return _arm("planar10", (0.1,) * 10, None, radius, tip, base_pose)


def _arm(
    name: str, lengths: ArrayLike, limits_deg: ArrayLike | None, radius: float, tip: str, base_pose: BasePose
) -> Robot:
    sizes = finite_array(lengths, (None,), f"{name}: lengths")
    at_most(len(sizes) + 1, MOST_JOINTS, f"robot '{name}': joints")
    if len(sizes) == 0 or (sizes <= 0.0).any():
        raise InputError(f"{name}: lengths must be one or more numbers greater than 0, got {sizes.tolist()}")

    given = [(-180.0, 180.0)] * len(sizes) if limits_deg is None else limits_deg
    limits = np.radians(finite_array(given, (len(sizes), 2), f"{name}: limits_deg"))
    rows = [
        DhRow(a=float(length), limits=(float(low), float(high)))
        for length, (low, high) in zip(sizes, limits, strict=True)
    ]
    return robot_from_dh(
        name,
        rows,
        convention="standard",
        radius=radius,
        tip=tip,
        base_pose=base_pose,
        postures={"zero": np.zeros(len(rows))},
        self_collision=False,
        planar=True,
        colour=SLATE,
    )
