"""Forward kinematics of many configurations entry by entry, several times faster than by products of 4 x 4 matrices.

The chain is rewritten once so that every joint turns about (or slides along) the z axis, with fixed transforms between
the joints. Entries of these that are 0, 1 or -1 need no multiplication.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.model.robot import Robot

Numbers = NDArray[np.float64]
Entry: TypeAlias = Numbers | float  # an entry of many matrices: an array, or a number if it is the same in all
ROUNDING = 1e-15  # Entries of rotations this near to -1, 0 or 1 are rounded to it.


@dataclass(frozen=True, slots=True, eq=False)
class TipColumns:
    """The k joints that move a frame, base first.

    Attributes:
        gain: Factors of the joint values, which are gain @ q + offset; shape (k, dof).
        offset: Offsets of the joint values, shape (k,).
        fixed: Fixed transform before each joint, which turns about z or slides along it, and one after the last joint;
            shape (k + 1, 4, 4).
        prismatic: Whether each joint slides, shape (k,).
    """

    gain: Numbers
    offset: Numbers
    fixed: Numbers
    prismatic: NDArray[np.bool_]

    def poses(self, q: Numbers) -> Numbers:
        """Compute the pose of the frame in the world for many configurations.

        Args:
            q: Configurations, joints in the first axis, shape (dof, ...).

        Returns:
            The columns x, y, z of the rotation and the position [m], shape (4, 3, ...).
        """
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
        """Return the value of each joint of the chain for q, shape (dof, ...); each has shape (...)."""
        if np.array_equal(self.gain, np.eye(len(q))) and not self.offset.any():
            return list(q)
        return list(np.tensordot(self.gain, q, 1) + self.offset.reshape(-1, *(1,) * (q.ndim - 1)))


@kept_with
def tip_columns(robot: Robot) -> TipColumns:
    """Return the chain from the base to the robot's tip."""
    target = robot.model.frames[robot.model.getFrameId(robot.tip)]
    return frame_columns(robot, int(target.parentJoint), target.placement.homogeneous)


def frame_columns(robot: Robot, joint: int, placement: Numbers) -> TipColumns:
    """Return the chain from the base to a frame.

    Args:
        robot: The arm.
        joint: Number of the joint that carries the frame; 0 is the world.
        placement: Pose of the frame in that of the joint, shape (4, 4).
    """
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
    """Return a pose (columns x, y, z and position) times a fixed transform; terms with a factor 0 are left out."""
    return [
        [_sum([(pose[i][axis], fixed[i, j]) for i in range(3)] + [(pose[3][axis], fixed[3, j])]) for axis in range(3)]
        for j in range(4)
    ]


def _sum(terms: list[tuple[Entry, float]]) -> Entry:
    """Return the sum of values times factors; factors of 0, 1 and -1 take no multiplication."""
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
    """Return a rotation, as a 4 x 4 matrix, that takes z to a unit axis; a signed permutation for x, y and z."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, np.cross(axis, x), axis])
    return matrix


def _exact(matrix: Numbers) -> Numbers:
    """Return the matrix with entries rounded that are whole numbers up to rounding."""
    rounded = np.round(matrix)
    return np.where(np.abs(matrix - rounded) < ROUNDING, rounded, matrix)
