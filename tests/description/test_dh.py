"""Robots from DH tables: forward kinematics is the product of the rows, in both conventions."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.dh import DhRow, robot_from_dh

LENGTH = st.floats(-1.0, 1.0).map(lambda x: round(x, 3))
ANGLE = st.floats(-3.1, 3.1)
ROW = st.builds(
    DhRow, a=LENGTH, alpha=ANGLE, d=LENGTH, theta=ANGLE, kind=st.sampled_from(["revolute", "continuous", "prismatic"])
)


def rot(axis, angle):
    matrix = np.eye(4)
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    matrix[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return matrix


def shift(x, z):
    matrix = np.eye(4)
    matrix[0, 3], matrix[2, 3] = x, z
    return matrix


def product(rows, q, convention):
    matrix = np.eye(4)
    for row, value in zip(rows, q, strict=True):
        slides = row.kind == "prismatic"
        z_part = rot("z", row.theta + (0 if slides else value)) @ shift(0, row.d + (value if slides else 0))
        if convention == "standard":
            matrix = matrix @ z_part @ shift(row.a, 0) @ rot("x", row.alpha)
        else:
            matrix = matrix @ rot("x", row.alpha) @ shift(row.a, 0) @ z_part
    return matrix


@settings(max_examples=60, deadline=None)
@given(rows=st.lists(ROW, min_size=1, max_size=5), convention=st.sampled_from(["standard", "modified"]), data=st.data())
def test_forward_kinematics_is_the_product_of_the_rows(rows, convention, data):
    q = np.array(data.draw(st.lists(st.floats(-3, 3), min_size=len(rows), max_size=len(rows))))
    robot = robot_from_dh("arm", rows, convention=convention)
    np.testing.assert_allclose(robot.fk(q).homogeneous, product(rows, q, convention), atol=1e-12)


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_the_capsules_join_the_joint_axes_without_gaps(convention):
    rows = [DhRow(a=0.3, alpha=1.0, d=0.2), DhRow(a=0.4, alpha=-0.5, d=0.1), DhRow(a=0.2, d=0.3)]
    robot = robot_from_dh("arm", rows, convention=convention, radius=0.01, tool=pin.SE3(np.eye(3), np.ones(3)))
    frames = robot.joint_frames(np.array([[0.3, -0.8, 0.5]]))[0]
    ends = []
    for item in robot.collision.geometryObjects:
        placement = pin.SE3(frames[item.parentJoint]) * item.placement
        half = np.array([0, 0, item.geometry.halfLength])
        ends += [placement.act(-half), placement.act(half)]
    np.testing.assert_allclose(ends[0], np.zeros(3), atol=1e-12)
    np.testing.assert_allclose(ends[1:-1:2], ends[2::2], atol=1e-12)
    np.testing.assert_allclose(ends[-1], robot.fk([0.3, -0.8, 0.5]).translation, atol=1e-12)


def test_a_floor_gap_keeps_the_first_link_above_the_base_and_moves_nothing_else():
    rows = [DhRow(d=0.6), DhRow(a=0.4)]
    plain, raised = (robot_from_dh("arm", rows, convention="standard", radius=0.1, floor_gap=g) for g in (0.0, 0.1))
    low, high = (robot.collision.geometryObjects[0] for robot in (plain, raised))
    assert low.placement.translation[2] - low.geometry.halfLength - 0.1 == pytest.approx(-0.1)
    assert high.placement.translation[2] - high.geometry.halfLength - 0.1 == pytest.approx(0.0)
    assert high.placement.translation[2] + high.geometry.halfLength == pytest.approx(0.6)


def test_the_two_conventions_give_two_different_arms():
    rows = [DhRow(a=0.3, alpha=1.0), DhRow(a=0.4, alpha=-0.5)]
    standard, modified = (robot_from_dh("arm", rows, convention=c).fk([0.2, 0.4]) for c in ("standard", "modified"))
    assert np.abs(standard.homogeneous - modified.homogeneous).max() > 0.1


FILE = """\
version: 1
name: scara
dh:
  convention: standard
  radius: [0.05, 0.04, 0.02]
  tool: {xyz: [0, 0, 0.1]}
  rows:
    - {joint: shoulder, a: 0.4, limits_deg: [-90, 120], velocity: 2.0}
    - {joint: elbow, type: continuous, a: 0.3, alpha_deg: 180}
    - {joint: quill, type: prismatic, d: 0.05, limits: [0.0, 0.2]}
postures_deg:
  out: [90, -90, 0.1]
"""


def test_a_dh_file_is_loaded_by_its_path(tmp_path):
    path = tmp_path / "scara.yaml"
    path.write_text(FILE)
    robot = load_robot(path)
    assert robot.joint_names == ("shoulder", "elbow", "quill")
    assert robot.continuous.tolist() == [False, True, False]
    assert robot.prismatic.tolist() == [False, False, True]
    np.testing.assert_allclose(robot.upper[[0, 2]], [np.radians(120), 0.2])
    np.testing.assert_allclose(robot.fk(robot.posture("out")).translation, [0.3, 0.4, -0.25], atol=1e-12)
    assert robot.source == {"dh": str(path)}


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("standard", "craig", "convention"),
        ("version: 1", "version: 2", "version"),
        ("version: 1", "version: true", "version"),
        ("a: 0.4", "a: long", "rows"),
        ("a: 0.4", "length: 0.4", "unknown key 'length'"),
        ("[-90, 120]", "[120, -90]", "swap them"),
        ("limits: [0.0, 0.2]", "limits_deg: [0, 20]", "a prismatic joint takes limits"),
        (", limits: [0.0, 0.2]", "", "needs limits"),
        ("0.02]", "0.02, 0.01]", "radius"),
        ("-90, 0.1]", "0.1]", "expected 3 numbers"),
        ("joint: elbow", "joint: shoulder", "stands there twice"),
        ("type: continuous", "type: floating", "type"),
    ],
)
def test_a_bad_dh_file_gets_one_line_with_its_place(tmp_path, old, new, expected):
    path = tmp_path / "bad.yaml"
    path.write_text(FILE.replace(old, new, 1))
    with pytest.raises(InputError, match=expected) as caught:
        load_robot(path)
    assert str(caught.value).startswith(f"{path}:")


@pytest.mark.parametrize(
    ("rows", "options", "expected"),
    [
        ([], {}, "no rows"),
        ([DhRow(a=np.nan)], {}, "a: must be a finite number"),
        ([DhRow(a=1, kind="ball")], {}, "no joint type 'ball'"),
        ([DhRow(a=1)], {"convention": "denavit"}, "no DH convention 'denavit'"),
        ([DhRow(a=1)], {"radius": -1.0}, "must not be negative"),
        ([DhRow(a=1)], {"radius": [1.0, 2.0]}, "radius"),
        ([DhRow(a=1, limits=(1.0, -1.0))], {}, "lower must be below upper"),
        ([DhRow(a=1)], {"postures": {"home": [0, 0]}}, "posture 'home'"),
    ],
)
def test_a_bad_table_gets_one_line(rows, options, expected):
    with pytest.raises(InputError, match=expected):
        robot_from_dh("arm", rows, **{"convention": "standard"} | options)
