"""Triangle meshes for drawing: crisp edges on smooth surfaces, fewer triangles, polygons, capsules and tubes."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.collision.solids import convex_parts

Faces: TypeAlias = NDArray[np.int64]  # vertex numbers, shape (m, 3)
CREASE = np.deg2rad(35.0)  # faces that meet at a larger angle are drawn with an edge between them


def split_creases(vertices: Matrix, faces: Faces, angle: float = CREASE) -> tuple[Matrix, Faces]:
    """Give both sides of every sharp edge vertices of their own, so that averaged normals shade it as an edge.

    Args:
        vertices: Without duplicates, shape (n, 3).
        faces: Shape (m, 3).
        angle: Edges between faces whose normals differ by more are sharp [rad].

    Returns:
        Vertices, shape (n', 3) with n' >= n used ones, and faces, shape (m, 3), in the same order.
    """
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)  # half-edge h starts at corner h
    first, second = _half_edge_pairs(start, end, len(vertices))
    normals = _unit_normals(vertices, faces)
    smooth = np.einsum("ij,ij->i", normals[first // 3], normals[second // 3]) > np.cos(angle)
    first, second = first[smooth], second[smooth]
    opposed = start[first] == end[second]
    at_start = np.where(opposed, _next_corner(second), second)
    at_end = np.where(opposed, second, _next_corner(second))
    label = _components(np.concatenate([first, _next_corner(first)]), np.concatenate([at_start, at_end]), len(start))
    split = np.empty((label.max() + 1, 3))
    split[label] = vertices[start]
    return split, label.reshape(-1, 3)


def thin_out(vertices: Matrix, faces: Faces, limit: int) -> tuple[Matrix, Faces]:
    """Merge neighbouring vertices on a grid, coarser and coarser, until at most ``limit`` triangles remain.

    A mesh that is small enough comes back unchanged. Each merged vertex stands at the mean of those it replaces.
    """
    extent = float(np.ptp(vertices, axis=0).max())
    cell = extent / 400.0
    thin_vertices, thin_faces = vertices, faces
    while len(thin_faces) > limit and cell < extent:
        thin_vertices, thin_faces = _cluster(vertices, faces, cell)
        cell *= max(1.1, 0.9 * np.sqrt(len(thin_faces) / limit))  # the number of triangles goes with the cell's area
    return thin_vertices, thin_faces


def extruded(polygon: Matrix, height: float) -> tuple[Matrix, Faces]:
    """Closed prism over a simple polygon, shape (k, 2), from z = -height/2 to +height/2."""
    ring = polygon if _signed_area(polygon) > 0.0 else polygon[::-1]
    walls = [_quad(a, b, height) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    fans = [np.stack([part[[0, k, k + 1]] for k in range(1, len(part) - 1)]) for part in convex_parts(ring)]
    cap = np.concatenate(fans)  # triangles in the plane, shape (m, 3, 2)
    z = np.full((*cap.shape[:2], 1), 0.5 * height)
    top, bottom = np.concatenate([cap, z], axis=2), np.concatenate([cap, -z], axis=2)[:, ::-1]
    corners = np.concatenate([top, bottom, *walls]).reshape(-1, 3)
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    return vertices, np.asarray(index, dtype=np.int64).reshape(-1, 3)


def capsule(radius: float, length: float, segments: int = 24) -> tuple[Matrix, Faces]:
    """Capsule along z about the origin; ``length`` is the distance between the two cap centres."""
    rings = segments // 4
    angles = np.linspace(0.0, 0.5 * np.pi, rings + 1)
    lift = np.concatenate([np.full(rings + 1, -0.5 * length), np.full(rings + 1, 0.5 * length)])
    latitude = np.concatenate([-angles[::-1], angles])
    radii, heights = radius * np.cos(latitude), radius * np.sin(latitude) + lift
    turn = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    x, y = np.outer(radii, np.cos(turn)), np.outer(radii, np.sin(turn))
    circles = np.stack([x, y, np.broadcast_to(heights[:, None], x.shape)], 2)
    return circles.reshape(-1, 3), _wrap(len(radii), segments)


def rounded(outline: Matrix, turn: Vector, length: float, radius: float, rings: int = 6) -> tuple[Matrix, Faces]:
    """What lies within a radius of an upright convex solid: its surface.

    Args:
        outline: Points on the solid's outline, anticlockwise, shape (k, 2).
        turn: Angles of the outward normal at each of them, shape (k,) [rad]; a corner is repeated, once for each.
        length: Full extent of the solid along z.
        radius: Of the edges.
        rings: Steps from an upright side to a face.
    """
    quarter = np.linspace(0.0, 0.5 * np.pi, rings + 1)
    out = np.stack([np.cos(turn), np.sin(turn)], 1)
    side = [outline + radius * np.cos(angle) * out for angle in quarter]
    half = 0.5 * length + radius * np.sin(np.append(quarter, quarter[-1]))
    middle = np.broadcast_to(outline.mean(axis=0), outline.shape)
    upper = [np.column_stack([ring, np.full(len(ring), z)]) for ring, z in zip([*side, middle], half, strict=True)]
    circles = [*(ring * [1.0, 1.0, -1.0] for ring in upper[::-1]), *upper]
    return np.concatenate(circles), _wrap(len(circles), len(outline))


def tube(points: Matrix, radius: float, sides: int = 8) -> tuple[Matrix, Faces]:
    """Tube of the given radius along a line through at least two points, shape (k, 3)."""
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    across = np.empty_like(points)
    normal = np.eye(3)[int(np.argmin(np.abs(along[0])))]
    for k, direction in enumerate(along):  # carry one normal along the line, so that the tube does not twist
        normal = normal - (normal @ direction) * direction
        normal /= max(float(np.linalg.norm(normal)), 1e-12)
        across[k] = normal
    beside = np.cross(along, across)
    turn = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)[:, None]
    circles = points[:, None] + radius * (np.cos(turn) * across[:, None] + np.sin(turn) * beside[:, None])
    return circles.reshape(-1, 3), _wrap(len(points), sides)


def box_corners(points: ArrayLike) -> Matrix:
    """The eight corners of the axis-aligned box around points, shape (8, 3)."""
    rows = np.asarray(points, dtype=np.float64)
    low, high = rows.min(axis=0), rows.max(axis=0)
    pick = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)], dtype=bool)
    corners: Matrix = np.where(pick, high, low)
    return corners


def _wrap(rings: int, sides: int) -> Faces:
    """Faces between consecutive rings of vertices, first and last ring left open."""
    ring, side = (a.reshape(-1) for a in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    a, b = ring * sides + side, ring * sides + (side + 1) % sides
    return np.concatenate([np.stack([a, b, b + sides], 1), np.stack([a, b + sides, a + sides], 1)])


def _half_edge_pairs(start: Faces, end: Faces, count: int) -> tuple[Faces, Faces]:
    """Numbers of the two half-edges of every edge that belongs to exactly two triangles."""
    key = np.minimum(start, end) * count + np.maximum(start, end)
    _, group, users = np.unique(key, return_inverse=True, return_counts=True)
    group = np.asarray(group).reshape(-1)
    shared = np.flatnonzero(users[group] == 2)
    pairs = shared[np.argsort(group[shared], kind="stable")].reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def _components(rows: Faces, columns: Faces, count: int) -> Faces:
    """Number of the connected component of each of ``count`` nodes, joined by edges rows[k] - columns[k]."""
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _next_corner(half_edge: Faces) -> Faces:
    return half_edge - half_edge % 3 + (half_edge + 1) % 3


def _unit_normals(vertices: Matrix, faces: Faces) -> Matrix:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    unit: Matrix = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return unit


def _cluster(vertices: Matrix, faces: Faces, cell: float) -> tuple[Matrix, Faces]:
    grid = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
    size = grid.max(axis=0) + 1
    _, label = np.unique((grid[:, 0] * size[1] + grid[:, 1]) * size[2] + grid[:, 2], return_inverse=True)
    label = label.reshape(-1)
    count = np.bincount(label)
    means = np.stack([np.bincount(label, vertices[:, k]) / count for k in range(3)], 1)
    merged = label[faces]
    kept = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    merged = merged[kept]
    # Of triangles that now lie upon each other, as the two sides of a thin wall do, one is enough.
    low, middle, high = np.sort(merged, axis=1).T
    _, different = np.unique((low * len(means) + middle) * len(means) + high, return_index=True)
    return means, merged[np.sort(different)].astype(np.int64)


def _signed_area(polygon: Matrix) -> float:
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _quad(a: Vector, b: Vector, height: float) -> NDArray[np.float64]:
    """Upright wall over the side from a to b, seen from the right of it, as two triangles, shape (2, 3, 3)."""
    z = 0.5 * height
    low, high = [[*a, -z], [*b, -z]], [[*a, z], [*b, z]]
    return np.array([[low[0], low[1], high[1]], [low[0], high[1], high[0]]])
