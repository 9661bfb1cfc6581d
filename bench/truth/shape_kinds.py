"""A maker for every kind of shape that the library checks, found in its own tables; several for those that vary."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.shape_table import ROWS
from rrtik_ompl.model.shapes import (
    SHAPES,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    Octree,
    PointCloud,
    Prism,
    Shape,
    Sphere,
)
from rrtik_ompl.model.shapes.surfaces import revolved

Maker = Callable[[np.random.Generator, float], Shape]


def _box(rng: np.random.Generator, size: float) -> Shape:
    return Box(size * rng.uniform(0.4, 1.0, 3))


def _sphere(rng: np.random.Generator, size: float) -> Shape:
    return Sphere(0.5 * size * rng.uniform(0.5, 1.0))


def _cylinder(rng: np.random.Generator, size: float) -> Shape:
    return Cylinder(0.5 * size * rng.uniform(0.4, 1.0), size * rng.uniform(0.4, 1.0))


def _capsule(rng: np.random.Generator, size: float) -> Shape:
    return Capsule(0.3 * size * rng.uniform(0.4, 1.0), size * rng.uniform(0.4, 1.0))


def _half_space(rng: np.random.Generator, size: float) -> Shape:
    """Its free side is above, so that an arm has room on it wherever its frame is."""
    return HalfSpace([*rng.normal(0.0, 0.2, 2), 1.0], -0.5 * size)


def _convex_prism(rng: np.random.Generator, size: float) -> Shape:
    return Prism(_star(rng, size, np.ones(6)), size * rng.uniform(0.3, 0.9))


def _polygon(rng: np.random.Generator, size: float) -> Shape:
    """A star, which is not convex and becomes several pieces."""
    return Prism(_star(rng, size, np.array([1.0, 0.4] * 4)), size * rng.uniform(0.3, 0.9))


def _star(rng: np.random.Generator, size: float, radii: Matrix) -> Matrix:
    corners = len(radii)
    angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False) + rng.uniform(0.0, 0.3, corners)
    around: Matrix = np.column_stack([np.cos(angles), np.sin(angles)])
    return 0.5 * size * radii[:, None] * around


def _closed_mesh(rng: np.random.Generator, size: float) -> Shape:
    """A ball of triangles, pressed flat."""
    vertices, faces = _ball()
    return Mesh(0.5 * size * rng.uniform(0.5, 1.0, 3) * vertices, faces)


def _concave_mesh(rng: np.random.Generator, size: float) -> Shape:
    """A ball with dents."""
    vertices, faces = _ball()
    waves = rng.uniform(2.0, 5.0, 3)
    radii = 0.7 + 0.3 * np.cos(vertices * waves).prod(axis=1)
    return Mesh(0.5 * size * radii[:, None] * vertices, faces)


def _open_mesh(rng: np.random.Generator, size: float) -> Shape:
    """A ball without its lid: a surface."""
    vertices, faces = _ball()
    below = vertices[faces].mean(axis=1)[:, 2] < 0.3
    return Mesh(0.5 * size * rng.uniform(0.6, 1.0) * vertices, faces[below])


def _hollow_mesh(rng: np.random.Generator, size: float) -> Shape:
    """A ball with a closed room inside, whose surface looks inwards."""
    vertices, faces = _ball()
    outer, inner = 0.5 * size * vertices, 0.5 * size * rng.uniform(0.5, 0.8) * vertices
    return Mesh(np.vstack([outer, inner]), np.vstack([faces, faces[:, ::-1] + len(vertices)]))


def _ball() -> tuple[Matrix, np.ndarray]:
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 7)
    ball = revolved(np.cos(latitude), np.sin(latitude), 9)
    return ball.vertices, ball.faces


def _height_field(rng: np.random.Generator, size: float) -> Shape:
    heights = 0.5 * size * rng.uniform(0.1, 1.0, (4, 3))
    return HeightField(heights, cell=size / 4.0, floor=-0.2 * size)


def _octree(rng: np.random.Generator, size: float) -> Shape:
    """Cubes of two sizes, none at the origin of their frame."""
    fine, coarse = size / 12.0, size / 6.0
    places = rng.integers(-3, 3, (24, 3)) + 0.5
    sides = np.where(np.arange(len(places)) % 3 == 0, coarse, fine)
    return Octree(places * coarse, sides)


def _cloud(rng: np.random.Generator, size: float) -> Shape:
    points = rng.normal(size=(300, 3))
    points *= 0.5 * size / np.linalg.norm(points, axis=1)[:, None]
    return PointCloud(points, 0.05 * size)


MAKERS: dict[type[Shape], dict[str, Maker]] = {
    Box: {"box": _box},
    Sphere: {"sphere": _sphere},
    Cylinder: {"cylinder": _cylinder},
    Capsule: {"capsule": _capsule},
    HalfSpace: {"half-space": _half_space},
    Prism: {"prism": _convex_prism, "polygon": _polygon},
    Mesh: {
        "closed mesh": _closed_mesh,
        "concave mesh": _concave_mesh,
        "open mesh": _open_mesh,
        "hollow mesh": _hollow_mesh,
    },
    HeightField: {"height field": _height_field},
    Octree: {"octree": _octree},
    PointCloud: {"point cloud": _cloud},
}


def kinds() -> dict[str, Maker]:
    """Makers by the names of kinds."""
    return {name: maker for makers in MAKERS.values() for name, maker in makers.items()}


def without_maker() -> Iterator[str]:
    """A line for each kind of shape of the library that has no maker here."""
    for shape in dict.fromkeys([*SHAPES.values(), *(row.shape for row in ROWS)]):
        if shape not in MAKERS:
            yield f"{shape.__name__} has no maker in bench/truth/shape_kinds.py; add one to MAKERS"
