"""The kernel that follows a rail against its reference implementation in numpy."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.ik.kernel_tables import KernelCall, limb_of
from rrtik_ompl.kernels.ik import rail_layout
from rrtik_ompl.kernels.ik.ik_layout import AIM_FLOATS
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.planning.tip_motion.following import (
    Leaning,
    Tolerance,
    centred,
    follow,
    follow_plainly,
    levers_of,
    packed_rail,
    redundant,
)
from rrtik_ompl.planning.tip_motion.rails import arc_rail, screw_rail, straight_rail
from rrtik_tests.sizes import how_many

TOLERANCE = Tolerance(1e-4, np.radians(0.1))
ROBOTS = ["titan4", "ur5", "panda", "kinova", "ur3_gripper", "so100", "planar3"]


def random_rails(robot, rng):
    q = rng.uniform(*robot.finite_range())
    begin = robot.fk(q)
    end = pin.SE3(begin.rotation @ pin.exp3(rng.normal(0.0, 0.2, 3)), begin.translation + rng.normal(0.0, 0.1, 3))
    through = begin.translation + rng.normal(0.0, 0.1, 3)
    return q, (straight_rail(begin, end), screw_rail(begin, end), arc_rail(begin, end, through))


@pytest.mark.kernels
@pytest.mark.parametrize("name", ROBOTS)
def test_kernel_and_reference_come_equally_far_by_the_same_configurations(name):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(2)
    for _ in range(how_many(3, 1)):
        q, rails = random_rails(robot, rng)
        homing = Leaning(rng.uniform(*robot.finite_range()), np.full(robot.dof, float(redundant(robot))), homing=True)
        for rail in rails:
            for leaning in (centred(robot), homing):
                fast, plain = (f(robot, rail, q, TOLERANCE, leaning) for f in (follow, follow_plainly))
                assert fast.shares[-1] == pytest.approx(plain.shares[-1], abs=1e-4)
                if len(fast.rows) == len(plain.rows):
                    assert np.abs(fast.rows - plain.rows).max() < 1e-3


@pytest.mark.kernels
@pytest.mark.parametrize("name", ROBOTS)
def test_no_kernel_writes_beyond_an_array(name):
    robot, kernels = rrtik.load_robot(name), library(rail_layout.KERNELS)
    rng = np.random.default_rng(3)
    q, rails = random_rails(robot, rng)
    for rail in rails:
        aim = np.zeros((1, AIM_FLOATS))
        aim[0, 12:14], aim[0, 17] = 1e-7, -1.0
        limb, call = limb_of(robot), KernelCall(limb_of(robot), aim, q[None], 8, 9)
        table = packed_rail(robot, rail, q, TOLERANCE, centred(robot))
        kernels.follow(limb.address, call.address, table.address)
        assert limb.intact()
        assert call.intact()
        assert table.intact()


@pytest.mark.parametrize("name", ["titan4", "panda", "so100"])
def test_no_joint_is_farther_from_the_tip_than_its_lever(name):
    robot = rrtik.load_robot(name)
    Q = np.random.default_rng(1).uniform(*robot.finite_range(), (2000, robot.dof))
    tips, frames = robot.fk_batch(Q)[:, :3, 3], robot.joint_frames(Q)
    joint = robot.model.frames[robot.model.getFrameId(robot.tip)].parentJoint
    for lever in levers_of(robot)[::-1]:
        assert np.linalg.norm(tips - frames[:, joint, :3, 3], axis=1).max() <= lever + 1e-9
        joint = robot.model.parents[joint]
