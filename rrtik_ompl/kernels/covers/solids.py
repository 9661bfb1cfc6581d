"""Represent solids as covers need them: a surface of triangles, and the depth of points inside.

Everything here is in the solid's own frame, moved and scaled so that the solid is about one unit across; ``Frame``
converts to and from the frame of the geometry.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, box_of, products, welded
from rrtik_ompl.geometry.collision.solids import inside_mesh, principal_axes
from rrtik_ompl.kernels.covers.points import bounding_balls, distances_to_nearest, farthest_beyond

# Allowance for rounding, relative to the extent of the solid: far above float64's, far below any length that matters.
ROUNDING = 1e-12
CYLINDER_SIDES = 64
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])  # of a cell

Triangles = NDArray[np.float64]  # shape (m, 3, 3): triangle, corner, coordinate


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The frame of a unit-sized solid: ``point = centre + scale * rotation @ local``."""

    centre: Vector
    rotation: Matrix
    scale: float

    def to_local(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert points of the geometry's frame, shape (..., 3), to the frame of the unit-sized solid."""
        moved = products((points - self.centre).reshape(-1, 3), self.rotation.T) / self.scale
        return np.asarray(moved.reshape(points.shape))

    def spheres_out(self, spheres: Matrix, slack: float) -> Matrix:
        """Convert spheres, shape (n, 4), to the geometry's frame.

        Args:
            spheres: Centres and radii in the frame of the unit-sized solid.
            slack: Length relative to the solid's extent that is added to each radius, together with an allowance for
                rounding; negative to shrink the spheres.
        """
        centres = self.centre + self.scale * products(spheres[:, :3], self.rotation)
        rounding = 4e-15 * float(np.abs(self.centre).max())
        grow = slack * self.scale + np.sign(slack) * rounding
        return np.column_stack([centres, self.scale * spheres[:, 3] + grow])


class Solid(Protocol):
    """The properties of a solid that the search for a cover uses."""

    @property
    def triangles(self) -> Triangles:
        """The outward-oriented surface, shape (m, 3, 3); it may lie outside the true surface, never inside."""

    @property
    def rim(self) -> Triangles:
        """Triangles that close an open surface, shape (b, 3, 3); empty for a closed one."""

    @property
    def enclosed(self) -> NDArray[np.float64]:
        """Corners of boxes that an open surface encloses, shape (k, 8, 3); none for a closed one."""

    @property
    def slack(self) -> float:
        """How far the true solid may reach beyond ``triangles`` because of rounding."""

    def depth(self, points: Matrix) -> Vector:
        """Return a lower bound, tight up to rounding, of the depth of points, shape (n, 3): negative outside."""

    def distance(self, points: Matrix) -> Vector:
        """Return the same as ``depth``, more quickly, for points that are known to be inside."""


@dataclass(frozen=True, slots=True, eq=False)
class ConvexSolid:
    """The convex hull of points: all x with ``normals @ x <= offsets``."""

    triangles: Triangles
    normals: Matrix
    offsets: Vector
    slack: float
    rim: Triangles = field(default_factory=lambda: np.empty((0, 3, 3)))
    enclosed: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 8, 3)))

    def depth(self, points: Matrix) -> Vector:
        """Return the smallest distance of each point, shape (n, 3), to one of the planes, negative outside."""
        return np.asarray((self.offsets - products(points, self.normals)).min(axis=1) - self.slack)

    def distance(self, points: Matrix) -> Vector:
        """Return the same as ``depth``."""
        return self.depth(points)


@dataclass(frozen=True, slots=True, eq=False)
class CylinderSolid:
    """A cylinder about z; ``triangles`` is the surface of a prism around it."""

    radius: float
    half_length: float
    triangles: Triangles
    slack: float
    rim: Triangles = field(default_factory=lambda: np.empty((0, 3, 3)))
    enclosed: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 8, 3)))

    def depth(self, points: Matrix) -> Vector:
        """Return the distance of each point, shape (n, 3), to the surface of the cylinder, negative outside."""
        radial = self.radius - np.hypot(points[:, 0], points[:, 1])
        axial = self.half_length - np.abs(points[:, 2])
        outside = -np.hypot(np.minimum(radial, 0.0), np.minimum(axial, 0.0))
        return np.asarray(np.where(outside < 0.0, outside, np.minimum(radial, axial)) - ROUNDING)

    def distance(self, points: Matrix) -> Vector:
        """Return the same as ``depth``."""
        return self.depth(points)


