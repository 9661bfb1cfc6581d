"""Boxes, cylinders, capsules and spheres as URDF text, from which shipped robots are built."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Part:
    """One solid of a link.

    Attributes:
        shape: The URDF element, such as ``<box size="1 1 1"/>``.
        xyz: Its centre in the link's frame [m].
        rpy: Its roll, pitch, yaw [rad].
        colour: Name of the material.
        capsule: Whether the cylinder has round caps beyond its ends (Pinocchio's ``collision_checking``).
    """

    shape: str
    xyz: Point
    rpy: Point
    colour: str = ""
    capsule: bool = False


def tube(start: Point, end: Point, radius: float, colour: str = "", *, capsule: bool = False) -> Part:
    """Return a cylinder from ``start`` to ``end`` [m], or the capsule with its cap centres there."""
    a = np.array(start)
    b = np.array(end)
    x, y, z = b - a
    yaw, pitch = (0.0, 0.0) if x == y == 0.0 and z > 0.0 else (np.arctan2(y, x), np.arctan2(np.hypot(x, y), z))
    shape = f'<cylinder radius="{number(radius)}" length="{number(float(np.linalg.norm(b - a)))}"/>'
    return Part(shape, _point((a + b) / 2), _point((0.0, pitch, yaw)), colour, capsule)


def upright(bottom: Point, top: Point, radius: float, colour: str = "") -> Part:
    """Return a cylinder along z, from ``bottom`` to ``top`` [m]."""
    return tube(bottom, top, radius, colour)


def box(size: Point, centre: Point, colour: str = "", pitch: float = 0.0) -> Part:
    """Return a box [m], turned about y by ``pitch`` [rad]."""
    return Part(f'<box size="{" ".join(map(number, size))}"/>', _point(centre), _point((0.0, pitch, 0.0)), colour)


def ball(centre: Point, radius: float, colour: str = "") -> Part:
    """A sphere [m]."""
    return Part(f'<sphere radius="{number(radius)}"/>', _point(centre), (0.0, 0.0, 0.0), colour)


def link_text(name: str, collision: Sequence[Part], visual: Sequence[Part]) -> str:
    """A ``<link>`` of a URDF."""
    lines = [f'  <link name="{name}">']
    lines += [_element("visual", part, f'<material name="{part.colour}"/>') for part in visual]
    labels = [f"{name}_{k}" for k in range(len(collision))]
    lines += [_element(f'collision name="{label}"', part, "") for label, part in zip(labels, collision, strict=True)]
    capsules = [label for label, part in zip(labels, collision, strict=True) if part.capsule]
    if capsules:
        names = "".join(f'<capsule name="{label}"/>' for label in capsules)
        lines.append(f"    <collision_checking>{names}</collision_checking>")
    return "\n".join([*lines, "  </link>"])


def materials_text(colours: Mapping[str, tuple[float, float, float]]) -> str:
    """The ``<material>`` elements of a URDF."""
    return "\n".join(
        f'  <material name="{name}"><color rgba="{" ".join(map(number, rgb))} 1"/></material>'
        for name, rgb in colours.items()
    )


def number(value: float) -> str:
    """Return a length or an angle as text, rounded to a nanometre or a nanoradian."""
    return f"{round(float(value), 9) + 0.0:.9g}"


def _element(tag: str, part: Part, material: str) -> str:
    place = f'<origin xyz="{" ".join(map(number, part.xyz))}" rpy="{" ".join(map(number, part.rpy))}"/>'
    return f"    <{tag}>{place}<geometry>{part.shape}</geometry>{material}</{tag.split()[0]}>"


def _point(values: Sequence[float] | np.ndarray) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
