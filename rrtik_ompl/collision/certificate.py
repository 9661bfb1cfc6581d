"""A second, independent answer to "is this configuration free?", used to certify paths before they are returned.

It shares no state with the checks that planners use: forward kinematics in numpy instead of Pinocchio, its own bounding
boxes instead of a broadphase tree, and a fresh coal request for every pair. Reused collision data keep the last
support points as a first guess and have been seen to miss about 3 overlaps in 100,000 near contacts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix, Vector
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.containment import Containment
from rrtik_ompl.collision.motion_bound import displacement_weights
from rrtik_ompl.robot import Robot

CHUNK = 256  # configurations at a time, to bound memory
BLOCK = 16  # configurations that stand for each other where they are near
ROOM = 1e-6  # [m] for rounding


class Certificate:
    """Collision test of configurations against fixed pairs of bodies."""

    def __init__(self, robot: Robot, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> None:
        self._robot, self._bodies = robot, bodies
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self._joints = np.array([b.joint for b in bodies], dtype=np.int64)
        self._placements = np.array([b.placement.homogeneous for b in bodies]).reshape(-1, 4, 4)
        self._centres, self._halves = _local_boxes(bodies)
        self._weights = displacement_weights(robot, [b for b in bodies if b.kind != "obstacle"])
        self._movers: Vector = np.sum(self._joints[self._pairs] > 0, axis=1).astype(np.float64)  # 0, 1 or 2 of a pair
        self._half_spaces = list(_half_space_pairs(bodies, pairs))
        self._containment = Containment(bodies, pairs)
        hollow = {frozenset(pair) for pair in self._containment.pairs}
        self._hollow = np.array([frozenset(pair) in hollow for pair in pairs], dtype=bool)

    def free(self, Q: Matrix) -> Mask:
        """Which rows of Q, shape (m, dof), are collision-free. Shape (m,). Quickest where rows follow a path."""
        return np.array([not found for found in self._first(Q)], dtype=bool)

    def first_pairs(self, Q: Matrix) -> tuple[tuple[str, str] | None, ...]:
        """For each row of Q the names of one colliding pair, or None."""
        return tuple(
            None if not found else (self._bodies[found[0]].name, self._bodies[found[1]].name)
            for found in self._first(Q)
        )

    def _first(self, Q: Matrix) -> list[tuple[int, ...]]:
        """For each row of Q the numbers of one colliding pair of bodies, or ()."""
        found: list[tuple[int, ...]] = [()] * len(Q)
        open_rows, close = self._open(Q)
        for start in range(0, len(open_rows), CHUNK):
            part = slice(start, start + CHUNK)
            for row, pair in zip(open_rows[part], self._first_of_chunk(Q[open_rows[part]], close[part]), strict=True):
                found[row] = pair
        return found

    def _open(self, Q: Matrix) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Rows in which something may touch, shape (k,), and for each of them which pairs, shape (k, pairs).

        Of neighbouring rows one in the middle is looked at: a pair whose gap there is wider than what the arm moves
        within the block is apart in all of it.
        """
        rows = np.arange(len(Q))
        middles = np.minimum(rows[::BLOCK] + BLOCK // 2, len(Q) - 1)
        block = rows // BLOCK
        moved = np.abs(Q - Q[middles[block]]) @ self._weights
        reach = np.maximum.reduceat(moved, rows[::BLOCK]) if len(Q) else moved
        close = np.zeros((len(middles), len(self._pairs)), dtype=bool)
        for start in range(0, len(middles), CHUNK):
            part = slice(start, start + CHUNK)
            frames = self._robot.joint_frames(Q[middles[part]])
            gaps = self._gaps(*self._boxes(self._poses(frames)))
            close[part] = gaps <= self._movers * reach[part, None] + ROOM
        concerned = np.asarray(close.any(axis=1))
        open_rows = rows[concerned[block]]
        return open_rows, close[block[open_rows]]

    def _first_of_chunk(self, Q: Matrix, close: NDArray[np.bool_]) -> list[tuple[int, ...]]:
        frames = self._robot.joint_frames(Q)
        poses = self._poses(frames)
        near: NDArray[np.bool_] = close & (self._gaps(*self._boxes(poses)) <= ROOM)
        found: list[tuple[int, ...]] = [()] * len(Q)
        for row, pair in zip(*np.nonzero(near), strict=True):
            if not found[row]:
                i, j = (int(body) for body in self._pairs[pair])
                if overlap(self._bodies[i].geometry, poses[row, i], self._bodies[j].geometry, poses[row, j]):
                    found[row] = (i, j)
        for row in np.flatnonzero((near & self._hollow).any(axis=1)):
            found[row] = found[row] or self._containment.first(frames[row])
        return found

    def _poses(self, frames: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses of the bodies, shape (m, bodies, 4, 4), from those of the joints."""
        poses: NDArray[np.float64] = frames[:, self._joints] @ self._placements
        return poses

    def _boxes(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centres and half extents of the bodies' bounding boxes in the world, shape (m, bodies, 3) each."""
        rotations = poses[..., :3, :3]
        centres = np.einsum("mgij,gj->mgi", rotations, self._centres) + poses[..., :3, 3]
        return centres, np.einsum("mgij,gj->mgi", np.abs(rotations), self._halves)

    def _gaps(self, centres: NDArray[np.float64], halves: NDArray[np.float64]) -> NDArray[np.float64]:
        """Lower bounds of the distances [m] between the pairs' boxes, shape (m, pairs)."""
        a, b = self._pairs[:, 0], self._pairs[:, 1]
        gaps: NDArray[np.float64] = (np.abs(centres[:, a] - centres[:, b]) - halves[:, a] - halves[:, b]).max(axis=2)
        for pair, other, normal, offset in self._half_spaces:
            gaps[:, pair] = centres[:, other] @ normal - offset - halves[:, other] @ np.abs(normal)
        return gaps


def overlap(first: Any, first_pose: NDArray[np.float64], second: Any, second_pose: NDArray[np.float64]) -> bool:
    """Whether two coal geometries at poses, shape (4, 4), touch; asked with fresh request and result."""
    transforms = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    result = coal.CollisionResult()
    return bool(coal.collide(first, transforms[0], second, transforms[1], coal.CollisionRequest(), result))


def _half_space_pairs(
    bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]
) -> Iterator[tuple[int, int, Vector, float]]:
    """Pairs with a half-space that stands still: number of the pair, of the other body, outward normal and offset."""
    for k, pair in enumerate(pairs):
        for first, other in (pair, pair[::-1]):
            body = bodies[first]
            if isinstance(body.geometry, coal.Halfspace) and body.joint == 0:
                normal = np.array(body.placement.rotation @ body.geometry.n)
                yield k, other, normal, float(body.geometry.d + normal @ body.placement.translation)


def _local_boxes(bodies: tuple[Body, ...]) -> tuple[Matrix, Matrix]:
    """Centres and half extents of the bodies' own bounding boxes, shapes (g, 3); a half-space has an endless one."""
    centres, halves = np.zeros((len(bodies), 3)), np.full((len(bodies), 3), 1e9)
    for k, body in enumerate(bodies):
        if not isinstance(body.geometry, coal.Halfspace):
            box = body.geometry.aabb_local
            centres[k], halves[k] = box.center(), 0.5 * np.array([box.width(), box.height(), box.depth()])
    return centres, halves
