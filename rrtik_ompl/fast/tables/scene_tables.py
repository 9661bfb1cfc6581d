"""What stands still as flat tables for the kernels: primitives, sorted by kind, with their bounding boxes.

A primitive is a solid whose distance to a point has a short formula. Simple solids are one primitive, convex solids one
primitive of planes, all else a primitive for each ball of its cover. Two tables have the same layout: the outer one
contains the bodies, the inner one is contained in them, so that one kernel serves both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.solids import SameObject
from rrtik_ompl.covers.planes import most_different
from rrtik_ompl.fast.tables.layout import (
    BALL,
    BOX,
    BOXES,
    CAPSULE,
    CHECKED,
    CONVEX,
    CYLINDER,
    EXCLUDING,
    HALF_SPACE,
    NUMBERS,
    OWN,
    PADDED_COUNT,
    PLANES,
    PRIMITIVE_COUNT,
    PRIMITIVE_FLOATS,
    PRIMITIVES,
    STANDING_COUNT,
)
from rrtik_ompl.fast.tables.robot_tables import Spheres, Table, table, usable_cover

MOST_PLANES = 64  # of the outer polyhedron of a convex solid: fewer planes make it larger, never smaller
LANE_PADDING = 16  # boxes are compared this many at a time, or half as many
UNBOUNDED_COORDINATE = 1e30  # [m]
UNBOUNDED_LENGTH = 1e12  # [m] what is larger or farther away counts as being everywhere
SLACK_PER_METRE = 1e-6  # rounding of a primitive's numbers and of the arithmetic on them, relative to the coordinates
PLANE_SLACK = 1e-5  # [m] for planes that stand for a few others with almost the same normal
SMALLEST_AREA = 1e-18  # [m^2] of a triangle that has a normal


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """One solid: see the kinds above. ``low`` and ``high`` bound it in the world, shape (3,)."""

    kind: int
    numbers: Vector
    low: Vector
    high: Vector
    planes: Matrix | None = None


def needs_covers(body: Any) -> tuple[bool, bool]:
    """Whether a body needs outer and inner spheres: what stands still and has a formula can do without."""
    if body.joint > 0:
        return True, True
    exact = _exact(body, grow=1.0)
    return exact is None, exact is None or isinstance(body.geometry, coal.ConvexBase)


def primitive_table(primitives: Sequence[tuple[int, Primitive]], checked: NDArray[np.bool_]) -> Table:
    """Rows with the numbers of their standing bodies; ``checked`` has shape (moving bodies, standing bodies).

    The kind of balls comes first, so that the last primitive of a body is the one with its formula, if it has one.
    """
    ordered = sorted(primitives, key=lambda item: item[1].kind)
    padded = -(-len(ordered) // LANE_PADDING) * LANE_PADDING
    boxes = np.empty((6, padded), dtype=np.float32)
    boxes[0::2], boxes[1::2] = UNBOUNDED_COORDINATE, -UNBOUNDED_COORDINATE
    if ordered:
        lows, highs = (
            np.array(ends, dtype=np.float32).T for ends in zip(*((r.low, r.high) for _, r in ordered), strict=True)
        )
        boxes[0::2, : len(ordered)] = np.nextafter(lows, np.float32(-np.inf))
        boxes[1::2, : len(ordered)] = np.nextafter(highs, np.float32(np.inf))
    floats = np.zeros((len(ordered), PRIMITIVE_FLOATS), dtype=np.float32)
    numbers = np.zeros((len(ordered), 4), dtype=np.int32)
    own = np.full(checked.shape[1], -1, dtype=np.int32)
    planes: list[Matrix] = [np.zeros((0, 4))]
    for k, (body, primitive) in enumerate(ordered):
        floats[k, : len(primitive.numbers)] = primitive.numbers
        first = sum(len(p) for p in planes)
        own[body] = k
        numbers[k] = primitive.kind, body, first, first + (0 if primitive.planes is None else len(primitive.planes))
        planes += [] if primitive.planes is None else [primitive.planes]
    return table(
        {
            PRIMITIVE_COUNT: len(ordered),
            PADDED_COUNT: padded,
            BOXES: boxes,
            PRIMITIVES: floats,
            NUMBERS: numbers,
            PLANES: np.concatenate(planes).astype(np.float32),
            STANDING_COUNT: checked.shape[1],
            CHECKED: checked.astype(np.int32),
            EXCLUDING: np.asarray((~checked).any(axis=1), dtype=np.int32),
            OWN: own,
        }
    )


def outer_primitives(body: Any, cover: Spheres, inflation: float = 0.0) -> list[Primitive]:
    """Rows whose union contains a standing body: its own formula if it has one, the balls of its cover otherwise.

    They contain every point that is no farther from the body than its margin and ``inflation`` [m].
    """
    inflation += body.margin
    exact = _exact(body, grow=1.0, inflation=inflation)
    primitives = (
        _balls(body, usable_cover(body.geometry, cover), grow=1.0, inflation=inflation) if exact is None else exact
    )
    everything = Primitive(
        BALL, np.array([0.0, 0.0, 0.0, UNBOUNDED_LENGTH]), np.full(3, -UNBOUNDED_LENGTH), np.full(3, UNBOUNDED_LENGTH)
    )
    return [primitive if _fits(primitive) else everything for primitive in primitives]


def inner_primitives(body: Any, inner: Spheres) -> list[Primitive]:
    """Rows that lie within the margin around a standing body, or inside it."""
    stays_round = isinstance(body.geometry, (coal.Sphere, coal.Capsule, coal.Halfspace))
    primitives = _exact(body, grow=-1.0, inflation=body.margin if stays_round else 0.0)
    if primitives is None or isinstance(body.geometry, coal.ConvexBase):
        balls = np.asarray(inner, dtype=np.float64).reshape(-1, 4)
        primitives = (primitives or []) + _balls(body, balls, grow=-1.0, inflation=body.margin)
    return [primitive for primitive in primitives if _fits(primitive)]


def _fits(primitive: Primitive) -> bool:
    """Whether the kernels can square the numbers of a primitive."""
    return float(np.abs(primitive.numbers).max()) < UNBOUNDED_LENGTH and (
        primitive.planes is None or float(np.abs(primitive.planes).max()) < UNBOUNDED_LENGTH
    )


def _exact(body: Any, grow: float, inflation: float = 0.0) -> list[Primitive] | None:
    """The body by the formula of its kind, a little larger (grow = 1) or smaller (-1), and by ``inflation`` [m] larger.

    None if there is no formula.
    """
    solid, pose = body.geometry, body.placement
    if isinstance(solid, coal.ShapeBase) and solid.getSweptSphereRadius() != 0.0:
        return None
    if isinstance(solid, coal.Halfspace):
        return [_half_space(solid, pose, grow, inflation)]
    if isinstance(solid, coal.ConvexBase):
        planes = _known_planes(SameObject(solid))
        return None if planes is None else _convex(solid, pose, planes, grow, inflation)
    if not isinstance(solid, (coal.Sphere, coal.Capsule, coal.Box, coal.Cylinder)):
        return None
    primitive = _primitive(solid, np.array(pose.rotation), np.array(pose.translation), grow, inflation)
    return [] if primitive is None else [primitive]


def _primitive(solid: Any, rotation: Matrix, centre: Vector, grow: float, inflation: float) -> Primitive | None:
    """Primitive of a ball, capsule, box or cylinder, or None if nothing is left of it."""
    z = rotation[:, 2]
    if isinstance(solid, coal.Box):
        half = np.array(solid.halfSide)
        half = half + grow * _slack(centre, float(np.linalg.norm(half))) + inflation
        spread = np.abs(rotation) @ half
        return _bounded_primitive(BOX, [*centre, *rotation.T.ravel(), *half], centre, spread, half.min())
    length = 0.0 if isinstance(solid, coal.Sphere) else float(solid.halfLength)
    radius = float(solid.radius) + grow * _slack(centre, float(solid.radius) + length) + inflation
    if isinstance(solid, coal.Sphere):
        return _bounded_primitive(BALL, [*centre, radius], centre, np.full(3, radius), radius)
    if isinstance(solid, coal.Capsule):
        way = 2.0 * length * z
        share = 1.0 / float(way @ way) if length > 1e-9 else 0.0
        spread = length * np.abs(z) + radius
        return _bounded_primitive(CAPSULE, [*(centre - 0.5 * way), *way, share, radius], centre, spread, radius)
    length += grow * _slack(centre, radius + length) + inflation
    spread = length * np.abs(z) + radius * np.sqrt(np.maximum(1.0 - z * z, 0.0))
    return _bounded_primitive(CYLINDER, [*centre, *z, length, radius], centre, spread, min(radius, length))


def _bounded_primitive(
    kind: int, numbers: Sequence[float], centre: Vector, spread: Vector, thickness: float
) -> Primitive | None:
    if thickness < 0.0:
        return None
    slack = _slack(centre, float(spread.max()))
    return Primitive(kind, np.array(numbers), centre - spread - slack, centre + spread + slack)


def _slack(centre: Vector, size: float) -> float:
    return SLACK_PER_METRE * (1.0 + float(np.abs(centre).max()) + size)


def _balls(body: Any, spheres: Spheres, grow: float, inflation: float = 0.0) -> list[Primitive]:
    rotation, origin = np.array(body.placement.rotation), np.array(body.placement.translation)
    primitives = []
    for x, y, z, radius in spheres:
        centre = rotation @ (x, y, z) + origin
        size = radius + grow * _slack(centre, radius) + inflation
        primitives.append(_bounded_primitive(BALL, [*centre, size], centre, np.full(3, size), size))
    return [primitive for primitive in primitives if primitive is not None]


def _half_space(solid: Any, pose: Any, grow: float, inflation: float) -> Primitive:
    normal = np.array(pose.rotation) @ np.array(solid.n)
    offset = float(solid.d) + float(normal @ pose.translation)
    offset += grow * _slack(np.array([offset]), 0.0) + inflation
    everywhere = np.full(3, UNBOUNDED_COORDINATE)
    return Primitive(HALF_SPACE, np.array([*normal, offset]), -everywhere, everywhere)


def _convex(solid: Any, pose: Any, planes: Matrix, grow: float, inflation: float) -> list[Primitive]:
    """A convex solid by its planes; the inner primitive asks that a ball's centre lies behind all of them."""
    rotation, origin = np.array(pose.rotation), np.array(pose.translation)
    corners = np.array(solid.points()).reshape(-1, 3) @ rotation.T + origin
    low, high = corners.min(axis=0), corners.max(axis=0)
    inflation += _slack(0.5 * (low + high), float((high - low).max()))
    kept = most_different(planes, MOST_PLANES) if grow > 0.0 else planes
    world = np.empty_like(kept)
    world[:, :3] = kept[:, :3] @ rotation.T
    world[:, 3] = kept[:, 3] + world[:, :3] @ origin + (inflation if grow > 0.0 else -inflation - PLANE_SLACK)
    return [Primitive(CONVEX, np.array([1.0 if grow > 0.0 else 0.0]), low - inflation, high + inflation, world)]


