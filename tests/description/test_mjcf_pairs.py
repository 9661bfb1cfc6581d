"""Which solids of an MJCF are compared, as in MuJoCo; what a robot does not get of a file is named."""

import pickle
import warnings

import numpy as np
import pytest

from rrtik_ompl.base.errors import ArmWarning, DescriptionWarning, InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.problem_files.scene import load_scene
from rrtik_ompl.world.world import World

HEAD = '<mujoco><compiler angle="radian"/><worldbody>'
MASKS = (
    HEAD
    + """
<body name="a"><joint name="j1" axis="0 1 0" range="-2 2"/><geom type="capsule" size=".03 .1" pos="0 0 .12"/>
 <body name="b" pos="0 0 .3"><joint name="j2" axis="0 1 0" range="-3 3"/><geom size=".03" pos="0 0 .1"/>
  <body name="c" pos="0 0 .3"><joint name="j3" axis="0 1 0" range="-3 3"/>
   <geom name="ghost" size=".15" pos="0 0 .1" contype="2" conaffinity="2"/>
   <geom name="real" size=".01" pos="0 0 .28"/></body></body></body></worldbody></mujoco>"""
)
FIRST = """<body name="first" pos="0 0 .2"><joint name="j1" axis="1 0 0" range="-3 3"/>
 <geom type="capsule" size=".02" fromto="0 0 0 0 .3 0"/>
 <body name="second" pos="0 .3 0"><joint name="j2" axis="0 0 1" range="-2 2"/>
  <geom type="capsule" size=".02" fromto="0 .05 0 0 .3 0"/></body></body>"""
STANDING = {
    "geom of the world": '<geom size=".1" pos="0 .3 0"/><body name="base"/>',
    "body beside the base": '<body name="post" pos="0 .3 0"><geom size=".1"/></body>',
    "body welded to such a body": '<body name="post"><body name="top" pos="0 .3 0"><geom size=".1"/></body></body>',
    "free body": '<body name="post" pos="0 .3 0"><freejoint/><geom size=".1"/></body>',
}
ON_A_BASE = HEAD + '{}<body name="mount"><geom size=".05"/>' + FIRST + "</body></worldbody></mujoco>"
ON_THE_WORLD = HEAD + "{}" + FIRST + "</worldbody></mujoco>"
SHOULDER = (
    HEAD
    + """<body name="root"><joint name="j0" axis="0 0 1" range="-1 1"/><geom size=".1"/>
<body name="rib" pos="0 .2 0"><geom size=".08"/></body>
<body name="arm" pos="0 .1 0"><joint name="j1" axis="1 0 0" range="-3 3"/><joint name="j2" axis="0 0 1" range="-3 3"/>
<geom type="capsule" size=".03" fromto="0 0 0 0 .4 0"/><body name="hand" pos="0 .4 0">
<joint name="j3" axis="1 0 0" range="-3 3"/><geom size=".05" pos="0 .35 0"/></body></body></body></worldbody>
</mujoco>"""
)
WELDED = (
    HEAD
    + """<body name="a"><joint name="j1" axis="0 0 1" range="-3 3"/>
<geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/><body name="camera" pos=".4 .15 0"><geom size=".06"/></body>
<body name="b" pos=".4 0 0"><joint name="j2" axis="0 0 1" range="-3 3"/>
<geom type="capsule" size=".02" fromto=".08 0 0 .2 0 0"/><body name="c" pos=".25 0 0">
<joint name="j3" axis="0 0 1" range="-3 3"/><geom type="capsule" size=".02" fromto=".08 0 0 .3 0 0"/></body></body>
</body></worldbody></mujoco>"""
)
FILES = {
    "masks": MASKS,
    "a body welded beside a joint": WELDED,
    "neighbours over two joints": SHOULDER,
    **{f"on a base, {name}": ON_A_BASE.format(text) for name, text in STANDING.items()},
    **{f"on the world, {name}": ON_THE_WORLD.format(text) for name, text in STANDING.items()},
}
# contacts that MuJoCo 4.0.0 finds in 400 postures drawn with seed 1
BY_MUJOCO = {
    "masks": 9,
    "a body welded beside a joint": 79,
    "neighbours over two joints": 51,
    "on a base, geom of the world": 107,
    "on a base, body beside the base": 107,
    "on a base, body welded to such a body": 107,
    "on a base, free body": 107,
    "on the world, geom of the world": 50,
    "on the world, body beside the base": 50,
    "on the world, body welded to such a body": 50,
    "on the world, free body": 50,
}


def loaded(tmp_path, text):
    file = tmp_path / "arm.xml"
    file.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = load_robot(file)
        return robot, World(robot, load_scene(file))


def postures(robot):
    return np.random.default_rng(1).uniform(robot.lower, robot.upper, (400, robot.dof))


