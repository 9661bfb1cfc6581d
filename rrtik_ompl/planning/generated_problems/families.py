"""What is built around a posture that the arm is to reach: the obstacles of each family of generated scenes.

A builder is given the place of the tip: x is the way that the forearm points, z lies as near as can be to the axis of
the first joint. All sizes are shares of the arm's reach, so that one builder serves arms of any size; an arm that is
thick, or whose wrist stands off to one side, is given more room beside the way of its forearm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Shape, Sphere

Solids: TypeAlias = list[tuple[Shape, Any]]  # shapes and their poses in the frame of the place, in shares of the reach
Builder: TypeAlias = Callable[[np.random.Generator, float], Solids]  # of a random stream and the spacing: 1 or more

THICKNESS = 0.03  # of boards and plates
BARS = 0.02  # half the thickness of a frame's bars
CLUTTER = 25  # solids
FREE_AROUND = 0.09  # pipes leave so much room about the way of the forearm


def _board(low: tuple[float, float, float], high: tuple[float, float, float]) -> tuple[Shape, Any]:
    """A box from one corner to the other."""
    corners = np.array([low, high])
    return Box(corners[1] - corners[0]), pin.SE3(np.eye(3), corners.mean(axis=0))


def panel(rng: np.random.Generator, spacing: float) -> Solids:
    """A board behind the tip with a shelf below it, a wall on one side, and knobs; after the subsea panel."""
    gap = rng.uniform(0.04, 0.08)
    width = rng.uniform(0.3, 0.5)
    up = rng.uniform(0.2, 0.4)
    side = rng.choice([-1.0, 1.0])
    floor = -spacing * rng.uniform(0.1, 0.18)
    depth = rng.uniform(0.2, 0.35)
    wall = sorted(side * (spacing * rng.uniform(0.1, 0.18) + np.array([0.0, THICKNESS])))

    solids = [
        _board((gap, -width, floor), (gap + THICKNESS, width, up)),
        _board((-depth, -width, floor - THICKNESS), (gap + THICKNESS, width, floor)),
        _board((-depth, wall[0], floor), (gap, wall[1], up)),
    ]

    for _ in range(rng.integers(2, 5)):
        y = -side * rng.uniform(0.12, width)
        z = rng.uniform(floor, up)
        length = rng.uniform(0.04, 0.12)
        turned = pin.SE3(pin.utils.rotate("y", np.pi / 2), np.array([gap - 0.5 * length, y, z]))
        solids.append((Cylinder(rng.uniform(0.01, 0.03), length), turned))
    return solids


def pipes(rng: np.random.Generator, spacing: float) -> Solids:
    """Upright and level pipes around the way of the forearm."""
    solids: Solids = []
    for number in range(rng.integers(6, 11)):
        x = rng.uniform(-0.4, 0.15)
        aside = rng.choice([-1.0, 1.0]) * rng.uniform(spacing * FREE_AROUND, 0.4 + spacing * FREE_AROUND)
        along = float(rng.uniform(-0.3, 0.3))
        upright = number % 2 == 0
        rotation = np.eye(3) if upright else pin.utils.rotate("x", np.pi / 2)
        centre = np.array([x, aside, along] if upright else [x, along, aside])
        solids.append((Capsule(rng.uniform(0.012, 0.03), rng.uniform(0.5, 1.2)), pin.SE3(rotation, centre)))
    return solids


def frame(rng: np.random.Generator, spacing: float) -> Solids:
    """Two windows of bars one behind the other, joined by four rails; the forearm reaches through the first."""
    half = spacing * rng.uniform(0.12, 0.2, 2)
    front = -rng.uniform(0.08, 0.2)
    back = rng.uniform(0.1, 0.2)
    y, z = half + BARS
    solids: Solids = []

    for x in (front, back):
        for sign in (-1.0, 1.0):
            solids.append(_beam((x, sign * y, 0.0), (BARS, BARS, z + BARS)))
            solids.append(_beam((x, 0.0, sign * z), (BARS, y + BARS, BARS)))

    middle = 0.5 * (front + back)
    length = 0.5 * (back - front)
    solids += [_beam((middle, a * y, b * z), (length, BARS, BARS)) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    return solids


def _beam(centre: tuple[float, float, float], half: tuple[float, float, float]) -> tuple[Shape, Any]:
    return Box(2.0 * np.array(half)), pin.SE3(np.eye(3), np.array(centre))


def _slot(rng: np.random.Generator, spacing: float, roll: float) -> Solids:
    """Two plates with the forearm between them, turned about its way."""
    gap = spacing * rng.uniform(0.065, 0.09)
    front = -rng.uniform(0.15, 0.3)
    back = rng.uniform(0.05, 0.1)
    half = rng.uniform(0.2, 0.35)
    turned = pin.SE3(pin.utils.rotate("x", roll), np.zeros(3))

    plates = [
        _board((front, gap, -half), (back, gap + THICKNESS, half)),
        _board((front, -gap - THICKNESS, -half), (back, -gap, half)),
    ]
    return [(shape, turned * pose) for shape, pose in plates]


def slot_along(rng: np.random.Generator, spacing: float) -> Solids:
    """A narrow slot that the axis of the first joint lies along: the other joints move in it one at a time."""
    return _slot(rng, spacing, 0.0)


def slot_across(rng: np.random.Generator, spacing: float) -> Solids:
    """A narrow slot askew to the joints' axes: to stay in it, several joints must move in turns."""
    return _slot(rng, spacing, rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.1))


def clutter(rng: np.random.Generator, spacing: float) -> Solids:
    """Boxes, cylinders and balls of many sizes, some near the tip and some far."""
    solids: Solids = []
    for _ in range(CLUTTER):
        kind = rng.integers(3)
        size = rng.uniform(0.03, 0.12, 3)
        shape: Shape = (Box(size), Cylinder(0.5 * size[0], 2.0 * size[1]), Sphere(0.6 * size[0]))[kind]

        direction = rng.normal(size=3)
        centre = direction / np.linalg.norm(direction) * rng.uniform(spacing * 0.1, 0.9)
        solids.append((shape, pin.SE3(pin.exp3(rng.normal(size=3)), centre)))
    return solids


FAMILIES: Mapping[str, Builder] = MappingProxyType(
    {
        "panel": panel,
        "pipes": pipes,
        "frame": frame,
        "slot_along": slot_along,
        "slot_across": slot_across,
        "clutter": clutter,
    }
)


def obstacles(
    family: str, rng: np.random.Generator, place: pin.SE3, reach: float, spacing: float = 1.0
) -> tuple[Obstacle, ...]:
    """Obstacles of a family around a place.

    Args:
        family: One of FAMILIES.
        rng: Of all sizes.
        place: ``pinocchio.SE3``; see the head of this module.
        reach: Of the arm [m].
        spacing: Beside the forearm, as a factor of the usual.
    """
    found = []
    for number, (shape, pose) in enumerate(FAMILIES[family](rng, spacing), start=1):
        there = place * pin.SE3(pose.rotation, reach * pose.translation)
        found.append(Obstacle(f"{family}{number}", _scaled(shape, reach), there))
    return tuple(found)


def _scaled(shape: Shape, factor: float) -> Shape:
    """The same shape in another size; all measures of those above are lengths."""
    return type(shape)(**{measure.name: factor * getattr(shape, measure.name) for measure in shape.measures})
