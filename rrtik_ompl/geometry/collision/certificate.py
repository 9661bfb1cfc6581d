"""Decide a second time, independently, whether configurations are free, to certify paths before they are returned.

These checks share no state with those that planners use: they have forward kinematics in numpy instead of Pinocchio,
their own bounding boxes instead of a broad-phase tree, and a new coal request for every pair. Coal's data keep the last
support points as a first guess; data that were reused have been seen to miss about 3 overlaps in 100,000 near contacts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, kept_apart
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.cloud_solid import LOOK_AHEAD
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.distances import gap_beyond
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.model.robot import Robot

MAX_PAIR_CHECKS = 1 << 16  # pairs of a run and a body pair that are checked in one batch, to bound memory
RUNS = (64, 16, 4, 1)  # lengths of the runs of rows that are checked together, from coarse to fine
FEW = 16  # Up to so many rows are checked one by one, as they mostly do not follow a path.

Numbers: TypeAlias = NDArray[np.int64]


class Certificate:
    """Collision check of configurations for fixed pairs of bodies."""

    def __init__(self, robot: Robot, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> None:
        self._robot = robot
        self._bodies = bodies
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self._boxes = Boxes(bodies)
        self._approach_weights = approach_weights(robot, bodies, pairs)  # [m per rad or m], shape (pairs, dof)
        self._planes = _half_space_pairs(bodies, pairs)
        self._margins = body_arrays(bodies).kept_apart(self._pairs)
        self._containment = Containment(bodies, pairs)

    def free(self, Q: Matrix) -> Mask:
        """Check which rows of Q, shape (m, dof), are collision-free; return a mask of shape (m,).

        This is fastest if the rows are neighbouring waypoints of a path.
        """
        return np.array([not colliding_pair for colliding_pair in self._colliding_pairs(Q)], dtype=bool)

    def first_pairs(self, Q: Matrix) -> tuple[tuple[str, str] | None, ...]:
        """Return the names of one colliding pair for each row of Q, shape (m, dof); None for a free row."""
        return tuple(
            None if not colliding_pair else (self._bodies[colliding_pair[0]].name, self._bodies[colliding_pair[1]].name)
            for colliding_pair in self._colliding_pairs(Q)
        )

    def _colliding_pairs(self, Q: Matrix) -> list[tuple[int, ...]]:
        """Return the body numbers of one colliding pair for each row of Q, shape (m, dof); () for a free row.

        Runs of neighbouring rows are checked together, at their middle row. If two bodies are farther apart there than
        they can approach each other within the run, they are apart in all of its rows. Pairs that remain undecided are
        checked again in shorter runs, down to single rows.
        """
        colliding: list[tuple[int, ...]] = [()] * len(Q)
        run_lengths = RUNS if len(Q) > FEW else RUNS[-1:]
        rows_at_once = run_lengths[0] * max(1, MAX_PAIR_CHECKS // max(1, len(self._pairs)))

        for batch_start in range(0, len(Q), rows_at_once):
            starts = np.arange(batch_start, min(batch_start + rows_at_once, len(Q)), run_lengths[0])
            run_of, pair_of = (k.ravel() for k in np.indices((len(starts), len(self._pairs))))
            for run_length, next_length in zip(run_lengths, (*run_lengths[1:], 0), strict=True):
                may_touch = self._examine(Q, starts, run_length, run_of, pair_of, colliding)
                if not may_touch.any():
                    break
                # The shortest runs are single rows, after which nothing is left to divide.
                if next_length:
                    starts, run_of, pair_of = _divided(
                        starts, run_of[may_touch], pair_of[may_touch], run_length, next_length, len(Q)
                    )

        return colliding

    def _examine(
        self,
        Q: Matrix,
        starts: Numbers,
        run_length: int,
        run_of: Numbers,
        pair_of: Numbers,
        colliding: list[tuple[int, ...]],
    ) -> Mask:
        """Find the pairs that may collide in their runs of rows, and enter the collisions found into ``colliding``.

        Bounding boxes decide first (broad phase); the distances of the remaining pairs are measured one by one.

        Args:
            Q: All configurations, shape (m, dof).
            starts: First row of each run, shape (runs,).
            run_length: Number of rows in a run.
            run_of: Index of the run in which each of k pairs is examined, shape (k,).
            pair_of: Number of each pair, shape (k,).
            colliding: One colliding pair of bodies, or (), for each row of Q; changed in place.

        Returns:
            Mask of the pairs that are not yet decided, shape (k,).
        """
        middles = np.minimum(starts + run_length // 2, len(Q) - 1)
        ends = np.minimum(starts + run_length, len(Q))
        largest_change = np.array(
            [np.abs(Q[a:b] - Q[m]).max(axis=0) for a, b, m in zip(starts, ends, middles, strict=True)]
        )

        frames = self._robot.chain.joint_frames(Q[middles])
        placed = self._boxes.placed(frames)
        approach_bounds = DISTANCE_TOLERANCE + self._approach_within_runs(largest_change, run_of, pair_of)
        may_touch: Mask = self._gaps(placed, run_of, pair_of) <= approach_bounds

        # Narrow phase: measure the distances of the pairs whose boxes are too near, one pair at a time.
        candidates = np.flatnonzero(may_touch)
        runs = run_of[candidates]
        pairs = pair_of[candidates]
        columns = (candidates, runs, pairs, approach_bounds[candidates], self._may_contain(frames, runs, pairs))
        for row, run, pair, approach_bound, may_be_inside in zip(*(k.tolist() for k in columns), strict=True):
            i, j = self._pairs[pair].tolist()
            first, second = ((self._bodies[k].geometry, placed.pose(run, k)) for k in (i, j))
            look_ahead = min(2.0 * approach_bound, LOOK_AHEAD)  # beyond the bound no more has to be known
            gap = distance(*first, *second, margin=float(self._margins[pair]), look_ahead=look_ahead)
            may_touch[row] = gap is None or gap <= approach_bound
            if gap is None:
                colliding[middles[run]] = (i, j)
            elif may_be_inside and self._containment.holds((i, j), frames[run]):
                # If the surfaces stay apart in the whole run, a body inside at the middle is inside in every row.
                rows = slice(middles[run], middles[run] + 1) if may_touch[row] else slice(starts[run], ends[run])
                colliding[rows] = [(i, j)] * (rows.stop - rows.start)

        return may_touch

    def _approach_within_runs(self, largest_change: Matrix, run_of: Numbers, pair_of: Numbers) -> Vector:
        """Return how much nearer than at the middle row the bodies of each pair can come in their run [m], shape (k,).

        Args:
            largest_change: For each run the largest change of each joint from the middle row, shape (runs, dof).
            run_of: Index of the run of each pair, shape (k,).
            pair_of: Number of each pair, shape (k,).
        """
        weights = self._approach_weights
        joints = range(largest_change.shape[1])
        return np.asarray(sum(largest_change[run_of, k] * weights[pair_of, k] for k in joints))

    def _may_contain(self, frames: NDArray[np.float64], run_of: Numbers, pair_of: Numbers) -> Mask:
        """Find the pairs in which one body may be inside the other, a hollow mesh, at the middle of the run.

        Args:
            frames: Poses of all joint frames at the middle of each run, shape (runs, joints + 1, 4, 4).
            run_of: Index of the run of each pair, shape (k,).
            pair_of: Number of each pair, shape (k,).

        Returns:
            Mask of these pairs, shape (k,).
        """
        may_contain = np.zeros(len(pair_of), dtype=bool)
        for rows in self._containment.rows_of_pairs[pair_of].T:
            listed = np.flatnonzero(rows >= 0)
            may_contain[listed] |= self._containment.reached(rows[listed], frames[run_of[listed]])
        return may_contain

    def _gaps(self, placed: PlacedBoxes, run_of: Numbers, pair_of: Numbers) -> Vector:
        """Return lower bounds of the pairs' distances, from their bounding boxes, minus their margins [m], shape (k,).

        A pair with a fixed half-space is measured from the box to the plane.
        """
        sides = [placed.rows(run_of, self._pairs[pair_of, k]) for k in (0, 1)]
        gaps = np.full(len(pair_of), -np.inf)

        for axis in range(3):
            centres = placed.centres[:, axis]
            halves = placed.halves[:, axis]
            axis_gaps = np.abs(centres[sides[0]] - centres[sides[1]]) - (halves[sides[0]] + halves[sides[1]])
            np.maximum(gaps, axis_gaps, out=gaps)

        for plane_pair, (side, normal, offset) in self._planes.items():
            selected = np.flatnonzero(pair_of == plane_pair)
            rows = sides[side][selected]
            gaps[selected] = placed.centres[rows] @ normal - offset - placed.halves[rows] @ np.abs(normal)

        gaps -= self._margins[pair_of]
        return gaps


@dataclass(frozen=True, slots=True, eq=False)
class PlacedBoxes:
    """Axis-parallel boxes around bodies at m configurations of the arm; bodies that stand still have one row for all.

    Attributes:
        centres: Centres of the boxes [m], shape (rows, 3); see :meth:`rows`.
        halves: Half extents of the boxes [m], shape (rows, 3).
        poses: Poses of the bodies, shape (rows, 4, 4).
        first_row: Row of each body in the first configuration, shape (bodies,).
        row_step: Number of rows from one configuration to the next for each body, 0 for bodies that stand still,
            shape (bodies,).
    """

    centres: Matrix
    halves: Matrix
    poses: NDArray[np.float64]
    first_row: NDArray[np.int64]
    row_step: NDArray[np.int64]

    def rows(self, configurations: NDArray[np.int64], bodies: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the rows of bodies at configurations, from their numbers, shape (k,) each."""
        return np.asarray(self.first_row[bodies] + self.row_step[bodies] * configurations)

    def pose(self, configuration: int, body: int) -> Matrix:
        """Return the pose of a body at a configuration, shape (4, 4)."""
        return np.asarray(self.poses[self.first_row[body] + self.row_step[body] * configuration])


