"""The robot: forward kinematics, its derivative, mimics, base pose, and the checks of what a user gives it."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text

MIXED = """<robot name="mixed"><link name="base"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="a"/><link name="b"/><link name="c"/><link name="d"><collision><geometry><sphere radius="1"/></geometry>
</collision></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="a"/><origin xyz="0 0 1" rpy="0.3 0 0"/>
  <axis xyz="0.6 0 0.8"/></joint>
<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0.6 0.8"/>
  <limit lower="0" upper="1" velocity="1" effort="1"/></joint>
<joint name="bend" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="follow" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-4" upper="4" velocity="1.5" effort="1"/><mimic joint="bend" multiplier="-1.5" offset="0.2"/></joint>
</robot>"""

T_BASE = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0]))


@pytest.fixture(scope="module")
def mixed():
    return robot_from_urdf_text(MIXED)


@settings(max_examples=60, deadline=None)
@given(q=st.lists(st.floats(-1.9, 1.9), min_size=3, max_size=3))
def test_the_jacobian_is_the_derivative_of_forward_kinematics(q):
    robot, step = robot_from_urdf_text(MIXED), 1e-6
    jacobian, here = robot.jacobian(q), robot.fk(q)
    for k in range(3):
        ahead, behind = (robot.fk(np.array(q) + s * step * np.eye(3)[k]) for s in (1, -1))
        linear = (ahead.translation - behind.translation) / (2 * step)
        turns = [pin.log3(there.rotation @ here.rotation.T) for there in (ahead, behind)]
        angular = (turns[0] - turns[1]) / (2 * step)
        np.testing.assert_allclose(jacobian[:, k], np.concatenate([linear, angular]), atol=1e-6)


def test_forward_kinematics_of_every_link_equals_pinocchios(mixed):
    Q = np.random.default_rng(3).uniform(-2, 2, (50, 3))
    data = mixed.model.createData()
    for link in mixed.link_names:
        for pose, full in zip(mixed.fk_batch(Q, link), mixed.pinocchio_configuration(Q), strict=True):
            pin.framesForwardKinematics(mixed.model, data, full)
            np.testing.assert_allclose(pose, data.oMf[mixed.model.getFrameId(link)].homogeneous, atol=1e-12)


def test_a_full_turn_of_a_continuous_joint_changes_nothing(mixed):
    np.testing.assert_allclose(
        mixed.fk([0.3 + 2 * np.pi, 0.1, 0.2]).homogeneous, mixed.fk([0.3, 0.1, 0.2]).homogeneous, atol=1e-14
    )
    assert mixed.continuous.tolist() == [True, False, False]
    assert mixed.prismatic.tolist() == [False, True, False]


def test_a_base_pose_moves_every_link_and_every_solid():
    plain, moved = robot_from_urdf_text(MIXED), robot_from_urdf_text(MIXED, base_pose=T_BASE)
    q = [0.3, 0.1, 0.2]
    for link in plain.link_names:
        np.testing.assert_allclose(moved.fk(q, link).homogeneous, (T_BASE * plain.fk(q, link)).homogeneous, atol=1e-12)
    for before, after in zip(plain.collision.geometryObjects, moved.collision.geometryObjects, strict=True):
        placed = [pin.SE3(robot.joint_frames(np.array([q]))[0, item.parentJoint]) * item.placement
                  for robot, item in ((plain, before), (moved, after))]  # fmt: skip
        np.testing.assert_allclose(placed[1].homogeneous, (T_BASE * placed[0]).homogeneous, atol=1e-12)


def test_a_robot_cannot_be_changed(mixed):
    with pytest.raises(AttributeError):
        mixed.tip = "base"
    with pytest.raises(ValueError, match="read-only"):
        mixed.lower[0] = 0.0


@pytest.mark.parametrize(("gain", "bend"), [("-1", 1.0), ("-1.5", 1.0 - 2 * np.pi)])
def test_a_posture_outside_the_limits_by_a_full_turn_is_turned_inside_if_what_follows_turns_fully_too(gain, bend):
    text = MIXED.replace('multiplier="-1.5"', f'multiplier="{gain}"')
    robot = robot_from_urdf_text(text, postures={"far": {"turn": 9.0, "slide": 0.5, "bend": 1.0 - 2 * np.pi}})
    np.testing.assert_allclose(robot.posture("far"), [9.0, 0.5, bend])


@pytest.mark.parametrize(
    ("values", "expected"),
    [([0, 0], "3 joints"), ([0, 0, np.nan], "finite"), (["a", 0, 0], "numbers"), ([[0, 0, 0]], "shape"), (3, "shape")],
)
def test_a_bad_configuration_is_refused(mixed, values, expected):
    with pytest.raises(InputError, match=expected):
        mixed.fk(values)


def test_unknown_frames_and_postures_list_the_alternatives():
    robot = load_robot("titan4")
    with pytest.raises(UnknownNameError, match="grip_point"):
        robot.fk(np.zeros(6), "grip_pint")
    with pytest.raises(UnknownNameError, match="stowed"):
        robot.posture("stoved")


def test_limits_are_closed_and_tolerate_rounding(mixed):
    assert mixed.within_limits([[0.0, 0.0, 2.0], [99.0, 1.0 + 9e-6, -2.0], [0.0, 1.0 + 2e-5, 0.0]]).tolist() == [
        True,
        True,
        False,
    ]
    assert mixed.clamp(np.array([50.0, 1.5, -3.0])).tolist() == [50.0, 1.0, -2.0]


def test_the_frame_of_a_joint_is_where_the_description_puts_it_also_for_a_slanted_endless_axis():
    robot = robot_from_urdf_text(MIXED)
    reference = pin.buildModelFromXML(MIXED)
    data, q = reference.createData(), np.array([0.7, 0.4, -0.3])
    full = np.array([np.cos(0.7), np.sin(0.7), 0.4, -0.3, 0.65])
    pin.framesForwardKinematics(reference, data, full)
    for joint in ("turn", "slide", "bend", "follow"):
        pose = data.oMf[reference.getFrameId(joint)]
        np.testing.assert_allclose(robot.fk(q, joint).homogeneous, pose.homogeneous, atol=1e-12)


def test_a_robot_of_one_joint_has_a_jacobian_of_one_column():
    robot = load_robot("planar", parameters={"lengths": [2.0]})
    np.testing.assert_allclose(robot.jacobian([0.0])[:, 0], [0, 2, 0, 0, 0, 1], atol=1e-12)


def test_the_finite_range_lies_inside_the_limits_wherever_they_are():
    rail = """<robot name="rail"><link name="a"/><link name="b"/><link name="c"/>
    <joint name="far" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
    <limit lower="5" upper="9" velocity="1" effort="1"/></joint>
    <joint name="turn" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/></joint></robot>"""
    lower, upper = robot_from_urdf_text(rail).finite_range()
    np.testing.assert_allclose(lower, [5.0, -np.pi])
    np.testing.assert_allclose(upper, [9.0, np.pi])


def test_a_joint_that_follows_a_moving_one_cannot_be_locked():
    with pytest.raises(InputError, match="follow"):
        robot_from_urdf_text(MIXED, locked={"follow": 0.1})
