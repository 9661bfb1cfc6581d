"""What stands still as flat tables for the kernels: rows of solids, sorted by kind, with their bounding boxes.

A row is a solid whose distance to a point has a short formula. Primitives are one row, convex solids one row of
planes, all else a row for each ball of its cover. Two tables have the same layout: the outer one contains the bodies,
the inner one is contained in them, so that one kernel serves both.
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
from rrtik_ompl.collision.shape_table import Core, core_of
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
    ROW_COUNT,
    ROW_FLOATS,
    ROWS,
    STANDING_COUNT,
)
from rrtik_ompl.fast.tables.robot_tables import Spheres, Table, table, usable_cover

MOST_PLANES = 64  # of the outer polyhedron of a convex solid: fewer planes make it larger, never smaller
LANE_PADDING = 16  # boxes are compared this many at a time, or half as many
ENDLESS = 1e30
HUGE = 1e12  # [m] what is larger or farther away counts as being everywhere
SLACK_PER_METRE = 1e-6  # rounding of a row's numbers and of the arithmetic on them, relative to the coordinates
PLANE_SLACK = 1e-5  # [m] for planes that stand for a few others with almost the same normal
SMALLEST_AREA = 1e-18  # [m^2] of a triangle that has a normal


@dataclass(frozen=True, slots=True, eq=False)
class Row:
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


def rows_table(rows: Sequence[tuple[int, Row]], checked: NDArray[np.bool_]) -> Table:
    """Rows with the numbers of their standing bodies; ``checked`` has shape (moving bodies, standing bodies).

    The kind of balls comes first, so that the last row of a body is the one with its formula, if it has one.
    """
    ordered = sorted(rows, key=lambda item: item[1].kind)
    padded = -(-len(ordered) // LANE_PADDING) * LANE_PADDING
    boxes = np.empty((6, padded), dtype=np.float32)
    boxes[0::2], boxes[1::2] = ENDLESS, -ENDLESS
    if ordered:
        lows, highs = (
            np.array(ends, dtype=np.float32).T for ends in zip(*((r.low, r.high) for _, r in ordered), strict=True)
        )
        boxes[0::2, : len(ordered)] = np.nextafter(lows, np.float32(-np.inf))
        boxes[1::2, : len(ordered)] = np.nextafter(highs, np.float32(np.inf))
    floats = np.zeros((len(ordered), ROW_FLOATS), dtype=np.float32)
    numbers = np.zeros((len(ordered), 4), dtype=np.int32)
    own = np.full(checked.shape[1], -1, dtype=np.int32)
    planes: list[Matrix] = [np.zeros((0, 4))]
    for k, (body, row) in enumerate(ordered):
        floats[k, : len(row.numbers)] = row.numbers
        first = sum(len(p) for p in planes)
        own[body] = k
        numbers[k] = row.kind, body, first, first + (0 if row.planes is None else len(row.planes))
        planes += [] if row.planes is None else [row.planes]
    return table(
        {
            ROW_COUNT: len(ordered),
            PADDED_COUNT: padded,
            BOXES: boxes,
            ROWS: floats,
            NUMBERS: numbers,
            PLANES: np.concatenate(planes).astype(np.float32),
            STANDING_COUNT: checked.shape[1],
            CHECKED: checked.astype(np.int32),
            EXCLUDING: np.asarray((~checked).any(axis=1), dtype=np.int32),
            OWN: own,
        }
    )


def outer_rows(body: Any, cover: Spheres, room: float = 0.0) -> list[Row]:
    """Rows whose union contains a standing body: its own formula if it has one, the balls of its cover otherwise.

    They contain every point that is no farther from the body than its margin and ``room`` [m].
    """
    room += body.margin
    exact = _exact(body, grow=1.0, room=room)
    rows = _balls(body, usable_cover(body.geometry, cover), grow=1.0, room=room) if exact is None else exact
    everything = Row(BALL, np.array([0.0, 0.0, 0.0, HUGE]), np.full(3, -HUGE), np.full(3, HUGE))
    return [row if _fits(row) else everything for row in rows]


def inner_rows(body: Any, inner: Spheres) -> list[Row]:
    """Rows that lie within the margin around a standing body, or inside it."""
    core = core_of(body.geometry)
    stays_round = isinstance(body.geometry, coal.Halfspace) if core is None else core.rounded
    rows = _exact(body, grow=-1.0, room=body.margin if stays_round else 0.0)
    if rows is None or isinstance(body.geometry, coal.ConvexBase):
        balls = np.asarray(inner, dtype=np.float64).reshape(-1, 4)
        rows = (rows or []) + _balls(body, balls, grow=-1.0, room=body.margin)
    return [row for row in rows if _fits(row)]


def _fits(row: Row) -> bool:
    """Whether the kernels can square the numbers of a row."""
    return float(np.abs(row.numbers).max()) < HUGE and (row.planes is None or float(np.abs(row.planes).max()) < HUGE)


def _exact(body: Any, grow: float, room: float = 0.0) -> list[Row] | None:
    """The body by the formula of its kind, a little larger (grow = 1) or smaller (-1), and by ``room`` [m] larger.

    None if there is no formula.
    """
    solid, pose = body.geometry, body.placement
    if isinstance(solid, coal.ShapeBase) and solid.getSweptSphereRadius() != 0.0:
        return None
    if isinstance(solid, coal.Halfspace):
        return [_half_space(solid, pose, grow, room)]
    if isinstance(solid, coal.ConvexBase):
        planes = _known_planes(SameObject(solid))
        return None if planes is None else _convex(solid, pose, planes, grow, room)
    core = core_of(solid)
    if core is None:
        return None
    row = _primitive(core, np.array(pose.rotation), np.array(pose.translation), grow, room)
    return [] if row is None else [row]


def _primitive(core: Core, rotation: Matrix, centre: Vector, grow: float, room: float) -> Row | None:
    """Row of a ball, capsule, box or cylinder, or None if nothing is left of it."""
    z = rotation[:, 2]
    half = core.half_sides
    if half is not None:
        half = half + grow * _slack(centre, float(np.linalg.norm(half))) + room
        spread = np.abs(rotation) @ half
        return _row(BOX, [*centre, *rotation.T.ravel(), *half], centre, spread, half.min())
    length, radius = core.half_length, core.radius if core.disc is None else core.disc
    radius = radius + grow * _slack(centre, radius + length) + room
    if len(core.corners) == 1:
        return _row(BALL, [*centre, radius], centre, np.full(3, radius), radius)
    if core.disc is None:
        way = 2.0 * length * z
        share = 1.0 / float(way @ way) if length > 1e-9 else 0.0
        spread = length * np.abs(z) + radius
        return _row(CAPSULE, [*(centre - 0.5 * way), *way, share, radius], centre, spread, radius)
    length += grow * _slack(centre, radius + length) + room
    spread = length * np.abs(z) + radius * np.sqrt(np.maximum(1.0 - z * z, 0.0))
    return _row(CYLINDER, [*centre, *z, length, radius], centre, spread, min(radius, length))


def _row(kind: int, numbers: Sequence[float], centre: Vector, spread: Vector, thickness: float) -> Row | None:
    if thickness < 0.0:
        return None
    room = _slack(centre, float(spread.max()))
    return Row(kind, np.array(numbers), centre - spread - room, centre + spread + room)


def _slack(centre: Vector, size: float) -> float:
    return SLACK_PER_METRE * (1.0 + float(np.abs(centre).max()) + size)


def _balls(body: Any, spheres: Spheres, grow: float, room: float = 0.0) -> list[Row]:
    rotation, origin = np.array(body.placement.rotation), np.array(body.placement.translation)
    rows = []
    for x, y, z, radius in spheres:
        centre = rotation @ (x, y, z) + origin
        size = radius + grow * _slack(centre, radius) + room
        rows.append(_row(BALL, [*centre, size], centre, np.full(3, size), size))
    return [row for row in rows if row is not None]


def _half_space(solid: Any, pose: Any, grow: float, room: float) -> Row:
    normal = np.array(pose.rotation) @ np.array(solid.n)
    offset = float(solid.d) + float(normal @ pose.translation)
    offset += grow * _slack(np.array([offset]), 0.0) + room
    everywhere = np.full(3, ENDLESS)
    return Row(HALF_SPACE, np.array([*normal, offset]), -everywhere, everywhere)


def _convex(solid: Any, pose: Any, planes: Matrix, grow: float, more: float) -> list[Row]:
    """A convex solid by its planes; the inner row asks that a ball's centre lies behind all of them."""
    rotation, origin = np.array(pose.rotation), np.array(pose.translation)
    corners = np.array(solid.points()).reshape(-1, 3) @ rotation.T + origin
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = _slack(0.5 * (low + high), float((high - low).max())) + more
    kept = most_different(planes, MOST_PLANES) if grow > 0.0 else planes
    world = np.empty_like(kept)
    world[:, :3] = kept[:, :3] @ rotation.T
    world[:, 3] = kept[:, 3] + world[:, :3] @ origin + (room if grow > 0.0 else -room - PLANE_SLACK)
    return [Row(CONVEX, np.array([1.0 if grow > 0.0 else 0.0]), low - room, high + room, world)]


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
