"""What a description says wrongly, or what is not read of it, is one warning with file, line and nearest name."""

import re
import warnings

import pytest

from rrtik_ompl.base.errors import DescriptionWarning, InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.srdf import MENTIONS

LINK = '<link name="{}"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>'
JOINT = """<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="0 0 0.3"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>"""
ARM = (
    '<robot name="arm">'
    + "".join(LINK.format(name) for name in ("base", "upper", "fore"))
    + JOINT.format("shoulder", "base", "upper")
    + JOINT.format("elbow", "upper", "fore")
    + "</robot>"
)
SRDF = """
<robot name="arm">
  <virtual_joint name="mount" type="fixed" parent_frame="world" child_link="base"/>
  <group name="arm">
    <joint name="mount"/>
    <joint name="shoulder"/>
    <link name="fore"/>
    <chain base_link="base" tip_link="fore"/>
  </group>
  <group name="all"><group name="arm"/></group>
  <group name="hand"><joint name="elbow"/></group>
  <group_state name="home" group="arm">
    <joint name="shoulder" value="0.1"/>
    <joint name="elbow" value="0.2"/>
  </group_state>
  <end_effector name="tool" parent_link="fore" group="hand" parent_group="arm"/>
  <disable_collisions link1="base" link2="upper" reason="Adjacent"/>
  <enable_collisions link1="base" link2="fore"/>
  <disable_default_collisions link="base"/>
  <passive_joint name="mount"/>
</robot>
"""


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "arm.srdf").write_text(SRDF)
    return tmp_path / "arm.urdf"


