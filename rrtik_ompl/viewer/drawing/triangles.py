"""Triangle meshes for drawing: crisp edges on smooth surfaces, fewer triangles, tubes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rrtik_ompl.base.arrays import TAU, Matrix
from rrtik_ompl.model.shapes.surfaces import Faces, wrap

CREASE = np.deg2rad(35.0)  # faces that meet at a larger angle are drawn with an edge between them


def split_creases(vertices: Matrix, faces: Faces, angle: float = CREASE) -> tuple[Matrix, Faces]:
    """Duplicate the vertices at every sharp edge, so that averaged normals show it as an edge.

    Corners of triangles at one vertex are joined across smooth edges only; each connected set becomes a vertex.

    Args:
        vertices: Without duplicates, shape (n, 3).
        faces: Shape (m, 3).
        angle: Edges between faces whose normals differ by more are sharp [rad].

    Returns:
        Vertices, shape (n', 3) with n' >= the number of used ones, and faces, shape (m, 3), in the same order.
    """
    start = faces.reshape(-1)
    end = np.roll(faces, -1, axis=1).reshape(-1)  # half-edge h starts at corner h
    first, second = _half_edge_pairs(start, end, len(vertices))

    normals = _unit_normals(vertices, faces)
    smooth = np.einsum("ij,ij->i", normals[first // 3], normals[second // 3]) > np.cos(angle)
    first = first[smooth]
    second = second[smooth]

    # Match the corners of both half-edges at the same vertex; on a consistent surface the half-edges are opposite.
    opposed = start[first] == end[second]
    at_start = np.where(opposed, _next_corner(second), second)
    at_end = np.where(opposed, second, _next_corner(second))
    label = _components(np.concatenate([first, _next_corner(first)]), np.concatenate([at_start, at_end]), len(start))

    split = np.empty((label.max() + 1, 3))
    split[label] = vertices[start]

    return split, label.reshape(-1, 3)


def _half_edge_pairs(start: Faces, end: Faces, count: int) -> tuple[Faces, Faces]:
    """Return the numbers of the two half-edges of every edge that belongs to exactly two triangles."""
    key = np.minimum(start, end) * count + np.maximum(start, end)
    _, group, users = np.unique(key, return_inverse=True, return_counts=True)
    group = np.asarray(group).reshape(-1)

    shared = np.flatnonzero(users[group] == 2)
    pairs = shared[np.argsort(group[shared], kind="stable")].reshape(-1, 2)

    return pairs[:, 0], pairs[:, 1]


def vertex_normals(vertices: Matrix, faces: Faces) -> Matrix:
    """Return unit normals at vertices: the means of the normals of the triangles there by their areas, shape (n, 3)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(across[:, k], 3), len(vertices)) for k in range(3)], axis=1)
    unit: Matrix = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    return unit


def _unit_normals(vertices: Matrix, faces: Faces) -> Matrix:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    unit: Matrix = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return unit


def _next_corner(half_edge: Faces) -> Faces:
    return half_edge - half_edge % 3 + (half_edge + 1) % 3


def _components(rows: Faces, columns: Faces, count: int) -> Faces:
    """Return the connected component of each of ``count`` nodes, joined by edges rows[k] - columns[k]."""
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def thin_out(vertices: Matrix, faces: Faces, limit: int) -> tuple[Matrix, Faces]:
    """Merge neighbouring vertices on increasingly coarse grids, until at most ``limit`` triangles remain.

    A mesh that is small enough is returned unchanged. Each merged vertex is the mean of those it replaces.
    """
    extent = float(np.ptp(vertices, axis=0).max())
    cell = extent / 400.0
    thin_vertices = vertices
    thin_faces = faces

    while len(thin_faces) > limit and cell < extent:
        thin_vertices, thin_faces = _cluster(vertices, faces, cell)
        # The number of triangles is about inversely proportional to the area of a cell.
        cell *= max(1.1, 0.9 * np.sqrt(len(thin_faces) / limit))
    return thin_vertices, thin_faces


def _cluster(vertices: Matrix, faces: Faces, cell: float) -> tuple[Matrix, Faces]:
    """Merge all vertices in the same cell of a grid to their mean, and drop triangles that become degenerate."""
    grid = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
    size = grid.max(axis=0) + 1
    _, label = np.unique((grid[:, 0] * size[1] + grid[:, 1]) * size[2] + grid[:, 2], return_inverse=True)
    label = label.reshape(-1)

    count = np.bincount(label)
    means = np.stack([np.bincount(label, vertices[:, k]) / count for k in range(3)], 1)

    merged = label[faces]
    kept = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    merged = merged[kept]

    # Keep one of several coincident triangles, which result for example from the two sides of a thin wall.
    low, middle, high = np.sort(merged, axis=1).T
    _, different = np.unique((low * len(means) + middle) * len(means) + high, return_index=True)

    return means, merged[np.sort(different)].astype(np.int64)


def tube(points: Matrix, radius: float, sides: int = 8) -> tuple[Matrix, Faces]:
    """Return a tube along a line through at least two points, shape (k, 3), with ``sides`` sides."""
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)

    across = np.empty_like(points)
    normal = np.eye(3)[int(np.argmin(np.abs(along[0])))]
    for k, direction in enumerate(along):  # carry one normal along the line, so that the tube does not twist
        normal = normal - (normal @ direction) * direction
        normal /= max(float(np.linalg.norm(normal)), 1e-12)
        across[k] = normal

    beside = np.cross(along, across)
    turn = np.linspace(0.0, TAU, sides, endpoint=False)[:, None]
    circles = points[:, None] + radius * (np.cos(turn) * across[:, None] + np.sin(turn) * beside[:, None])
    return circles.reshape(-1, 3), wrap(len(points), sides)


def box_corners(points: ArrayLike) -> Matrix:
    """Return the eight corners of the axis-aligned box around points, shape (8, 3)."""
    rows = np.asarray(points, dtype=np.float64)
    low = rows.min(axis=0)
    high = rows.max(axis=0)

    # Bits 0, 1 and 2 of a corner's number select low or high along x, y and z.
    pick = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)], dtype=bool)
    corners: Matrix = np.where(pick, high, low)
    return corners
