"""Make and examine coal geometries: convex hulls and their planes, meshes and their interiors, a robot's solids."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from operator import itemgetter
from typing import Any, TypeAlias, TypeVar, cast

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import LARGEST, Matrix, Vector, box_of, distinct, products, welded
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.shapes.mesh import mended
from rrtik_ompl.model.shapes.mesh_repair import edges_of
from rrtik_ompl.model.shapes.point_tree import curve_places

Found = TypeVar("Found")
# Two placed geometries: the first geometry, its coal.Transform3s, the second geometry, its coal.Transform3s.
Ends: TypeAlias = tuple[Any, Any, Any, Any]

# A mesh counts as convex, and is replaced by its convex hull, if no triangle lies deeper below the hull than this [m].
# The hull contains the mesh, so no collision is missed. Volumes are compared first, as that is quick.
DEEPEST_DENT = 1e-6
CONVEX_VOLUME_RATIO = 0.999
COMPARED_AT_ONCE = 20_000  # pairs of a triangle and a face of the hull that are compared in one step
_CORNERS = itemgetter(0, 1, 2)  # of one of coal's triangles
BOX_POINTS = 32  # points of a box, in the search for those that are farthest along directions
NEAREST_FACES = 8  # faces of the hull, of normals like its own, that a triangle is compared with first
MOST_COMPARED = 400_000_000  # A mesh with more pairs of a triangle and a face of the hull stays a mesh.

THINNEST_FACE = 1e-6  # least height of a face over its longest side, for its normal to be reliable
SMALLEST_AREA = 1e-18  # [m^2] twice the area below which a triangle has no usable normal

FLATTEST = 1e-7  # least ratio of a hull's thickness to its extent; flatter hulls are refused
SMALLEST = 1e-6  # [m] least extent of a hull
MOST_PLANES = 64  # most planes of an outer polyhedron; with fewer planes it only becomes larger


def once_per_geometry(find: Callable[[Any], Found]) -> Callable[[Any], Found]:
    """Return a function of a coal geometry that computes its answer once per object and forgets it with the object.

    The answer must not refer to the geometry, as otherwise the geometry would never be freed.
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
    """Return a coal mesh (bounding volume hierarchy) from vertices, shape (n, 3), and triangles, shape (m, 3)."""
    if len(vertices) == 1:
        # Coal's bindings take an array of one row for a column, and read what lies behind it in memory.
        vertices = np.repeat(vertices, 2, axis=0)

    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(vertices))
    model.addVertices(np.ascontiguousarray(vertices))
    model.addTriangles(np.ascontiguousarray(triangles))
    model.endModel()
    return model


def hull(points: Matrix) -> coal.Convex:
    """Return the convex hull of points, shape (n, 3), as a coal solid.

    Raises:
        InputError: If the points lie (nearly) in a plane or are too close together or too far apart; qhull would end
            the process.
    """
    extent = _extent(points)
    thickness = _thickness(points)
    if not thickness >= FLATTEST * extent or not SMALLEST <= extent <= LARGEST:
        raise InputError(
            f"a solid of {extent:.3g} m across and {thickness:.3g} m thick is too flat, too small or too large to check"
        )

    cloud = coal.StdVec_Vec3s()
    cloud.extend(list(points))
    return coal.Convex.convexHull(cloud, True, "Qt")


def _extent(points: Matrix) -> float:
    low, high = box_of(points)
    return float((high - low).max())


def _thickness(points: Matrix) -> float:
    """Return a measure of the points' spread along the direction in which they spread least [m].

    It is the smallest singular value of the centred points, shape (n, 3).
    """
    return float(principal_axes(points)[0][-1])


