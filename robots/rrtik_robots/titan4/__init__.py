"""TITAN 4: a seven-function hydraulic subsea manipulator, six joints and a jaw."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rrtik_ompl.description.robot_build import JointLimits
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.model.robot import Robot
from rrtik_robots.titan4.geometry import (
    JOINTS,
    LIMITS_ENVELOPE_DEG,
    LIMITS_PLANNING_DEG,
    TitanGeometry,
    geometry_from,
    limits_rad,
)
from rrtik_robots.titan4.inverse import closed_form
from rrtik_robots.titan4.pair import two_titan4
from rrtik_robots.titan4.urdf import titan4_urdf

if TYPE_CHECKING:
    from rrtik_ompl.description.robot_source import BasePose


__all__ = [
    "JOINTS",
    "LIMITS_ENVELOPE_DEG",
    "LIMITS_PLANNING_DEG",
    "TitanGeometry",
    "titan4",
    "titan4_urdf",
    "two_titan4",
]

FOLDER = Path(__file__).parent


def titan4(
    *,
    limits: str = "planning",
    lengths: Mapping[str, float] | TitanGeometry | None = None,
    tip: str = "grip_point",
    base_pose: BasePose = None,
) -> Robot:
    """Make the arm, with the world's origin on the azimuth axis at the height of the shoulder, x forward and z up.

    All angles are the physical ones: at 0 the arm is stretched along x with a straight wrist.

    Args:
        limits: ``"planning"`` (of the tests in [1, ch. 6.3]) or ``"envelope"`` (measured from the shoulder-elbow line;
            for all questions of reach). The range of the shoulder differs between them by 7.81 degrees.
        lengths: Lengths [m] that differ from `TitanGeometry`'s, by name.
        tip: Link that goals refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.

    Raises:
        InputError: If the limit set, a length or the tip makes no sense.
    """
    bounds = {joint: JointLimits(lower=low, upper=high) for joint, (low, high) in limits_rad(limits).items()}
    geometry = geometry_from(lengths)
    return robot_from_urdf_text(
        titan4_urdf(geometry),
        name="titan4",
        where="titan4",
        srdf=FOLDER / "titan4.srdf",
        joint_limits=FOLDER / "joint_limits.yaml",
        joints=JOINTS,
        tip=tip,
        base_pose=base_pose,
        limits=bounds,
        closed_form=closed_form(geometry),
    )
