"""Solids and meshes of every sort, and checks of the spheres that cover them or lie in them."""

import itertools

import coal
import numpy as np
from scipy.spatial import ConvexHull

from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.solids import bvh, inside_mesh, is_closed, is_mesh, mesh_arrays

TOLERANCE = 1e-9
SOLIDS = {
    "box": coal.Box(0.3, 0.2, 0.1),
    "thin box": coal.Box(0.5, 0.4, 1e-4),
    "long box": coal.Box(1.0, 0.02, 0.02),
    "sphere": coal.Sphere(0.1),
    "capsule": coal.Capsule(0.05, 0.4),
    "capsule of no length": coal.Capsule(0.05, 0.0),
    "rod": coal.Capsule(1e-4, 1.0),
    "cylinder": coal.Cylinder(0.1, 0.2),
    "disc": coal.Cylinder(0.2, 0.01),
    "pipe": coal.Cylinder(0.02, 0.8),
}


def hollow_box(size=0.2, wall=0.02):
    """A closed mesh with a cavity."""
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    faces = facing_outward(corners, ConvexHull(corners).simplices)
    inner = corners * (size - 2 * wall)
    return np.concatenate([corners * size, inner]), np.concatenate([faces, faces[:, ::-1] + 8])


def facing_outward(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c - 3 * points.mean(axis=0)) < 0
    return np.where(turned[:, None], faces[:, ::-1], faces)


def torus(big=0.2, small=0.06, n=24, m=14):
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    rho = big + small * np.cos(v)
    vertices = np.stack([rho * np.cos(u), rho * np.sin(u), small * np.sin(v)], axis=-1).reshape(-1, 3)
    faces = []
    for i, j in itertools.product(range(n), range(m)):
        a, b = i * m + j, (i + 1) % n * m + j
        c, d = (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
        faces += [(a, b, c), (a, c, d)]
    return vertices, np.array(faces)


def torus_with_hole(share=0.9):
    vertices, faces = torus()
    return vertices, faces[: int(share * len(faces))]


def soup():
    return np.random.default_rng(3).uniform(-0.2, 0.2, (60, 3)), np.arange(60).reshape(-1, 3)


def turned_over():
    vertices, faces = torus()
    return vertices, np.where((np.arange(len(faces)) % 2 == 0)[:, None], faces, faces[:, ::-1])


MESHES = {
    "torus": torus(),
    "cavity": hollow_box(),
    "inside out": (torus()[0], torus()[1][:, ::-1]),
    "hole": torus_with_hole(),
    "half": torus_with_hole(0.5),
    "soup": soup(),
    "turned over": turned_over(),
    "sheet": (np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])),
    "three sheets": (
        np.concatenate([[[0.0, 0, z], [1, 0, z], [0, 1, z]] for z in (0.0, 0.01, 0.02)]),
        np.arange(9).reshape(3, 3),
    ),
    "doubled": (torus()[0], np.concatenate([torus()[1]] * 2)),
    "with slivers": (torus()[0], np.concatenate([torus()[1], [[0, 0, 1], [5, 5, 5]]])),
}


def mesh_solid(name):
    vertices, faces = MESHES[name]
    return bvh(np.asarray(vertices, dtype=float), faces)


def points_in_triangles(corners, count, rng):
    share = rng.dirichlet((0.6, 0.6, 0.6), (count, 1))
    pick = rng.integers(len(corners), size=count)
    return (share @ corners[pick])[:, 0]


def points_of(geometry, rng, count=6000):
    """Points of a solid: surface, edges, corners and interior."""
    if isinstance(geometry, (coal.Sphere, coal.Capsule)):
        half = geometry.halfLength if isinstance(geometry, coal.Capsule) else 0.0
        way = rng.normal(size=(count, 3))
        way *= geometry.radius * rng.uniform(0.9, 1.0, (count, 1)).round(1) / np.linalg.norm(way, axis=1)[:, None]
        return way + np.outer(rng.uniform(-half, half, count), (0, 0, 1))
    if isinstance(geometry, coal.Cylinder):
        turn = rng.uniform(0, 2 * np.pi, count)
        rho = geometry.radius * np.maximum(rng.uniform(size=count) ** 0.3, rng.integers(2, size=count))
        z = geometry.halfLength * np.clip(rng.uniform(-1.5, 1.5, count), -1, 1)
        return np.column_stack([rho * np.cos(turn), rho * np.sin(turn), z])
    if isinstance(geometry, coal.Box):
        return np.clip(rng.uniform(-1.4, 1.4, (count, 3)), -1, 1) * np.array(geometry.halfSide)
    if is_mesh(geometry):
        return points_of_mesh(geometry, rng, count)
    points = np.array(geometry.points())
    mixed = [rng.dirichlet(np.full(len(points), a), count // 3) @ points for a in (0.02, 0.1, 1.0)]
    return np.concatenate([points, *mixed])


def points_of_mesh(geometry, rng, count):
    vertices, faces = mesh_arrays(geometry)
    corners = vertices[faces]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    work = max(20, min(1500, 3_000_000 // len(faces)))
    some = rng.uniform(low, high, (work, 3))
    if is_closed(geometry):
        inside = [p for p in some if inside_mesh(vertices, faces, p)]
    else:
        inside = [p for p in some if enclosure(geometry).holds(p[None])]
    return np.concatenate(
        [vertices[faces.ravel()], points_in_triangles(corners, count, rng), np.reshape(inside, (-1, 3))]
    )


def gap_outside(points, spheres):
    """Largest distance of a point from the union of balls (negative: all are inside)."""
    worst = -np.inf
    for some in np.array_split(points, max(1, len(points) // 2000)):
        away = np.linalg.norm(some[:, None] - spheres[:, :3], axis=2) - spheres[:, 3]
        worst = max(worst, away.min(axis=1).max())
    return worst
