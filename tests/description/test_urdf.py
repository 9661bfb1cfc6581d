"""Robots from URDF: kinematics as Pinocchio's own parser, groups, mimics, meshes, one clear line for every mistake."""

import os
import struct
import textwrap
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import ArmWarning, DescriptionWarning, InputError, MeshWarning
from rrtik_ompl.description.urdf import robot_from_urdf, robot_from_urdf_text
from rrtik_robots.example_arms import data_folder


def arm(extra="", links="<link name='base'/><link name='upper'/><link name='hand'/>", shoulder="", elbow=""):
    return f"""
    <robot name="arm">{links}
      <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
        <origin xyz="0 0 0.5" rpy="0 0 0.3"/><axis xyz="0 1 0"/>
        {shoulder or '<limit lower="-1" upper="2" velocity="3" effort="1"/>'}</joint>
      <joint name="elbow" type="revolute"><parent link="upper"/><child link="hand"/>
        <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
        {elbow or '<limit lower="-2" upper="1" velocity="3" effort="1"/>'}</joint>
      {extra}</robot>"""


def solid(geometry, tag="collision"):
    return arm(links=f"<link name='base'/><link name='upper'><{tag}><geometry>{geometry}</geometry></{tag}></link>"
               "<link name='hand'/>")  # fmt: skip


TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    "file",
    [
        "panda_description/urdf/panda.urdf",
        "kinova_description/robots/kinova.urdf",
        "baxter_description/urdf/baxter.urdf",
        "so_arm_description/urdf/so101.urdf",
        "tiago_description/robots/tiago_no_hand.urdf",
    ],
)
def test_link_poses_equal_those_of_pinocchios_own_parser(file):
    path = data_folder() / file
    ours, theirs = robot_from_urdf(path), pin.buildModelFromUrdf(str(path))
    rng = np.random.default_rng(1)
    values = dict(zip(ours.joint_names, rng.uniform(-1, 1, ours.dof), strict=True))
    followers = ours.chain.gain @ list(values.values()) + ours.chain.offset
    values |= dict(zip(list(ours.model.names)[1:], followers, strict=True))
    q = np.clip(pin.neutral(theirs), theirs.lowerPositionLimit, theirs.upperPositionLimit)  # where the others are held
    for number, joint in enumerate(theirs.names):
        if joint in values and theirs.nqs[number] == 1:
            q[theirs.idx_qs[number]] = values[joint]
        elif joint in values:
            q[theirs.idx_qs[number] :][:2] = np.cos(values[joint]), np.sin(values[joint])
    data = theirs.createData()
    pin.framesForwardKinematics(theirs, data, q)
    Q = np.array([[values[joint] for joint in ours.joint_names]])
    for link in ours.link_names:
        expected = data.oMf[theirs.getFrameId(link, pin.FrameType.BODY)].homogeneous
        np.testing.assert_allclose(ours.fk_batch(Q, link)[0], expected, atol=1e-12)


def test_a_joint_and_a_link_may_share_a_name():
    robot = robot_from_urdf_text(arm().replace("'hand'", "'elbow'").replace('"hand"', '"elbow"'))
    np.testing.assert_allclose(robot.fk([0, 0], "elbow").translation, [0.4 * np.cos(0.3), 0.4 * np.sin(0.3), 0.5])


def test_a_joint_that_is_not_chosen_is_held_at_its_locked_value():
    free, held = robot_from_urdf_text(arm()), robot_from_urdf_text(arm(), joints=["elbow"], locked={"shoulder": 0.7})
    assert held.joint_names == ("elbow",)
    np.testing.assert_allclose(held.fk([0.2]).homogeneous, free.fk([0.7, 0.2]).homogeneous, atol=1e-15)


