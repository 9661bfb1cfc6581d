"""MJCF files: kinematics and solids as MuJoCo and Pinocchio read them, one clear line for what cannot be read.

Pinocchio's parser drops the place of a base that is fixed, and takes the range of a slide for degrees.
"""

import sys
import warnings
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import ArmWarning, DescriptionWarning, InputError, RrtikError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.mjcf.compiled import compiled, ellipsoid
from rrtik_ompl.description.mjcf.read import read_mjcf
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

HEAD = """<mujoco model="arm"><compiler angle="{angle}" eulerseq="{sequence}"/>
<default><geom rgba="1 0 0 1"/><default class="hard"><geom group="3" type="capsule" size="0.03"/>
<joint axis="0 1 0"/></default></default>"""
BODIES = """<worldbody><geom type="plane" size="1 1 .1"/>
<body name="base" pos="0.1 0 0"><geom type="cylinder" size=".08 .1"/>
 <body name="upper" pos="0 0 .3" euler="{euler}" childclass="hard">
  <joint name="turn" axis="0 0 1" range="{range}"/>
  <geom fromto="0 0 0 .4 0 .1"/><geom type="box" size=".1 .05 .04" pos=".2 0 0" contype="0" conaffinity="0"/>
  <body name="lower" pos=".4 0 .1" quat=".8 0 .6 0">
   <joint name="bend" pos="0.02 0 -0.01" range="{range}"/>
   <geom type="box" size=".1 .02 .03" pos=".2 0 0" axisangle="0 0 1 {tilt}"/>
   <body name="hand" pos=".3 0 0" xyaxes="0 1 0 -1 0 0"><joint name="draw" type="slide" axis="1 0 0" range="-.1 .2"/>
    <geom type="sphere" size=".05"/><site name="tcp" pos="0 0 .1"/>
   </body></body></body></body></worldbody>"""
TAIL = """<contact><exclude body1="base" body2="hand"/></contact>
<keyframe><key name="home" qpos="0.1 -0.2 0.05"/></keyframe></mujoco>"""
DEGREES = {"angle": "degree", "sequence": "xyz", "euler": "10 20 30", "range": "-90 120", "tilt": "25"}
RADIANS = {"angle": "radian", "sequence": "zyx", "euler": ".1 .2 .3", "range": "-1.5 2", "tilt": ".4"}


def written(tmp_path, text=HEAD + BODIES + TAIL, values=DEGREES):
    file = tmp_path / "arm.xml"
    for key, value in values.items():
        text = text.replace("{" + key + "}", value)
    file.write_text(text)
    return file


@pytest.mark.parametrize("values", [DEGREES, RADIANS])
def test_bodies_sites_solids_and_limits_are_those_of_pinocchios_own_parser(tmp_path, values):
    file = written(tmp_path, (HEAD + BODIES + TAIL).replace('name="base" pos="0.1 0 0"', 'name="base"'), values)
    ours, theirs = load_robot(file), pin.buildModelFromMJCF(str(file))
    assert ours.joint_names == tuple(theirs.names)[1:]
    assert ours.lower == pytest.approx([*theirs.lowerPositionLimit[:2], -0.1])
    assert ours.upper == pytest.approx([*theirs.upperPositionLimit[:2], 0.2])
    data, solids = theirs.createData(), pin.buildGeomFromMJCF(theirs, str(file), pin.GeometryType.COLLISION)
    for q in np.random.default_rng(1).uniform(ours.lower, ours.upper, (20, 3)):
        pin.framesForwardKinematics(theirs, data, q)
        for name in ("base", "upper", "lower", "hand", "tcp"):
            pose = data.oMf[theirs.getFrameId(name)]
            assert ours.fk(q, name).homogeneous == pytest.approx(pose.homogeneous, abs=1e-9), name
        frames = ours.joint_frames(q)[0]
        mine = [pin.SE3(frames[each.parentJoint]) * each.placement for each in ours.collision.geometryObjects]
        for each in solids.geometryObjects:
            if type(each.geometry).__name__ in ("Box", "Sphere") and each.parentJoint > 0:
                place = (data.oMi[each.parentJoint] * each.placement).translation
                # a geom without contype and conaffinity is drawn and does not collide
                near = min(np.linalg.norm(place - pose.translation) for pose in mine)
                assert (near < 1e-9) == ("upper" not in each.name), each.name


