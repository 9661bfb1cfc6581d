"""Solids of every kind of shape in the size of an arm, and coal's solids of the same numbers, for judges."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import coal
import numpy as np
import pinocchio as pin

from rrtik_ompl import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    Octree,
    PointCloud,
    Prism,
    Sphere,
    load_robot,
)
from rrtik_ompl.model.shapes import Shape

SMALL = 1e-3  # [m]: of plates and needles
ELL = np.array([[0, 0], [0.4, 0], [0.4, 0.15], [0.15, 0.15], [0.15, 0.4], [0, 0.4]])
CORNERS = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.4, 0], [0.12, 0.12, 0.4], [0.12, 0.12, 0.06]])
DENTED = [[0, 2, 4], [2, 1, 4], [1, 0, 4], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


def one_of_each(rng: np.random.Generator, size: float) -> dict[str, Shape]:
    """One of each kind, about as large as ``size`` [m]."""
    a, b, c = size * rng.uniform(0.5, 1.0, 3)
    cells = rng.integers(-2, 3, (12, 3)) * 0.25 * size
    return {
        "box": Box([a, b, c]),
        "plate": Box([SMALL, 2.0 * b, 2.0 * c]),
        "needle": Capsule(SMALL, 3.0 * c),
        "ball": Sphere(0.5 * a),
        "capsule": Capsule(0.3 * a, b),
        "cylinder": Cylinder(0.4 * a, b),
        "prism": Prism(2.0 * size * ELL, b),
        "closed mesh": Mesh(2.0 * size * CORNERS[:4], [*DENTED[3:], [0, 2, 1]]),
        "concave mesh": Mesh(2.0 * size * CORNERS, DENTED),
        "open mesh": Mesh(2.0 * size * CORNERS, DENTED[1:]),
        "height field": HeightField(size * rng.uniform(0.2, 1.0, (4, 4)), cell=0.3 * size, floor=0.0),
        "octree": Octree(cells, np.full(len(cells), 0.25 * size)),
        "cloud": PointCloud(size * rng.uniform(-0.5, 0.5, (150, 3)), 0.06 * size),
        "half-space": HalfSpace([0.0, 0.0, 1.0], 0.0),
    }


@cache
def reach_of(name: str) -> float:
    """How far the tip of a shipped robot gets from the origin [m]."""
    robot = load_robot(name)
    rows = np.random.default_rng(0).uniform(*robot.finite_range(), (300, robot.dof))
    return float(np.linalg.norm(robot.fk_batch(rows)[:, :3, 3], axis=1).max())


def coal_solids(shape: Shape) -> list[tuple[coal.CollisionGeometry, pin.SE3]]:
    """Coal's solids of a shape and where they are in it, by the numbers of the shape."""
    here = pin.SE3.Identity()
    match shape:
        case Box():
            return [(coal.Box(*np.asarray(shape.size).tolist()), here)]
        case Sphere():
            return [(coal.Sphere(shape.radius), here)]
        case Capsule():
            return [(coal.Capsule(shape.radius, shape.length), here)]
        case Cylinder():
            return [(coal.Cylinder(shape.radius, shape.length), here)]
        case HalfSpace():
            return [(coal.Halfspace(np.asarray(shape.normal), shape.offset), here)]
        case PointCloud():
            return [(coal.Sphere(shape.radius), _at(point)) for point in np.asarray(shape.points, dtype=float)]
        case HeightField():
            return [
                (coal.Box(shape.cell, shape.cell, float(top - shape.floor)), _at([x, y, 0.5 * (top + shape.floor)]))
                for x, y, top in _columns(shape)
            ]
        case Octree():
            cubes = zip(shape.centres, shape.sides.tolist(), strict=True)
            return [(coal.Box(side, side, side), _at(centre)) for centre, side in cubes]
        case _:  # prisms and meshes: their surfaces
            surface = shape.surface()
            hull = coal.BVHModelOBBRSS()
            hull.beginModel(len(surface.faces), len(surface.vertices))
            vertices = coal.StdVec_Vec3s()
            vertices.extend([np.asarray(v, dtype=float) for v in surface.vertices])
            triangles = coal.StdVec_Triangle()
            triangles.extend([coal.Triangle(*map(int, face)) for face in surface.faces])
            hull.addSubModel(vertices, triangles)
            hull.endModel()
            return [(hull, here)]


def _at(point: object) -> pin.SE3:
    return pin.SE3(np.eye(3), np.asarray(point, dtype=float))


def _columns(field: HeightField) -> Iterator[tuple[float, float, float]]:
    rows, columns = field.heights.shape
    for row in range(rows):
        for column in range(columns):
            x, y = column + 0.5 - 0.5 * columns, row + 0.5 - 0.5 * rows
            yield field.cell * x, field.cell * y, float(field.heights[row, column])
