"""Find bodies that are wholly inside a mesh. Coal's meshes are hollow, so coal sees no collision there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
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
from rrtik_ompl.geometry.collision.enclosure import enclosure, with_enclosed_boxes
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
# End points of a body about its origin, in units of its half extents, shape (6, 3).
END_POINTS = np.concatenate([np.eye(3), -np.eye(3)])


class Containment:
    """The pairs of a world in which one body is a mesh large enough to contain the other.

    If two surfaces do not cross, one body is either wholly inside the other or wholly outside, so a single point
    decides. Six points are used, at the ends of the body: most bodies have an end outside the other's bounding box,
    which shows quickly that they are not inside.

    Attributes:
        pairs: Pairs of body numbers, the body that may contain the other first.
        rows_of_pairs: For each pair given, its indices in ``pairs``: with the first body as the outer one, and with the
            second as the outer one; -1 where that is impossible. Shape (given, 2).
    """

    def __init__(
        self, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...], covers: Sequence[Matrix] | None = None
    ) -> None:
        """Select the pairs in which one body may contain the other.

        Args:
            bodies: The bodies of a world.
            pairs: Numbers of the bodies that must not touch.
            covers: For each body balls that contain it, shape (n, 4), in the body's frame. :meth:`between` uses them to
                reject points quickly.
        """
        arrays = body_arrays(bodies)
        pair_array = np.array(pairs, dtype=np.int64).reshape(-1, 2)

        # [m] Radius of the ball around each hollow body that may contain others, -inf for the rest.
        holding_radius = np.full(len(bodies), -np.inf)
        for k in distinct(pair_array).tolist():
            if has_inside(bodies[k]):
                holding_radius[k] = bodies[k].geometry.aabb_radius

        both_ways = np.concatenate([pair_array, pair_array[:, ::-1]])
        sizes = arrays.halves.max(axis=1, initial=0.0)
        # Clouds are excluded, as each of their points is checked for itself.
        sizes[[isinstance(body.geometry, CloudSolid) for body in bodies]] = np.inf
        may_hold = sizes[both_ways[:, 1]] <= holding_radius[both_ways[:, 0]]

        outer, inner = both_ways[may_hold].T
        self.pairs: list[tuple[int, int]] = list(zip(outer.tolist(), inner.tolist(), strict=True))
        self.rows_of_pairs = np.where(may_hold, np.cumsum(may_hold) - 1, -1).reshape(2, -1).T

        self._outer_joint = arrays.joints[outer]
        self._inner_joint = arrays.joints[inner]

        inner_bodies = distinct(inner)
        points = _end_points([bodies[k].geometry for k in inner_bodies.tolist()], arrays.halves[inner_bodies])
        rotations = arrays.placements[inner_bodies, :3, :3]
        placed_points = points @ rotations.transpose(0, 2, 1) + arrays.placements[inner_bodies, None, :3, 3]
        self._points = placed_points[np.searchsorted(inner_bodies, inner)]

        self._to_outer = np.linalg.inv(arrays.placements)[outer]
        self._centres = arrays.centres[outer]
        self._halves = arrays.halves[outer] + ROUNDING

        everywhere = np.array([[0.0, 0.0, 0.0, np.inf]])
        outer_bodies = distinct(outer).tolist()
        self._covers = {o: everywhere if covers is None else covers[o] for o in outer_bodies}
        self._meshes = {o: bodies[o].geometry for o in outer_bodies}

    @cached_property
    def _row_of_pair(self) -> dict[tuple[int, int], int]:
        """Return the index in ``pairs`` of each pair."""
        return {pair: k for k, pair in enumerate(self.pairs)}

    def holds(self, pair: tuple[int, int], frames: NDArray[np.float64]) -> bool:
        """Check whether one of two bodies contains the other, whose surfaces do not cross.

        Args:
            pair: Numbers of the bodies, in either order.
            frames: Pose of every joint frame in the world, the world's own first, shape (joints + 1, 4, 4).
        """
        rows = (self._row_of_pair[p] for p in (pair, pair[::-1]) if p in self._row_of_pair)
        return any(self._holds_in_row(row, frames) for row in rows)

    def _holds_in_row(self, row: int, frames: NDArray[np.float64]) -> bool:
        inner = frames[self._inner_joint[row]]
        outer = frames[self._outer_joint[row]]
        world = self._points[row] @ inner[:3, :3].T + inner[:3, 3]
        in_joint = (world - outer[:3, 3]) @ outer[:3, :3]  # the inverse of a rotation is its transpose
        local = in_joint @ self._to_outer[row, :3, :3].T + self._to_outer[row, :3, 3]

        if (np.abs(local - self._centres[row]) > self._halves[row]).any():
            return False
        return self._inside(row, local)

    def reached(self, rows: NDArray[np.int64], frames: NDArray[np.float64]) -> Mask:
        """Check in which pairs all end points of the inner body are in the bounding box of the outer body.

        Only in these may the outer body contain the inner one.

        Args:
            rows: Indices in ``pairs``, shape (k,).
            frames: Poses of all joint frames for each of them, shape (k, joints + 1, 4, 4).

        Returns:
            Mask of shape (k,).
        """
        every_row = np.arange(len(rows))
        inner = frames[every_row, self._inner_joint[rows]]
        outer = frames[every_row, self._outer_joint[rows]]
        to_outer = self._to_outer[rows]

        turn = to_outer[:, :3, :3] @ outer[:, :3, :3].transpose(0, 2, 1)
        world = self._points[rows] @ inner[:, :3, :3].transpose(0, 2, 1) + inner[:, None, :3, 3]
        local = (world - outer[:, None, :3, 3]) @ turn.transpose(0, 2, 1) + to_outer[:, None, :3, 3]
        may_be_inside: Mask = (np.abs(local - self._centres[rows, None]) <= self._halves[rows, None]).all(axis=(1, 2))
        return may_be_inside

    def between(self, pairs: Iterable[tuple[int, int]], joints: Sequence[pin.SE3]) -> bool:
        """Check whether in any of the given pairs one body contains the other.

        Args:
            pairs: Numbers of the bodies, in either order.
            joints: ``pinocchio.SE3`` of every joint frame in the world, the world's own first.
        """
        both_ways = (pair for i, j in pairs for pair in ((i, j), (j, i)) if pair in self._row_of_pair)
        for pair in both_ways:
            row = self._row_of_pair[pair]
            inner_in_outer = joints[int(self._outer_joint[row])].actInv(joints[int(self._inner_joint[row])])
            in_joint = self._points[row] @ inner_in_outer.rotation.T + inner_in_outer.translation
            local = in_joint @ self._to_outer[row, :3, :3].T + self._to_outer[row, :3, 3]
            if (np.abs(local - self._centres[row]) > self._halves[row]).any():
                continue

            balls = self._covers[pair[0]]
            squared_gaps = ((balls[:, None, :3] - local) ** 2).sum(axis=2) - (balls[:, None, 3] + ROUNDING) ** 2
            if (squared_gaps <= 0.0).any() and self._inside(row, local):
                return True
        return False

    def _inside(self, row: int, local: Matrix) -> bool:
        """Check whether the end points of a body, shape (6, 3), are inside the mesh that may contain it.

        For a closed mesh one point decides, as surfaces that do not cross have all of the body on one side. For an open
        mesh all points are tried, as the cells near its surface count neither as inside nor as outside.
        """
        mesh = self._meshes[self.pairs[row][0]]
        return inside_mesh(*mesh_arrays(mesh), local[0]) if is_closed(mesh) else enclosure(mesh).holds(local)


def filled(body: Body) -> Body:
    """Return a link of an open mesh with the faces of the boxes that it encloses; any other body unchanged.

    As long as another body touches neither, none of its points enters or leaves the enclosed cells.
    """
    if body.kind != "link" or not is_mesh(body.geometry) or is_closed(body.geometry):
        return body
    return replace(body, geometry=with_enclosed_boxes(body.geometry))


def has_inside(body: Body) -> bool:
    """Check whether a body is a hollow mesh that represents a solid: a link's always does, others only if closed."""
    return is_mesh(body.geometry) and (body.kind == "link" or is_closed(body.geometry))


def _end_points(geometries: Sequence[Any], halves: Matrix) -> NDArray[np.float64]:
    """Return six points of each body in its own frame, its extremes along the axes, shape (n, 6, 3).

    Args:
        geometries: The geometries of n bodies.
        halves: Half extents of their bounding boxes [m], shape (n, 3).
    """
    points: NDArray[np.float64] = END_POINTS * halves[:, None, :]
    for k, geometry in enumerate(geometries):
        if not has_core(geometry):
            points[k] = _extremes(geometry)
    return points


@once_per_geometry
def _extremes(geometry: coal.CollisionGeometry) -> Matrix:
    """Return the extreme vertices of a mesh or a convex solid along the axes, shape (6, 3); zeros for other kinds."""
    points = vertices_of(geometry)
    if points is None:
        return np.zeros((6, 3))
    # Vertices that belong to no triangle are left out.
    if is_mesh(geometry):
        points = points[distinct(mesh_arrays(geometry)[1])]
    return frozen(points[np.concatenate([points.argmin(axis=0), points.argmax(axis=0)])])
