"""PUMA 560: the six-joint arm, and the two arms cut from it for trajectory studies (three and five joints)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.model.robot import Robot
from rrtik_robots.puma560.inverse import PumaGeometry, five_joint_form, pose_form, position_form

if TYPE_CHECKING:
    from rrtik_ompl.description.robot_source import BasePose


INCH = 0.0254  # [m]
RIGHT = np.pi / 2
CREAM = (0.93, 0.87, 0.74, 1.0)

# Standard DH rows: a [m], alpha, d [m], limits [deg], radius of the link [m]
ROWS_560 = (
    (0.0, RIGHT, 0.672, (-160.0, 160.0), 0.090),
    (0.4318, 0.0, 0.0, (-45.0, 225.0), 0.075),
    (0.0203, -RIGHT, 0.15005, (-225.0, 45.0), 0.065),
    (0.0, RIGHT, 0.4318, (-110.0, 170.0), 0.055),
    (0.0, -RIGHT, 0.0, (-100.0, 100.0), 0.045),
    (0.0, 0.0, 0.0, (-266.0, 266.0), 0.045),
)
POSTURES_560_DEG = {
    "zero": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "ready": (0.0, 90.0, -90.0, 0.0, 0.0, 0.0),
    "rest": (0.0, 90.0, -90.0, 0.0, 0.0, 0.0),
    "nominal": (0.0, 45.0, -180.0, 0.0, 45.0, 0.0),
}

# The two arms of the trajectory studies: lengths [m] and limits [deg]
LENGTHS_CUT = {"a2": 17.0 * INCH, "a3": 0.8 * INCH, "d3": 4.9 * INCH, "d4": 17.0 * INCH, "d7": 2.2 * INCH}
LIMITS_CUT_DEG = ((-170.0, 170.0), (-225.0, 45.0), (-250.0, 75.0), (-135.0, 135.0), (-100.0, 100.0))
START_CUT_DEG = (15.3319, 7.1738, 24.5756, 0.0, 0.0)  # wrist at (7, 7, -17) in, where the published trajectories begin


def puma560(*, base_height: float = 0.672, tip: str = "tip", base_pose: BasePose = None) -> Robot:
    """Make the six-joint arm, standard DH; its tip is the wrist centre with the axes of the last DH frame.

    Args:
        base_height: Height of the shoulder above the base [m]; 0 puts the base at the shoulder.
        tip: Link that goals refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.
    """
    height = float(finite_array(base_height, (), "puma560: base_height"))
    rows = [
        DhRow(a=a, alpha=alpha, d=height if k == 0 else d, limits=_radians(limits))
        for k, (a, alpha, d, limits, _) in enumerate(ROWS_560)
    ]
    geometry = PumaGeometry(base=height, a2=rows[1].a, a3=rows[2].a, d3=rows[2].d, d4=rows[3].d)
    return robot_from_dh(
        "puma560",
        rows,
        convention="standard",
        closed_form=pose_form(geometry),
        radius=[row[-1] for row in ROWS_560],
        floor_gap=ROWS_560[0][-1] + 0.01,
        tip=tip,
        base_pose=base_pose,
        postures={name: np.radians(values) for name, values in POSTURES_560_DEG.items()},
        colour=CREAM,
    )


def puma560_3dof(*, lengths: Mapping[str, float] | None = None, tip: str = "tip", base_pose: BasePose = None) -> Robot:
    """Make the arm of the first three joints, modified DH; its tip is the wrist centre.

    Args:
        lengths: Lengths [m] that differ from the defaults: a2, a3, d3, d4.
        tip: Link that goals refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.
    """
    return _cut("puma560_3dof", 3, lengths, tip, base_pose)


def puma560_5dof(*, lengths: Mapping[str, float] | None = None, tip: str = "tip", base_pose: BasePose = None) -> Robot:
    """Make the arm of five joints, modified DH; its tip is the end of a segment of length d7 beyond the wrist.

    Args:
        lengths: Lengths [m] that differ from the defaults: a2, a3, d3, d4, d7.
        tip: Link that goals refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.
    """
    return _cut("puma560_5dof", 5, lengths, tip, base_pose)


def _cut(name: str, joints: int, lengths: Mapping[str, float] | None, tip: str, base_pose: BasePose) -> Robot:
    known = {key: value for key, value in LENGTHS_CUT.items() if joints == 5 or key != "d7"}
    for key in lengths or {}:
        if key not in known:
            raise UnknownNameError("length", key, known, where=f"{name}: lengths")
    size = {key: float(finite_array(v, (), f"{name}: {key}")) for key, v in (known | dict(lengths or {})).items()}
    table = [
        (0.0, 0.0, 0.0, 0.09),
        (0.0, -RIGHT, 0.0, 0.065),
        (size["a2"], 0.0, size["d3"], 0.055),
        (size["a3"], -RIGHT, size["d4"], 0.05),
        (0.0, RIGHT, 0.0, 0.045),
    ][:joints]

    geometry = PumaGeometry(base=0.0, a2=size["a2"], a3=size["a3"], d3=-size["d3"], d4=size["d4"])
    end = DhRow(a=size["a3"], alpha=-RIGHT, d=size["d4"]) if joints == 3 else DhRow(alpha=-RIGHT, d=size["d7"])
    tool = pin.SE3(pin.rpy.rpyToMatrix(end.alpha, 0.0, 0.0), np.array([end.a, 0.0, 0.0]))
    return robot_from_dh(
        name,
        [
            DhRow(a=a, alpha=alpha, d=d, limits=_radians(limits))
            for (a, alpha, d, _), limits in zip(table, LIMITS_CUT_DEG, strict=False)
        ],
        convention="modified",
        closed_form=position_form(geometry) if joints == 3 else five_joint_form(geometry, end.d),
        radius=[row[-1] for row in table],
        tool=tool * pin.SE3(np.eye(3), np.array([0.0, 0.0, end.d])),
        tip=tip,
        base_pose=base_pose,
        postures={"zero": np.zeros(joints), "start": np.radians(START_CUT_DEG[:joints])},
        colour=CREAM,
    )


def _radians(limits: tuple[float, float]) -> tuple[float, float]:
    return float(np.radians(limits[0])), float(np.radians(limits[1]))
