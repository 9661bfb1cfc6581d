"""A second, independent answer to "is this configuration free?", used to certify paths before they are returned.

It shares no state with the checks that planners use: forward kinematics in numpy instead of Pinocchio, its own bounding
boxes instead of a broadphase tree, and a fresh coal request for every pair. Reused collision data keep the last
support points as a first guess and have been seen to miss about 3 overlaps in 100,000 near contacts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import coal
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.distances import gap_beyond
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.model.robot import Robot

MAX_PAIR_CHECKS = 1 << 16  # runs of rows times pairs checked together, to bound memory
RUNS = (64, 16, 4, 1)  # rows that are checked together
FEW = 16  # rows that are checked one by one: mostly they do not follow a path

Numbers: TypeAlias = NDArray[np.int64]


class Certificate:
    """Collision test of configurations against fixed pairs of bodies."""

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
        """Which rows of Q, shape (m, dof), are collision-free. Shape (m,). Quickest where rows follow a path."""
        return np.array([not colliding_pair for colliding_pair in self._colliding_pairs(Q)], dtype=bool)

    def first_pairs(self, Q: Matrix) -> tuple[tuple[str, str] | None, ...]:
        """For each row of Q the names of one colliding pair, or None."""
        return tuple(
            None if not colliding_pair else (self._bodies[colliding_pair[0]].name, self._bodies[colliding_pair[1]].name)
            for colliding_pair in self._colliding_pairs(Q)
        )

    def _colliding_pairs(self, Q: Matrix) -> list[tuple[int, ...]]:
        """For each row of Q, shape (m, dof), the numbers of one colliding pair of bodies; () where there is none.

        Neighbouring rows are checked together: where two bodies are farther apart at the middle one than they can
        come nearer within the run of rows, they are apart in all of it. What is left open is checked in shorter runs.
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
                if next_length:  # 0 after the shortest runs, which are single rows
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
        """Which pairs may touch somewhere in their runs of rows, shape (k,); enters collisions that it finds.

        Args:
            Q: All configurations, shape (m, dof).
            starts: First row of each run, shape (runs,).
            run_length: Rows in a run.
            run_of: For each of k pairs the run in which it is examined, shape (k,).
            pair_of: Their numbers, shape (k,).
            colliding: For each row of Q a colliding pair of bodies, or (); is added to.
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

        # What the boxes leave open is measured, one pair at a time.
        candidates = np.flatnonzero(may_touch)
        runs = run_of[candidates]
        pairs = pair_of[candidates]
        columns = (candidates, runs, pairs, approach_bounds[candidates], self._may_contain(frames, runs, pairs))
        for row, run, pair, approach_bound, may_be_inside in zip(*(k.tolist() for k in columns), strict=True):
            i, j = self._pairs[pair].tolist()
            first, second = ((self._bodies[k].geometry, placed.pose(run, k)) for k in (i, j))
            gap = distance(*first, *second, margin=float(self._margins[pair]))
            may_touch[row] = gap is None or gap <= approach_bound
            if gap is None:
                colliding[middles[run]] = (i, j)
            elif may_be_inside and self._containment.holds((i, j), frames[run]):
                # Where surfaces stay apart in the whole run, what is inside in the middle is inside all along.
                rows = slice(middles[run], middles[run] + 1) if may_touch[row] else slice(starts[run], ends[run])
                colliding[rows] = [(i, j)] * (rows.stop - rows.start)

        return may_touch

    def _approach_within_runs(self, largest_change: Matrix, run_of: Numbers, pair_of: Numbers) -> Vector:
        """How much nearer the pairs can come in their runs than at the middle [m], shape (k,).

        ``largest_change``, shape (runs, dof), is how far each joint gets from its value at the middle.
        """
        weights = self._approach_weights
        joints = range(largest_change.shape[1])
        return np.asarray(sum(largest_change[run_of, k] * weights[pair_of, k] for k in joints))

    def _may_contain(self, frames: NDArray[np.float64], run_of: Numbers, pair_of: Numbers) -> Mask:
        """In which pairs one body may be inside the other, a hollow one, in the middle of their runs, shape (k,)."""
        may_contain = np.zeros(len(pair_of), dtype=bool)
        for rows in self._containment.rows_of_pairs[pair_of].T:
            listed = np.flatnonzero(rows >= 0)
            may_contain[listed] |= self._containment.reached(rows[listed], frames[run_of[listed]])
        return may_contain

    def _gaps(self, placed: PlacedBoxes, run_of: Numbers, pair_of: Numbers) -> Vector:
        """Lower bounds of the distances between the pairs' boxes less their margins [m], shape (k,)."""
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
    """Axis-parallel boxes around bodies at m configurations of the arm; what does not move is held once.

    Attributes:
        centres, halves: Centres and half extents [m], shape (rows, 3) each; see :meth:`rows`.
        poses: Poses of the bodies, shape (rows, 4, 4).
        first_row: For each body its row in the first configuration.
        row_step: For each body how many rows further on the next configuration is, 0 for what does not move.
    """

    centres: Matrix
    halves: Matrix
    poses: NDArray[np.float64]
    first_row: NDArray[np.int64]
    row_step: NDArray[np.int64]

    def rows(self, configurations: NDArray[np.int64], bodies: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of bodies at configurations, by their numbers, shape (k,) each."""
        return np.asarray(self.first_row[bodies] + self.row_step[bodies] * configurations)

    def pose(self, configuration: int, body: int) -> Matrix:
        """Pose of a body at a configuration, shape (4, 4)."""
        return np.asarray(self.poses[self.first_row[body] + self.row_step[body] * configuration])


class Boxes:
    """Axis-parallel boxes around bodies: a first test that never misses what touches."""

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
        """The boxes where the joints' frames, shape (m, joints + 1, 4, 4), have these poses."""
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
        """Centres and half extents of the boxes around bodies at poses, shape (k, 4, 4): (k, 3) each."""
        rotations = poses[:, :3, :3]
        centres = np.einsum("kij,kj->ki", rotations, self._centres[bodies]) + poses[:, :3, 3]
        return centres, np.einsum("kij,kj->ki", np.abs(rotations), self._halves[bodies])


def fixed_contact(robot: Robot, bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> tuple[str, str] | None:
    """Names of two bodies that touch and never move (the base and the obstacles), None if all are clear of each other.

    Args:
        robot: The arm.
        bodies: All solids.
        pairs: Numbers of those that never move and must not touch.
    """
    meeting = _boxes_meet(bodies, pairs)
    return Certificate(robot, bodies, meeting).first_pairs(np.zeros((1, robot.dof)))[0] if meeting else None


def _boxes_meet(bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
    """The pairs of standing bodies whose bounding boxes meet."""
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
    """The runs named in ``run_of`` divided into shorter ones: their first rows, and the run and number of each pair."""
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
) -> float | None:
    """As :func:`.distances.gap_beyond`, of two coal geometries at poses, shape (4, 4)."""
    transforms = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    return gap_beyond((first, transforms[0], second, transforms[1]), margin)


def _half_space_pairs(
    bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]
) -> dict[int, tuple[int, Vector, float]]:
    """Pairs with a half-space that does not move, by number: side of the other body, outward normal and offset."""
    arrays = body_arrays(bodies)
    planes = {}
    is_fixed_plane = (arrays.half_spaces & (arrays.joints == 0))[np.array(pairs, dtype=np.int64).reshape(-1, 2)]

    for k, side in np.argwhere(is_fixed_plane).tolist():
        body = bodies[pairs[k][side]]
        normal = np.array(body.placement.rotation @ body.geometry.n)
        planes[k] = 1 - side, normal, float(body.geometry.d + normal @ body.placement.translation)
    return planes
