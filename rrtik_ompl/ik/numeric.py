"""Numeric inverse kinematics of any arm, many starts at once: Levenberg-Marquardt with a damping that needs no tuning.

Source: T. Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE Transactions
on Robotics 27 (2011), 984-991: the damping is the residual itself plus a small constant, so that steps are short far
from the target and in singular postures, and Newton's near the solution.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.goal import PoseGoal, PositionGoal
from rrtik_ompl.ik.residual import twist, well_inside
from rrtik_ompl.robot import Robot

ITERATIONS = 60
DAMPING = 1e-6  # the constant part, in units of the squared residual (1 is the reach)
LARGEST_STEP = 0.5  # [rad] or [m] of any joint in one iteration


def numeric_ik(robot: Robot, goal: PoseGoal | PositionGoal, starts: Matrix, *, iterations: int = ITERATIONS) -> Matrix:
    """Move configurations towards a goal, each from its own start, inside the joint limits.

    Args:
        robot: The arm.
        goal: A pose, or a position with any orientation.
        starts: Shape (m, dof).
        iterations: Steps at most.

    Returns:
        The rows that satisfy the goal, in the order of their starts, shape (k, dof), k <= m.
    """
    Q, _ = descend(robot, goal, starts, iterations=iterations)
    return Q[goal.satisfied(robot, Q)]


def descend(
    robot: Robot, goal: PoseGoal | PositionGoal, starts: Matrix, *, iterations: int = ITERATIONS
) -> tuple[Matrix, int]:
    """As `numeric_ik`, but where every start has led to, at the goal or not: shape (m, dof), and the steps taken."""
    Q = np.clip(starts, robot.lower, robot.upper)
    reach = float(np.linalg.norm(robot.chain.placement[:, :3, 3], axis=1).sum()) or 1.0
    scale = np.array([1.0 / reach] * 3 + [0.5] * 3)  # a full turn of orientation counts as much as the whole reach
    for step in range(iterations):
        open_rows = np.flatnonzero(~well_inside(robot, goal, Q))
        if len(open_rows) == 0:
            return Q, step
        q = Q[open_rows]
        residual, jacobian = twist(goal, robot.fk_batch(q)), robot.jacobian_batch(q)
        rows = slice(0, 3) if isinstance(goal, PositionGoal) else slice(0, 6)
        e, J = (residual * scale)[:, rows], (jacobian * scale[:, None])[:, rows]
        Q[open_rows] = np.clip(q + bounded_step(J, e), robot.lower, robot.upper)
    return Q, iterations


def bounded_step(J: NDArray[np.float64], e: Matrix) -> Matrix:
    """Solve (J^T J + (e^T e / 2 + DAMPING) I) dq = J^T e for every row; shapes (m, k, n), (m, k) -> (m, n)."""
    damping: Vector = 0.5 * np.einsum("mi,mi->m", e, e) + DAMPING
    normal = np.einsum("mki,mkj->mij", J, J) + damping[:, None, None] * np.eye(J.shape[2])
    step: Matrix = np.linalg.solve(normal, np.einsum("mki,mk->mi", J, e)[..., None])[..., 0]
    largest = np.abs(step).max(axis=1, keepdims=True)
    bounded: Matrix = step * np.minimum(1.0, LARGEST_STEP / np.maximum(largest, 1e-12))
    return bounded
