"""Bounding boxes of bodies in the world: a first test that never misses what touches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.body_arrays import body_arrays


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
    """The boxes of bodies, in the frames that carry them."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        own = body_arrays(bodies)
        self._moving, self._standing = np.flatnonzero(own.joints > 0), np.flatnonzero(own.joints == 0)
        self._joints, self._placements = own.joints[self._moving], own.placements
        self._centres, self._halves = own.centres, own.halves
        self._still = self._around(self._placements[self._standing], self._standing)

    def placed(self, frames: NDArray[np.float64]) -> PlacedBoxes:
        """The boxes where the joints' frames, shape (m, joints + 1, 4, 4), have these poses."""
        poses = (frames[:, self._joints] @ self._placements[self._moving]).reshape(-1, 4, 4)
        centres, halves = self._around(poses, np.tile(self._moving, len(frames)))
        still = self._placements[self._standing]
        place, step = (np.zeros(len(self._placements), dtype=np.int64) for _ in range(2))
        place[self._moving], step[self._moving] = np.arange(len(self._moving)), len(self._moving)
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
