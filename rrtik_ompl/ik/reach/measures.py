"""What a map of reach can say of a cell: how many samples came, in which directions, how well the arm moves there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.model.robot import Robot, jacobians

DIRECTIONS = 64  # one bit each of a 64-bit number
FINE = 16  # the nearest of them is looked up in a cube of 33 cells a side
GOLDEN = np.pi * (3.0 - np.sqrt(5.0))  # [rad], the golden angle


class Counter:
    """Collects what the samples of each cell say: here, how many there are."""

    def __init__(self, cells: int, planar: bool) -> None:
        self.planar = planar
        self.totals = np.zeros(cells)

    def quality(self, robot: Robot, Q: Matrix) -> Vector:
        """What does not change when the arm turns as a whole, for each posture, shape (m,)."""
        del robot
        return np.ones(len(Q))

    def add(self, cells: NDArray[np.int64], pointing: Matrix, quality: Vector) -> None:
        """Take in samples: their cells, shape (m,), which way the tip points, shape (m, 3), and their quality."""
        del pointing
        np.add.at(self.totals, cells, quality)

    @property
    def values(self) -> Vector:
        """What the map says, a number for each cell."""
        return self.totals


class Orientations(Counter):
    """Which of the directions were seen, a bit for each."""

    def __init__(self, cells: int, planar: bool) -> None:
        super().__init__(cells, planar)
        self.seen = np.zeros(cells, dtype=np.uint64)
        ticks = np.arange(-FINE, FINE + 1)
        cube = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
        self.nearest = np.argmax(cube @ _directions(planar).T, axis=1).astype(np.uint64)

    def add(self, cells: NDArray[np.int64], pointing: Matrix, quality: Vector) -> None:
        """Set the bit of the direction that is nearest to each sample's."""
        del quality
        place = np.rint(FINE * pointing).astype(np.int64) + FINE
        nearest = self.nearest[(place[:, 0] * (2 * FINE + 1) + place[:, 1]) * (2 * FINE + 1) + place[:, 2]]
        np.bitwise_or.at(self.seen, cells, np.uint64(1) << nearest)

    @property
    def values(self) -> Vector:
        """Share of the directions that were seen."""
        share: Vector = np.bitwise_count(self.seen) / DIRECTIONS
        return share


class Manipulability(Counter):
    """The largest manipulability that was seen in each cell."""

    def quality(self, robot: Robot, Q: Matrix) -> Vector:
        """Product of the singular values of the Jacobian [31], as many as there are joints, at most six."""
        jacobian = jacobians(robot, Q)
        flipped = jacobian.transpose(0, 2, 1)
        gram = flipped @ jacobian if robot.dof < 6 else jacobian @ flipped  # the smaller of the two
        root: Vector = np.sqrt(np.maximum(np.linalg.det(gram), 0.0))
        return root

    def add(self, cells: NDArray[np.int64], pointing: Matrix, quality: Vector) -> None:
        """Keep the largest of each cell."""
        del pointing
        np.maximum.at(self.totals, cells, quality)


MEASURES: Mapping[str, Callable[[int, bool], Counter]] = MappingProxyType(
    {"orientations": Orientations, "manipulability": Manipulability, "samples": Counter}
)


def _directions(planar: bool) -> Matrix:
    """Evenly spread unit vectors, shape (DIRECTIONS, 3): a circle, or a sunflower on the sphere."""
    if planar:
        angle = TAU * np.arange(DIRECTIONS) / DIRECTIONS
        return np.stack([np.cos(angle), np.sin(angle), np.zeros(DIRECTIONS)], axis=1)
    height = 1.0 - (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS
    turn = GOLDEN * np.arange(DIRECTIONS)
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