def principal_axes(points: Matrix) -> tuple[Vector, Matrix]:
    """Return the singular values of centred points, shape (n, 3), descending, and the axes that go with them as rows.

    The points are reduced to a triangular matrix first, by Gram and Schmidt's method, whose factor is accurate to
    rounding [72]: a decomposition of all points would wake the threads of the library of linear algebra.
    """
    columns = [column.copy() for column in (points - points.mean(axis=0)).T]
    triangle = np.zeros((3, 3))
    for row in range(3):
        triangle[row, row] = length = float(np.sqrt((columns[row] ** 2).sum()))
        unit = columns[row] / max(length, 1e-300)
        for other in range(row + 1, 3):
            triangle[row, other] = share = float((unit * columns[other]).sum())
            columns[other] -= share * unit
    _, sizes, axes = np.linalg.svd(triangle)
    return sizes, axes


def farthest_along(points: Matrix, normals: Matrix) -> Vector:
    """Return the largest dot product of any of the points with each normal, shape (k,).

    Only boxes of points that may hold the farthest one are looked into, so that many points and normals take little
    more time than a tenth of their number.

    Args:
        points: Shape (n, 3).
        normals: Shape (k, 3).
    """
    if len(points) <= 4 * BOX_POINTS:
        return np.asarray(products(normals, points).max(axis=1))

    boxes = _boxes_of_points(points)
    centres = 0.5 * (boxes.min(axis=1) + boxes.max(axis=1))
    halves = 0.5 * np.ptp(boxes, axis=1)
    found = np.empty(len(normals))
    step = max(COMPARED_AT_ONCE * 10 // len(boxes), 1)
    for begin in range(0, len(normals), step):
        part = normals[begin : begin + step]
        bounds = products(part, centres) + products(np.abs(part), halves)
        best = np.einsum("npj,nj->np", boxes[bounds.argmax(axis=1)], part).max(axis=1)
        rows, may_hold = np.nonzero(bounds > best[:, None])
        heights = np.einsum("npj,nj->np", boxes[may_hold], part[rows]).max(axis=1, initial=-np.inf)
        np.maximum.at(best, rows, heights)
        found[begin : begin + step] = best
    return found


def _boxes_of_points(points: Matrix) -> NDArray[np.float64]:
    """Return points in groups that are close together, shape (g, BOX_POINTS, 3); the last group repeats one point."""
    ordered = points[np.argsort(curve_places(points.astype(np.float32)), kind="stable")]
    missing = -len(points) % BOX_POINTS
    return np.concatenate([ordered, np.repeat(ordered[-1:], missing, axis=0)]).reshape(-1, BOX_POINTS, 3)


def convexified(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """Return the convex hull of a mesh that is convex (see ``DEEPEST_DENT``), and any other geometry unchanged."""
    return around(geometry) if fills_its_hull(geometry) and _is_convex(geometry) else geometry


@once_per_geometry
def _is_convex(geometry: coal.CollisionGeometry) -> bool:
    """Check whether a mesh that nearly fills its convex hull has no dent either."""
    vertices, triangles = mesh_arrays(geometry)
    hull_solid = around(geometry)
    if len(triangles) * hull_solid.num_polygons > MOST_COMPARED:
        return False
    return not _has_dent(vertices, triangles, hull_solid)


def fills_its_hull(geometry: coal.CollisionGeometry) -> bool:
    """Check whether a coal geometry is a mesh whose volume is nearly that of its convex hull."""
    return is_mesh(geometry) and _fills_its_hull(geometry)


@once_per_geometry
def _fills_its_hull(geometry: coal.CollisionGeometry) -> bool:
    hull_solid = around(geometry)
    if is_mesh(hull_solid):  # A flat mesh has no hull.
        return False

    vertices, triangles = mesh_arrays(geometry)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volume = abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())) / 6.0
    return bool(volume >= CONVEX_VOLUME_RATIO * hull_solid.computeVolume())


