"""What obstacles and attached bodies are: frozen solids in their own frame, in metres (not how they collide)."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Matrix, Vector, finite_array, frozen, positive
from rrtik_ompl.errors import InputError


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball centred on its frame. ``radius`` in metres."""

    radius: float

    def __post_init__(self) -> None:
        positive(self.radius, "sphere radius")


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder along z, centred on its frame. ``radius`` and full ``length`` in metres."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        positive(self.radius, "cylinder radius")
        positive(self.length, "cylinder length")


@dataclass(frozen=True, slots=True)
class Capsule:
    """A capsule along z, centred on its frame. ``length`` is the distance between the two cap centres, in metres."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        positive(self.radius, "capsule radius")
        positive(self.length, "capsule length")


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A box centred on its frame. ``size``: full side lengths, shape (3,), metres."""

    size: Vector

    def __init__(self, size: ArrayLike) -> None:
        sides = finite_array(size, (3,), "box size")
        if (sides <= 0.0).any():
            raise InputError(f"box size must be three numbers greater than 0, got {sides.tolist()}")
        object.__setattr__(self, "size", frozen(sides))


@dataclass(frozen=True, slots=True, eq=False)
class HalfSpace:
    """The filled side of a plane: points with ``normal . x <= offset``; the free side is ``normal . x > offset``.

    ``normal`` is stored with unit length, and ``offset`` [m] is scaled with it.
    """

    normal: Vector
    offset: float

    def __init__(self, normal: ArrayLike, offset: float = 0.0) -> None:
        direction = finite_array(normal, (3,), "half-space normal")
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            raise InputError("half-space normal must not be the zero vector")
        object.__setattr__(self, "normal", frozen(direction / length))
        object.__setattr__(self, "offset", float(finite_array(offset, (), "half-space offset")) / length)


@dataclass(frozen=True, slots=True, eq=False)
class Prism:
    """A simple polygon in the xy-plane, extruded along z and centred about z = 0.

    Attributes:
        polygon: Vertices in order (either sense), shape (k, 2), metres; convex or not, without self-crossings and
            without places where two sides touch.
        height: Full extent along z [m].
    """

    polygon: Matrix
    height: float

    def __init__(self, polygon: ArrayLike, height: float = 1.0) -> None:
        vertices = _without_repeats(finite_array(polygon, (None, 2), "polygon"))
        if len(vertices) < 3:
            raise InputError(f"polygon needs at least 3 different vertices, got {len(vertices)}")
        _check_simple(vertices)
        object.__setattr__(self, "polygon", frozen(vertices))
        object.__setattr__(self, "height", positive(height, "polygon height"))


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh. A closed mesh counts as a solid, an open one as a surface.

    Attributes:
        vertices: Shape (n, 3), metres.
        triangles: Vertex numbers, shape (m, 3).
        source: Path of the file it was read from, or "".
        scale: The factor that was applied to the file's numbers, kept for writing the scene back.
    """

    vertices: Matrix
    triangles: NDArray[np.int64]
    source: str = ""
    scale: float = 1.0
    open_edges: int = field(default=0)

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike, source: str = "", scale: float = 1.0) -> None:
        what = f"mesh {source}" if source else "mesh"
        points = finite_array(vertices, (None, 3), f"{what}: vertices")
        faces = np.asarray(triangles)
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise InputError(f"{what}: needs at least one triangle (three vertex numbers each); export it triangulated")
        faces = finite_array(faces, (None, 3), f"{what}: triangles").astype(np.int64)
        if faces.min() < 0 or faces.max() >= len(points):
            raise InputError(f"{what}: a triangle names vertex {int(faces.max())}, but there are only {len(points)}")
        points, faces = _welded(points, faces)
        if len(faces) == 0:
            raise InputError(f"{what}: every triangle has zero area; check its scale and export it again")
        object.__setattr__(self, "vertices", frozen(points))
        object.__setattr__(self, "triangles", frozen(faces, np.int64))
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "scale", float(scale))
        object.__setattr__(self, "open_edges", _open_edges(faces))

    @property
    def closed(self) -> bool:
        """Whether every edge is shared by exactly two triangles of opposite sense, so that inside and outside exist."""
        return self.open_edges == 0


Shape: TypeAlias = Sphere | Cylinder | Capsule | Box | HalfSpace | Prism | Mesh


def same_shape(first: Shape, second: Shape) -> bool:
    """Whether two shapes are of one kind and one size."""
    return first is second or (
        type(first) is type(second)
        and all(np.array_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))
    )


def _welded(points: Matrix, faces: NDArray[np.int64]) -> tuple[Matrix, NDArray[np.int64]]:
    """Merge equal vertices (STL repeats them per triangle) and drop triangles that collapse to a line or a point."""
    unique, index = np.unique(points, axis=0, return_inverse=True)
    merged = np.asarray(index).reshape(-1)[faces]
    a, b, c = (unique[merged[:, k]] for k in range(3))
    return unique, merged[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0]


def _open_edges(faces: NDArray[np.int64]) -> int:
    """Count directed edges without exactly one opposite partner: 0 for a closed, consistently oriented surface."""
    edges: NDArray[Any] = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = int(faces.max()) + 1
    forward, count = np.unique(edges[:, 0] * size + edges[:, 1], return_counts=True)
    backward = np.unique(edges[:, 1] * size + edges[:, 0])
    return int((count > 1).sum() + np.setxor1d(forward, backward).size)


def _without_repeats(polygon: Matrix) -> Matrix:
    """The polygon without vertices that the next one repeats, as the first one of a closed ring repeats the last."""
    kept: Matrix = polygon[(polygon != np.roll(polygon, -1, axis=0)).any(axis=1)]
    return kept


def _check_simple(polygon: Matrix) -> None:
    """Raise if two sides of the polygon cross or touch, or if it has no area."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    area = 0.5 * float(np.sum(a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]))
    extent = float(np.ptp(polygon, axis=0).max())
    if abs(area) <= 1e-12 * max(extent * extent, 1e-12):
        raise InputError("polygon has no area: its vertices lie on one line")
    for i in range(len(a)):
        if _side(a[i - 1], a[i], b[i]) == 0.0 and (a[i] - a[i - 1]) @ (b[i] - a[i]) < 0.0:
            raise InputError(f"polygon folds back on itself at vertex {i}; delete it")
        for j in range(i + 2, len(a)):
            if (i, j) != (0, len(a) - 1) and _meet(a[i], b[i], a[j], b[j]):
                raise InputError(f"polygon crosses itself: side {i} meets side {j}; list its vertices in order")


def _meet(p: Vector, q: Vector, r: Vector, s: Vector) -> bool:
    """Whether the segments p q and r s have a point in common."""
    if (np.maximum(p, q) < np.minimum(r, s)).any() or (np.maximum(r, s) < np.minimum(p, q)).any():
        return False
    return _side(p, q, r) * _side(p, q, s) <= 0.0 and _side(r, s, p) * _side(r, s, q) <= 0.0


def _side(u: Vector, v: Vector, w: Vector) -> float:
    """On which side of the line u v the point w lies: positive on the left."""
    return float((v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0]))
