"""What stands still as primitives: solids whose distance to a point has a short formula.

Simple solids are one primitive, convex solids one primitive of planes, all else a primitive for each ball of its cover.
There are two sets of them: the outer ones contain the bodies, the inner ones are contained in them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import coal
import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.solids import SameObject
from rrtik_ompl.covers.planes import most_different
from rrtik_ompl.fast.tables.layout import (
    BALL,
    BALL_RADIUS,
    BOX,
    BOX_AXES,
    BOX_HALF_SIZES,
    CAPSULE,
    CAPSULE_AXIS,
    CAPSULE_INVERSE_SQUARE,
    CAPSULE_RADIUS,
    CONVEX,
    CONVEX_SHARE,
    CYLINDER,
    CYLINDER_AXIS,
    CYLINDER_HALF_LENGTH,
    CYLINDER_RADIUS,
    HALF_SPACE,
    HALF_SPACE_NORMAL,
    HALF_SPACE_OFFSET,
    PLANE_NORMAL,
    PLANE_OFFSET,
    SHAPE_CENTRE,
    SHAPE_FLOATS,
)
from rrtik_ompl.fast.tables.memory import record
from rrtik_ompl.fast.tables.primitive_tables import UNBOUNDED_COORDINATE, Primitive
from rrtik_ompl.fast.tables.robot_tables import Spheres, usable_cover

MOST_PLANES = 64  # of the outer polyhedron of a convex solid: fewer planes make it larger, never smaller
UNBOUNDED_LENGTH = 1e12  # [m] what is larger or farther away counts as being everywhere
SLACK_PER_METRE = 1e-6  # rounding of a primitive's numbers and of the arithmetic on them, relative to the coordinates
PLANE_SLACK = 1e-5  # [m] for planes that stand for a few others with almost the same normal
SMALLEST_AREA = 1e-18  # [m^2] of a triangle that has a normal


def needs_covers(body: Body) -> tuple[bool, bool]:
    """Whether a body needs outer and inner spheres: what stands still and has a formula can do without."""
    if body.joint > 0:
        return True, True
    exact = _exact(body, grow=1.0)
    return exact is None, exact is None or isinstance(body.geometry, coal.ConvexBase)


def outer_primitives(body: Body, cover: Spheres, inflation: float = 0.0) -> list[Primitive]:
    """Rows whose union contains a standing body: its own formula if it has one, the balls of its cover otherwise.

    They contain every point that is no farther from the body than its margin and ``inflation`` [m].
    """
    inflation += body.margin
    exact = _exact(body, grow=1.0, inflation=inflation)
    primitives = (
        _balls(body, usable_cover(body.geometry, cover), grow=1.0, inflation=inflation) if exact is None else exact
    )
    whole = record(SHAPE_FLOATS, {BALL_RADIUS: UNBOUNDED_LENGTH})
    everything = Primitive(BALL, whole, np.full(3, -UNBOUNDED_LENGTH), np.full(3, UNBOUNDED_LENGTH))
    return [primitive if _fits(primitive) else everything for primitive in primitives]


def inner_primitives(body: Body, inner: Spheres) -> list[Primitive]:
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


def _exact(body: Body, grow: float, inflation: float = 0.0) -> list[Primitive] | None:
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
        return _bounded_primitive(
            BOX,
            {SHAPE_CENTRE: centre, BOX_AXES: rotation.T.ravel(), BOX_HALF_SIZES: half},
            centre,
            spread,
            half.min(),
        )
    length = 0.0 if isinstance(solid, coal.Sphere) else float(solid.halfLength)
    radius = float(solid.radius) + grow * _slack(centre, float(solid.radius) + length) + inflation
    if isinstance(solid, coal.Sphere):
        return _ball(centre, radius)
    if isinstance(solid, coal.Capsule):
        axis = 2.0 * length * z
        share = 1.0 / float(axis @ axis) if length > 1e-9 else 0.0
        spread = length * np.abs(z) + radius
        numbers = {SHAPE_CENTRE: centre - 0.5 * axis, CAPSULE_AXIS: axis, CAPSULE_INVERSE_SQUARE: share}
        return _bounded_primitive(CAPSULE, numbers | {CAPSULE_RADIUS: radius}, centre, spread, radius)
    length += grow * _slack(centre, radius + length) + inflation
    spread = length * np.abs(z) + radius * np.sqrt(np.maximum(1.0 - z * z, 0.0))
    numbers = {SHAPE_CENTRE: centre, CYLINDER_AXIS: z, CYLINDER_HALF_LENGTH: length, CYLINDER_RADIUS: radius}
    return _bounded_primitive(CYLINDER, numbers, centre, spread, min(radius, length))


def _bounded_primitive(
    kind: int, numbers: Mapping[int, Any], centre: Vector, spread: Vector, thickness: float
) -> Primitive | None:
    if thickness < 0.0:
        return None
    slack = _slack(centre, float(spread.max()))
    return Primitive(kind, record(SHAPE_FLOATS, numbers), centre - spread - slack, centre + spread + slack)


def _ball(centre: Vector, radius: float) -> Primitive | None:
    numbers = {SHAPE_CENTRE: centre, BALL_RADIUS: radius}
    return _bounded_primitive(BALL, numbers, centre, np.full(3, radius), radius)


def _slack(centre: Vector, size: float) -> float:
    return SLACK_PER_METRE * (1.0 + float(np.abs(centre).max()) + size)


def _balls(body: Body, spheres: Spheres, grow: float, inflation: float = 0.0) -> list[Primitive]:
    rotation, origin = np.array(body.placement.rotation), np.array(body.placement.translation)
    primitives = []
    for x, y, z, radius in spheres:
        centre = rotation @ (x, y, z) + origin
        size = radius + grow * _slack(centre, radius) + inflation
        primitives.append(_ball(centre, size))
    return [primitive for primitive in primitives if primitive is not None]


def _half_space(solid: Any, pose: Any, grow: float, inflation: float) -> Primitive:
    normal = np.array(pose.rotation) @ np.array(solid.n)
    offset = float(solid.d) + float(normal @ pose.translation)
    offset += grow * _slack(np.array([offset]), 0.0) + inflation
    everywhere = np.full(3, UNBOUNDED_COORDINATE)
    numbers = record(SHAPE_FLOATS, {HALF_SPACE_NORMAL: normal, HALF_SPACE_OFFSET: offset})
    return Primitive(HALF_SPACE, numbers, -everywhere, everywhere)


def _convex(solid: Any, pose: Any, planes: Matrix, grow: float, inflation: float) -> list[Primitive]:
    """A convex solid by its planes; a ball meets the inner primitive if its centre lies behind all of them."""
    rotation, origin = np.array(pose.rotation), np.array(pose.translation)
    corners = np.array(solid.points()).reshape(-1, 3) @ rotation.T + origin
    low, high = corners.min(axis=0), corners.max(axis=0)
    inflation += _slack(0.5 * (low + high), float((high - low).max()))
    kept = most_different(planes, MOST_PLANES) if grow > 0.0 else planes
    world = np.empty_like(kept)
    normals = world[:, PLANE_NORMAL : PLANE_NORMAL + 3]
    normals[:] = kept[:, :3] @ rotation.T
    world[:, PLANE_OFFSET] = kept[:, 3] + normals @ origin + (inflation if grow > 0.0 else -inflation - PLANE_SLACK)
    numbers = record(SHAPE_FLOATS, {CONVEX_SHARE: 1.0 if grow > 0.0 else 0.0})
    return [Primitive(CONVEX, numbers, low - inflation, high + inflation, world)]


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