class MeshSolid:
    """A triangle mesh, taken as a solid.

    If the mesh is closed, the solid consists of all points whose winding number is not 0, otherwise of the surface and
    the boxes ``enclosed``. For an open mesh, depth is measured to the surface and to the caps that close it.
    """

    slack = ROUNDING

    def __init__(self, vertices: Matrix, faces: NDArray[np.int64], enclosed: NDArray[np.float64]) -> None:
        self.triangles = vertices[faces]
        self.enclosed = enclosed
        self.rim = rim_caps(vertices, faces)
        self._closed = np.concatenate([self.triangles, self.rim])
        self._centres, self._reach = bounding_balls(self._closed)
        self._corners = self._closed.reshape(-1, 3)
        self._indices = np.arange(len(self._corners)).reshape(-1, 3)

    def depth(self, points: Matrix) -> Vector:
        """Return the distance of each point, shape (n, 3), to the surface and its caps, negative outside."""
        inside = np.array([inside_mesh(self._corners, self._indices, p) for p in points], dtype=bool)
        return np.asarray(np.where(inside, 1.0, -1.0) * (self.distance(points) + ROUNDING) - ROUNDING)

    def distance(self, points: Matrix) -> Vector:
        """Return the distance of each point, shape (n, 3), to the surface and its caps."""
        return distances_to_nearest(points, self._closed, self._centres, self._reach) - ROUNDING


def convex_solid(points: Matrix) -> tuple[ConvexSolid, Frame]:
    """Return the convex hull of points, shape (n, 3), as a solid in the frame of its principal axes, and that frame.

    The hull is computed after every axis is stretched to the same size, which keeps it accurate for very thin solids.

    Raises:
        ValueError: If the points lie in a plane.
    """
    middle = 0.5 * np.add(*box_of(points))
    _, axes = principal_axes(points)
    in_axes = products(points - middle, axes)
    low, high = box_of(in_axes)
    centre = middle + 0.5 * (low + high) @ axes
    extent = high - low
    frame = Frame(centre, axes.T, float(np.linalg.norm(extent)))

    if not extent.min() > 1e-13 * frame.scale:
        raise ValueError("points in a plane")

    local = frame.to_local(points)
    stretch = extent / frame.scale
    hull = ConvexHull(local / stretch, qhull_options="Qt")
    normals = hull.equations[:, :3] / stretch
    length = np.linalg.norm(normals, axis=1)
    normals = normals / length[:, None]
    offsets = -hull.equations[:, 3] / length

    triangles = local[hull.simplices]
    a, b, c = (triangles[:, k] for k in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), normals)
    triangles[outward < 0.0] = triangles[outward < 0.0][:, ::-1]

    heights = [np.einsum("ij,ij->i", triangles[:, k], normals) for k in range(3)]
    planes_beyond_triangles = float((offsets - np.minimum(np.minimum(heights[0], heights[1]), heights[2])).max())
    slack = farthest_beyond(local, normals, offsets) + max(planes_beyond_triangles, 0.0) + ROUNDING
    return ConvexSolid(triangles, normals, offsets, slack), frame


def cylinder_solid(radius: float, half_length: float) -> tuple[CylinderSolid, Frame]:
    """Return a cylinder about z as a solid, whose triangles are those of a regular prism around it, and its frame."""
    frame = Frame(np.zeros(3), np.eye(3), 2.0 * float(np.hypot(radius, half_length)))
    unit_radius = radius / frame.scale
    unit_half_length = half_length / frame.scale
    angles = (np.arange(CYLINDER_SIDES) + 0.5) * (TAU / CYLINDER_SIDES)
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) * (unit_radius / np.cos(np.pi / CYLINDER_SIDES))
    return CylinderSolid(unit_radius, unit_half_length, _prism(ring, unit_half_length), ROUNDING), frame


