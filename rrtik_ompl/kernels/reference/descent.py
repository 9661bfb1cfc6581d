"""Levenberg-Marquardt from many starts in numpy: the reference of :mod:`rrtik_ompl.kernels.ik.ik_kernels`.

Source: [22]: the damping is the residual itself plus a small constant, so that steps are short far
from the target and in singular postures, and Newton's near the solution.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.kernels.ik.ik_layout import ANY_TURN, BOX, CHORD_TOLERANCE, FREE_TURN, NO_TURN, POSITION_TOLERANCE
from rrtik_ompl.model.robot import Robot, jacobians, poses, reach_of

PER_CHORD = 0.3  # weight of a turn (its chord 2 sin(angle / 2)) where the position counts in reaches
DAMPING = 1e-9  # the constant part, in units of the squared residual
DAMPING_SHARE = 0.1  # of the squared residual, which goes into the damping
# of that share after a step that led away: it was too bold, as it is in front of what is out of reach
SHARE_GROWTH = 4.0
LARGEST_STEP = 0.5  # [rad] or [m] of any joint in one step
STALLED = 0.5  # a start whose squared residual has not fallen to this share in some steps is given up
HALF_TURN_COSINE = 1e-12  # of half the angle: below this the skew part says nothing of the axis


def walk_plainly(robot: Robot, aims: Matrix, Q: Matrix, steps: int, patience: int) -> tuple[Matrix, Mask, int]:
    """Walk from every row of Q, shape (m, dof), to its goal among ``aims``, shape (m, 18) or (1, 18).

    Returns:
        Where the rows have come to, whether that is at their goals, shape (m,), and the most steps taken.
    """
    Q = np.clip(Q, robot.lower, robot.upper)
    aims = np.broadcast_to(aims, (len(Q), aims.shape[1]))
    reached = np.zeros(len(Q), dtype=bool)
    going = np.arange(len(Q))
    # of every row: squared residuals, infinite before there are any, and the share of them that goes into the damping
    error_at_last_check = np.full(len(Q), np.inf)
    error_before = np.full(len(Q), np.inf)
    damping_share = np.full(len(Q), DAMPING_SHARE)
    weights = np.repeat([1.0 / reach_of(robot), PER_CHORD], 3)

    for step in range(steps + 1):
        error, felt, there = residuals(aims[going], poses(robot, Q[going]))
        reached[going] = there
        error = error * weights
        squared_error = (error * error).sum(axis=1)

        # every few steps those are given up whose error has not fallen enough since the last check
        goes_on = ~there
        if step > 0 and step % patience == 0:
            goes_on &= squared_error <= STALLED * error_at_last_check[going]
            error_at_last_check[going] = squared_error
        going = going[goes_on]
        error = error[goes_on]
        felt = felt[goes_on]
        squared_error = squared_error[goes_on]
        if len(going) == 0 or step == steps:
            break

        damping_share[going[squared_error > error_before[going]]] *= SHARE_GROWTH
        error_before[going] = squared_error
        J = _jacobians(robot, aims[going], felt, Q[going]) * weights[:, None]
        J[:, :3][(aims[going, BOX : BOX + 3] > 0.0) & (error[:, :3] == 0.0)] = 0.0  # free to move inside the box
        Q[going] = np.clip(
            Q[going] + _changes(robot, J, error, DAMPING + damping_share[going] * squared_error, Q[going]),
            robot.lower,
            robot.upper,
        )

    return Q, reached, step


def residuals(aims: Matrix, tips: NDArray[np.float64]) -> tuple[Matrix, NDArray[np.float64], Mask]:
    """What separates tips, shape (m, 4, 4), from their goals: [m] and chords in the goals' axes, shape (m, 6).

    Returns:
        The residuals; what of a turn they feel as matrices, shape (m, 3, 3), not the part about an axis of the tip
        that may point anywhere in its own turn; and whether they are within tolerance, shape (m,).
    """
    turned = aims[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1)
    free = aims[:, FREE_TURN].astype(int)
    position = (turned @ (tips[:, :3, 3] - aims[:, 9:12])[..., None])[..., 0]
    half_box = aims[:, BOX : BOX + 3]
    R = turned @ tips[:, :3, :3]

    skew = -0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    cosine = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    felt_turn = np.tile(np.eye(3), (len(aims), 1, 1))

    for axis in range(3):
        rows = free == axis
        tip_axis = R[rows, :, axis]
        skew[rows] = np.cross(tip_axis, np.eye(3)[axis])
        cosine[rows] = tip_axis[:, axis]
        felt_turn[rows] -= tip_axis[:, :, None] * tip_axis[:, None]
    skew[free == ANY_TURN] = 0.0
    cosine[free == ANY_TURN] = 1.0
    felt_turn[free == ANY_TURN] = 0.0

    half = np.sqrt(np.maximum(0.5 * (1.0 + cosine), 0.0))
    # half a turn about an axis that rounding hides: any will do, the next step sees better
    hidden = half < HALF_TURN_COSINE
    skew[hidden] = np.eye(3)[np.where(free[hidden] == 0, 1, 0)]
    half[hidden] = 0.5

    error = np.hstack([np.clip(position, -half_box, half_box) - position, skew / half[:, None]])
    distance = np.linalg.norm(error[:, :3], axis=1)
    turn = np.linalg.norm(error[:, 3:], axis=1)
    return error, felt_turn, (distance <= aims[:, POSITION_TOLERANCE]) & (turn <= aims[:, CHORD_TOLERANCE])


def farness(robot: Robot, aims: Matrix, tips: NDArray[np.float64]) -> Matrix:
    """How far each of the tips, shape (n, 4, 4), is from each goal, squared and without units, shape (m, n)."""
    offset = tips[None, :, :3, 3] - aims[:, None, 9:12]
    free = aims[:, FREE_TURN].astype(int)
    same = np.einsum("nij,mij->mnj", tips[:, :3, :3], aims[:, :9].reshape(-1, 3, 3))
    counts = (free[:, None] == NO_TURN) | (free[:, None] == np.arange(3))
    turned = ((1.0 - same) * counts[:, None]).sum(axis=2)
    squared: Matrix = (offset * offset).sum(axis=2) / reach_of(robot) ** 2 + PER_CHORD**2 * turned
    return squared


def _jacobians(robot: Robot, aims: Matrix, felt: NDArray[np.float64], Q: Matrix) -> NDArray[np.float64]:
    """Jacobians in the axes of the goals, turns as far as they are felt, shape (m, 6, dof)."""
    turned = aims[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1)
    J = jacobians(robot, Q)
    return np.concatenate([turned @ J[:, :3], felt @ turned @ J[:, 3:]], axis=1)


def _changes(robot: Robot, J: NDArray[np.float64], error: Matrix, damping: Vector, Q: Matrix) -> Matrix:
    """Steps J^T (J J^T + damping)^-1 e without the joints at a limit that would go on beyond it, shape (m, dof)."""
    pull = np.einsum("mki,mk->mi", J, error)
    pinned = ((robot.lower >= Q) & (pull < 0.0)) | ((robot.upper <= Q) & (pull > 0.0))
    J = np.where(pinned[:, None], 0.0, J)
    square = J @ J.transpose(0, 2, 1) + damping[:, None, None] * np.eye(6)
    solved = np.linalg.solve(square, error[..., None])
    change: Matrix = (J.transpose(0, 2, 1) @ solved)[..., 0]
    change *= LARGEST_STEP / np.maximum(np.abs(change).max(axis=1, keepdims=True), LARGEST_STEP)
    return change
