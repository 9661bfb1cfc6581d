"""Coal geometries: convex hulls and their planes, meshes, what is inside them, and those of a robot."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable
from functools import lru_cache, wraps
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import LARGEST, Matrix, Vector, distinct
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot

if TYPE_CHECKING:
    pass

Found = TypeVar("Found")
Ends: TypeAlias = tuple[Any, Any, Any, Any]  # first geometry, its coal.Transform3s, second geometry, its

# A mesh no triangle of which lies deeper [m] below its convex hull is taken as convex: its hull stands for it. The hull
# contains the mesh, so nothing that touches the mesh is missed. Volumes are compared first, as that is quick.
DEEPEST_DENT = 1e-6
CONVEX_VOLUME_RATIO = 0.999
COMPARED_AT_ONCE = 20_000  # triangles times faces of the hull
MOST_COMPARED = 400_000_000  # the same; a mesh of more stays a mesh

SMALLEST_AREA = 1e-18  # [m^2] of a triangle that has a normal, twice

FLATTEST = 1e-7  # thickness of a hull over its extent; what is flatter is refused
SMALLEST = 1e-6  # [m] extent of a hull
MOST_PLANES = 64  # of the outer polyhedron of a convex solid: fewer planes make it larger, never smaller


def once_per_geometry(find: Callable[[Any], Found]) -> Callable[[Any], Found]:
    """A function of a coal geometry that is called once for each object, and forgets its answer when that is gone.

    What it returns must not hold the geometry, which would otherwise never go.
    """
    answers: dict[int, tuple[weakref.ref[Any], Found]] = {}

    @wraps(find)
    def cached(geometry: coal.CollisionGeometry) -> Found:
        key = id(geometry)
        if key in answers:
            return answers[key][1]

        answer = find(geometry)
        answers[key] = weakref.ref(geometry, lambda _: answers.pop(key, None)), answer
        return answer

    return cached


def bvh(vertices: Matrix, triangles: NDArray[np.int64]) -> coal.BVHModelBase:
    """Coal mesh (bounding-volume hierarchy) from vertices, shape (n, 3), and triangles, shape (m, 3)."""
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(vertices))
    model.addVertices(np.ascontiguousarray(vertices))
    model.addTriangles(np.ascontiguousarray(triangles))
    model.endModel()
    return model


def hull(points: Matrix) -> coal.Convex:
    """Convex hull of points, shape (n, 3), as a coal solid.

    Raises:
        InputError: If the points lie (nearly) in a plane or are too far apart; qhull would end the process.
    """
    extent = _extent(points)
    thickness = _thickness(points)
    if not thickness >= FLATTEST * extent or not SMALLEST <= extent <= LARGEST:
        raise InputError(
            f"a solid of {extent:.3g} m across and {thickness:.3g} m thick is too flat, too small or too large to check"
        )

    cloud = coal.StdVec_Vec3s()
    for point in points:
        cloud.append(np.array(point))
    return coal.Convex.convexHull(cloud, True, "Qt")


def _extent(points: Matrix) -> float:
    return float(np.ptp(points, axis=0).max())


def _thickness(points: Matrix) -> float:
    """Spread of points, shape (n, 3), along the direction in which they spread least [m]."""
    return float(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1])


def convexified(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """The convex hull of a mesh that is convex (see ``DEEPEST_DENT``); any other geometry as it is."""
    if not fills_its_hull(geometry):
        return geometry

    vertices, triangles = mesh_arrays(geometry)
    hull_solid = around(geometry)

    if len(triangles) * hull_solid.num_polygons > MOST_COMPARED:
        return geometry
    return hull_solid if _depth(vertices, triangles, hull_solid) <= DEEPEST_DENT else geometry


def fills_its_hull(geometry: coal.CollisionGeometry) -> bool:
    """Whether a coal geometry is a mesh whose volume is nearly that of its convex hull; False for what is no mesh."""
    return is_mesh(geometry) and _fills_its_hull(geometry)


@once_per_geometry
def _fills_its_hull(geometry: coal.CollisionGeometry) -> bool:
    hull_solid = around(geometry)
    if is_mesh(hull_solid):  # which is flat
        return False

    vertices, triangles = mesh_arrays(geometry)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volume = abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())) / 6.0
    return bool(volume >= CONVEX_VOLUME_RATIO * hull_solid.computeVolume())


def _depth(vertices: Matrix, triangles: NDArray[np.int64], solid: coal.Convex) -> float:
    """At most how far triangles lie below the surface of their convex hull [m].

    All of a triangle is as near to a plane beside the hull as its farthest corner; the plane is that of the face which
    is nearest to the triangle's middle.
    """
    normals, _ = face_normals(*convex_arrays(solid))
    corners = vertices[triangles]

    part_count = 1 + len(triangles) * len(normals) // COMPARED_AT_ONCE
    hull_offsets = np.concatenate([(vertices @ part.T).max(axis=0) for part in np.array_split(normals, part_count)])
    middle_parts = np.array_split(corners.mean(axis=1), part_count)
    nearest = np.concatenate([(hull_offsets - part @ normals.T).argmin(axis=1) for part in middle_parts])

    return float((hull_offsets[nearest, None] - np.einsum("tcj,tj->tc", corners, normals[nearest])).max())


def is_mesh(geometry: coal.CollisionGeometry) -> bool:
    """Whether a coal geometry is a hollow triangle mesh (everything else is solid)."""
    return isinstance(geometry, coal.BVHModelBase)


def vertices_of(geometry: coal.CollisionGeometry) -> Matrix | None:
    """The vertices of a mesh or of a convex solid, shape (n, 3) [m]; None of other kinds."""
    if is_mesh(geometry):
        return mesh_arrays(geometry)[0]
    if isinstance(geometry, coal.ConvexBase):
        return np.array(geometry.points(), dtype=np.float64).reshape(-1, 3)
    return None


def of_each(geometries: Iterable[Any], find: Callable[[Any], Found]) -> list[Found]:
    """What is found of each of some coal geometries; looked for once where several are one object."""
    answers: dict[int, Found] = {}
    found = []
    for geometry in geometries:
        key = id(geometry)
        if key not in answers:
            answers[key] = find(geometry)
        found.append(answers[key])
    return found


def around(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """A convex solid that contains a coal geometry: a mesh's hull (the mesh, if it is flat), a solid itself."""
    hull_solid = _hull_of_mesh(geometry) if is_mesh(geometry) else None
    return geometry if hull_solid is None else hull_solid


