"""Poses in the forms in which a person writes them."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose, pose_from_rpy, quaternion_xyzw, rigid

XYZ, RPY = [0.4, -0.1, 0.3], [0.2, -0.5, 1.0]
POSE = pose_from_rpy(XYZ, RPY)


@pytest.mark.parametrize(
    ("form", "meant"),
    [
        (POSE, POSE),
        (POSE.homogeneous, POSE),
        (POSE.homogeneous.tolist(), POSE),
        (XYZ, pin.SE3(np.eye(3), np.array(XYZ))),
        (XYZ + RPY, POSE),
        ([*XYZ, 0.0, 0.0, 1.0, 0.0], pose(XYZ, [0.0, 0.0, 1.0, 0.0])),
    ],
)
def test_all_forms_of_a_pose_mean_the_same(form, meant):
    assert np.allclose(rigid(form, "pose").homogeneous, meant.homogeneous)
    assert np.allclose(rrtik.PoseGoal(form).T_world_tip.homogeneous, meant.homogeneous)
    robot = rrtik.load_robot("ur5", base_pose=form)
    assert np.allclose(robot.fk(np.zeros(6), "base_link").homogeneous, meant.homogeneous)


def test_inverse_kinematics_takes_a_pose_in_any_form():
    robot = rrtik.load_robot("ur5")
    T = robot.fk([0.3, -1.2, 1.0, 0.4, 0.5, 0.6])
    wanted = rrtik.solve_ik(robot, rrtik.PoseGoal(T)).solutions
    quat = [*T.translation, *quaternion_xyzw(T)]
    for form in (T, T.homogeneous, T.homogeneous.tolist(), [*T.translation, *pin.rpy.matrixToRpy(T.rotation)], quat):
        assert np.allclose(rrtik.solve_ik(robot, form).solutions, wanted, atol=1e-4)


@pytest.mark.parametrize("form", [[0.1, 0.2], [[0.0, 1.0]], "here", [*XYZ, 0.0, 0.0, 2.0, 0.0], [0.0, np.nan, 0.0]])
def test_what_is_no_pose_is_refused_in_a_line(form):
    with pytest.raises(InputError, match=r"^here:") as caught:
        rigid(form, "here")
    assert "\n" not in str(caught.value)


def test_pose_takes_every_form_that_a_person_may_write():
    angles = rrtik.pose([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert angles.isApprox(rrtik.PoseGoal([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]).T_world_tip)
    assert rrtik.pose(angles.homogeneous) == angles
    with pytest.raises(InputError, match=r"pose: .*1e"):
        rrtik.pose([0.0, 0.0, 1e30])
