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
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.body_arrays import body_arrays
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.margins import DISTANCE_TOLERANCE, request
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.own_distances import is_ours, own_gap
from rrtik_ompl.geometry.collision.solids import solids_of
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
        self._approach = approach_weights(robot, bodies, pairs)  # [m per rad or m], shape (pairs, dof)
        self._planes = _half_space_pairs(bodies, pairs)
        self._margins = body_arrays(bodies).kept_apart(self._pairs)
        self._containment = Containment(bodies, pairs)

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

        Neighbouring rows are checked together: where two bodies are farther apart at the middle one than they can
        come nearer within the run of rows, they are apart in all of it. What is left open is checked in shorter runs.
        """
        found: list[tuple[int, ...]] = [()] * len(Q)
        runs = RUNS if len(Q) > FEW else RUNS[-1:]
        together = runs[0] * max(1, MAX_PAIR_CHECKS // max(1, len(self._pairs)))

        for start in range(0, len(Q), together):
            begins = np.arange(start, min(start + together, len(Q)), runs[0])
            run, pair = (k.ravel() for k in np.indices((len(begins), len(self._pairs))))
            for size, shorter in zip(runs, (*runs[1:], 0), strict=True):
                open_ = self._open(Q, begins, size, run, pair, found)
                if not open_.any():
                    break
                if shorter:
                    begins, run, pair = _shorter(begins, run[open_], pair[open_], size, shorter, len(Q))

        return found

    def _open(
        self, Q: Matrix, begins: Numbers, size: int, run: Numbers, pair: Numbers, found: list[tuple[int, ...]]
    ) -> Mask:
        """Which of some pairs, shape (k,), may touch somewhere in the runs of rows given, shape (k,).

        Adds to found.
        """
        middles = np.minimum(begins + size // 2, len(Q) - 1)
        ends = np.minimum(begins + size, len(Q))
        near = np.array([np.abs(Q[a:b] - Q[m]).max(axis=0) for a, b, m in zip(begins, ends, middles, strict=True)])

        frames = self._robot.chain.joint_frames(Q[middles])
        placed = self._boxes.placed(frames)
        approach = DISTANCE_TOLERANCE + self._approached(near, run, pair)
        open_: Mask = self._gaps(placed, run, pair) <= approach

        # What the boxes leave open is measured, one pair at a time.
        kept = np.flatnonzero(open_)
        columns = (kept, run[kept], pair[kept], approach[kept], self._reached(frames, run[kept], pair[kept]))
        for entry, r, p, most, reached in zip(*(k.tolist() for k in columns), strict=True):
            i, j = self._pairs[p].tolist()
            first, second = ((self._bodies[k].geometry, placed.pose(r, k)) for k in (i, j))
            gap = distance(*first, *second, margin=float(self._margins[p]))
            open_[entry] = gap is None or gap <= most
            if gap is None:
                found[middles[r]] = (i, j)
            elif reached and self._containment.holds((i, j), frames[r]):
                rows = slice(middles[r], middles[r] + 1) if open_[entry] else slice(begins[r], ends[r])
                found[rows] = [(i, j)] * (rows.stop - rows.start)  # where surfaces stay apart, what is held stays held

        return open_

    def _approached(self, near: Matrix, run: Numbers, pair: Numbers) -> Vector:
        """How much nearer the pairs can come in their runs than at the middle [m], shape (k,)."""
        return np.asarray(sum(near[run, joint] * self._approach[pair, joint] for joint in range(near.shape[1])))

    def _reached(self, frames: NDArray[np.float64], run: Numbers, pair: Numbers) -> Mask:
        """Which of the pairs may be of a body inside a hollow one, in the middle of their runs, shape (k,)."""
        reached = np.zeros(len(pair), dtype=bool)
        for places in self._containment.ways[pair].T:
            given = np.flatnonzero(places >= 0)
            reached[given] |= self._containment.reached(places[given], frames[run[given]])
        return reached

    def _gaps(self, placed: PlacedBoxes, run: Numbers, pair: Numbers) -> Vector:
        """Lower bounds of the distances between the pairs' boxes less their margins [m], shape (k,)."""
        sides = [placed.rows(run, self._pairs[pair, k]) for k in (0, 1)]
        gaps = np.full(len(pair), -np.inf)

        for axis in range(3):
            centres = placed.centres[:, axis]
            halves = placed.halves[:, axis]
            apart = np.abs(centres[sides[0]] - centres[sides[1]]) - (halves[sides[0]] + halves[sides[1]])
            np.maximum(gaps, apart, out=gaps)

        for number, (side, normal, offset) in self._planes.items():
            mine = np.flatnonzero(pair == number)
            rows = sides[side][mine]
            gaps[mine] = placed.centres[rows] @ normal - offset - placed.halves[rows] @ np.abs(normal)

        gaps -= self._margins[pair]
        return gaps


