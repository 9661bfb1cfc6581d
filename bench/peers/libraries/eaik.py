"""EAIK (C++; all solutions in closed form, of which the first inside the limits is taken)."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.peers.ik import Solver
from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.model.robot import Robot


def solver(robot: Robot, start: np.ndarray) -> Solver:
    """From a pose to a configuration; the start is of no use to it."""
    arm, at_zero = eaik_robot(robot)

    def solve(pose: np.ndarray) -> np.ndarray | None:
        answer = arm.IK(turned_back(pose, at_zero))
        exact = ~np.array(answer.is_LS, dtype=bool)
        found = turned_inside(robot, np.array(answer.Q).reshape(-1, robot.dof)[exact])
        inside = found[robot.within_limits(found)]
        return inside[0] if len(inside) else None

    return solve


def eaik_robot(robot: Robot) -> tuple[Any, np.ndarray]:
    """EAIK's robot from the axes and offsets at zero, and the rotation of the tip there.

    Raises:
        ImportError: If it is not installed.
        ValueError: If it knows no decomposition of this arm.
    """
    from eaik.IK_HP import HPRobot

    if robot.dof != 6:
        raise ValueError(f"it solves six joints, this arm has {robot.dof}")
    zero = np.zeros((1, robot.dof))
    frames, tip = robot.joint_frames(zero)[0, 1:], robot.fk_batch(zero)[0]
    points = np.vstack([np.zeros(3), frames[:, :3, 3], tip[:3, 3]])
    solver = HPRobot(np.einsum("kij,kj->ki", frames[:, :3, :3], robot.chain.axis), np.diff(points, axis=0))
    if not solver.hasKnownDecomposition():
        raise ValueError("it knows no decomposition of this arm")
    return solver, tip[:3, :3]


def turned_back(poses: np.ndarray, at_zero: np.ndarray) -> np.ndarray:
    """Poses of the tip as EAIK takes them, its rotation at zero being none. Shape (..., 4, 4)."""
    turned = poses.copy()
    turned[..., :3, :3] = poses[..., :3, :3] @ at_zero.T
    return turned


def turned_inside(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Angles moved by full turns to the lowest value above the lower limit."""
    low = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    return np.where(robot.prismatic, q, low + (q - low) % TAU)
