"""Methods that turn one joint at a time: cyclic coordinate descent, and FABRIK.

Cyclic coordinate descent [27] sets each joint to its own optimum, from the last to the first. The cost of a pose is the
sum of the squared distances of the tip and of the ends of its three axes, whose length is a share of the reach.

FABRIK [28] treats the joints as points at fixed distances, which are pulled to the goal from the tip, then back to the
base. Here, on the way back each joint turns about its own axis, inside its limits, to bring the points after it nearest
to where they were pulled. So the result is a configuration of the arm in the plane and in space, but convergence is no
longer certain, and other starts are tried.

A joint that turns vectors v about its axis a brings them nearest to wanted vectors u at the angle that maximises
A cos(angle) + B sin(angle), where A is the sum of u.(v - (a.v) a) and B the sum of u.(a x v).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.ik.residual import walked
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot, poses, reach_of

SWEEPS = 300
AXIS_LENGTH = 0.3  # length of the tip's axes, in units of the reach
PASSES = 200
TIP_WEIGHT = 3.0  # Weight of the tip for spatial arms, which never reached the goal if only the next point counted.
# Each row is a flattened 3 x 3 matrix M, for one of the axes x, y, z, such that v @ M is the cross product axis x v.
CROSS = np.array(
    [[0, 0, 0, 0, 0, 1, 0, -1, 0], [0, 0, -1, 0, 0, 0, 1, 0, 0], [0, 1, 0, -1, 0, 0, 0, 0, 0]], dtype=float
)


def ccd(
    robot: Robot, goal: Target, starts: Matrix, *, sweeps: int = SWEEPS, enough: int | None = None
) -> tuple[Matrix, int]:
    """Run cyclic coordinate descent from many starts, inside the limits.

    Args:
        robot: An arm without coupled joints.
        goal: A pose, or a position with any orientation.
        starts: Configurations to start from, shape (m, dof).
        sweeps: Largest number of sweeps over the joints.
        enough: Number of starts that have to arrive; all of them if None.

    Returns:
        The last configuration of each start, shape (m, dof), and the number of sweeps taken.
    """
    joints = joints_to_tip(robot)[::-1]
    length = AXIS_LENGTH * reach_of(robot)
    return walked(robot, goal, starts, lambda Q: _sweep(robot, goal, Q, joints, length), sweeps, enough)


def _sweep(robot: Robot, goal: Target, Q: Matrix, joints: tuple[Joint, ...], length: float) -> Matrix:
    """Set every joint once to its optimum, from the last to the first; Q, shape (m, dof), is changed in place.

    Frames before a joint do not move with it, so forward kinematics is computed only once.
    """
    frames = robot.chain.joint_frames(Q)
    tips = poses(robot, Q)

    wanted = np.zeros((1, 4 if goal.oriented else 1, 3))
    wanted[0, 0] = goal.point
    points = tips[:, None, :3, 3]
    if goal.oriented:
        wanted[0, 1:] = wanted[0, 0] + length * goal.pose.rotation.T
        points = np.concatenate([points, points + length * tips[:, :3, :3].transpose(0, 2, 1)], axis=1)

    for joint in joints:
        axis = frames[:, joint.row + 1, :3, :3] @ robot.chain.axis[joint.row]
        origin = frames[:, joint.row + 1, None, :3, 3]
        points = _move(robot, joint, Q, axis, origin, points, wanted)

    return Q


def _move(
    robot: Robot,
    joint: Joint,
    Q: Matrix,
    axis: Matrix,
    origin: NDArray[np.float64],
    points: NDArray[np.float64],
    wanted: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Set one joint to its optimum, and move the points that it carries.

    Args:
        robot: The arm.
        joint: The joint.
        Q: Configurations, shape (m, dof), changed in place.
        axis: Axis of the joint in the world, shape (m, 3).
        origin: Origin of the joint in the world, shape (m, 1, 3).
        points: Points that the joint moves, shape (m, k, 3).
        wanted: Wanted points, shape (1, k, 3).

    Returns:
        The moved points, shape (m, k, 3).
    """
    column = joint.column
    low, high = room(robot, joint, Q)
    if joint.prismatic:
        shift = np.clip(((wanted - points).mean(axis=1) * axis).sum(axis=1), low, high)
        points = points + (shift[:, None] * axis)[:, None]
    else:
        swing = Swing.about(axis, points - origin)
        shift = swing.best(wanted - origin, low, high)
        points = origin + swing.turned(shift)

    Q[:, column] = np.clip(Q[:, column] + shift / joint.gain, robot.lower[column], robot.upper[column])
    return points