def test_a_held_joint_without_a_value_stands_at_zero_or_at_the_limit_next_to_it():
    text = arm(shoulder='<limit lower="0.5" upper="2" velocity="1" effort="1"/>')
    np.testing.assert_allclose(
        robot_from_urdf_text(text, joints=["elbow"]).fk([0.0]).homogeneous,
        robot_from_urdf_text(text).fk([0.5, 0.0]).homogeneous,
        atol=1e-15,
    )


def test_a_tip_alone_chooses_the_joints_on_the_way_to_it():
    assert robot_from_urdf_text(arm(), tip="upper").joint_names == ("shoulder",)


def test_a_mimic_of_a_mimic_follows_the_first_joint():
    links = "".join(f"<link name='l{k}'/>" for k in range(4))
    joints = "".join(
        f"<joint name='j{k}' type='revolute'><parent link='l{k}'/><child link='l{k + 1}'/><axis xyz='0 0 1'/>"
        f"<limit lower='-3' upper='3' velocity='1' effort='1'/>{tie}</joint>"
        for k, tie in enumerate(
            ("", "<mimic joint='j0' multiplier='2' offset='0.1'/>", "<mimic joint='j1' multiplier='-3' offset='0.2'/>")
        )
    )
    robot = robot_from_urdf_text(f"<robot name='r'>{links}{joints}</robot>")
    q = 0.4
    turned = q + (2 * q + 0.1) + (-3 * (2 * q + 0.1) + 0.2)
    np.testing.assert_allclose(robot.fk([q]).rotation, pin.rpy.rpyToMatrix(0, 0, turned), atol=1e-14)
    assert robot.joint_names == ("j0",)


def test_a_continuous_joint_about_a_slanted_axis_turns_about_that_axis():
    text = arm().replace('name="elbow" type="revolute"', 'name="elbow" type="continuous"')
    robot = robot_from_urdf_text(text.replace("0 0 1", "1 2 -2"))
    assert robot.continuous.tolist() == [False, True]
    turn = robot.fk([0, 0]).rotation.T @ robot.fk([0, 0.9]).rotation
    np.testing.assert_allclose(turn, pin.exp3(0.9 * np.array([1, 2, -2]) / 3), atol=1e-14)


def test_a_named_cylinder_becomes_a_capsule_and_a_capsule_element_is_one():
    links = """<link name='base'/><link name='upper'>
      <collision name='c'><geometry><cylinder radius='0.1' length='0.5'/></geometry></collision>
      <collision><geometry><capsule radius='0.2' length='0.4'/></geometry></collision>
      <collision_checking><capsule name='c'/></collision_checking></link><link name='hand'/>"""
    first, second = robot_from_urdf_text(arm(links=links)).collision.geometryObjects
    for item, radius, half in ((first, 0.1, 0.25), (second, 0.2, 0.2)):
        assert type(item.geometry).__name__ == "Capsule"
        assert (item.geometry.radius, item.geometry.halfLength) == (radius, half)


def test_meshes_are_found_in_packages_above_the_file_and_beside_it(tmp_path):
    for folder in ("my_arm/meshes", "my_arm/urdf", "elsewhere/other_arm"):
        (tmp_path / folder).mkdir(parents=True)
    for file in ("my_arm/meshes/a.obj", "my_arm/urdf/b.obj", "elsewhere/other_arm/c.obj"):
        (tmp_path / file).write_bytes(TRIANGLE)
    shapes = ("package://my_arm/meshes/a.obj", "b.obj", "package://other_arm/c.obj")
    for uri in shapes:
        path = tmp_path / "my_arm/urdf/arm.urdf"
        path.write_text(solid(f"<mesh filename='{uri}'/>"))
        robot = robot_from_urdf(path, packages=tmp_path / "elsewhere")
        assert Path(robot.collision.geometryObjects[0].meshPath).name == uri.rpartition("/")[2]