def said(file, **options):
    """The descriptions' warnings of a call, each in one line."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_robot(file, **options)
    found = [str(each.message) for each in caught if each.category is DescriptionWarning]
    assert all("\n" not in line for line in found)
    return found


def test_a_sound_description_says_nothing(arm):
    assert said(arm, srdf=arm.with_suffix(".srdf"), group="all") == []
    assert load_robot(arm, srdf=arm.with_suffix(".srdf"), strict=True).dof == 2


def spoilt(tag, key):
    """The SRDF with a letter too much in one name, and the line on which it stands."""
    lines = SRDF.split("\n")
    inside = tag.partition("/")[0]
    for number, line in enumerate(lines):
        above = "\n".join(lines[: number + 1])
        element = f"<{tag.rpartition('/')[2]} "
        opened = above.rfind(f"<{inside}")
        if (element in line[line.find(f"<{inside}") + 1 :] or (tag == inside and element in line)) and opened >= 0:
            at = line.rindex(element)
            lines[number] = line[:at] + re.sub(rf'\b{key}="(\w+)"', rf'{key}="\1x"', line[at:], count=1)
            if lines[number] != line:
                return "\n".join(lines), number + 1
    raise AssertionError(f"{tag} {key} does not stand in the SRDF of this test")


@pytest.mark.parametrize(("tag", "key", "kind"), MENTIONS)
def test_each_name_that_does_not_exist_is_named_with_its_line_and_the_nearest(arm, tag, key, kind):
    text, line = spoilt(tag, key)
    srdf = arm.with_suffix(".srdf")
    srdf.write_text(text)
    [found] = said(arm, srdf=srdf)
    assert f"arm.srdf:{line}: <{tag.rpartition('/')[2]}>: no {kind} '" in found
    assert re.search(r"did you mean '\w+'\?", found)
    with pytest.raises(InputError, match=rf"arm\.srdf:{line}: .*load without strict"):
        load_robot(arm, srdf=srdf, strict=True)


def test_a_group_that_is_asked_for_must_exist_whole(arm):
    srdf = arm.with_suffix(".srdf")
    srdf.write_text(SRDF.replace('<joint name="shoulder"/>', '<joint name="sholder"/>'))
    with pytest.raises(InputError, match=r"'arm'.*sholder.*'shoulder'"):
        load_robot(arm, srdf=srdf, group="arm")


def test_a_name_that_is_wrong_in_many_places_is_named_once_and_many_names_are_counted(arm):
    srdf = arm.with_suffix(".srdf")
    more = "".join(f'<disable_collisions link1="wrist{k % 6}" link2="base"/>\n' for k in range(60))
    srdf.write_text(SRDF.replace("</robot>", more + "</robot>"))
    [found] = said(arm, srdf=srdf)
    assert found.count("no link") == 3
    assert found.endswith("and 3 more")


def test_a_state_that_lacks_a_joint_is_named(arm):
    srdf = arm.with_suffix(".srdf")
    srdf.write_text(SRDF.replace('<joint name="elbow" value="0.2"/>', ""))
    [found] = said(arm, srdf=srdf, group="arm")
    assert "arm.srdf:12: group_state 'home' has no value of joint 'elbow' and is left out" in found


def mjcf_at(value, folder):
    """The file of an arm whose only joint goes from -1 to 1 rad, with a posture "home" at a value."""
    file = folder / "arm.xml"
    file.write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body><joint name="j" range="-1 1"/><geom size=".1"/></body>'
        f'</worldbody><keyframe><key name="home" qpos="{value}"/></keyframe></mujoco>'
    )
    return file


def test_a_posture_outside_the_limits_is_named_in_an_srdf_and_in_an_mjcf(arm, tmp_path):
    srdf = arm.with_suffix(".srdf")
    srdf.write_text(SRDF.replace('value="0.2"', 'value="2.5"'))
    [found] = said(arm, srdf=srdf)
    assert "arm.srdf:12: posture 'home': joint 'elbow' is at 143.239 deg, outside its limits" in found
    with pytest.raises(InputError, match="posture 'home': joint 'elbow'"):
        load_robot(arm, srdf=srdf, strict=True)
    [found] = said(mjcf_at(1.5, tmp_path))
    assert "arm.xml: key 'home': joint 'j' is at 85.9437 deg, outside its limits" in found
    with pytest.raises(InputError, match="key 'home'"):
        load_robot(tmp_path / "arm.xml", strict=True)


def test_a_posture_that_full_turns_bring_inside_the_limits_is_named_too(arm, tmp_path):
    srdf = arm.with_suffix(".srdf")
    srdf.write_text(SRDF.replace('value="0.2"', 'value="6.5"'))
    [found] = said(arm, srdf=srdf)
    assert "arm.srdf:12: posture 'home': joint 'elbow' is at 372.423 deg, outside its limits" in found
    assert found.endswith("; it is taken a full turn away")
    [found] = said(mjcf_at(6.5, tmp_path))
    assert "arm.xml: key 'home': joint 'j' is at 372.423 deg, outside its limits" in found


def test_an_srdf_of_another_robot_is_named(arm):
    srdf = arm.with_suffix(".srdf")
    srdf.write_text(SRDF.replace('robot name="arm"', 'robot name="crane"'))
    [found] = said(arm, srdf=srdf)
    assert re.search(r"arm\.srdf: it is of robot 'crane', and .*arm\.urdf describes 'arm'", found)
    with pytest.raises(InputError, match="of robot 'crane'"):
        load_robot(arm, srdf=srdf, strict=True)


def test_a_joint_without_a_motor_that_is_moved_is_named(arm):
    srdf = arm.with_suffix(".srdf")
    srdf.write_text(SRDF.replace('<passive_joint name="mount"/>', '<passive_joint name="elbow"/>'))
    [found] = said(arm, srdf=srdf)
    assert "arm.srdf:20: <passive_joint>: joint 'elbow' has no motor and is moved like the others; choose by " in found
    with pytest.raises(InputError, match="has no motor"):
        load_robot(arm, srdf=srdf, strict=True)
    assert said(arm, srdf=srdf, joints=["elbow"]) == []
    assert said(arm, srdf=srdf, tip="upper") == []
    assert load_robot(arm, srdf=srdf, group="arm").joint_names == ("shoulder",)


HAND = (
    '<link name="finger"/><joint name="grip" type="prismatic"><parent link="fore"/><child link="finger"/>'
    '<axis xyz="1 0 0"/><limit lower="0" upper="0.04" velocity="1" effort="1"/></joint></robot>'
)
STATES = """<group name="jaw"><joint name="grip"/></group>
<group_state name="open" group="jaw"><joint name="grip" value="{}"/></group_state>
<group_state name="close" group="jaw"><joint name="grip" value="0"/></group_state></robot>"""


def test_a_gripper_that_opens_beyond_its_limits_is_named(arm):
    arm.write_text(ARM.replace("</robot>", HAND))
    srdf = arm.with_suffix(".srdf")
    text = SRDF.replace('group="hand" parent', 'group="jaw" parent')
    srdf.write_text(text.replace("</robot>", STATES.format(0.04)))
    assert said(arm, srdf=srdf, group="arm") == []
    srdf.write_text(text.replace("</robot>", STATES.format(0.4)))
    [found] = said(arm, srdf=srdf, group="arm")
    assert "arm.srdf: a state of the gripper: joint 'grip' is at 0.4, outside its limits 0 .. 0.04" in found


ELBOW_LIMIT = '<limit lower="-2" upper="2" velocity="1" effort="1"/></joint></robot>'
UNREAD = {
    "soft limits": ('<safety_controller k_velocity="1" soft_lower_limit="-1" soft_upper_limit="2"/></joint></robot>',
                    "<safety_controller> of joint 'elbow'"),
    "acceleration": ("ACCELERATION", "<limit acceleration> of joint 'elbow'"),
    "a part of a link": ('</joint><link name="more"><capsule_chain/></link></robot>', "<capsule_chain> of link 'more'"),
    "a part of a joint": ("<screw/></joint></robot>", "<screw> of joint 'elbow'"),
    "a part of the robot": ("</joint><loop_joint/></robot>", "<loop_joint>"),
    "another program's": ('</joint><d:filter xmlns:d="http://drake.mit.edu"/></robot>', "<filter>"),
    "loops in a simulator": ("</joint><gazebo><joint/></gazebo></robot>", "joints within <gazebo>"),
}  # fmt: skip


@pytest.mark.parametrize("what", UNREAD)
def test_what_bears_on_shapes_joints_or_limits_of_a_urdf_and_is_not_read_is_named(arm, what):
    added, name = UNREAD[what]
    head = ARM.removesuffix("</joint></robot>")
    text = ARM.replace(ELBOW_LIMIT, ELBOW_LIMIT.replace("/>", ' acceleration="3"/>', 1))
    text = text if added == "ACCELERATION" else head + added
    links = text.replace("</robot>", JOINT.format("wrist", "fore", "more") + "</robot>") if "more" in text else text
    arm.write_text(links)
    [found] = said(arm)
    assert found.startswith(str(arm)), found
    assert f"not read: {name}" in found
    with pytest.raises(InputError, match="not read"):
        load_robot(arm, strict=True)


def test_soft_limits_that_leave_all_say_nothing(arm):
    soft = '<safety_controller k_velocity="1" soft_lower_limit="-2" soft_upper_limit="2.1"/>'
    arm.write_text(ARM.replace("</joint>", soft + "</joint>"))
    assert said(arm) == []


def test_limits_that_are_not_read_are_named(arm, tmp_path):
    limits = tmp_path / "joint_limits.yaml"
    limits.write_text(
        "joint_limits:\n  elbow: {max_deceleration: 1, has_soft_limits: false, soft_lower_limit: -1}\n"
        "  shoulder: {max_velocity: 1, has_deceleration_limits: true, max_deceleration: 2}\n"
    )
    [found] = said(arm, joint_limits=limits)
    assert found.endswith("joint_limits.yaml: not read: max_deceleration of 'elbow', 'shoulder'")


def test_lines_are_not_named_where_macros_have_moved_them(arm, tmp_path):
    pytest.importorskip("xacro")
    head = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    text = SRDF.strip().replace('<robot name="arm">', head).replace('link2="upper"', 'link2="uper"')
    (tmp_path / "arm.srdf.xacro").write_text(text)
    [found] = said(arm, srdf=tmp_path / "arm.srdf.xacro")
    assert "arm.srdf.xacro: <disable_collisions>: no link 'uper'; did you mean 'upper'?" in found
