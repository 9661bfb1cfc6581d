"""Bodies wholly inside a mesh. Coal's meshes are hollow surfaces, so what has slipped through one looks free to it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, distinct, frozen
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.enclosure import enclosure
from rrtik_ompl.geometry.collision.shape_table import has_core
from rrtik_ompl.geometry.collision.solids import (
    inside_mesh,
    is_closed,
    is_mesh,
    mesh_arrays,
    once_per_geometry,
    vertices_of,
)

ROUNDING = 1e-9  # [m]
END_POINTS = np.concatenate([np.eye(3), -np.eye(3)])  # of a body about its origin, in half extents


class Containment:
    """The pairs of a world in which one body is a mesh large enough to hold the other.

    If two surfaces do not cross, one body is either wholly inside the other or wholly outside, so one point decides;
    a few more, at the body's ends, show quickly that most bodies are too large for the other's bounding box.

    Attributes:
        pairs: Numbers of the bodies, the one that may hold first.
        ways: For each pair that was given its places in ``pairs``, in the order given and the other one; -1 where the
            second body cannot be inside the first. Shape (given, 2).
    """

    def __init__(
        self, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...], covers: Sequence[Matrix] | None = None
    ) -> None:
        """Prepare the pairs.

        Args:
            bodies: The solids of a world.
            pairs: Numbers of those that must not touch.
            covers: For each body balls that contain it, shape (n, 4), as a first look for :meth:`between`.
        """
        own = body_arrays(bodies)
        listed = np.array(pairs, dtype=np.int64).reshape(-1, 2)

        holding = np.full(len(bodies), -np.inf)  # [m] around the middle of a hollow body that may hold others
        for k in distinct(listed).tolist():
            if _has_inside(bodies[k]):
                holding[k] = bodies[k].geometry.aabb_radius

        both_ways = np.concatenate([listed, listed[:, ::-1]])
        sizes = own.halves.max(axis=1, initial=0.0)
        sizes[[isinstance(body.geometry, CloudSolid) for body in bodies]] = np.inf  # its points are asked one by one
        may_hold = sizes[both_ways[:, 1]] <= holding[both_ways[:, 0]]

        outer, inner = both_ways[may_hold].T
        self.pairs: list[tuple[int, int]] = list(zip(outer.tolist(), inner.tolist(), strict=True))
        self.ways = np.where(may_hold, np.cumsum(may_hold) - 1, -1).reshape(2, -1).T

        self._outer_joint = own.joints[outer]
        self._inner_joint = own.joints[inner]

        held = distinct(inner)
        points = _end_points([bodies[k].geometry for k in held.tolist()], own.halves[held])
        placed = points @ own.placements[held, :3, :3].transpose(0, 2, 1) + own.placements[held, None, :3, 3]
        self._points = placed[np.searchsorted(held, inner)]

        self._to_outer = np.linalg.inv(own.placements)[outer]
        self._centres = own.centres[outer]
        self._halves = own.halves[outer] + ROUNDING

        everywhere = np.array([[0.0, 0.0, 0.0, np.inf]])
        hollow = distinct(outer).tolist()
        self._covers = {o: everywhere if covers is None else covers[o] for o in hollow}
        self._meshes = {o: bodies[o].geometry for o in hollow}

    @cached_property
    def _places(self) -> dict[tuple[int, int], int]:
        """The place of each of the pairs."""
        return {pair: k for k, pair in enumerate(self.pairs)}

    def holds(self, pair: tuple[int, int], frames: NDArray[np.float64]) -> bool:
        """Whether one of two bodies holds the other.

        Args:
            pair: Numbers of the bodies, in either order.
            frames: Pose of every joint frame in the world, world first, shape (joints + 1, 4, 4).
        """
        return any(self._holds(self._places[p], frames) for p in (pair, pair[::-1]) if p in self._places)

    def _holds(self, k: int, frames: NDArray[np.float64]) -> bool:
        inner = frames[self._inner_joint[k]]
        outer = frames[self._outer_joint[k]]
        world = self._points[k] @ inner[:3, :3].T + inner[:3, 3]
        in_joint = (world - outer[:3, 3]) @ outer[:3, :3]  # the inverse of a rotation is its transpose
        local = in_joint @ self._to_outer[k, :3, :3].T + self._to_outer[k, :3, 3]

        if (np.abs(local - self._centres[k]) > self._halves[k]).any():
            return False
        return self._inside(k, local)

    def reached(self, places: NDArray[np.int64], frames: NDArray[np.float64]) -> Mask:
        """Which of some pairs may be such: the ends of the inner body are in the bounding box of the outer one.

        Args:
            places: Places in ``pairs``, shape (k,).
            frames: Poses of all joint frames for each of them, shape (k, joints + 1, 4, 4).
        """
        every = np.arange(len(places))
        inner = frames[every, self._inner_joint[places]]
        outer = frames[every, self._outer_joint[places]]
        to_outer = self._to_outer[places]

        turn = to_outer[:, :3, :3] @ outer[:, :3, :3].transpose(0, 2, 1)
        world = self._points[places] @ inner[:, :3, :3].transpose(0, 2, 1) + inner[:, None, :3, 3]
        local = (world - outer[:, None, :3, 3]) @ turn.transpose(0, 2, 1) + to_outer[:, None, :3, 3]
        inside: Mask = (np.abs(local - self._centres[places, None]) <= self._halves[places, None]).all(axis=(1, 2))
        return inside

    def between(self, pairs: Iterable[tuple[int, int]], joints: Sequence[pin.SE3]) -> bool:
        """Whether in one of some pairs, in either order, a body holds the other.

        Args:
            pairs: Numbers of the bodies.
            joints: ``pinocchio.SE3`` of every joint frame in the world, world first.
        """
        both_ways = (pair for i, j in pairs for pair in ((i, j), (j, i)) if pair in self._places)
        for pair in both_ways:
            k = self._places[pair]
            between = joints[int(self._outer_joint[k])].actInv(joints[int(self._inner_joint[k])])
            in_joint = self._points[k] @ between.rotation.T + between.translation
            local = in_joint @ self._to_outer[k, :3, :3].T + self._to_outer[k, :3, 3]
            if (np.abs(local - self._centres[k]) > self._halves[k]).any():
                continue

            balls = self._covers[pair[0]]
            away = ((balls[:, None, :3] - local) ** 2).sum(axis=2) - (balls[:, None, 3] + ROUNDING) ** 2
            if (away <= 0.0).any() and self._inside(k, local):
                return True
        return False

    def _inside(self, k: int, local: Matrix) -> bool:
        """Whether the end points of a body, shape (6, 3), are inside the mesh that may hold it.

        Surfaces that do not cross have all of a body on one side, but the cells at an open mesh's surface belong to no
        side; hence all of the points are tried there.
        """
        mesh = self._meshes[self.pairs[k][0]]
        return inside_mesh(*mesh_arrays(mesh), local[0]) if is_closed(mesh) else enclosure(mesh).holds(local)


def _has_inside(body: Body) -> bool:
    """Whether a body is a hollow mesh that stands for a solid: a link's always does, another one if it is closed."""
    return is_mesh(body.geometry) and (body.kind == "link" or is_closed(body.geometry))


def _end_points(geometries: Sequence[Any], halves: Matrix) -> NDArray[np.float64]:
    """Six points of each body in its own frame, its extremes along the axes, shape (n, 6, 3).

    Args:
        geometries: The bodies.
        halves: Half extents of their bounding boxes [m], shape (n, 3).
    """
    points: NDArray[np.float64] = END_POINTS * halves[:, None, :]
    for k, geometry in enumerate(geometries):
        if not has_core(geometry):
            points[k] = _extremes(geometry)
    return points


@once_per_geometry
def _extremes(geometry: coal.CollisionGeometry) -> Matrix:
    """The vertices of a mesh or a convex solid that are farthest along the axes, shape (6, 3); 0 of other kinds."""
    points = vertices_of(geometry)
    if points is None:
        return np.zeros((6, 3))
    if is_mesh(geometry):  # not all vertices need be of a triangle
        points = points[distinct(mesh_arrays(geometry)[1])]
    return frozen(points[np.concatenate([points.argmin(axis=0), points.argmax(axis=0)])])