class Boxes:
    """Axis-parallel boxes around bodies: a broad phase that never misses a collision."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        arrays = body_arrays(bodies)
        self._moving = np.flatnonzero(arrays.joints > 0)
        self._standing = np.flatnonzero(arrays.joints == 0)
        self._joints = arrays.joints[self._moving]
        self._placements = arrays.placements
        self._centres = arrays.centres
        self._halves = arrays.halves
        self._standing_boxes = self._boxes_at(self._placements[self._standing], self._standing)

    def placed(self, frames: NDArray[np.float64]) -> PlacedBoxes:
        """Return the boxes of all bodies for given poses of the joint frames, shape (m, joints + 1, 4, 4)."""
        poses = (frames[:, self._joints] @ self._placements[self._moving]).reshape(-1, 4, 4)
        centres, halves = self._boxes_at(poses, np.tile(self._moving, len(frames)))
        standing_poses = self._placements[self._standing]

        first_row, row_step = (np.zeros(len(self._placements), dtype=np.int64) for _ in range(2))
        first_row[self._moving] = np.arange(len(self._moving))
        row_step[self._moving] = len(self._moving)
        first_row[self._standing] = len(poses) + np.arange(len(standing_poses))

        return PlacedBoxes(
            np.concatenate([centres, self._standing_boxes[0]]),
            np.concatenate([halves, self._standing_boxes[1]]),
            np.concatenate([poses, standing_poses]),
            first_row,
            row_step,
        )

    def _boxes_at(self, poses: NDArray[np.float64], bodies: NDArray[np.int64]) -> tuple[Matrix, Matrix]:
        """Return the centres and half extents of the axis-parallel boxes around bodies, shape (k, 3) each.

        Args:
            poses: Pose of each body, shape (k, 4, 4).
            bodies: Number of each body, shape (k,).
        """
        rotations = poses[:, :3, :3]
        centres = np.einsum("kij,kj->ki", rotations, self._centres[bodies]) + poses[:, :3, 3]
        return centres, np.einsum("kij,kj->ki", np.abs(rotations), self._halves[bodies])


def fixed_contact(bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> tuple[str, str] | None:
    """Return the names of two bodies that touch and never move (such as base and obstacle); None if there are none.

    Args:
        bodies: All bodies of the world.
        pairs: Numbers of the bodies that never move and must not touch.
    """
    meeting = _boxes_meet(bodies, pairs) if pairs else ()
    if not meeting:
        return None
    inside = Containment(bodies, meeting)
    for i, j in meeting[::-1]:
        one = bodies[i]
        other = bodies[j]
        ends = (one.geometry, one.placement.homogeneous, other.geometry, other.placement.homogeneous)
        apart = distance(*ends, kept_apart(one, other), 2.0 * DISTANCE_TOLERANCE) is not None
        if not apart or inside.holds((i, j), np.eye(4)[None]):
            return one.name, other.name
    return None


def _boxes_meet(bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of standing bodies whose axis-parallel bounding boxes overlap or touch."""
    arrays = body_arrays(bodies)
    first, second = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    poses = arrays.placements
    centres = np.einsum("nij,nj->ni", poses[:, :3, :3], arrays.centres) + poses[:, :3, 3]
    halves = np.einsum("nij,nj->ni", np.abs(poses[:, :3, :3]), arrays.halves)

    gaps = np.abs(centres[first] - centres[second]) - (halves[first] + halves[second])
    meet = (gaps <= DISTANCE_TOLERANCE).all(axis=1)
    return tuple(pair for pair, meets in zip(pairs, meet.tolist(), strict=True) if meets)