def fabrik_misfit(robot: Robot, target: Target) -> str:
    """Return why FABRIK does not fit: the target is a pose, or joints slide or are coupled; "" if it fits."""
    if target.oriented:
        return "it moves points and knows no orientation; give a position"
    if robot.prismatic.any():
        return "it keeps distances between joints, and this robot has sliding joints"
    return coupled_fault(robot)


def fabrik(
    robot: Robot, goal: Target, starts: Matrix, *, iterations: int = PASSES, enough: int | None = None
) -> tuple[Matrix, int]:
    """Run FABRIK from many starts, inside the limits.

    Args:
        robot: An arm of turning joints.
        goal: A position.
        starts: Configurations to start from, shape (m, dof).
        iterations: Largest number of backward and forward passes.
        enough: Number of starts that have to arrive; all of them if None.

    Returns:
        The last configuration of each start, shape (m, dof), and the number of passes taken.
    """
    joints = joints_to_tip(robot)
    return walked(robot, goal, starts, lambda Q: _pass(robot, goal, Q, joints), iterations, enough)


def _pass(robot: Robot, goal: Target, Q: Matrix, joints: tuple[Joint, ...]) -> Matrix:
    # The backward pass pulls the joints' origins and the tip to the goal.
    frames = robot.chain.joint_frames(Q)
    rows = [joint.row + 1 for joint in joints]
    tips = poses(robot, Q)
    points = np.concatenate([frames[:, rows][..., :3, 3], tips[:, None, :3, 3]], axis=1)
    axes = np.einsum("mkij,kj->mki", frames[:, rows][..., :3, :3], robot.chain.axis[[joint.row for joint in joints]])
    pulled = _pulled(points, goal)

    # The forward pass turns each joint, base first, to bring the points after it nearest to the pulled ones.
    for k, joint in enumerate(joints):
        axis = axes[:, k]
        origin = points[:, k, None]
        rest = Swing.about(axis, points[:, k + 1 :] - origin)
        weights = _weights(robot, len(joints) - k)
        angle = rest.best((pulled[:, k + 1 :] - origin) * weights[:, None], *room(robot, joint, Q))
        points[:, k + 1 :] = origin + rest.turned(angle)
        axes[:, k + 1 :] = Swing.about(axis, axes[:, k + 1 :]).turned(angle)
        Q[:, joint.column] += angle / joint.gain

    return robot.clamp(Q)


def _pulled(points: NDArray[np.float64], goal: Target) -> NDArray[np.float64]:
    """Put the last of the points, shape (m, k, 3), on the goal and pull the others after it; distances are kept.

    The first point, at the base, stays where it is.
    """
    pulled = points.copy()
    pulled[:, -1] = goal.point
    for k in range(points.shape[1] - 2, 0, -1):
        direction = points[:, k] - pulled[:, k + 1]
        distance = np.linalg.norm(direction, axis=1, keepdims=True)
        length = np.linalg.norm(points[:, k + 1] - points[:, k], axis=1, keepdims=True)
        pulled[:, k] = pulled[:, k + 1] + direction * (length / np.where(distance > 0.0, distance, 1.0))
    return pulled