def _has_dent(vertices: Matrix, triangles: NDArray[np.int64], solid: coal.Convex) -> bool:
    """Check whether a triangle may lie deeper below the surface of the convex hull than ``DEEPEST_DENT``.

    No point of a triangle is farther from the plane of a face than the farthest of its corners, whichever face it is.
    So it is enough to find one face that all three corners are near to: among those whose normals are most like the
    triangle's own, or else the one that is nearest to the triangle's middle. Faces that are too thin to have a reliable
    normal are left out: others lie in the same plane.

    Args:
        vertices: Vertices of the mesh, shape (n, 3).
        triangles: Indices of vertices, shape (m, 3).
        solid: The convex hull.
    """
    normals, offsets = _reliable_planes(*convex_arrays(solid))
    if not len(normals):
        return True
    corners = vertices[triangles]

    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    own /= np.maximum(np.linalg.norm(own, axis=1), 1e-300)[:, None]
    outward = np.einsum("ij,ij->i", own, corners.mean(axis=1) - vertices.mean(axis=0))
    own *= np.where(outward < 0.0, -1.0, 1.0)[:, None]

    depth = np.full(len(triangles), np.inf)
    for faces in _similar(normals, own):
        below = offsets[faces, None] - np.einsum("tcj,tj->tc", corners, normals[faces])
        depth = np.minimum(depth, np.abs(below).max(axis=1))

    doubtful = corners[depth > DEEPEST_DENT]
    step = max(COMPARED_AT_ONCE // len(normals), 1)
    for begin in range(0, len(doubtful), step):
        part = doubtful[begin : begin + step]
        nearest = np.abs(offsets - products(part.mean(axis=1), normals)).argmin(axis=1)
        below = offsets[nearest, None] - np.einsum("tcj,tj->tc", part, normals[nearest])
        if (np.abs(below) > DEEPEST_DENT).any():
            return True
    return False


def _reliable_planes(points: Matrix, triangles: NDArray[np.int64]) -> tuple[Matrix, Vector]:
    """Return unit normals and offsets of the faces of a convex solid that are not too thin, shapes (k, 3) and (k,)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    squares = [((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))]
    longest = np.maximum(np.maximum(squares[0], squares[1]), squares[2])
    is_reliable = (areas > THINNEST_FACE * longest) & (areas > SMALLEST_AREA)
    normals, _ = face_normals(points, triangles[is_reliable])
    return normals, np.einsum("ij,ij->i", a[is_reliable], normals)


def _similar(normals: Matrix, wanted: Matrix) -> Iterator[NDArray[np.int64]]:
    """Yield ``NEAREST_FACES`` times the index of a normal that is mostly much like each of the wanted ones, shape (m,).

    They are neighbours along a curve through the normals.
    """
    places = curve_places(np.concatenate([normals, wanted]).astype(np.float32))
    order = np.argsort(places[: len(normals)], kind="stable")
    at = np.searchsorted(places[order], places[len(normals) :])
    for step in range(-(NEAREST_FACES // 2), NEAREST_FACES // 2):
        yield order[np.clip(at + step, 0, len(order) - 1)]


def is_mesh(geometry: coal.CollisionGeometry) -> bool:
    """Check whether a coal geometry is a hollow triangle mesh (all other kinds are solid)."""
    return isinstance(geometry, coal.BVHModelBase)


def vertices_of(geometry: coal.CollisionGeometry) -> Matrix | None:
    """Return the vertices of a mesh or of a convex solid, shape (n, 3) [m]; None for other kinds."""
    if is_mesh(geometry):
        return mesh_arrays(geometry)[0]
    if isinstance(geometry, coal.ConvexBase):
        return np.array(geometry.points(), dtype=np.float64).reshape(-1, 3)
    return None


def of_each(geometries: Iterable[Any], find: Callable[[Any], Found]) -> list[Found]:
    """Apply a function to each geometry and return the results; it is called once for each distinct object."""
    answers: dict[int, Found] = {}
    found = []
    for geometry in geometries:
        key = id(geometry)
        if key not in answers:
            answers[key] = find(geometry)
        found.append(answers[key])
    return found


def around(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """Return a convex solid that contains a coal geometry.

    For a mesh it is the convex hull, or the mesh itself if it is flat; any other geometry is returned as it is.
    """
    hull_solid = _hull_of_mesh(geometry) if is_mesh(geometry) else None
    return geometry if hull_solid is None else hull_solid


@once_per_geometry
def _hull_of_mesh(mesh: coal.CollisionGeometry) -> coal.CollisionGeometry | None:
    """Return the convex hull of a mesh; None if the mesh is flat."""
    vertices, triangles = mesh_arrays(mesh)
    used_vertices = vertices[distinct(triangles)]
    if len(used_vertices) < 4 or not _thickness(used_vertices) >= FLATTEST * _extent(used_vertices):
        return None
    solid = hull(used_vertices)
    solid.computeLocalAABB()
    return solid


@once_per_geometry  # This is slow, as coal hands out one triangle at a time.
def mesh_arrays(geometry: coal.CollisionGeometry) -> tuple[Matrix, NDArray[np.int64]]:
    """Return the vertices, shape (n, 3), and the triangles, shape (m, 3), of a coal mesh, both read-only."""
    vertices = np.array(geometry.vertices(), dtype=np.float64).reshape(-1, 3)
    corners = map(_CORNERS, map(geometry.tri_indices, range(geometry.num_tris)))
    triangles = np.array(list(corners), dtype=np.int64).reshape(-1, 3)
    vertices.flags.writeable = False
    triangles.flags.writeable = False
    return vertices, triangles


def convex_arrays(solid: coal.Convex) -> tuple[Matrix, NDArray[np.int64]]:
    """Return the corners, shape (n, 3), and the triangles, shape (m, 3), of a coal convex solid.

    The triangles are not oriented consistently.
    """
    points = np.array(solid.points(), dtype=np.float64).reshape(-1, 3)
    corners = map(_CORNERS, map(solid.polygons, range(solid.num_polygons)))
    return points, np.array(list(corners), dtype=np.int64).reshape(-1, 3)


def face_normals(points: Matrix, triangles: NDArray[np.int64]) -> tuple[Matrix, Vector]:
    """Return the outward unit normals of a convex solid's faces, shape (k, 3), and twice their areas [m^2], shape (k,).

    Faces without area are left out, so k may be smaller than the number of triangles.

    Args:
        points: Corners of the solid, shape (n, 3).
        triangles: Indices of corners, shape (m, 3).
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
    """Return the planes of a polyhedron around a convex solid: outward unit normals and offsets, shape (k, 4).

    It has at most ``MOST_PLANES`` of the planes of `outward_planes`.
    """
    return most_different(cast(Matrix, outward_planes(solid)), MOST_PLANES)


@once_per_geometry
def outward_planes(solid: coal.Convex) -> Matrix | None:
    """Return outward unit normals and offsets of a convex solid's faces, shape (k, 4); None if it has no thickness.

    A plane is the set of points x with ``normal @ x == offset``. Each plane is moved to the outermost corner along its
    normal, so that the solid lies behind all of them whatever the precision of the faces; almost parallel faces share
    one plane.
    """
    points, triangles = convex_arrays(solid)
    if len(triangles) < 4:
        return None

    normals, areas = face_normals(points, triangles)
    if len(normals) < 4:
        return None

    # The largest of several almost parallel faces comes first and represents them.
    normals = normals[np.argsort(-areas)]
    normals = normals[np.sort(welded(np.round(normals, 6))[0])]
    return np.column_stack([normals, farthest_along(points, normals)])


def most_different(planes: Matrix, count: int) -> Matrix:
    """Choose at most ``count`` planes of different normals, from planes of shape (n, 4).

    The first plane is taken, then again and again the one whose normal is farthest from all those already taken.
    """
    if len(planes) <= count:
        return planes

    x, y, z = np.ascontiguousarray(planes[:, :3].T)
    taken = [0]
    largest_cosine = x * x[0] + y * y[0] + z * z[0]
    while len(taken) < count:
        last = int(np.argmin(largest_cosine))
        taken.append(last)
        np.maximum(largest_cosine, x * x[last] + y * y[last] + z * z[last], out=largest_cosine)
    return planes[taken]


@once_per_geometry
@once_per_geometry
def is_closed(geometry: coal.CollisionGeometry) -> bool:
    """Check whether a coal mesh is closed: triangles pass every edge equally often in both directions.

    The winding numbers of a closed mesh are integers and change only where the surface is crossed.
    """
    vertices, triangles = mesh_arrays(geometry)
    # Vertices at the same place are merged, as many files give each triangle its own vertices.
    corners = welded(vertices)[1][triangles]

    start = corners.ravel()
    end = np.roll(corners, -1, axis=1).ravel()
    edge_keys = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    order = np.argsort(edge_keys)
    first = np.flatnonzero(np.diff(edge_keys[order], prepend=-1))
    return not np.add.reduceat(np.sign(end - start)[order], first).any()


@kept_with
def robot_solids(robot: Robot) -> tuple[Any, ...]:
    """Return the coal geometries of a robot's collision objects in the model's order, convex meshes as solids."""
    return tuple(measured(convexified(closed_if_mended(body.geometry))) for body in robot.collision.geometryObjects)


def closed_if_mended(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """Return an open mesh without the mistakes that keep it from being closed; any other geometry unchanged.

    Links of robots are read by coal, and are mended like a `Mesh` of a scene; what stays open is left as it was.
    """
    better = _closed_if_mended(geometry) if is_mesh(geometry) else None
    return geometry if better is None else better


@once_per_geometry
def _closed_if_mended(geometry: coal.CollisionGeometry) -> coal.BVHModelBase | None:
    """Return an open mesh as a closed one; None if it is closed, or stays open."""
    if is_closed(geometry):
        return None
    vertices, triangles = mended(*mesh_arrays(geometry))
    return bvh(vertices, triangles) if len(triangles) and not edges_of(triangles).open.any() else None


def measured(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """Compute a geometry's bounding box and sphere in place, which coal does not always do, and return the geometry."""
    geometry.computeLocalAABB()
    return geometry


def inside_mesh(vertices: Matrix, triangles: NDArray[np.int64], point: Vector) -> bool:
    """Check whether a point is inside a mesh: whether its generalised winding number exceeds one half in size.

    This works for slightly open meshes too. The solid angle of each triangle is van Oosterom and Strackee's formula
    [37]; their sum over 4 pi is the winding number [38].

    Args:
        vertices: Vertices of the mesh, shape (n, 3).
        triangles: Indices of vertices, shape (m, 3).
        point: The point, shape (3,).
    """
    a, b, c = (vertices[triangles[:, k]] - point for k in range(3))
    length_a, length_b, length_c = (np.linalg.norm(v, axis=1) for v in (a, b, c))

    numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
    denominator = length_a * length_b * length_c
    denominator = denominator + np.einsum("ij,ij->i", a, b) * length_c
    denominator = denominator + np.einsum("ij,ij->i", b, c) * length_a
    denominator = denominator + np.einsum("ij,ij->i", c, a) * length_b
    # Each arctangent is half of a solid angle, so one half of 4 pi becomes pi.
    return bool(abs(np.arctan2(numerator, denominator).sum()) > np.pi)


def solids_of(ends: Ends, margin: float) -> tuple[Ends, float]:
    """Return the two geometries that coal is to compare for a required distance, and the distance it is to use.

    Coal has no penetration depth for hollow meshes. If the margin is negative, so that the two may overlap by some
    depth, meshes are therefore replaced by their convex hulls. A flat mesh has no hull with a depth, so the margin
    becomes 0 and it must not be touched.

    Args:
        ends: Two geometries with their poses.
        margin: Distance that they must keep [m], negative for an allowed penetration depth.

    Returns:
        The geometries to compare, with their poses, and the margin to use [m].
    """
    if margin >= 0.0:
        return ends, margin
    first_hull = around(ends[0])
    second_hull = around(ends[2])
    if is_mesh(first_hull) or is_mesh(second_hull):
        margin = 0.0
    return (first_hull, ends[1], second_hull, ends[3]), margin
