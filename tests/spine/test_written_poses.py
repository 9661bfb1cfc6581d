"""Poses in the forms in which a person writes them."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.errors import InputError
from rrtik_ompl.poses import pose, pose_from_rpy, rigid

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


@pytest.mark.parametrize("form", [[0.1, 0.2], [[0.0, 1.0]], "here", [*XYZ, 0.0, 0.0, 2.0, 0.0], [0.0, np.nan, 0.0]])
def test_what_is_no_pose_is_refused_in_a_line(form):
    with pytest.raises(InputError, match=r"^here:") as caught:
        rigid(form, "here")
    assert "\n" not in str(caught.value)