@dataclass(frozen=True, slots=True, eq=False)
class PlacedBoxes:
    """Axis-parallel boxes around bodies at m configurations of the arm; what does not move is held once.

    Attributes:
        centres, halves: Centres and half extents [m], shape (rows, 3) each; see :meth:`rows`.
        poses: Poses of the bodies, shape (rows, 4, 4).
        place: For each body its row in the first configuration.
        step: For each body how many rows further on the next configuration is, 0 for what does not move.
    """

    centres: Matrix
    halves: Matrix
    poses: NDArray[np.float64]
    place: NDArray[np.int64]
    step: NDArray[np.int64]

    def rows(self, configurations: NDArray[np.int64], bodies: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of bodies at configurations, by their numbers, shape (k,) each."""
        return np.asarray(self.place[bodies] + self.step[bodies] * configurations)

    def pose(self, configuration: int, body: int) -> Matrix:
        """Pose of a body at a configuration, shape (4, 4)."""
        return np.asarray(self.poses[self.place[body] + self.step[body] * configuration])


class Boxes:
    """Axis-parallel boxes around bodies: a first test that never misses what touches."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        own = body_arrays(bodies)
        self._moving = np.flatnonzero(own.joints > 0)
        self._standing = np.flatnonzero(own.joints == 0)
        self._joints = own.joints[self._moving]
        self._placements = own.placements
        self._centres = own.centres
        self._halves = own.halves
        self._still = self._around(self._placements[self._standing], self._standing)

    def placed(self, frames: NDArray[np.float64]) -> PlacedBoxes:
        """The boxes where the joints' frames, shape (m, joints + 1, 4, 4), have these poses."""
        poses = (frames[:, self._joints] @ self._placements[self._moving]).reshape(-1, 4, 4)
        centres, halves = self._around(poses, np.tile(self._moving, len(frames)))
        still = self._placements[self._standing]

        place, step = (np.zeros(len(self._placements), dtype=np.int64) for _ in range(2))
        place[self._moving] = np.arange(len(self._moving))
        step[self._moving] = len(self._moving)
        place[self._standing] = len(poses) + np.arange(len(still))

        return PlacedBoxes(
            np.concatenate([centres, self._still[0]]),
            np.concatenate([halves, self._still[1]]),
            np.concatenate([poses, still]),
            place,
            step,
        )

    def _around(self, poses: NDArray[np.float64], bodies: NDArray[np.int64]) -> tuple[Matrix, Matrix]:
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
    near = _boxes_meet(bodies, pairs)
    return Certificate(robot, bodies, near).first_pairs(np.zeros((1, robot.dof)))[0] if near else None


def _boxes_meet(bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
    """The pairs of standing bodies whose bounding boxes meet."""
    own = body_arrays(bodies)
    first, second = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    poses = own.placements
    centres = np.einsum("nij,nj->ni", poses[:, :3, :3], own.centres) + poses[:, :3, 3]
    halves = np.einsum("nij,nj->ni", np.abs(poses[:, :3, :3]), own.halves)

    gaps = np.abs(centres[first] - centres[second]) - (halves[first] + halves[second])
    meet = (gaps <= DISTANCE_TOLERANCE).all(axis=1)
    return tuple(pair for pair, near in zip(pairs, meet.tolist(), strict=True) if near)


def _shorter(
    begins: Numbers, run: Numbers, pair: Numbers, size: int, shorter: int, end: int
) -> tuple[Numbers, Numbers, Numbers]:
    """Begins of shorter runs in the place of those named by ``run``, and what is to be checked of them."""
    named, place = np.unique(run, return_inverse=True)
    parts = size // shorter

    starts = (begins[named, None] + np.arange(0, size, shorter)).ravel()
    runs = (parts * np.asarray(place).reshape(-1, 1) + np.arange(parts)).ravel()
    pairs = np.repeat(pair, parts)

    inside = starts[runs] < end
    return starts[: int((starts < end).sum())], runs[inside], pairs[inside]


def distance(
    first: coal.CollisionGeometry,
    first_pose: Matrix,
    second: coal.CollisionGeometry,
    second_pose: Matrix,
    margin: float = 0.0,
) -> float | None:
    """A lower bound of the distance of two coal geometries at poses, shape (4, 4), less a margin [m].

    None if the margin is not kept. Computed with a fresh request and result.
    """
    transforms = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in (first_pose, second_pose)]
    ends, margin = solids_of((first, transforms[0], second, transforms[1]), margin)

    if is_ours(ends):
        return own_gap(ends, margin)

    result = coal.CollisionResult()
    if coal.collide(*ends, request(margin), result):
        return None
    return float(result.distance_lower_bound)


def _half_space_pairs(
    bodies: tuple[Body, ...], pairs: tuple[tuple[int, int], ...]
) -> dict[int, tuple[int, Vector, float]]:
    """Pairs with a half-space that does not move, by number: side of the other body, outward normal and offset."""
    own = body_arrays(bodies)
    found = {}
    standing = (own.half_spaces & (own.joints == 0))[np.array(pairs, dtype=np.int64).reshape(-1, 2)]

    for k, side in np.argwhere(standing).tolist():
        body = bodies[pairs[k][side]]
        normal = np.array(body.placement.rotation @ body.geometry.n)
        found[k] = 1 - side, normal, float(body.geometry.d + normal @ body.placement.translation)
    return found