def test_a_ball_joint_is_held_and_named(tmp_path):
    text = (HEAD + BODIES + TAIL.replace("0.1 -0.2", "1 0 0 0 -0.2")).replace('name="turn"', 'name="turn" type="ball"')
    with pytest.warns(DescriptionWarning, match="bodies on ball joints, held where they are: 'upper'"):
        robot = load_robot(written(tmp_path, text))
    assert robot.joint_names == ("bend", "draw")
    assert robot.posture("home") == pytest.approx([-0.2, 0.05])


# by mj_kinematics of MuJoCo 4.0.0 at 0.1, 0.2, 0.05
BY_MUJOCO = {
    "degree": {"lower": (0.4421838, 0.23587877, 0.32185261), "tcp": (0.41053176, 0.39929424, 0.04836855)},
    "radian": {"lower": (0.5123571, 0.05079224, 0.32424569), "tcp": (0.56279506, 0.20188097, 0.04652603)},
}


@pytest.mark.parametrize("values", [DEGREES, RADIANS])
def test_places_are_those_that_mujoco_computes(tmp_path, values):
    robot = load_robot(written(tmp_path, values=values))
    for name, place in BY_MUJOCO[values["angle"]].items():
        assert robot.fk([0.1, 0.2, 0.05], name).translation == pytest.approx(place, abs=1e-8)


def test_a_file_says_tip_posture_pairs_and_what_is_only_drawn(tmp_path):
    robot = load_robot(written(tmp_path))
    assert robot.tip == "tcp"
    assert robot.posture("home").tolist() == [0.1, -0.2, 0.05]
    assert robot.allowed_collisions == {frozenset(("base", "hand"))}
    kinds = [(robot.link_of(each), type(each.geometry).__name__) for each in robot.collision.geometryObjects]
    assert sorted(kinds) == [("base", "Cylinder"), ("hand", "Sphere"), ("lower", "Box"), ("upper", "Capsule")]
    assert len(robot.visual.geometryObjects) == 4
    assert World(robot).valid([0.0, 0.0, 0.0])


def test_a_tip_chooses_the_joints_and_problem_files_name_the_file(tmp_path):
    file = written(tmp_path)
    assert load_robot(file, tip="lower").joint_names == ("turn", "bend")
    robot = load_robot(file, tip="hand")
    Problem(World(robot), "home", "home").save(tmp_path / "p.yaml")
    assert "mjcf: arm.xml" in (tmp_path / "p.yaml").read_text()
    assert load_problem(tmp_path / "p.yaml").robot is robot


def test_includes_followers_masks_and_references(tmp_path):
    (tmp_path / "more.xml").write_text(f"<mujocoinclude>{BODIES}</mujocoinclude>")  # any name will do for MuJoCo
    tie = '<equality><joint joint1="draw" joint2="turn" polycoef="0.01 0.05 0 0 0"/></equality>'
    file = written(tmp_path, HEAD + '<include file="more.xml"/>' + tie + TAIL.replace("0.05", "0.015"))
    (tmp_path / "more.xml").write_text(
        (tmp_path / "more.xml")
        .read_text()
        .format(**DEGREES)
        .replace('size=".05"', 'size=".05" contype="2" conaffinity="2"')
    )
    robot = load_robot(file)
    assert robot.joint_names == ("turn", "bend")
    assert robot.joint_values(np.array([[0.2, 0.0]]))[0, 2] == pytest.approx(0.02)
    assert {frozenset(("hand", other)) for other in ("base", "upper", "lower")} <= robot.allowed_collisions


def test_a_slide_without_limits_is_held_unless_it_is_asked_for(tmp_path):
    """Mobile bases have three of them."""
    file = written(tmp_path, (HEAD + BODIES + TAIL).replace(' range="-.1 .2"', ""))
    with pytest.warns(ArmWarning, match=r"endless slides of a base \('draw'\)"):
        assert load_robot(file).joint_names == ("turn", "bend")
    with pytest.raises(InputError, match=r"needs finite limits.*or leave the joint out of joints="):
        load_robot(file, joints=["turn", "bend", "draw"])


