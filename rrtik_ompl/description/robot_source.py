"""Convert the options of a robot to plain values, for problem files and to tell robots apart."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.base.poses import PoseLike, orientation_data, placed, rigid

BasePose: TypeAlias = PoseLike | Mapping[str, Sequence[float]] | None
POSE_KEYS = ("xyz", "quat_xyzw", "quat_wxyz", "rpy_deg")


def plain(value: object) -> object:
    """Convert a value to None, booleans, numbers, text, lists and dictionaries; paths become absolute."""
    if isinstance(value, pin.SE3):
        return {"xyz": value.translation.tolist(), **orientation_data(value)}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, os.PathLike):
        return str(Path(value).resolve())
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [plain(item) for item in value]
    return value


def source_entry(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the given options as plain values, without empty ones."""
    entry = {key: plain(value) for key, value in options.items()}
    return {key: value for key, value in entry.items() if value is not None and value != [] and value != {}}


def base_pose(value: BasePose, what: str = "base_pose") -> pin.SE3 | None:
    """Return a base pose, from a form of `rrtik_ompl.base.poses.rigid` or a mapping with the keys of ``POSE_KEYS``.

    Raises:
        InputError: If it has neither form, or a key or number in it is not valid.
    """
    if value is None:
        return None
    if not isinstance(value, Mapping):
        return rigid(value, what)

    for key in value:
        if key not in POSE_KEYS:
            raise UnknownNameError("key", key, POSE_KEYS, where=what)

    xyz = value.get("xyz", (0.0, 0.0, 0.0))
    angles = value.get("rpy_deg")
    rpy = None if angles is None else np.radians(finite_array(angles, (3,), f"{what}: rpy_deg"))
    return placed(xyz, what, quat_xyzw=value.get("quat_xyzw"), quat_wxyz=value.get("quat_wxyz"), rpy=rpy)