def _divided(
    starts: Numbers, run_of: Numbers, pair_of: Numbers, run_length: int, next_length: int, end: int
) -> tuple[Numbers, Numbers, Numbers]:
    """Divide the undecided runs into shorter ones.

    Args:
        starts: First row of each run, shape (runs,).
        run_of: Index of the run of each undecided pair, shape (k,).
        pair_of: Number of each undecided pair, shape (k,).
        run_length: Length of the runs.
        next_length: Length of the shorter runs.
        end: Number of rows of all configurations.

    Returns:
        First rows of the shorter runs, shape (new_runs,), and for each of n pairs the index of its run and its number,
        shape (n,) both.
    """
    open_runs, position = np.unique(run_of, return_inverse=True)
    parts = run_length // next_length

    new_starts = (starts[open_runs, None] + np.arange(0, run_length, next_length)).ravel()
    new_runs = (parts * np.asarray(position).reshape(-1, 1) + np.arange(parts)).ravel()
    new_pairs = np.repeat(pair_of, parts)

    exists = new_starts[new_runs] < end
    return new_starts[: int((new_starts < end).sum())], new_runs[exists], new_pairs[exists]


def distance(
    first: coal.CollisionGeometry,
    first_pose: Matrix,
    second: coal.CollisionGeometry,
    second_pose: Matrix,
    margin: float = 0.0,
    look_ahead: float = LOOK_AHEAD,
) -> float | None:
    """Return what :func:`.distances.gap_beyond` does, for two coal geometries at poses of shape (4, 4)."""
    transforms = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    return gap_beyond((first, transforms[0], second, transforms[1]), margin, look_ahead)


def _half_space_pairs(
    bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]
) -> dict[int, tuple[int, Vector, float]]:
    """Return the pairs with a half-space that does not move, by pair number.

    Returns:
        For each such pair: the position of the other body in the pair (0 or 1), the outward normal of the plane in the
        world, shape (3,), and its offset along the normal [m].
    """
    arrays = body_arrays(bodies)
    planes = {}
    is_fixed_plane = (arrays.half_spaces & (arrays.joints == 0))[np.array(pairs, dtype=np.int64).reshape(-1, 2)]

    for k, side in np.argwhere(is_fixed_plane).tolist():
        body = bodies[pairs[k][side]]
        normal = np.array(body.placement.rotation @ body.geometry.n)
        planes[k] = 1 - side, normal, float(body.geometry.d + normal @ body.placement.translation)
    return planes