@once_per_geometry
def _hull_of_mesh(mesh: coal.CollisionGeometry) -> coal.CollisionGeometry | None:
    """The convex hull of a mesh; None if it is flat."""
    vertices, triangles = mesh_arrays(mesh)
    used_vertices = vertices[distinct(triangles)]
    if len(used_vertices) < 4 or not _thickness(used_vertices) >= FLATTEST * _extent(used_vertices):
        return None
    solid = hull(used_vertices)
    solid.computeLocalAABB()
    return solid


@once_per_geometry  # coal hands out one triangle at a time
def mesh_arrays(geometry: coal.CollisionGeometry) -> tuple[Matrix, NDArray[np.int64]]:
    """Vertices, shape (n, 3), and triangles, shape (m, 3), of a coal mesh, read-only."""
    vertices = np.array(geometry.vertices(), dtype=np.float64).reshape(-1, 3)
    corners = (geometry.tri_indices(k) for k in range(geometry.num_tris))
    triangles = np.array([(t[0], t[1], t[2]) for t in corners], dtype=np.int64).reshape(-1, 3)
    vertices.flags.writeable = False
    triangles.flags.writeable = False
    return vertices, triangles


def convex_arrays(solid: coal.Convex) -> tuple[Matrix, NDArray[np.int64]]:
    """Corners, shape (n, 3), and triangles, shape (m, 3), of a coal convex solid; its triangles turn either way."""
    points = np.array(solid.points(), dtype=np.float64).reshape(-1, 3)
    corners = (solid.polygons(k) for k in range(solid.num_polygons))
    return points, np.array([(t[0], t[1], t[2]) for t in corners], dtype=np.int64).reshape(-1, 3)


def face_normals(points: Matrix, triangles: NDArray[np.int64]) -> tuple[Matrix, Vector]:
    """Outward unit normals of the faces of a convex solid, shape (k, 3), and twice their areas [m^2], shape (k,).

    Faces that have none are left out.
    """
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    faces = areas > SMALLEST_AREA
    normals = normals[faces] / areas[faces, None]

    outward = (a - points.mean(axis=0))[faces]
    return normals * np.where(np.einsum("ij,ij->i", normals, outward) < 0.0, -1.0, 1.0)[:, None], areas[faces]


