"""Surfaces of solids as triangles, which are counter-clockwise seen from outside."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.model.shapes.polygons import convex_parts

Faces: TypeAlias = NDArray[np.int64]  # vertex indices, shape (m, 3)


class Triangles(NamedTuple):
    """A triangle mesh.

    Attributes:
        vertices: Shape (n, 3) [m].
        faces: Vertex indices of each triangle, shape (m, 3).
    """

    vertices: Matrix
    faces: Faces


def extruded(polygon: Matrix, height: float) -> Triangles:
    """Return the closed prism over a simple polygon, shape (k, 2), from z = -height/2 to +height/2."""
    ring = polygon if _signed_area(polygon) > 0.0 else polygon[::-1]
    walls = [_quad(a, b, height) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]

    fans = [np.stack([part[[0, k, k + 1]] for k in range(1, len(part) - 1)]) for part in convex_parts(ring)]
    cap = np.concatenate(fans)  # triangles in the plane, shape (m, 3, 2)
    z = np.full((*cap.shape[:2], 1), 0.5 * height)
    top = np.concatenate([cap, z], axis=2)
    bottom = np.concatenate([cap, -z], axis=2)[:, ::-1]

    corners = np.concatenate([top, bottom, *walls]).reshape(-1, 3)
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    return Triangles(vertices, np.asarray(index, dtype=np.int64).reshape(-1, 3))


def revolved(radii: Vector, heights: Vector, segments: int) -> Triangles:
    """Return the surface that connects circles about z, from bottom to top.

    Args:
        radii: Radius of each circle, shape (k,) [m].
        heights: Height of each circle, shape (k,) [m].
        segments: Number of vertices on each circle.
    """
    turn = np.linspace(0.0, TAU, segments, endpoint=False)
    x = np.outer(radii, np.cos(turn))
    y = np.outer(radii, np.sin(turn))
    circles = np.stack([x, y, np.broadcast_to(heights[:, None], x.shape)], 2)
    return Triangles(circles.reshape(-1, 3), wrap(len(radii), segments))


def round_ended(radius: float, length: float, segments: int) -> Triangles:
    """Return a capsule along z whose cap centres are ``length`` apart; a ball if that is 0."""
    rings = segments // 4
    angles = np.linspace(0.0, 0.5 * np.pi, rings + 1)
    lift = np.concatenate([np.full(rings + 1, -0.5 * length), np.full(rings + 1, 0.5 * length)])
    latitude = np.concatenate([-angles[::-1], angles])
    return revolved(radius * np.cos(latitude), radius * np.sin(latitude) + lift, segments)


def rounded(outline: Matrix, turn: Vector, length: float, radius: float, rings: int = 6) -> Triangles:
    """Return the surface of all points within a radius of an upright convex solid.

    Args:
        outline: Points on the solid's outline, counter-clockwise, shape (k, 2) [m].
        turn: Angle of the outward normal at each point, shape (k,) [rad]; a corner is repeated for each of its normals.
        length: Full extent of the solid along z [m].
        radius: Radius of the rounding [m].
        rings: Number of steps from a vertical side to a horizontal face.
    """
    quarter = np.linspace(0.0, 0.5 * np.pi, rings + 1)
    out = np.stack([np.cos(turn), np.sin(turn)], 1)
    side = [outline + radius * np.cos(angle) * out for angle in quarter]

    half = 0.5 * length + radius * np.sin(np.append(quarter, quarter[-1]))
    middle = np.broadcast_to(outline.mean(axis=0), outline.shape)
    upper = [np.column_stack([ring, np.full(len(ring), z)]) for ring, z in zip([*side, middle], half, strict=True)]
    circles = [*(ring * [1.0, 1.0, -1.0] for ring in upper[::-1]), *upper]
    return Triangles(np.concatenate(circles), wrap(len(circles), len(outline)))


def wrap(rings: int, sides: int) -> Faces:
    """Return the faces between consecutive rings of vertices; the first and the last ring are left open."""
    ring, side = (a.reshape(-1) for a in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    a = ring * sides + side
    b = ring * sides + (side + 1) % sides
    return np.concatenate([np.stack([a, b, b + sides], 1), np.stack([a, b + sides, a + sides], 1)])


def _signed_area(polygon: Matrix) -> float:
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _quad(a: Vector, b: Vector, height: float) -> NDArray[np.float64]:
    """Return a vertical wall above the edge from a to b as two triangles, shape (2, 3, 3), facing to its right."""
    z = 0.5 * height
    low = [[*a, -z], [*b, -z]]
    high = [[*a, z], [*b, z]]
    return np.array([[low[0], low[1], high[1]], [low[0], high[1], high[0]]])