def test_an_arm_of_urdf_may_be_called_xml_too(tmp_path):
    (tmp_path / "arm.xml").write_text(
        '<robot name="a"><link name="b"/><link name="c"/><joint name="j" type="continuous"><parent link="b"/>'
        '<child link="c"/></joint></robot>'
    )
    assert load_robot(tmp_path / "arm.xml").joint_names == ("j",)


FAULTS = {
    "joint": ('name="turn" axis', 'name="turn" type="screw" axis', "no type of joint 'screw'; have ball, free"),
    "class": ('childclass="hard"', 'childclass="soft"', "no default class 'soft'"),
    "ellipsoid": (
        'type="sphere" size=".05"',
        'type="ellipsoid" size=".1 .1 .2"',
        "geom of type 'ellipsoid' .*pip install mujoco",
    ),
    "size": ('type="sphere" size=".05"', 'type="sphere" size="-1"', "body 'hand'.*greater than 0"),
    "no size": (
        '<geom type="cylinder" size=".08 .1"/>',
        '<geom type="cylinder" size=".08"/>',
        "must hold 2 finite",
    ),
    "mesh": ('type="sphere" size=".05"', 'type="mesh" mesh="m"', "body 'hand': no mesh 'm'"),
    "axis": ('axis="1 0 0"', 'axis="0 0 0"', "axis is the zero vector"),
    "two orientations": ('quat=".8 0 .6 0"', 'quat=".8 0 .6 0" zaxis="0 0 1"', "has quat and zaxis; leave one"),
    "NaN": ('pos=".4 0 .1"', 'pos="nan 0 .1"', "3 finite numbers"),
    "upside down": ('range="-.1 .2"', 'range=".2 -.1"', "lower must be below upper"),
    "named twice": ('name="lower"', 'name="upper"', "'upper': its name stands there twice"),
    "key": ('qpos="0.1 -0.2 0.05"', 'qpos="0.1"', "key 'home': .*must hold 3 finite numbers"),
    "replicate": (
        '<site name="tcp" pos="0 0 .1"/>',
        '<replicate count="3"/>',
        "<replicate> cannot be read.*pip install mujoco",
    ),
    "missing include": ("<worldbody>", '<include file="no.xml"/><worldbody>', "no such file"),
    "ring": ("<worldbody>", '<include file="arm.xml"/><worldbody>', "is it a ring"),
    "no XML": ("</mujoco>", "", "not valid XML"),
    "sequence": ('eulerseq="xyz"', 'eulerseq="abc"', "three of the letters x, y, z"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_cannot_be_read_is_one_line_with_the_file(tmp_path, monkeypatch, fault):
    monkeypatch.setitem(sys.modules, "mujoco", None)  # its compiler reads more
    old, new, said = FAULTS[fault]
    file = written(tmp_path)
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(RrtikError, match=said) as error:
        load_robot(file)
    assert "\n" not in str(error.value)


PLAIN = HEAD + BODIES + TAIL
MORE = {
    "frame": ('<site name="tcp" pos="0 0 .1"/>', '<frame pos="0 0 .06"><site name="tcp" pos="0 0 .04"/></frame>'),
    "replicate": ('<geom type="sphere" size=".05"/>', '<replicate count="3" offset="0 0 .1">'
                  '<geom name="bead" type="sphere" size=".01"/></replicate>'),
    "ellipsoid": ('type="sphere" size=".05"', 'type="ellipsoid" size=".05 .1 .2"'),
    "inline mesh": ('type="sphere" size=".05"', 'type="mesh" mesh="m"'),
    "fitted": ('type="sphere" size=".05"', 'type="box" mesh="m"'),
}  # fmt: skip
ASSET = '<asset><mesh name="m" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>'


@pytest.mark.parametrize("kind", MORE)
def test_what_only_mujoco_can_read_moves_as_it_does_for_mujoco(tmp_path, kind):
    mujoco = pytest.importorskip("mujoco")
    file = written(tmp_path, PLAIN.replace(*MORE[kind]).replace("<worldbody>", ASSET + "<worldbody>"))
    robot = load_robot(file)
    assert robot.joint_names == ("turn", "bend", "draw")
    assert robot.tip == "tcp"

    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    for q in np.random.default_rng(1).uniform(robot.lower, robot.upper, (5, 3)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(robot.fk(q).translation, data.site("tcp").xpos, atol=1e-8)
    assert len(robot.collision.geometryObjects) == np.count_nonzero(model.geom_contype[1:])


@pytest.mark.parametrize("values", [DEGREES, RADIANS])
def test_a_file_is_the_same_robot_whoever_reads_it(tmp_path, values):
    pytest.importorskip("mujoco")
    file = written(tmp_path, values=values)
    ours = read_mjcf(file)
    root, _ = compiled(file)
    theirs_file = tmp_path / "compiled.xml"
    theirs_file.write_text(ElementTree.tostring(root, encoding="unicode"))
    theirs = read_mjcf(theirs_file)
    for name in ("excluded", "apart", "touchable", "loops", "postures", "mimics"):
        assert getattr(ours, name) == getattr(theirs, name), name
    for first, second in zip(ours.tree.joints, theirs.tree.joints, strict=True):
        assert (first.name, first.kind, first.parent) == (second.name, second.kind, second.parent)
        assert [first.lower, first.upper] == pytest.approx([second.lower, second.upper], abs=1e-12)
        np.testing.assert_allclose(first.axis, second.axis, atol=1e-12)
        np.testing.assert_allclose(first.T_parent_joint.homogeneous, second.T_parent_joint.homogeneous, atol=1e-8)


def test_the_mesh_of_an_ellipsoid_holds_it_and_is_little_larger():
    mesh = ellipsoid(np.array([0.1, 0.2, 0.5]))
    corners = mesh.vertices[mesh.triangles] / [0.1, 0.2, 0.5]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    distances = np.einsum("ij,ij->i", normals, corners[:, 0]) / np.linalg.norm(normals, axis=1)
    assert distances.min() >= 1.0 - 1e-9  # every face is outside of the sphere, and faces outward
    assert np.linalg.norm(corners, axis=2).max() < 1.03


BARS = """<mujoco><compiler angle="radian"/><worldbody>{world}
<body name="a"><joint name="j1" range="-2 2"/><geom size=".02"/>
<body name="b" pos=".3 0 0"><joint name="j2" range="-2 2"/><geom size=".02"/>
<body name="left" pos="0 .1 0"><joint name="crank" range="0.2 1" ref="0.5"/><geom size=".01"/>
<body name="rod" pos=".1 0 0"><joint name="rod" range="-2 2"/><geom size=".01"/></body></body>
<body name="right" pos="0 -.1 0"><joint name="rocker" range="-2 2"/><geom size=".01"/></body></body></body>
</worldbody><tendon><fixed name="cord"><joint joint="crank" coef="1"/></fixed></tendon>
<equality>{tie}</equality></mujoco>"""
LOOPS = {
    "connect": ('<connect body1="rod" body2="right" anchor="0 0 0"/>', ("crank", "rod", "rocker"), 0.5),
    "weld": ('<weld body1="rod" body2="b"/>', ("crank", "rod"), 0.5),
    "tendon": ('<tendon tendon1="cord"/>', ("crank",), 0.5),
    "value": ('<joint joint1="crank" polycoef="0.25 0 0 0 0"/>', ("crank",), 0.75),
    "weld to what a user moves": ('<weld body1="mouse" body2="rod"/>', (), None),
    "not active": ('<connect body1="rod" body2="right" anchor="0 0 0" active="false"/>', (), None),
}


@pytest.mark.parametrize("kind", LOOPS)
def test_joints_in_a_loop_are_held_where_the_file_closes_it(tmp_path, kind):
    tie, joints, crank = LOOPS[kind]
    file = tmp_path / "bars.xml"
    file.write_text(BARS.format(world='<body name="mouse" mocap="true"/>', tie=tie))
    loops = read_mjcf(file).loops
    assert tuple(loops) == joints
    assert loops.get("crank") == crank

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = load_robot(file)
    assert set(joints).isdisjoint(robot.joint_names)
    assert {"j1", "j2"} <= set(robot.joint_names)
    told = " ".join(str(each.message) for each in caught)
    assert not joints or f"joints in loops ('{joints[0]}'" in told
    if crank is not None:
        turned = np.arccos(robot.fk(np.zeros(robot.dof), "left").rotation[0, 0])
        assert turned == pytest.approx(crank - 0.5, abs=1e-9)