@once_per_geometry
def outer_planes(solid: coal.Convex) -> Matrix:
    """The planes of the outer polyhedron of a convex solid."""
    return most_different(cast(Matrix, outward_planes(solid)), MOST_PLANES)


@once_per_geometry
def outward_planes(solid: coal.Convex) -> Matrix | None:
    """Outward unit normals and offsets of a coal convex solid's faces, shape (k, 4); None if it has no thickness.

    Each plane is moved to the outermost corner along its normal, so that the solid lies behind all of them whatever
    the faces' own precision; almost parallel faces share one plane.
    """
    points, triangles = convex_arrays(solid)
    if len(triangles) < 4:
        return None

    normals, areas = face_normals(points, triangles)
    if len(normals) < 4:
        return None

    normals = normals[np.argsort(-areas)]  # of almost parallel faces the largest stands for the others
    normals = normals[np.sort(np.unique(np.round(normals, 6), axis=0, return_index=True)[1])]
    return np.column_stack([normals, (points @ normals.T).max(axis=0)])


def most_different(planes: Matrix, count: int) -> Matrix:
    """At most ``count`` of the planes, each time the one whose normal is farthest from those already taken."""
    if len(planes) <= count:
        return planes

    taken = [0]
    largest_cosine = planes[:, :3] @ planes[0, :3]
    while len(taken) < count:
        taken.append(int(np.argmin(largest_cosine)))
        largest_cosine = np.maximum(largest_cosine, planes[:, :3] @ planes[taken[-1], :3])
    return planes[taken]


@once_per_geometry
def is_closed(geometry: coal.CollisionGeometry) -> bool:
    """Whether a coal mesh has an inside: every edge is passed as often one way as the other.

    Then winding numbers are whole, and change only where the surface is crossed.
    """
    vertices, triangles = mesh_arrays(geometry)
    # Vertices at one place are one: many files give each triangle its own.
    _, welded = np.unique(vertices, axis=0, return_inverse=True)
    corners = np.asarray(welded).ravel()[triangles]

    start = corners.ravel()
    end = np.roll(corners, -1, axis=1).ravel()
    edge_keys = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    _, edge_numbers = np.unique(edge_keys, return_inverse=True)
    return not np.bincount(np.asarray(edge_numbers).ravel(), weights=np.sign(end - start)).any()


@lru_cache(maxsize=16)
def robot_solids(robot: Robot) -> tuple[Any, ...]:
    """Coal geometry of every collision object of a robot, convex meshes as solids, in the order of the model."""
    return tuple(measured(convexified(body.geometry)) for body in robot.collision.geometryObjects)


def measured(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """The geometry with its bounding box and sphere computed, which coal leaves undone for some kinds."""
    geometry.computeLocalAABB()
    return geometry


def inside_mesh(vertices: Matrix, triangles: NDArray[np.int64], point: Vector) -> bool:
    """Whether a point lies inside a mesh: generalised winding number above one half (also for slightly open meshes).

    The solid angle of each triangle is van Oosterom and Strackee's formula [37]; their sum over 4 pi is the winding
    number [38].
    """
    a, b, c = (vertices[triangles[:, k]] - point for k in range(3))
    length_a, length_b, length_c = (np.linalg.norm(v, axis=1) for v in (a, b, c))

    numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
    denominator = length_a * length_b * length_c
    denominator = denominator + np.einsum("ij,ij->i", a, b) * length_c
    denominator = denominator + np.einsum("ij,ij->i", b, c) * length_a
    denominator = denominator + np.einsum("ij,ij->i", c, a) * length_b
    return bool(abs(np.arctan2(numerator, denominator).sum()) > np.pi)  # half of 4 pi, as each angle is counted halved


def solids_of(ends: Ends, margin: float) -> tuple[Ends, float]:
    """Two geometries at their places as coal compares them for a margin [m], and the margin that it takes.

    Of hollow meshes coal knows no depth: where bodies may overlap to one, their hulls stand for them. A flat mesh has
    none, and may not be touched.
    """
    if margin >= 0.0:
        return ends, margin
    first_hull = around(ends[0])
    second_hull = around(ends[2])
    if is_mesh(first_hull) or is_mesh(second_hull):
        margin = 0.0
    return (first_hull, ends[1], second_hull, ends[3]), margin
