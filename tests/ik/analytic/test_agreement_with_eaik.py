"""An independent check, where it is installed: subproblem decomposition of the same arms (EAIK)."""

import numpy as np
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import solutions

eaik = pytest.importorskip("eaik.IK_HP", reason="pip install eaik")


def axes_and_offsets(robot):
    """Joint axes, shape (6, 3), and the offsets from the base over the joints to the tip, shape (7, 3), at zero."""
    frames = robot.joint_frames(np.zeros((1, 6)))[0, 1:]
    points = np.vstack([np.zeros(3), frames[:, :3, 3], robot.fk(np.zeros(6)).translation])
    return np.einsum("kij,kj->ki", frames[:, :3, :3], robot.chain.axis), np.diff(points, axis=0)


@pytest.mark.parametrize("name", ["titan4", "puma560", "ur5", "ur10_limited", "z1"])
def test_both_find_the_same_solutions(name):
    robot = load_robot(name)
    other, at_zero = eaik.HPRobot(*axes_and_offsets(robot)), robot.fk(np.zeros(6)).rotation
    for q in np.random.default_rng(4).uniform(robot.lower, robot.upper, (100, 6)):
        pose = robot.fk(q).homogeneous
        found = solutions(robot, pose[None], check=False)
        pose[:3, :3] = pose[:3, :3] @ at_zero.T  # EAIK's tip is parallel to the base at zero
        answer = other.IK(pose)
        theirs = np.array([q for q, approximate in zip(answer.Q, answer.is_LS, strict=True) if not approximate])
        ours = found.branches[0][found.real[0]]
        gaps = np.abs(wrapped(theirs[:, None] - ours[None])).max(axis=2)
        assert len(theirs) == len(ours)
        assert gaps.min(axis=1).max() < 1e-6
        assert gaps.min(axis=0).max() < 1e-6
