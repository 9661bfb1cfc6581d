"""Bodies wholly inside a mesh. Coal's meshes are hollow surfaces, so what has slipped through one looks free to it."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.solids import inside_mesh, is_mesh, mesh_arrays
from rrtik_ompl.shapes import Mesh


class Containment:
    """The pairs of a world in which one body is a mesh large enough to hold the other.

    If two surfaces do not cross, one body is either wholly inside the other or wholly outside, so one point decides.
    """

    def __init__(self, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> None:
        both_ways = [*pairs, *((j, i) for i, j in pairs)]
        solid = {o for o in {o for o, _ in both_ways} if _has_inside(bodies[o])}
        self.pairs = [(o, i) for o, i in both_ways if o in solid and _may_hold(bodies[o].geometry, bodies[i].geometry)]
        outer, inner = ([bodies[p[k]] for p in self.pairs] for k in (0, 1))
        self._outer_joint = np.array([b.joint for b in outer], dtype=np.int64)
        self._inner_joint = np.array([b.joint for b in inner], dtype=np.int64)
        self._to_outer = np.array([b.placement.inverse().homogeneous for b in outer]).reshape(-1, 4, 4)
        points = [b.placement.act(_reference_point(b.geometry)) for b in inner]
        self._points = np.array([[*p, 1.0] for p in points]).reshape(-1, 4)
        self._centres = np.array([b.geometry.aabb_local.center() for b in outer]).reshape(-1, 3)
        self._halves = np.array([_half_extents(b.geometry) for b in outer]).reshape(-1, 3)
        self._meshes = {o: mesh_arrays(bodies[o].geometry) for o, _ in self.pairs}

    def first(self, frames: NDArray[np.float64]) -> tuple[int, int] | tuple[()]:
        """Numbers of two bodies of which one holds the other, or ().

        Args:
            frames: Pose of every joint frame in the world, world first, shape (joints + 1, 4, 4).
        """
        if not self.pairs:
            return ()
        world = np.einsum("pij,pj->pi", frames[self._inner_joint], self._points)
        rotation, origin = frames[self._outer_joint, :3, :3], frames[self._outer_joint, :3, 3]
        in_joint = np.einsum(
            "pji,pj->pi", rotation, world[:, :3] - origin
        )  # the inverse of a rotation is its transpose
        local = np.einsum("pij,pj->pi", self._to_outer[:, :3, :3], in_joint) + self._to_outer[:, :3, 3]
        for k in np.flatnonzero((np.abs(local - self._centres) <= self._halves).all(axis=1)):
            if inside_mesh(*self._meshes[self.pairs[k][0]], local[k]):
                return self.pairs[k]
        return ()


def _has_inside(body: Body) -> bool:
    """Whether a body is a hollow mesh that stands for a solid: a link's always does, another one if it is closed."""
    return is_mesh(body.geometry) and (body.kind == "link" or Mesh(*mesh_arrays(body.geometry)).closed)


def _may_hold(outer: Any, inner: Any) -> bool:
    if isinstance(inner, coal.Halfspace):
        return False
    return bool(_half_extents(inner).max() <= outer.aabb_radius)


def _half_extents(geometry: Any) -> NDArray[np.float64]:
    box = geometry.aabb_local
    return 0.5 * np.array([box.width(), box.height(), box.depth()])


def _reference_point(geometry: Any) -> Any:
    """A point of the body in its own frame."""
    if is_mesh(geometry):
        return np.array(geometry.vertex(0))
    return np.mean(geometry.points(), axis=0) if isinstance(geometry, coal.ConvexBase) else np.zeros(3)