def _prism(ring: Matrix, high: float) -> Triangles:
    """Return the outward triangles of a prism, shape (m, 3, 3).

    Args:
        ring: Corners of its convex base in counter-clockwise order, shape (n, 2).
        high: Half its height.
    """
    low, top = (np.column_stack([ring, np.full(len(ring), z)]) for z in (-high, high))
    low_next = np.roll(low, -1, axis=0)
    top_next = np.roll(top, -1, axis=0)
    zeros = np.zeros_like(low)
    floor = zeros - np.array([0.0, 0.0, high])
    roof = zeros + np.array([0.0, 0.0, high])

    sides = [(low, low_next, top_next), (low, top_next, top), (floor, low_next, low), (roof, top, top_next)]
    return np.concatenate([np.stack(side, axis=1) for side in sides])


def mesh_solid(vertices: Matrix, triangles: NDArray[np.int64], boxes: tuple[Matrix, Matrix]) -> tuple[MeshSolid, Frame]:
    """Return a mesh as a solid, and its frame.

    Degenerate triangles are kept, as they are part of the surface.

    Args:
        vertices: Vertices of the mesh, shape (n, 3).
        triangles: Indices of vertices, shape (m, 3).
        boxes: Lowest and highest corners of boxes that an open mesh encloses, shape (k, 3) each.
    """
    used_vertices, point_of_corner = np.unique(triangles, return_inverse=True)
    first, place = welded(vertices[used_vertices])
    points = vertices[used_vertices[first]]

    low, high = box_of(points)
    frame = Frame(0.5 * (low + high), np.eye(3), float(np.linalg.norm(high - low)))

    enclosed = np.where(CORNERS[None] == 1, boxes[1][:, None], boxes[0][:, None])
    local = frame.to_local(enclosed.reshape(-1, 3)).reshape(-1, 8, 3)
    return MeshSolid(frame.to_local(points), place[point_of_corner.reshape(-1, 3)], local), frame


def rim_caps(vertices: Matrix, faces: NDArray[np.int64]) -> Triangles:
    """Return triangles that close a surface, shape (b, 3, 3): one for each open edge.

    An edge is open if the surface's oriented triangles do not pass it equally often in both directions. The open edges
    form loops (the boundary of a boundary is empty), so the surface is closed by triangles that join the edges of each
    connected group of loops to one point. The open edge of a cap is the one opposite to its first corner.

    Args:
        vertices: Vertices, no two of them equal, shape (n, 3).
        faces: Indices of vertices, shape (m, 3).
    """
    start = faces.T.ravel()
    end = np.roll(faces, -1, axis=1).T.ravel()
    edge_keys = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    edges, edge_of_side = np.unique(edge_keys, return_inverse=True)
    surplus = np.bincount(edge_of_side.ravel(), weights=np.sign(end - start), minlength=len(edges)).astype(np.int64)

    open_edges = np.flatnonzero(surplus)
    low = vertices[edges[open_edges] // len(vertices)]
    high = vertices[edges[open_edges] % len(vertices)]
    is_reversed = (surplus[open_edges] < 0)[:, None]
    ends = np.stack([np.where(is_reversed, low, high), np.where(is_reversed, high, low)], axis=1)
    ends = np.repeat(ends, np.abs(surplus[open_edges]), axis=0)

    if not len(ends):
        return np.empty((0, 3, 3))

    apex = _loop_centres(ends)
    return np.concatenate([apex[:, None], ends], axis=1)


def _loop_centres(ends: NDArray[np.float64]) -> Matrix:
    """Return for each edge the mean of the middles of all edges connected with it, shape (b, 3).

    Args:
        ends: Both ends of each edge, shape (b, 2, 3).
    """
    _, number = welded(ends.reshape(-1, 3))
    start, end = number.reshape(-1, 2).T
    size = int(number.max()) + 1
    links = coo_matrix((np.ones(len(start)), (start, end)), shape=(size, size))
    _, loop_of_vertex = connected_components(links, directed=False)

    loop_of_edge = loop_of_vertex[start]
    edge_counts = np.bincount(loop_of_edge)
    middles = ends.mean(axis=1)
    sums = np.column_stack([np.bincount(loop_of_edge, weights=middles[:, k]) for k in range(3)])
    return np.asarray((sums / np.maximum(edge_counts, 1)[:, None])[loop_of_edge])