def _weights(robot: Robot, points: int) -> Vector:
    """Return the weights of points that a joint moves, shape (points,): for planar arms only the next one counts."""
    weights = np.ones(points)
    if robot.planar:
        weights[1:] = 0.0
    else:
        weights[-1] = TIP_WEIGHT
    return weights


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between base and tip.

    Attributes:
        row: Its row in the chain.
        column: Its entry of q.
        gain: Motion of the joint [rad or m] per unit of that entry.
        prismatic: Whether it slides.
    """

    row: int
    column: int
    gain: float
    prismatic: bool


def coupled_fault(robot: Robot) -> str:
    """Return why the joints cannot be moved one at a time; "" if none is coupled."""
    used = robot.chain.gain != 0.0
    alone = (used.sum(axis=1) <= 1).all() and (used.sum(axis=0) == 1).all()
    return "" if alone else "it moves one joint at a time, and this robot couples some"


def joints_to_tip(robot: Robot) -> tuple[Joint, ...]:
    """Return the joints that move the tip, base first."""
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
    """Vectors that turn about unit axes; all arrays have shape (m, k, 3).

    Attributes:
        vectors: The vectors.
        outward: Their components perpendicular to the axes.
        ahead: The directions in which these components move, axis x vector.
    """

    vectors: NDArray[np.float64]
    outward: NDArray[np.float64]
    ahead: NDArray[np.float64]

    @classmethod
    def about(cls, axis: Matrix, vectors: NDArray[np.float64]) -> Swing:
        """Prepare the rotation of vectors, shape (m, k, 3), about unit axes, shape (m, 3)."""
        cross = (axis @ CROSS).reshape(-1, 3, 3)  # v @ cross = axis x v
        ahead = vectors @ cross
        return cls(vectors, -(ahead @ cross), ahead)

    def best(self, wanted: NDArray[np.float64], low: Vector, high: Vector) -> Vector:
        """Return the angles in [low, high] [rad], shape (m,), that bring the vectors nearest to wanted ones.

        Where the angle does not matter (vectors on the axis) it is 0, or the end nearest to 0.

        Args:
            wanted: Wanted vectors, shape (m, k, 3).
            low: Smallest angles [rad], shape (m,).
            high: Largest angles [rad], shape (m,).
        """
        A = (self.outward * wanted).sum(axis=(1, 2))
        B = (self.ahead * wanted).sum(axis=(1, 2))
        best = np.arctan2(B, A)

        # Move the angles by full turns into the limits, from below, then from above.
        best = best + TAU * np.ceil((low - best) / TAU).clip(0.0, None)
        best = best - TAU * np.ceil((best - high) / TAU).clip(0.0, None)

        # If no such angle is inside, take the better one of the two ends.
        lower_end = A * np.cos(low) + B * np.sin(low) >= A * np.cos(high) + B * np.sin(high)
        is_inside = (best >= low) & (best <= high)
        angle: Vector = np.where(is_inside, best, np.where(lower_end, low, high))
        return np.where(np.hypot(A, B) > 0.0, angle, np.clip(0.0, low, high))

    def turned(self, angle: Vector) -> NDArray[np.float64]:
        """Return the vectors turned by angles [rad], shape (m,); shape (m, k, 3)."""
        cosine = np.cos(angle)[:, None, None]
        sine = np.sin(angle)[:, None, None]
        rotated: NDArray[np.float64] = self.vectors + sine * self.ahead - (1.0 - cosine) * self.outward
        return rotated


def room(robot: Robot, joint: Joint, Q: Matrix) -> tuple[Vector, Vector]:
    """Return how far a joint may still move down (at most 0) and up [rad or m], shape (m,) each.

    A missing limit counts as 1000.
    """
    limits = np.array([robot.lower[joint.column], robot.upper[joint.column]]).clip(-1e3, 1e3)
    low, high = np.sort((limits[:, None] - Q[:, joint.column]) * joint.gain, axis=0)
    return low, high
