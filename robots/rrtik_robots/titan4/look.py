"""The visual model of the TITAN 4: each link consists of boxes and tubes inside its collision body or near it."""

from __future__ import annotations

import numpy as np

from rrtik_robots.titan4.geometry import TitanGeometry
from rrtik_robots.urdf_parts import Part, Point, ball, box, tube, upright


def link_visuals(g: TitanGeometry) -> dict[str, list[Part]]:
    """Return the visual parts of each link, base first, each in its link's frame."""
    return {
        "base": _base(g),
        "shoulder": _shoulder(g),
        "upper_arm": _upper_arm(g),
        "forearm": _forearm(g),
        "wrist": _wrist(g),
        "yaw_housing": _yaw_housing(g),
        "gripper": _gripper(g),
    }


def _base(g: TitanGeometry) -> list[Part]:
    face = -g.shoulder_height
    bolts = [(0.085 * np.cos(t), 0.085 * np.sin(t)) for t in np.arange(8) * np.pi / 4 + np.pi / 8]
    return [
        upright((0.0, 0.0, face), (0.0, 0.0, face + 0.025), g.base_radius, "dark"),
        *(upright((x, y, face + 0.025), (x, y, face + 0.037), 0.009, "chrome") for x, y in bolts),
        upright((0.0, 0.0, face + 0.025), (0.0, 0.0, -0.085), 0.072, "titanium"),
        upright((0.0, 0.0, -0.105), (0.0, 0.0, -0.092), 0.078, "orange"),
    ]


def _shoulder(g: TitanGeometry) -> list[Part]:
    cheeks = [box((g.a1 + 0.05, 0.018, 0.095), (g.a1 / 2 + 0.015, y, 0.0), "titanium") for y in (-0.066, 0.066)]
    return [
        upright((0.0, 0.0, -0.085), (0.0, 0.0, 0.062), 0.070, "titanium"),
        upright((0.0, 0.0, 0.062), (0.0, 0.0, 0.078), 0.045, "dark"),
        *cheeks,
        _hub((g.a1, 0.0, 0.0), 0.043, 0.080),
    ]


def _upper_arm(g: TitanGeometry) -> list[Part]:
    knee = np.array([g.knee_along, 0.0, g.knee_above])
    along = knee / np.linalg.norm(knee)
    above = np.array([-along[2], 0.0, along[0]])

    def at(share: float, height: float) -> Point:
        x, y, z = share * knee + height * above
        return float(x), float(y), float(z)

    low = -0.022
    return [
        _hub((0.0, 0.0, 0.0), 0.052, 0.054),
        tube(at(0.0, low / 2), at(0.96, low), 0.046, "titanium"),
        tube(at(0.20, low), at(0.23, low), 0.049, "orange"),
        tube(at(0.80, low), at(0.83, low), 0.049, "orange"),
        ball(at(0.97, low), 0.050, "titanium"),
        tube(at(0.97, low), (g.a2, 0.0, 0.0), 0.046, "titanium"),
        *_actuator(at(0.10, 0.048), at(0.52, 0.050), at(0.88, 0.040), 0.030),
        _hub((g.a2, 0.0, 0.0), 0.050, 0.068),
    ]


def _forearm(g: TitanGeometry) -> list[Part]:
    end = g.a3
    cheeks = [box((0.16, 0.014, 0.07), (0.075, y, 0.0), "titanium") for y in (-0.050, 0.050)]
    return [
        *cheeks,
        tube((0.07, 0.0, -0.010), (end - 0.05, 0.0, -0.010), 0.041, "titanium"),
        tube((0.20, 0.0, -0.010), (0.22, 0.0, -0.010), 0.044, "orange"),
        *_actuator((0.13, 0.0, 0.040), (0.29, 0.0, 0.041), (end - 0.07, 0.0, 0.036), 0.019),
        *(box((0.10, 0.013, 0.06), (end - 0.02, y, 0.0), "titanium") for y in (-0.048, 0.048)),
    ]


def _wrist(g: TitanGeometry) -> list[Part]:
    yaw = g.a4
    return [
        _hub((0.0, 0.0, 0.0), 0.040, 0.062),
        box((yaw - 0.02, 0.075, 0.085), (yaw / 2, 0.0, 0.0), "titanium"),
        *(box((0.075, 0.06, 0.014), (yaw - 0.015, 0.0, z), "titanium") for z in (-0.056, 0.056)),
        upright((yaw, 0.0, -0.068), (yaw, 0.0, 0.068), 0.033, "dark"),
    ]


def _yaw_housing(g: TitanGeometry) -> list[Part]:
    return [
        tube((-0.01, 0.0, 0.0), (0.115, 0.0, 0.0), 0.047, "titanium"),
        tube((0.075, 0.0, 0.0), (0.090, 0.0, 0.0), 0.050, "orange"),
    ]


def _gripper(g: TitanGeometry) -> list[Part]:
    palm = 0.195
    tip = g.d6 + 0.048
    parts = [
        tube((0.115, 0.0, 0.0), (palm - 0.02, 0.0, 0.0), 0.053, "dark"),
        box((0.05, 0.05, 0.095), (palm - 0.005, 0.0, 0.0), "titanium"),
    ]
    for side in (1.0, -1.0):
        root = (palm, side * 0.036)
        bend = (0.6 * palm + 0.4 * tip, side * 0.052)
        end = (tip, side * 0.014)
        pad = (0.45 * bend[0] + 0.55 * tip, side * 0.024)
        parts += [
            _bar(root, bend, 0.034, 0.024, "titanium"),
            _bar(bend, end, 0.030, 0.020, "titanium"),
            _bar(pad, (tip, side * 0.006), 0.024, 0.008, "dark"),
            tube((palm, -0.024, side * 0.036), (palm, 0.024, side * 0.036), 0.014, "chrome"),
        ]
    return parts


def _hub(centre: Point, radius: float, half_width: float) -> Part:
    x, y, z = centre
    return tube((x, y - half_width, z), (x, y + half_width, z), radius, "dark")


def _actuator(start: Point, gland: Point, end: Point, radius: float) -> list[Part]:
    """A hydraulic cylinder: barrel, gland, rod and the eye at its end."""
    return [
        tube(start, gland, radius, "dark"),
        ball(gland, radius, "orange"),
        tube(gland, end, 0.45 * radius, "chrome"),
        ball(end, 0.75 * radius, "dark"),
    ]


def _bar(start: tuple[float, float], end: tuple[float, float], width: float, height: float, colour: str) -> Part:
    """A flat bar between two points (x, z) of the gripper's plane."""
    x0, z0 = start
    x1, z1 = end
    length = float(np.hypot(x1 - x0, z1 - z0))
    centre = ((x0 + x1) / 2, 0.0, (z0 + z1) / 2)
    return box((length, width, height), centre, colour, pitch=-float(np.arctan2(z1 - z0, x1 - x0)))
