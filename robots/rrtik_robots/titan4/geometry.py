"""Lengths and joint limits of the TITAN 4 manipulator; the README in this folder names all sources."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import InputError, UnknownNameError, require

JOINTS = ("azimuth", "shoulder_pitch", "elbow_pitch", "wrist_pitch", "wrist_yaw", "wrist_rotate")

_OTHERS = {"azimuth": (-120.0, 120.0), "elbow_pitch": (-164.0, 106.0), "wrist_pitch": (-90.0, 90.0)}
_OTHERS |= {"wrist_yaw": (-90.0, 90.0), "wrist_rotate": (-120.0, 120.0)}
LIMITS_PLANNING_DEG: Mapping[str, tuple[float, float]] = _OTHERS | {"shoulder_pitch": (-34.19, 85.81)}
LIMITS_ENVELOPE_DEG: Mapping[str, tuple[float, float]] = _OTHERS | {"shoulder_pitch": (-42.0, 78.0)}
LIMIT_SETS = {"planning": LIMITS_PLANNING_DEG, "envelope": LIMITS_ENVELOPE_DEG}


@dataclass(frozen=True, slots=True)
class TitanGeometry:
    """Lengths of the arm [m]. The first five are its kinematics, the others its solids.

    Attributes:
        a1: Azimuth axis to shoulder axis.
        a2: Shoulder axis to elbow axis.
        a3: Elbow axis to wrist pitch axis.
        a4: Wrist pitch axis to wrist yaw axis.
        d6: Wrist yaw axis to the grip point E between the jaws.
        shoulder_height: Shoulder axis above the mounting face.
        base_rear: Azimuth axis to the rear edge of the base.
        knee_along, knee_above: Knee of the upper arm, along and above the line from shoulder to elbow.
        base_radius, base_height: Radius and height of the base cylinder, which stands on the mounting face.
        shoulder_radius, upper_arm_radius, knee_radius, forearm_radius, wrist_radius, gripper_radius: Radii of the
            capsules.
    """

    a1: float = 0.122
    a2: float = 0.851
    a3: float = 0.483
    a4: float = 0.127
    d6: float = 0.339
    shoulder_height: float = 0.194
    base_rear: float = 0.080
    knee_along: float = 0.74
    knee_above: float = 0.06
    base_radius: float = 0.10
    base_height: float = 0.20
    shoulder_radius: float = 0.085
    upper_arm_radius: float = 0.085
    knee_radius: float = 0.075
    forearm_radius: float = 0.06
    wrist_radius: float = 0.078
    gripper_radius: float = 0.06

    def __post_init__(self) -> None:
        for field in fields(self):
            value = float(finite_array(getattr(self, field.name), (), f"titan4: {field.name}"))
            if value <= 0.0:
                raise InputError(f"titan4: {field.name} must be greater than 0 m, got {value:g}")

    @property
    def reach(self) -> float:
        """Distance from the azimuth axis to E with the arm stretched [m]."""
        return self.a1 + self.a2 + self.a3 + self.a4 + self.d6


def geometry_from(lengths: Mapping[str, float] | TitanGeometry | None) -> TitanGeometry:
    """Return the default geometry with the given lengths [m] replaced, or the geometry itself.

    Raises:
        InputError: If the argument is no mapping, or a length has a name that `TitanGeometry` does not know.
    """
    if isinstance(lengths, TitanGeometry):
        return lengths
    if lengths is None:
        return TitanGeometry()

    require(lengths, Mapping, "titan4: lengths", "give lengths [m] by name")
    names = [field.name for field in fields(TitanGeometry)]
    for name in lengths:
        if name not in names:
            raise UnknownNameError("length", name, names, where="titan4: lengths")
    return TitanGeometry(**lengths)


def limits_rad(which: str) -> dict[str, tuple[float, float]]:
    """Return the lower and upper limit [rad] of each joint in the set ``"planning"`` or ``"envelope"``, by name.

    Raises:
        InputError: If there is no set of that name.
    """
    require(which, str, "titan4: limits", f"use one of {', '.join(LIMIT_SETS)}")
    if which not in LIMIT_SETS:
        raise UnknownNameError("limit set", which, LIMIT_SETS, where="titan4: limits")
    table = LIMIT_SETS[which]
    return {joint: (float(np.radians(low)), float(np.radians(high))) for joint, (low, high) in table.items()}