def in_contact(mujoco, text, robot):
    """Of each posture: whether MuJoCo finds solids in each other."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    places = [model.joint(name).qposadr[0] for name in robot.joint_names]
    found = []
    for q in postures(robot):
        data.qpos[places] = q
        mujoco.mj_forward(model, data)
        found.append(any(contact.dist < 0.0 for contact in data.contact))
    return np.array(found)


@pytest.mark.parametrize("name", FILES)
def test_as_many_postures_touch_as_in_mujoco(tmp_path, name):
    robot, world = loaded(tmp_path, FILES[name])
    assert (~world.valid_batch(postures(robot))).sum() == BY_MUJOCO[name]
    assert World(pickle.loads(pickle.dumps(robot)), world.scene).pairs == world.pairs


@pytest.mark.parametrize("name", FILES)
def test_the_same_postures_touch_as_in_mujoco(tmp_path, name):
    mujoco = pytest.importorskip("mujoco")
    robot, world = loaded(tmp_path, FILES[name])
    expected = in_contact(mujoco, FILES[name], robot)
    assert expected.sum() == BY_MUJOCO[name]
    assert (~world.valid_batch(postures(robot)) == expected).all()


BOTH = ("j1", "j2")  # which are asked for, as some of these ties hold them
LEFT_OUT = {
    "plane": ('<geom name="ground" type="plane" size="1 1 1"/>', "", "plane 'ground'"),
    "free body": ('<body name="cube"><freejoint/><geom size=".1"/></body>', "", "of the scene .*sphere 'cube'"),
    "mocap": ('<body name="hand" mocap="true"><geom size=".1"/></body>', "", "mocap bodies, held.*: 'hand'"),
    "connect": ("", '<equality><connect body1="first" body2="second" anchor="0 0 0"/></equality>',
                "loops, left open: connect of 'first' and 'second'"),
    "weld": ("", '<equality><weld body1="second"/></equality>', "loops, left open: weld of 'second'"),
    "tendons": ("", '<tendon><fixed name="t"><joint joint="j1" coef="1"/></fixed></tendon>'
                '<equality><tendon tendon1="t"/></equality>', "loops, left open: tendon of 't'"),
    "limited tendon": ("", '<tendon><fixed name="t" range="0 1"><joint joint="j1" coef="1"/></fixed></tendon>',
                       "limits of tendons: 't'"),
    "joint held": ("", '<equality><joint joint1="j2"/></equality>', "joints held by <equality>: 'j2'"),
    "other actuator": ("", '<tendon><fixed name="t"><joint joint="j1" coef="1"/></fixed></tendon>'
                       '<actuator><motor name="pull" tendon="t"/><motor joint="j1"/></actuator>',
                       "actuators of no joint: 'pull'"),
    "flag": ("", '<option><flag filterparent="disable"/></option>', "flags: filterparent"),
    "pair": ("", '<contact><pair geom1="x" geom2="y"/></contact>', "pairs of <contact>: 'pair'"),
}  # fmt: skip


@pytest.mark.parametrize("kind", LEFT_OUT)
def test_what_is_left_out_is_named_and_refused_where_all_must_be_read(tmp_path, kind):
    world, rest, said = LEFT_OUT[kind]
    file = tmp_path / "arm.xml"
    file.write_text(ON_THE_WORLD.format(world).replace("</mujoco>", rest + "</mujoco>"))
    with pytest.warns(DescriptionWarning, match=f"arm.xml: not read: .*{said}"):
        load_robot(file, joints=BOTH)
    with pytest.raises(InputError, match="without strict"):
        load_robot(file, joints=BOTH, strict=True)


DOOR = '<body name="door" pos="9 0 0"><joint name="hinge"/><geom size=".1"/></body>'
FOLLOWED = '<equality><joint joint1="hinge" joint2="j1"/></equality>'


def test_joints_of_what_stands_beside_the_robot_are_named_where_they_are_held(tmp_path):
    file = tmp_path / "arm.xml"
    file.write_text(ON_THE_WORLD.format(DOOR))
    with pytest.warns(ArmWarning, match=r"joints that move no tip \('hinge'\)"):
        first = load_robot(file).joint_names[0]
    with pytest.warns(DescriptionWarning, match="arm.xml.*'hinge'"):
        load_robot(file, joints=[first])
    with pytest.raises(InputError, match="without strict"):
        load_robot(file, joints=[first], strict=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DescriptionWarning)
        assert "hinge" not in load_robot(file).joint_names
        load_robot(file, joints=[first], locked={"hinge": 0.5})
        file.write_text(ON_THE_WORLD.format(DOOR).replace("</mujoco>", FOLLOWED + "</mujoco>"))
        load_robot(file, joints=["j1"])


def test_all_that_is_left_out_is_one_warning_and_what_is_not_in_force_is_none(tmp_path):
    file = tmp_path / "arm.xml"
    worlds, rests, _ = zip(*LEFT_OUT.values(), strict=True)
    file.write_text(ON_THE_WORLD.format("".join(worlds)).replace("</mujoco>", "".join(rests) + "</mujoco>"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_robot(file, joints=BOTH)
    assert len([each for each in caught if each.category is DescriptionWarning]) == 1
    off = '<equality><connect body1="first" body2="second" anchor="0 0 0" active="false"/></equality></mujoco>'
    file.write_text(ON_THE_WORLD.format("").replace("</mujoco>", off))
    assert load_robot(file, strict=True).dof == 2
