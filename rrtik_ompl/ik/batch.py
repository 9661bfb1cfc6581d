"""Inverse kinematics of an array of poses: by closed form all at once, and what that leaves one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Mask, Matrix, Vector, finite_array, frozen
from rrtik_ompl.goal import PoseGoal, joint_difference
from rrtik_ompl.ik.closed_form import check_rotations, form_of, has_closed_form, solutions, tip_fault
from rrtik_ompl.ik.face import SECONDS, solve_ik
from rrtik_ompl.robot import Robot
from rrtik_ompl.world import World


@dataclass(frozen=True, slots=True, eq=False)
class IkBatch:
    """One answer per pose.

    Attributes:
        q: The solution nearest to the posture asked for, shape (m, dof); NaN where there is none.
        found: Where there is one, shape (m,).
        residuals: Distance [m] and angle [rad] by forward kinematics, shape (m, 2); NaN where there is none.
        reasons: Why there is none, "" where there is one: see `IkResult`.
    """

    q: Matrix
    found: Mask
    residuals: Matrix
    reasons: tuple[str, ...]


def solve_ik_batch(
    robot: Robot,
    poses: ArrayLike,
    *,
    near: ArrayLike | None = None,
    world: World | None = None,
    seconds: float = SECONDS,
    seed: int = 0,
) -> IkBatch:
    """For each pose the solution nearest to a posture, inside the limits and, if a world is given, free of collision.

    Args:
        robot: The arm.
        poses: T_world_tip, shape (m, 4, 4).
        near: Posture, shape (dof,); the middle of the limits if None.
        world: If given, solutions in collision are left out.
        seconds: For each pose that has no closed-form solution.
        seed: Of the random numbers.

    Raises:
        InputError: If a pose is none, or an argument makes no sense.
    """
    targets = finite_array(poses, (None, 4, 4), "poses")
    if len(targets):
        check_rotations(targets[:, :3, :3], "poses")
    posture = 0.5 * np.sum(robot.finite_range(), axis=0) if near is None else robot.configuration(near, "near")
    q, residuals = np.full((len(targets), robot.dof), np.nan), np.full((len(targets), 2), np.nan)
    reasons = [""] * len(targets)
    if _fits(robot):
        _all_at_once(robot, targets, posture, world, q, residuals)
    for k in np.flatnonzero(np.isnan(q[:, 0])):
        goal = PoseGoal(targets[k])
        result = solve_ik(robot, goal, near=posture, world=world, seconds=seconds, seed=seed + int(k))
        reasons[k] = result.reason
        if result.found:
            q[k], residuals[k] = result.solutions[0], result.residuals[0]
    return IkBatch(frozen(q), frozen(~np.isnan(q[:, 0]), bool), frozen(residuals), tuple(reasons))


def _fits(robot: Robot) -> bool:
    return has_closed_form(robot) and form_of(robot).kind == "pose" and not tip_fault(robot, form_of(robot))


def _all_at_once(
    robot: Robot, targets: NDArray[np.float64], near: Vector, world: World | None, q: Matrix, residuals: Matrix
) -> None:
    """Write the nearest valid branch of each target into q, shape (m, dof), and residuals, shape (m, 2)."""
    found = solutions(robot, targets, near=near)
    valid = np.array(found.valid)
    if world is not None:
        rows = found.branches[valid]
        free = np.array(world.valid_batch(rows))
        free[free] = world.certify(rows[free])
        valid[valid] = free
    distance = np.linalg.norm(joint_difference(robot, found.branches, near), axis=2)
    best = np.argmin(np.where(valid, distance, np.inf), axis=1)
    done = np.flatnonzero(valid.any(axis=1))
    q[done] = robot.clamp(found.branches[done, best[done]])
    residuals[done] = np.asarray(found.residuals)[done, best[done]]
