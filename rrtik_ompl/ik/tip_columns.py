"""Forward kinematics of many configurations number by number, several times faster than by 4 x 4 products.

A chain of joints is folded beforehand into fixed transforms between turns about z, whose zeros cost nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.model.robot import Robot

Numbers = NDArray[np.float64]
Entry: TypeAlias = Numbers | float  # of matrices for many configurations at once: a number where all have the same
ROUNDING = 1e-15  # entries of rotations this near to -1, 0, 1 are meant to be that


@dataclass(frozen=True, slots=True, eq=False)
class TipColumns:
    """The joints that move a frame, base first.

    Attributes:
        gain: Joint values = gain @ q + offset, shape (k, dof).
        offset: See ``gain``, shape (k,).
        fixed: Transform before each turn about z (or slide along it), the last one after all, shape (k + 1, 4, 4).
        prismatic: Shape (k,).
    """

    gain: Numbers
    offset: Numbers
    fixed: Numbers
    prismatic: NDArray[np.bool_]

    def poses(self, q: Numbers) -> Numbers:
        """Rotation columns x, y, z and position of the frame in the world for q of shape (dof, ...): (4, 3, ...)."""
        values = self._values(q)
        pose = [list(self.fixed[0][:3, column]) for column in range(4)]

        for k, value in enumerate(values):
            if self.prismatic[k]:
                pose[3] = [p + value * z for p, z in zip(pose[3], pose[2], strict=True)]
            else:
                c = np.cos(value)
                s = np.sin(value)
                x = [c * a + s * b for a, b in zip(pose[0], pose[1], strict=True)]
                pose[1] = [c * b - s * a for a, b in zip(pose[0], pose[1], strict=True)]
                pose[0] = x
            pose = _moved(pose, self.fixed[k + 1])

        return np.stack([np.stack([np.broadcast_to(entry, q.shape[1:]) for entry in column]) for column in pose])

    def _values(self, q: Numbers) -> list[Numbers]:
        """The values of the chain's joints for q, shape (dof, ...), each shape (...)."""
        if np.array_equal(self.gain, np.eye(len(q))) and not self.offset.any():
            return list(q)
        return list(np.tensordot(self.gain, q, 1) + self.offset.reshape(-1, *(1,) * (q.ndim - 1)))


@lru_cache(maxsize=64)
def tip_columns(robot: Robot) -> TipColumns:
    """The chain from the base to the robot's tip."""
    target = robot.model.frames[robot.model.getFrameId(robot.tip)]
    return frame_columns(robot, int(target.parentJoint), target.placement.homogeneous)


def frame_columns(robot: Robot, joint: int, placement: Numbers) -> TipColumns:
    """The chain from the base to a frame, given by its joint's number (0: the world) and its pose in the joint's."""
    chain = robot.chain
    rows = list[int]()
    row = joint - 1
    while row >= 0:
        rows.insert(0, row)
        row = int(chain.parent[row])

    turned = np.eye(4)
    fixed = []
    for row in rows:
        to_axis = _z_along(chain.axis[row])
        fixed.append(_exact(turned.T @ chain.placement[row] @ to_axis))
        turned = to_axis
    fixed.append(_exact(turned.T @ placement))

    return TipColumns(chain.gain[rows], chain.offset[rows], np.array(fixed), chain.prismatic[rows])


def _moved(pose: list[list[Entry]], fixed: Numbers) -> list[list[Entry]]:
    """The pose followed by a fixed transform; terms with a factor 0 are left out."""
    return [
        [_sum([(pose[i][axis], fixed[i, j]) for i in range(3)] + [(pose[3][axis], fixed[3, j])]) for axis in range(3)]
        for j in range(4)
    ]


def _sum(terms: list[tuple[Entry, float]]) -> Entry:
    """The sum of values times factors; factors of 0 and 1 or -1 take no multiplication."""
    total: Entry = 0.0
    for value, factor in terms:
        if factor == 0.0:
            continue
        if factor == 1.0:
            term = value
        elif factor == -1.0:
            term = -value
        else:
            term = factor * value

        is_first = isinstance(total, float) and total == 0.0
        total = term if is_first else total + term
    return total


def _z_along(axis: Numbers) -> Numbers:
    """A rotation, as a 4 x 4 matrix, that takes z to a unit axis; a signed permutation for the usual axes."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, np.cross(axis, x), axis])
    return matrix


def _exact(matrix: Numbers) -> Numbers:
    """The matrix with entries that are whole numbers but for rounding made so."""
    rounded = np.round(matrix)
    return np.where(np.abs(matrix - rounded) < ROUNDING, rounded, matrix)