@lru_cache(maxsize=4096)
def _known_planes(solid: SameObject) -> Matrix | None:
    """See :func:`outward_planes`; an obstacle that moves keeps them."""
    return outward_planes(solid.geometry)


def outward_planes(solid: Any) -> Matrix | None:
    """Outward unit normals and offsets of a coal convex solid's faces, shape (k, 4); None if it has no thickness.

    Each plane is moved to the outermost corner along its normal, so that the solid lies behind all of them whatever
    the faces' own precision; almost parallel faces share one plane.
    """
    points = np.array(solid.points(), dtype=np.float64).reshape(-1, 3)
    triangles = np.array([[t[0], t[1], t[2]] for t in (solid.polygons(k) for k in range(solid.num_polygons))])
    if len(triangles) < 4:
        return None
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    solid_faces = areas > SMALLEST_AREA
    normals, outward = normals[solid_faces] / areas[solid_faces, None], (a - points.mean(axis=0))[solid_faces]
    if len(normals) < 4:
        return None
    normals *= np.where(np.einsum("ij,ij->i", normals, outward) < 0.0, -1.0, 1.0)[:, None]
    normals = normals[np.argsort(-areas[solid_faces])]  # of almost parallel faces the largest stands for the others
    normals = normals[np.sort(np.unique(np.round(normals, 6), axis=0, return_index=True)[1])]
    return np.column_stack([normals, (points @ normals.T).max(axis=0)])
