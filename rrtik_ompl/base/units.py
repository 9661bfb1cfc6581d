"""Units of joint values: stored in radians, or metres for prismatic joints; shown in degrees, or metres."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU

DEGREES = 180.0 / np.pi  # [deg/rad] degrees in a radian
DEGREE = np.pi / 180.0  # [rad] one degree
SHOWN_IN_METRES = 0.1  # [m]; smaller distances are told in millimetres
LEAST_METRES = 5e-5  # [m]; with an angle, smaller distances are not told
LEAST_DEGREES = 0.01  # smaller angles are not told

Angle = TypeVar("Angle", float, NDArray[np.float64])


def wrapped(angle: Angle) -> Angle:
    """Shift angles [rad] by full turns into [-pi, pi); a number or an array, whose shape is kept."""
    return (angle + np.pi) % TAU - np.pi


def joint_unit(slides: bool) -> str:
    """Return the unit of the values of a joint: "m" if it is prismatic (``slides``), else "rad"."""
    return "m" if slides else "rad"


def joint_units(prismatic: Iterable[bool]) -> list[str]:
    """Return the unit of the values of each joint."""
    return [joint_unit(slides) for slides in prismatic]


def shown_unit(slides: bool) -> tuple[float, str]:
    """Return the factor from stored to shown values of a joint, and the shown unit, "m" or "deg"."""
    return (1.0, "m") if slides else (DEGREES, "deg")


def reading(value: float, unit: str) -> tuple[float, str]:
    """Convert a value in a unit, "m" or "rad", to the shown one; return it with its unit, "m" or "deg"."""
    return (value, "m") if unit == "m" else (float(np.rad2deg(value)), "deg")


def how_far(distance: float, angle: float = 0.0) -> str:
    """Say how far a pose is from another: "1.06 m", "3.2 mm and 12 degrees"; a part that is nothing is left out.

    Args:
        distance: Between the positions [m].
        angle: Between the orientations [rad].
    """
    away = f"{distance:.3g} m" if distance >= SHOWN_IN_METRES else f"{1e3 * distance:.3g} mm"
    if angle * DEGREES < LEAST_DEGREES:
        return away
    turned = f"{angle * DEGREES:.3g} degrees"
    return turned if distance < LEAST_METRES else f"{away} and {turned}"


def closest_configuration(distance: float, angle: float = 0.0) -> str:
    """Say how near an arm comes to a goal that it does not reach, by :func:`how_far`."""
    return f"the closest configuration is {how_far(distance, angle)} away"
