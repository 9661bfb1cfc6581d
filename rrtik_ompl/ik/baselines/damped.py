"""Jacobian methods: damped least squares for many starts at once, and Pinocchio's iteration for one start.

Sources: [24]; the inverse kinematics example in Pinocchio's documentation (step 0.1, damping 1e-12, at most 1000
steps), which does not regard joint limits.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import TAU, Matrix, Vector
from rrtik_ompl.base.poses import working_memory
from rrtik_ompl.ik.residual import shortened, twist, walked
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot, jacobians, pinocchio_rows, poses

ITERATIONS = 200
DAMPING = 0.05  # constant damping [m or rad]; it is squared where it is used
LARGEST_STEP = 0.5  # largest step of any joint [rad or m]
STEPS = 1000  # largest number of steps of Pinocchio's iteration
STEP = 0.1  # share of the error that one step of Pinocchio's iteration removes
TINY = 1e-12  # damping of Pinocchio's iteration
CLOSE = 1e-4  # norm of the error [m and rad] at which Pinocchio's iteration ends


def damped_least_squares(
    robot: Robot, goal: Target, starts: Matrix, *, iterations: int = ITERATIONS, enough: int | None = None
) -> tuple[Matrix, int]:
    """Take steps dq = J^T (J J^T + damping^2 I)^-1 e from many starts, clipped to the limits.

    Args:
        robot: The arm.
        goal: A pose, or a position with any orientation.
        starts: Configurations to start from, shape (m, dof).
        iterations: Largest number of steps.
        enough: Number of starts that have to arrive; all of them if None.

    Returns:
        The last configuration of each start, shape (m, dof), and the number of steps taken.
    """
    rows = slice(0, 6 if goal.oriented else 3)

    def step(Q: Matrix) -> Matrix:
        e = twist(goal, poses(robot, Q))[:, rows, None]
        J = jacobians(robot, Q)[:, rows]
        square = J @ J.transpose(0, 2, 1) + DAMPING**2 * np.eye(J.shape[1])
        dq = (J.transpose(0, 2, 1) @ np.linalg.solve(square, e))[..., 0]
        return robot.clamp(Q + shortened(dq, LARGEST_STEP))

    return walked(robot, goal, starts, step, iterations, enough)


def pinocchio_iteration(robot: Robot, goal: Target, starts: Matrix) -> tuple[Matrix, int]:
    """Run Pinocchio's own loop from each start; angles are moved into the limits by full turns where that helps.

    Returns:
        The last configuration of each start, inside the limits or not, shape (m, dof), and the number of all steps.
    """
    walked = [_one_start(robot, goal, q) for q in starts]
    return np.array([q for q, _ in walked]), sum(steps for _, steps in walked)


def _one_start(robot: Robot, goal: Target, q: Vector) -> tuple[Vector, int]:
    model = robot.model
    data = working_memory(robot.model)
    frame = model.getFrameId(robot.tip)
    steps = 0

    # Errors and Jacobian are in the frame of the tip, as in Pinocchio's example.
    while steps < STEPS:
        full = pinocchio_rows(robot, q[None])[0]
        pin.framesForwardKinematics(model, data, full)
        J = np.reshape(pin.computeFrameJacobian(model, data, full, frame, pin.ReferenceFrame.LOCAL), (6, -1))
        J = J @ robot.chain.gain
        here = data.oMf[frame]

        if not goal.oriented:
            error = here.actInv(goal.point)
            J = J[:3]
        else:
            error_pose = here.actInv(goal.pose)
            error = pin.log6(error_pose).vector
            J = pin.Jlog6(error_pose.inverse()) @ J

        if np.linalg.norm(error) < CLOSE:
            break
        q = q + STEP * (J.T @ np.linalg.solve(J @ J.T + TINY * np.eye(len(J)), error))
        steps += 1

    return _into_limits(robot, q), steps


def _into_limits(robot: Robot, q: Vector) -> Vector:
    """Move joints that turn by full turns to the lowest value above their lower limit."""
    turning = ~robot.prismatic & np.isfinite(robot.lower)
    moved: Vector = np.where(turning, q + TAU * np.ceil((np.where(turning, robot.lower, 0.0) - q) / TAU), q)
    return moved