def test_materials_may_be_defined_after_use_and_twice():
    text = solid("<sphere radius='1'/>", "visual").replace("</visual>", "<material name='red'/></visual>")
    extra = "<material name='red'><color rgba='1 0 0 1'/></material>" * 2
    robot = robot_from_urdf_text(text.replace("</robot>", extra + "</robot>"))
    assert robot.visual.geometryObjects[0].meshColor.tolist() == [1, 0, 0, 1]


def test_robots_of_one_file_share_its_surface_until_it_is_written_anew(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(solid("<mesh filename='a.obj'/>"))
    (tmp_path / "a.obj").write_bytes(TRIANGLE)
    one, other = (robot_from_urdf(path) for _ in range(2))
    (tmp_path / "a.obj").write_bytes(TRIANGLE.replace(b"1", b"2.5", 1))
    later = robot_from_urdf(path)
    surfaces = [robot.collision.geometryObjects[0].geometry for robot in (one, other, later)]
    assert surfaces[0] is surfaces[1]
    assert [surface.vertices().max() for surface in surfaces] == [1.0, 1.0, 2.5]


def test_a_mesh_that_is_only_drawn_is_read_when_somebody_looks(tmp_path, capfd):
    (tmp_path / "broken.obj").write_bytes(b"v 0 0 nan\n")
    text = solid("<mesh filename='broken.obj'/>", "visual")
    (tmp_path / "arm.urdf").write_text(
        text.replace("</visual>", "</visual><collision><geometry><box size='1 1 1'/></geometry></collision>")
    )
    robot = robot_from_urdf(tmp_path / "arm.urdf")
    assert robot.fk(np.zeros(2)).translation[2] == 0.5  # planning does not need it
    with pytest.warns(MeshWarning, match=r"arm\.urdf: not drawn: link 'upper': .*broken\.obj.*finite"):
        drawn = robot.visual
    assert [type(item.geometry).__name__ for item in drawn.geometryObjects] == ["Box"]
    assert capfd.readouterr() == ("", "")


UNDRAWN = {
    "missing": "<mesh filename='none.dae'/>",
    "missing package": "<mesh filename='package://arm/none.glb'/>",
    "of no kind": "<mesh filename='a.step'/>",
    "of the web": "<mesh filename='https://a.b/none.stl'/>",
    "unknown shape": "<cone radius='1'/>",
    "no shape": "",
    "scale of 0": "<mesh filename='a.step' scale='0 0 0'/>",
    "negative size": "<box size='1 -1 1'/>",
}


@pytest.mark.parametrize("case", UNDRAWN)
def test_what_is_only_drawn_never_refuses_a_robot(tmp_path, case):
    (tmp_path / "a.step").write_bytes(b"ISO-10303-21;")
    (tmp_path / "arm.urdf").write_text(solid(UNDRAWN[case], "visual"))
    with pytest.warns(MeshWarning, match=r"arm\.urdf: not drawn: link 'upper'") as said:
        robot = robot_from_urdf(tmp_path / "arm.urdf")
    assert len(said) == 1
    assert robot.visual.ngeoms == 0
    with pytest.raises(InputError, match="link 'upper'"):  # what is not known cannot be kept clear of
        robot_from_urdf_text(solid(UNDRAWN[case]), folder=tmp_path)


SRDF = """<robot name="arm">
  <group name="chain"><chain base_link="base" tip_link="hand"/></group>
  <group name="joints"><joint name="elbow"/></group>
  <group name="links"><link name="upper"/></group>
  <group name="all"><group name="joints"/><group name="links"/></group>
  <group name="ring"><group name="ring"/></group>
  <group name="wrong"><joint name="knee"/></group>
  <group_state name="folded" group="chain">
    <joint name="shoulder" value="0.5"/><joint name="elbow" value="-0.5"/></group_state>
  <group_state name="half" group="joints"><joint name="elbow" value="1"/></group_state>
  <end_effector name="eef" parent_link="upper" group="gripper" parent_group="joints"/>
  <disable_collisions link1="base" link2="hand" reason="Never"/>
  <disable_collisions link1="base" link2="nowhere" reason="Never"/>
</robot>"""


@pytest.fixture
def srdf(tmp_path):
    path = tmp_path / "arm.srdf"
    path.write_text(SRDF)
    return path


@pytest.mark.parametrize(
    ("group", "joints", "tip"),
    [
        ("chain", ("shoulder", "elbow"), "hand"),
        ("joints", ("elbow",), "upper"),
        ("links", ("shoulder",), "upper"),
        ("all", ("shoulder", "elbow"), "hand"),
    ],
)
def test_a_group_chooses_joints_and_tip(srdf, group, joints, tip):
    robot = robot_from_urdf_text(arm(), srdf=srdf, group=group)
    assert (robot.joint_names, robot.tip) == (joints, tip)


def test_group_states_become_postures_if_they_name_every_joint(srdf):
    robot = robot_from_urdf_text(arm(), srdf=srdf, group="chain")
    assert {name: q.tolist() for name, q in robot.postures.items()} == {"folded": [0.5, -0.5]}


def test_disabled_pairs_are_allowed_and_of_unknown_ones_a_warning_tells(srdf):
    with pytest.warns(DescriptionWarning, match=r"arm\.srdf:\d+: <disable_collisions>: no link 'nowhere'"):
        robot = robot_from_urdf_text(arm(), srdf=srdf)
    assert frozenset(("base", "hand")) in robot.allowed_collisions


def test_joint_limits_replace_those_of_the_urdf(tmp_path):
    path = tmp_path / "joint_limits.yaml"
    path.write_text(
        textwrap.dedent("""\
        joint_limits:
          shoulder: {has_velocity_limits: true, max_velocity: 0.5, has_acceleration_limits: true, max_acceleration: 2,
                     has_jerk_limits: true, max_jerk: 30.0, min_position: -0.5, max_position: 0.25}
          elbow: {has_velocity_limits: false}
        """)
    )
    robot = robot_from_urdf_text(arm(), joint_limits=path)
    assert robot.velocity.tolist() == [0.5, np.inf]
    assert robot.acceleration.tolist() == [2.0, np.inf]
    assert robot.jerk.tolist() == [30.0, np.inf]
    assert (robot.lower[0], robot.upper[0], robot.lower[1]) == (-0.5, 0.25, -2.0)


LINKS = "<link name='base'/><link name='upper'/><link name='hand'/>"
BOUNDS = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
BAD_TEXTS = {
    "not XML": ("<robot><link</robot>", "not valid XML"),
    "empty": ("", "not valid XML"),
    "merge markers": ("<robot>\n<<<<<<< HEAD\n<link/>\n=======\n</robot>", r":2: git's merge marker '<<<<<<<'; settle"),
    "another root": ("<sdf/>", "<sdf>, expected <robot>"),
    "no links": ("<robot name='r'/>", "no link"),
    "two links of a name": (arm(links=LINKS + "<link name='hand'/>"), "link name 'hand' stands there twice"),
    "two joints of a name": (
        arm("<link name='x'/><joint name='elbow' type='fixed'><parent link='hand'/><child link='x'/></joint>"),
        "joint name 'elbow' stands there twice",
    ),
    "unknown parent": (arm().replace('parent link="base"', 'parent link="bass"'), "did you mean 'base'"),
    "unknown child": (arm().replace('child link="hand"', 'child link="foot"'), "no child link 'foot'"),
    "no parent": (arm().replace('<parent link="base"/>', ""), "<parent link"),
    "two roots": (arm(links=LINKS + "<link name='alone'/>"), "2 links hang on nothing (base, alone)"),
    "a loop": (arm("<joint name='back' type='fixed'><parent link='hand'/><child link='upper'/></joint>"), "two joints"),
    "no root": (arm("<joint name='back' type='fixed'><parent link='hand'/><child link='base'/></joint>"), "loop"),
    "no limit": (arm(shoulder=" "), "needs <limit"),
    "limits swapped": (arm(shoulder='<limit lower="2" upper="1" velocity="1"/>'), "lower limit 2 is above upper"),
    "NaN limit": (arm(shoulder='<limit lower="nan" upper="1" velocity="1"/>'), "finite"),
    "negative speed": (arm(shoulder='<limit lower="0" upper="1" velocity="-1"/>'), "negative"),
    "ball": (arm().replace('type="revolute"', 'type="ball"', 1), "no usable joint type 'ball'"),
    "no type": (arm().replace('type="revolute"', "", 1), "<joint type"),
    "no joint moves": ("<robot name='r'><link name='base'/></robot>", "no movable joint"),
    "mimic of itself": (arm(elbow=BOUNDS + "<mimic joint='elbow'/>"), "mimics itself"),
    "mimic ring": (
        arm(elbow=BOUNDS + "<mimic joint='shoulder'/>", shoulder=BOUNDS + "<mimic joint='elbow'/>"),
        "mimics itself",
    ),
    "axis of zeros": (arm().replace("0 1 0", "0 0 0"), "axis is the zero vector"),
    "axis of words": (arm().replace("0 1 0", "up"), "3 finite numbers"),
    "origin of two numbers": (arm().replace("0.4 0 0", "0.4 0"), "3 finite numbers"),
    "box turned inside out": (solid("<box size='1 -1 1'/>"), "box size"),
    "no size": (solid("<box/>"), "has no size"),
    "negative radius": (solid("<sphere radius='-1'/>"), "sphere radius"),
    "NaN length": (solid("<cylinder radius='1' length='nan'/>"), "1 finite number"),
    "cone": (solid("<cone radius='1'/>"), "no shape 'cone'"),
    "no shape": (solid(""), "one shape"),
    "mesh missing": (solid("<mesh filename='package://arm/none.stl'/>"), "packages=[the folder that holds 'arm']"),
    "mesh of the web": (solid("<mesh filename='https://a.b/none.stl'/>"), "is not a file"),
    "scale of zero": (solid("<mesh filename='a.stl' scale='1 0 1'/>"), "scale of 0"),
}


@pytest.mark.parametrize("case", BAD_TEXTS)
def test_a_bad_urdf_gets_one_line_that_names_file_and_cause(case, tmp_path, capfd):
    text, expected = BAD_TEXTS[case]
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        robot_from_urdf(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert expected in message
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


ODD_TEXTS = {
    "limits equal": (arm(shoulder='<limit lower="1" upper="1" velocity="1"/>'), "held still.*joint shoulder"),
    "no limits": (arm(shoulder='<limit effort="1" velocity="1"/>'), "held still.*joint shoulder"),
    "floating": (arm().replace('type="revolute"', 'type="floating"', 1), r"held still.*'shoulder' \(floating\)"),
    "planar": (arm().replace('type="revolute"', 'type="planar"', 1), r"held still.*'shoulder' \(planar\)"),
    "box of size 0": (solid("<box size='0 0 0'/>"), "ignored.*link 'upper'"),
    "sphere of size 0": (solid("<sphere radius='0'/>"), "ignored.*link 'upper'"),
    "flat box": (solid("<box size='1 0 1'/>"), "0.1 mm thick.*link 'upper'"),
    "colour of words": (arm("<material name='m'><color rgba='red'/></material>"), "colour of material 'm'"),
    "empty colour": (arm("<material name='m'><color rgba=''/></material>"), "colour of material 'm'"),
    "mimics no joint": (
        arm(shoulder=BOUNDS + "<mimic joint='elbw'/>"),
        "held still.*'shoulder' of 'elbw'; did you mean 'elbow'",
    ),
    "mass of words": (
        arm(links=LINKS.replace("'base'/>", "'base'><inertial><mass value='x'/><inertia/></inertial></link>")),
        "inertia of link 'base'",
    ),
}


@pytest.mark.parametrize("case", ODD_TEXTS)
def test_what_planning_can_do_without_is_told_and_strict_refuses_it(case):
    text, expected = ODD_TEXTS[case]
    with pytest.warns(DescriptionWarning, match=f"URDF text: .*{expected}"):
        robot = robot_from_urdf_text(text)
    assert "elbow" in robot.joint_names
    with pytest.raises(InputError, match=expected):
        robot_from_urdf_text(text, strict=True)


def test_a_joint_whose_limits_are_equal_is_held_there_and_so_is_what_follows_it():
    equal = '<limit lower="0.7" upper="0.7" velocity="1" effort="1"/>'
    with pytest.warns(DescriptionWarning, match="held still"):
        held = robot_from_urdf_text(arm(shoulder=equal))
    assert held.joint_names == ("elbow",)
    np.testing.assert_allclose(
        held.fk([0.2]).homogeneous, robot_from_urdf_text(arm()).fk([0.7, 0.2]).homogeneous, atol=1e-15
    )
    follower = (
        "<link name='tail'/><joint name='wag' type='revolute'><parent link='hand'/><child link='tail'/>"
        f"<axis xyz='0 0 1'/>{BOUNDS}<mimic joint='shoulder' multiplier='2' offset='0.1'/></joint>"
    )
    with pytest.warns(DescriptionWarning, match="held still"):
        followed = robot_from_urdf_text(arm(follower, shoulder=equal), tip="tail")
    turn = followed.fk([0.2], "hand").rotation.T @ followed.fk([0.2], "tail").rotation
    np.testing.assert_allclose(turn, pin.exp3(np.array([0, 0, 1.5])), atol=1e-14)


def test_a_follower_without_a_range_does_not_hold_its_leader():
    """Grippers in files often have no limits but for the finger that is driven."""
    no_range = '<limit effort="1" velocity="1"/><mimic joint="shoulder"/>'
    robot = robot_from_urdf_text(arm(elbow=no_range))
    assert robot.joint_names == ("shoulder",)
    assert robot.upper - robot.lower > 1.0


def test_a_colour_of_three_numbers_is_opaque():
    text = solid("<sphere radius='1'/>", "visual").replace(
        "</visual>", "<material name='m'><color rgba='1 0.5 0'/></material></visual>"
    )
    assert robot_from_urdf_text(text).visual.geometryObjects[0].meshColor.tolist() == [1, 0.5, 0, 1]


BAD_MESHES = {
    "empty.stl": b"",
    "noise.stl": bytes(range(256)) * 2,
    "huge_count.stl": b"\0" * 80 + struct.pack("<I", 2**31) + b"\0" * 50,
    "nan.stl": b"\0" * 80 + struct.pack("<I", 1) + struct.pack("<12f", *[np.nan] * 12) + b"\0\0",
    "cut_off.stl": b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "bad_index.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "lines_only.obj": b"v 0 0 0\nv 1 0 0\nl 1 2\n",
    "words.dae": b"not a mesh",
    "empty.dae": b"<COLLADA></COLLADA>",
    "part.step": b"ISO-10303-21;",
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_a_bad_mesh_is_refused_by_name_and_in_silence(name, tmp_path, capfd):
    (tmp_path / name).write_bytes(BAD_MESHES[name])
    path = tmp_path / "arm.urdf"
    path.write_text(solid(f"<mesh filename='{name}'/>"))
    with pytest.raises(InputError, match=f"link 'upper'.*{name}"):
        robot_from_urdf(path)
    assert capfd.readouterr() == ("", "")


BAD_OPTIONS = {
    "unknown tip": ({"tip": "foot"}, "no frame.*'foot'"),
    "unknown joint": ({"joints": ["knee"]}, "no movable joint 'knee'"),
    "joint twice": ({"joints": ["elbow", "elbow"]}, "listed twice"),
    "locked and actuated": ({"joints": ["elbow"], "locked": {"elbow": 0.0}}, "both actuated and locked"),
    "locked unknown": ({"joints": ["elbow"], "locked": {"knee": 0.0}}, "'knee'"),
    "locked NaN": ({"joints": ["elbow"], "locked": {"shoulder": np.nan}}, "finite"),
    "group without srdf": ({"group": "chain"}, "needs an SRDF"),
}


@pytest.mark.parametrize("case", BAD_OPTIONS)
def test_a_bad_option_is_named(case):
    options, expected = BAD_OPTIONS[case]
    with pytest.raises(InputError, match=expected):
        robot_from_urdf_text(arm(), **options)


@pytest.mark.parametrize(
    ("group", "expected"),
    [("wrong", "no joint 'knee'"), ("ring", "contains itself"), ("chian", "did you mean 'chain'")],
)
def test_a_bad_group_is_named(srdf, group, expected):
    with pytest.raises(InputError, match=expected):
        robot_from_urdf_text(arm(), srdf=srdf, group=group)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<robot", "not valid XML"),
        ("<urdf/>", "expected <robot>"),
        ("<robot><group/></robot>", "<group name"),
        ("<robot><group name='g'><chain base_link='base'/></group></robot>", "<chain tip_link"),
        ("<robot><group_state name='s'><joint name='elbow' value='up'/></group_state></robot>", "1 finite number"),
    ],
)
def test_a_bad_srdf_gets_one_line(tmp_path, text, expected):
    path = tmp_path / "bad.srdf"
    path.write_text(text)
    with pytest.raises(InputError, match=expected) as caught:
        robot_from_urdf_text(arm(), srdf=path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("joint_limits: 3", "joint_limits"),
        ("limits: {}", "joint_limits"),
        ("joint_limits: {elbow: 3}", "found 3"),
        ("joint_limits: {elbow: {max_velocty: 1}}", "did you mean 'max_velocity'"),
        ("joint_limits: {elbow: {max_velocity: fast}}", "finite number, found text 'fast'"),
        ("joint_limits: {elbow: {max_velocity: .nan}}", "finite number"),
        ("joint_limits: {elbow: {max_velocity: 0}}", "greater than 0"),
        ("joint_limits: {elbow: {has_velocity_limits: 1}}", "true or false"),
        ("joint_limits: {elbow: {min_position: 2, max_position: 1}}", "swap them"),
    ],
)
def test_bad_joint_limits_get_one_line(tmp_path, text, expected):
    path = tmp_path / "joint_limits.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=expected) as caught:
        robot_from_urdf_text(arm(), joint_limits=path)
    assert str(caught.value).startswith(f"{path}:1")


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    for path in (tmp_path / "none.urdf", tmp_path):
        with pytest.raises(InputError, match=os.path.basename(path)):
            robot_from_urdf(path)


FORK = "".join(
    f"<joint name='{link}' type='fixed'><parent link='hand'/><child link='{link}'/></joint>"
    for link in ("left", "right")
)
FORKED = "".join(f"<link name='{name}'/>" for name in ("base", "upper", "hand", "left", "right"))


def test_a_tip_that_is_guessed_among_several_is_said_once_with_the_remedy(recwarn):
    text = arm(FORK, links=FORKED).replace("hand", "plate")  # "hand" would be the tip
    with pytest.warns(ArmWarning, match=r"taken to be 'right'; tip="):
        assert robot_from_urdf_text(text).tip == "right"
    recwarn.clear()
    robot_from_urdf_text(text, tip="left")  # named
    robot_from_urdf_text(arm(FORK, links=FORKED))  # a usual name
    robot_from_urdf_text(arm())  # no other choice
    assert not [each for each in recwarn if issubclass(each.category, ArmWarning)]
