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
from rrtik_ompl.collision.motion_bound import approach_weights
from rrtik_ompl.robot import Robot

CHUNK = 256  # configurations at a time, to bound memory
RUNS = (64, 16, 4, 1)  # rows that are looked at together
ROOM = 1e-5  # [m] for rounding, in our arithmetic and in coal's distances


class Certificate:
    """Collision test of configurations against fixed pairs of bodies."""

    def __init__(self, robot: Robot, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> None:
        self._robot, self._bodies = robot, bodies
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self._joints = np.array([b.joint for b in bodies], dtype=np.int64)
        self._placements = np.array([b.placement.homogeneous for b in bodies]).reshape(-1, 4, 4)
        self._centres, self._halves = _local_boxes(bodies)
        self._approach = approach_weights(robot, bodies, pairs).T  # [m per rad or m], shape (dof, pairs)
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
        """For each row of Q the numbers of one colliding pair of bodies, or ().

        Neighbouring rows are looked at together: where two bodies are farther apart at the middle one than they can
        come nearer within the run of rows, they are apart in all of it. What is left open is looked at in shorter runs.
        """
        found: list[tuple[int, ...]] = [()] * len(Q)
        begins, open_ = np.arange(0, len(Q), RUNS[0]), np.ones((-(-len(Q) // RUNS[0]), len(self._pairs)), dtype=bool)
        for size, shorter in zip(RUNS, (*RUNS[1:], 0), strict=True):
            for start in range(0, len(begins), CHUNK):
                part = slice(start, start + CHUNK)
                open_[part] = self._open(Q, begins[part], size, open_[part], found)
            if shorter:
                left = open_.any(axis=1)
                begins = (begins[left, None] + np.arange(0, size, shorter)).ravel()
                open_ = np.repeat(open_[left], size // shorter, axis=0)[begins < len(Q)]
                begins = begins[begins < len(Q)]
        return found

    def _open(
        self, Q: Matrix, begins: NDArray[np.int64], size: int, asked: NDArray[np.bool_], found: list[tuple[int, ...]]
    ) -> NDArray[np.bool_]:
        """Which of the pairs ``asked`` for, shape (runs, pairs), may touch somewhere in runs of rows. Adds to found."""
        middles = np.minimum(begins + size // 2, len(Q) - 1)
        ends = np.minimum(begins + size, len(Q))
        near = np.array([np.abs(Q[a:b] - Q[m]).max(axis=0) for a, b, m in zip(begins, ends, middles, strict=True)])
        approach = near @ self._approach + ROOM
        frames = self._robot.joint_frames(Q[middles])
        poses = self._poses(frames)
        open_: NDArray[np.bool_] = asked & (self._gaps(*self._boxes(poses)) <= approach)
        for run, pair in zip(*(k.tolist() for k in np.nonzero(open_)), strict=True):
            i, j = self._pairs[pair].tolist()
            gap = distance(self._bodies[i].geometry, poses[run, i], self._bodies[j].geometry, poses[run, j])
            open_[run, pair] = gap is None or gap <= approach[run, pair]
            if gap is None:
                found[middles[run]] = (i, j)
            elif self._hollow[pair] and self._containment.holds((i, j), frames[run]):
                rows = slice(middles[run], middles[run] + 1) if open_[run, pair] else slice(begins[run], ends[run])
                found[rows] = [(i, j)] * (rows.stop - rows.start)  # where surfaces stay apart, what is held stays held
        return open_

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


def distance(first: Any, first_pose: Matrix, second: Any, second_pose: Matrix) -> float | None:
    """A lower bound of the distance [m] of two coal geometries at poses, shape (4, 4); None if they touch.

    Asked with fresh request and result.
    """
    transforms = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    result = coal.CollisionResult()
    if coal.collide(first, transforms[0], second, transforms[1], coal.CollisionRequest(), result):
        return None
    return float(result.distance_lower_bound)


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
