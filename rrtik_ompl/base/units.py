"""Units of joint values: kept in radians, or metres where a joint slides; shown in degrees, or metres."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU

DEGREES = 180.0 / np.pi  # in a radian
DEGREE = np.pi / 180.0  # [rad]


Angle = TypeVar("Angle", float, NDArray[np.float64])


def wrapped(angle: Angle) -> Angle:
    """Angles [rad] moved by full turns into [-pi, pi): a number, or an array of any shape, whose shape it keeps."""
    return (angle + np.pi) % TAU - np.pi


def joint_unit(slides: bool) -> str:
    """Unit of the values of a joint: "m" if it slides, else "rad"."""
    return "m" if slides else "rad"


def joint_units(prismatic: Iterable[bool]) -> list[str]:
    """Unit of the values of each joint."""
    return [joint_unit(slides) for slides in prismatic]


def shown_unit(slides: bool) -> tuple[float, str]:
    """Factor from the values of a joint to those that are shown, and their unit: "m" if it slides, else "deg"."""
    return (1.0, "m") if slides else (DEGREES, "deg")


def reading(value: float, unit: str) -> tuple[float, str]:
    """Return a joint value as a person reads it: degrees for radians, metres as they are; and the name of that unit."""
    return (value, "m") if unit == "m" else (float(np.rad2deg(value)), "deg")
