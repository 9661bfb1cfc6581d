"""A second, independent answer to "is this configuration free?", used to certify paths before they are returned.

It shares no state with the checks that planners use: forward kinematics in numpy instead of Pinocchio, its own bounding
boxes instead of a broadphase tree, and a fresh coal request for every pair. Reused collision data keep the last
support points as a first guess and have been seen to miss about 3 overlaps in 100,000 near contacts.
"""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Mask, Matrix
from rrtik_ompl.collision.bodies import Body
from rrtik_ompl.collision.containment import Containment
from rrtik_ompl.robot import Robot

CHUNK = 256  # configurations at a time, to bound memory


class Certificate:
    """Collision test of configurations against fixed pairs of bodies."""

    def __init__(self, robot: Robot, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> None:
        self._robot, self._bodies = robot, bodies
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self._joints = np.array([b.joint for b in bodies], dtype=np.int64)
        self._placements = np.array([b.placement.homogeneous for b in bodies]).reshape(-1, 4, 4)
        self._centres, self._halves = _local_boxes(bodies)
        self._containment = Containment(bodies, pairs)

    def free(self, Q: Matrix) -> Mask:
        """Which rows of Q, shape (m, dof), are collision-free. Shape (m,)."""
        return np.array([not found for found in self._first(Q)], dtype=bool)

    def first_pairs(self, Q: Matrix) -> tuple[tuple[str, str] | None, ...]:
        """For each row of Q the names of one colliding pair, or None."""
        return tuple(
            None if not found else (self._bodies[found[0]].name, self._bodies[found[1]].name)
            for found in self._first(Q)
        )

    def _first(self, Q: Matrix) -> list[tuple[int, ...]]:
        """For each row of Q the numbers of one colliding pair of bodies, or ()."""
        found: list[tuple[int, ...]] = []
        for start in range(0, len(Q), CHUNK):
            found += self._first_of_chunk(self._robot.joint_frames(Q[start : start + CHUNK]))
        return found

    def _first_of_chunk(self, frames: NDArray[np.float64]) -> list[tuple[int, ...]]:
        poses = frames[:, self._joints] @ self._placements
        found: list[tuple[int, ...]] = [()] * len(frames)
        for row, pair in zip(*np.nonzero(self._near(poses)), strict=True):
            if not found[row]:
                i, j = (int(body) for body in self._pairs[pair])
                if overlap(self._bodies[i].geometry, poses[row, i], self._bodies[j].geometry, poses[row, j]):
                    found[row] = (i, j)
        if self._containment.pairs:
            found = [pair or self._containment.first(frames[row]) for row, pair in enumerate(found)]
        return found

    def _near(self, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which pairs have overlapping bounding boxes, shape (m, pairs)."""
        centres = np.einsum("mgij,gj->mgi", poses[..., :3, :3], self._centres) + poses[..., :3, 3]
        halves = np.einsum("mgij,gj->mgi", np.abs(poses[..., :3, :3]), self._halves)
        a, b = self._pairs[:, 0], self._pairs[:, 1]
        gaps = np.abs(centres[:, a] - centres[:, b]) - halves[:, a] - halves[:, b]
        near: NDArray[np.bool_] = (gaps <= 1e-9).all(axis=2)
        return near


def overlap(first: Any, first_pose: NDArray[np.float64], second: Any, second_pose: NDArray[np.float64]) -> bool:
    """Whether two coal geometries at poses, shape (4, 4), touch; asked with fresh request and result."""
    transforms = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    result = coal.CollisionResult()
    return bool(coal.collide(first, transforms[0], second, transforms[1], coal.CollisionRequest(), result))


def _local_boxes(bodies: tuple[Body, ...]) -> tuple[Matrix, Matrix]:
    """Centres and half extents of the bodies' own bounding boxes, shapes (g, 3); a half-space has an endless one."""
    centres, halves = np.zeros((len(bodies), 3)), np.full((len(bodies), 3), 1e9)
    for k, body in enumerate(bodies):
        if not isinstance(body.geometry, coal.Halfspace):
            box = body.geometry.aabb_local
            centres[k], halves[k] = box.center(), 0.5 * np.array([box.width(), box.height(), box.depth()])
    return centres, halves
