"""What methods need that turn one joint at a time: the joints from base to tip, and the best angle of each.

A joint that turns vectors v about its axis a brings them nearest to wanted vectors u where
A cos(angle) + B sin(angle) is greatest, A being the sum of u.(v - (a.v) a) and B that of u.(a x v).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.model.robot import Robot

# three rows of nine: the matrices of v -> (x, y, z axis) x v, for rows v
CROSS = np.array(
    [[0, 0, 0, 0, 0, 1, 0, -1, 0], [0, 0, -1, 0, 0, 0, 1, 0, 0], [0, 1, 0, -1, 0, 0, 0, 0, 0]], dtype=float
)


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint on the way to the tip: its row in the chain, its column in q, radians (or metres) per unit of q."""

    row: int
    column: int
    gain: float
    prismatic: bool


def coupled_fault(robot: Robot) -> str:
    """Why joints cannot be moved one at a time: "" if none is coupled."""
    used = robot.chain.gain != 0.0
    alone = (used.sum(axis=1) <= 1).all() and (used.sum(axis=0) == 1).all()
    return "" if alone else "it moves one joint at a time, and this robot couples some"


def joints_to_tip(robot: Robot) -> tuple[Joint, ...]:
    """The joints that move the tip, base first."""
    row = robot.model.frames[robot.model.getFrameId(robot.tip)].parentJoint - 1
    found: list[Joint] = []
    while row >= 0:
        columns = np.flatnonzero(robot.chain.gain[row])
        if len(columns):
            gain = float(robot.chain.gain[row, columns[0]])
            found.append(Joint(int(row), int(columns[0]), gain, bool(robot.chain.prismatic[row])))
        row = int(robot.chain.parent[row])
    return tuple(reversed(found))


@dataclass(frozen=True, slots=True, eq=False)
class Swing:
    """Vectors, shape (m, k, 3), seen from unit axes about which they turn.

    Attributes:
        vectors: As given.
        outward: Their parts across the axes.
        ahead: Where these parts move, as long as they are: axis x vector.
    """

    vectors: NDArray[np.float64]
    outward: NDArray[np.float64]
    ahead: NDArray[np.float64]

    @classmethod
    def about(cls, axis: Matrix, vectors: NDArray[np.float64]) -> Swing:
        """Rotation of vectors, shape (m, k, 3), from axes, shape (m, 3)."""
        cross = (axis @ CROSS).reshape(-1, 3, 3)  # v @ cross = axis x v
        ahead = vectors @ cross
        return cls(vectors, -(ahead @ cross), ahead)

    def best(self, wanted: NDArray[np.float64], low: Vector, high: Vector) -> Vector:
        """Angles in [low, high], shape (m,), that bring the vectors nearest to wanted ones, shape (m, k, 3).

        Where the angle does not matter (vectors on the axis) 0, or the end nearest to it.
        """
        A = (self.outward * wanted).sum(axis=(1, 2))
        B = (self.ahead * wanted).sum(axis=(1, 2))
        best = np.arctan2(B, A)

        # by full turns into the limits, from below, then from above
        best = best + TAU * np.ceil((low - best) / TAU).clip(0.0, None)
        best = best - TAU * np.ceil((best - high) / TAU).clip(0.0, None)

        # where no turn of it is inside, the better end of the two
        lower_end = A * np.cos(low) + B * np.sin(low) >= A * np.cos(high) + B * np.sin(high)
        is_inside = (best >= low) & (best <= high)
        angle: Vector = np.where(is_inside, best, np.where(lower_end, low, high))
        return np.where(np.hypot(A, B) > 0.0, angle, np.clip(0.0, low, high))

    def turned(self, angle: Vector) -> NDArray[np.float64]:
        """The vectors turned by angles, shape (m,)."""
        cosine = np.cos(angle)[:, None, None]
        sine = np.sin(angle)[:, None, None]
        rotated: NDArray[np.float64] = self.vectors + sine * self.ahead - (1.0 - cosine) * self.outward
        return rotated


def room(robot: Robot, joint: Joint, Q: Matrix) -> tuple[Vector, Vector]:
    """How far a joint of the chain may still move down and up [rad or m], each of shape (m,), 1000 if no limit."""
    limits = np.array([robot.lower[joint.column], robot.upper[joint.column]]).clip(-1e3, 1e3)
    low, high = np.sort((limits[:, None] - Q[:, joint.column]) * joint.gain, axis=0)
    return low, high
