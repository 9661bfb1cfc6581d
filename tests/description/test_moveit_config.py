"""Folders that MoveIt's setup assistant wrote, xacro, and the grippers that an SRDF describes."""

import re
import shutil
import sys
import warnings

import numpy as np
import pytest

from rrtik_ompl.base.errors import ArmWarning, DescriptionWarning, InputError, RrtikError, UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.joint_limits import read_joint_limits
from rrtik_ompl.description.moveit_config import robot_from_moveit
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_robots.example_arms import data_folder

PACKAGE, SRDF = "panda_description", "panda_description/srdf/panda.srdf"
ARM = [f"panda_joint{k}" for k in range(1, 8)]
HAND = """
  <group name="panda_arm"><chain base_link="panda_link0" tip_link="panda_link8"/></group>
  <group name="hand"><joint name="panda_finger_joint1"/></group>
  <group_state name="open" group="hand"><joint name="panda_finger_joint1" value="0.04"/></group_state>
  <group_state name="close" group="hand"><joint name="panda_finger_joint1" value="0"/></group_state>
  <group_state name="half" group="hand"><joint name="panda_finger_joint1" value="0.02"/></group_state>
  <group_state name="ready" group="panda_arm">{ready}</group_state>
  <end_effector name="hand" parent_link="panda_link8" group="hand" parent_group="panda_arm"/>
"""
READY = (0, -0.785, 0, -2.356, 0, 1.571, 0.785)
ASSISTANT = """moveit_setup_assistant_config:
  urdf: {package: panda_description, relative_path: urdf/panda.urdf}
  srdf: {relative_path: config/panda.srdf}
  package_settings: {author_name: Somebody, generated_timestamp: 1700000000}
"""
LIMITS = """default_velocity_scaling_factor: 0.1
default_acceleration_scaling_factor: 0.1
joint_limits:
  panda_joint1: {has_velocity_limits: true, max_velocity: 1.5, has_acceleration_limits: true, max_acceleration: 3.75}
  panda_joint2: {has_velocity_limits: true, max_velocity: 1.25, has_acceleration_limits: false, max_acceleration: 0}
"""
KINEMATICS = """panda_arm:
  kinematics_solver: kdl_kinematics_plugin/KDLKinematicsPlugin
  kinematics_solver_search_resolution: 0.005
  kinematics_solver_timeout: 0.05
"""


@pytest.fixture
def folder(tmp_path):
    """A configuration of the Panda beside its description package, as in a workspace."""
    config = tmp_path / "panda_moveit_config" / "config"
    config.mkdir(parents=True)
    (tmp_path / PACKAGE).symlink_to(data_folder() / PACKAGE)
    text = (data_folder() / SRDF).read_text()
    ready = "".join(f'<joint name="{joint}" value="{value}"/>' for joint, value in zip(ARM, READY, strict=True))
    head, tail = '<robot name="panda">', text[text.index("    <disable_collisions") :]
    (config / "panda.srdf").write_text(head + HAND.format(ready=ready) + tail)
    (config.parent / ".setup_assistant").write_text(ASSISTANT)
    (config / "joint_limits.yaml").write_text(LIMITS)
    (config / "kinematics.yaml").write_text(KINEMATICS)
    return config.parent


def test_one_call_reads_all_that_a_folder_says(folder):
    robot = load_robot(folder)
    assert robot is load_robot(folder)
    assert list(robot.joint_names) == ARM
    assert robot.tip == "panda_link8"
    assert robot.posture("ready") == pytest.approx(READY)
    assert robot.velocity[:2].tolist() == [1.5, 1.25]
    assert robot.acceleration[:2].tolist() == [3.75, np.inf]
    shipped = load_robot("panda")
    assert robot.allowed_collisions == shipped.allowed_collisions
    q = np.array(READY)
    link = np.linalg.inv(shipped.fk(q, "panda_link8").homogeneous) @ robot.fk(q).homogeneous
    assert link == pytest.approx(np.eye(4), abs=1e-9)
    Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (200, 7))
    assert (World(robot).valid_batch(Q) == World(shipped).valid_batch(Q)).all()


@pytest.mark.parametrize("around", ["{0}:", "/**:\n  ros__parameters:\n    {0}:"])
def test_parameters_may_stand_within_their_names_on_the_parameter_server(folder, around):
    """Folders for ROS 1 and for parameter files of ROS 2."""
    for file, name in (("joint_limits", "robot_description_planning"), ("kinematics", "robot_description_kinematics")):
        path, head = folder / "config" / f"{file}.yaml", around.format(name)
        indent = " " * (head.splitlines()[-1].count(" ") + 2)
        path.write_text(head + "\n" + "".join(indent + line + "\n" for line in path.read_text().splitlines()))
    srdf = folder / "config" / "panda.srdf"
    srdf.write_text(
        srdf.read_text().replace("</robot>", '<group name="b"><joint name="panda_joint1"/></group></robot>')
    )
    robot = load_robot(folder)  # which group has a solver is said in kinematics.yaml
    assert robot.tip == "panda_link8"
    assert robot.velocity[:2].tolist() == [1.5, 1.25]
    broken(folder, "joint_limits.yaml", "max_velocity: 1.25", "max_velocity: fast")
    with pytest.raises(InputError, match=r"joint_limits.yaml:\d: .*joint2.max_velocity: expected a finite number"):
        load_robot(folder)


def test_meshes_may_be_named_as_xacro_finds_packages(folder):
    """As in the URDF of MoveIt's own resources, which is named .urdf all the same."""
    text = (data_folder() / PACKAGE / "urdf" / "panda.urdf").read_text()
    named = text.replace("package://example-robot-data/robots/panda_description", "file://$(find panda_description)")
    assert named != text
    (folder / "config" / "panda.urdf").write_text(named)
    q = np.array(READY)
    assert load_robot(folder).fk(q).isApprox(load_robot("panda").fk(q, "panda_link8"), 1e-12)
    (folder / "config" / "panda.urdf").write_text(named.replace("find panda_description", "find panda_parts"))
    with pytest.raises(InputError, match=r"packages=.*panda_parts"):
        load_robot(folder)


def test_the_gripper_is_that_of_the_end_effectors_states(folder):
    hand = load_robot(folder).gripper
    assert hand.posture("open") == {"panda_finger_joint1": 0.04}
    assert hand.posture("close") == {"panda_finger_joint1": 0.0}
    assert hand.width == pytest.approx(load_robot("panda").gripper.width, abs=1e-4)
    holding = load_robot(folder, locked=hand.close_on(0.05))
    apart = [holding.fk(np.array(READY), f"panda_{side}finger").translation for side in ("left", "right")]
    assert np.linalg.norm(apart[0] - apart[1]) == pytest.approx(0.05, abs=1e-4)


def test_a_gripper_that_is_part_of_the_arm_is_none(folder):
    assert load_robot(folder, joints=[*ARM, "panda_finger_joint1"], tip="panda_link8").gripper is None


@pytest.mark.parametrize(
    ("names", "opened"),
    [(("hand_open", "hand_closed"), 0.03), (("Open", "Close"), 0.03), (("wide", "narrow"), 0.04)],
)
def test_states_are_known_by_the_words_in_their_names(folder, names, opened):
    """Otherwise the fingers are open at their limit."""
    srdf = folder / "config" / "panda.srdf"
    text = srdf.read_text().replace('name="open"', f'name="{names[0]}"').replace('name="close"', f'name="{names[1]}"')
    srdf.write_text(re.sub(r'(_finger_joint\d" value=)"0\.0?4\d*"', r'\1"0.03"', text))
    assert load_robot(folder).gripper.opened == (opened,)


def test_problem_files_name_the_folder(folder):
    robot = load_robot(folder, padding={"panda_hand": 0.01})
    Problem(World(robot), "ready", "ready").save(folder.parent / "problem.yaml")
    assert "moveit: panda_moveit_config" in (folder.parent / "problem.yaml").read_text()
    assert load_problem(folder.parent / "problem.yaml").robot is robot


def test_a_urdf_that_is_given_is_read_in_place_of_the_folders(folder):
    given = next((folder.parent / PACKAGE).rglob("panda.urdf"))
    (folder / ".setup_assistant").unlink()  # the message then says: give urdf=FILE
    robot = load_robot(folder, urdf=given)
    assert robot.posture("ready") == pytest.approx(READY)
    assert list(robot.joint_names) == ARM
    Problem(World(robot), "ready", "ready").save(folder.parent / "problem.yaml")
    assert load_problem(folder.parent / "problem.yaml").robot is robot


def test_a_changed_file_is_read_again(folder):
    before = load_robot(folder)
    (folder / "config" / "joint_limits.yaml").write_text(LIMITS.replace("1.25", "1.125"))
    assert load_robot(folder).velocity[1] == 1.125
    assert before.velocity[1] == 1.25


def test_links_that_are_never_checked_but_with_a_few(folder):
    srdf = folder / "config" / "panda.srdf"
    extra = '<disable_default_collisions link="panda_hand"/><enable_collisions link1="panda_hand" link2="panda_link2"/>'
    srdf.write_text(srdf.read_text().replace("</robot>", extra + "</robot>"))
    allowed = load_robot(folder).allowed_collisions
    never = {other for pair in allowed if "panda_hand" in pair for other in pair}
    assert never == set(load_robot(folder).link_names) - {"panda_link2"}


def broken(folder, file, old, new):
    path = folder / "config" / file if file != ".setup_assistant" else folder / file
    path.write_text(path.read_text().replace(old, new))


FAULTS = {
    "no folder": (shutil.rmtree, "moveit_config"),
    "no SRDF": (lambda f: (f / "config" / "panda.srdf").unlink(), r"config: no SRDF in this folder; .* give srdf=FILE"),
    "two SRDFs": (
        lambda f: (shutil.copy(f / "config/panda.srdf", f / "config/b.srdf"), (f / ".setup_assistant").unlink()),
        r"2 files are an SRDF: b.srdf, panda.srdf; choose one by srdf=FILE",
    ),
    "no package": (lambda f: (f.parent / PACKAGE).unlink(), r"'panda_description' is not found; give packages="),
    "no URDF": (lambda f: (f / ".setup_assistant").unlink(), r"config: no URDF in this folder; .* give urdf=FILE"),
    "assistant": (lambda f: broken(f, ".setup_assistant", "moveit_", "m_"), r"\.setup_assistant.*setup assistant"),
    "assistant no YAML": (lambda f: broken(f, ".setup_assistant", ":", "["), r"\.setup_assistant:\d"),
    "joint of the arm": (
        lambda f: broken(f, "panda.srdf", 'tip_link="panda_link8"', 'tip_link="link8"'),
        r"panda.urdf: no link 'link8'",
    ),
    "words of xacro": (
        lambda f: (
            broken(f, ".setup_assistant", "urdf/panda.urdf", "urdf/arm.urdf.xacro, xacro_args: 'hand=false'"),
            (f.parent / PACKAGE).unlink(),
            (f.parent / PACKAGE / "urdf").mkdir(parents=True),
            (f.parent / PACKAGE / "urdf" / "arm.urdf.xacro").write_text("<robot/>"),
        ),
        r"\.setup_assistant: xacro_args: expected words such as name:=value, found 'hand=false'",
    ),
    "no group that moves": (
        lambda f: (
            broken(f, "panda.srdf", '<chain base_link="panda_link0" tip_link="panda_link8"/>', ""),
            broken(f, "panda.srdf", '<group name="hand"><joint name="panda_finger_joint1"/>', '<group name="hand">'),
            (f / "config/kinematics.yaml").unlink(),
        ),
        r"which group is the arm\? choose one by group=, of none that moves",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_missing_or_wrong_is_one_line_with_the_remedy(folder, fault):
    spoil, said = FAULTS[fault]
    spoil(folder)
    with pytest.raises(RrtikError, match=said) as error:
        load_robot(folder)
    assert "\n" not in str(error.value)


IGNORED = {
    "group of kinematics": (lambda f: broken(f, "kinematics.yaml", "panda_arm", "arm"), r"yaml:1: arm: no group 'arm'"),
    "joint of a limit": (lambda f: broken(f, "joint_limits.yaml", "t1", "t99"), r"joint_limits.yaml:4: .*no joint"),
    "a key twice": (
        lambda f: broken(f, "kinematics.yaml", "panda_arm", "panda_arm: {}\npanda_arm"),
        r"kinematics.yaml:2: key 'panda_arm' stands here twice \(first in line 1\); the last one counts",
    ),
}


@pytest.mark.parametrize("fault", IGNORED)
def test_what_moveit_ignores_is_a_warning(folder, fault):
    spoil, said = IGNORED[fault]
    spoil(folder)
    with pytest.warns(DescriptionWarning, match=said):
        assert list(load_robot(folder).joint_names) == ARM


@pytest.mark.parametrize(("written", "value"), [("!degrees 90", np.pi / 2), ("!radians 1.5", 1.5)])
def test_limits_may_be_angles_with_a_unit(folder, written, value):
    broken(folder, "joint_limits.yaml", "max_velocity: 1.25", f"max_velocity: {written}")
    assert load_robot(folder).velocity[1] == pytest.approx(value, abs=1e-15)
    broken(folder, "joint_limits.yaml", written, "!degrees fast")
    with pytest.raises(InputError, match=r"joint_limits.yaml:\d: .*max_velocity: !degrees needs a number"):
        load_robot(folder)


def test_a_solver_tells_the_arm_among_several_groups(folder):
    more = '<group name="turret"><joint name="panda_joint1"/></group></robot>'
    broken(folder, "panda.srdf", "</robot>", more)
    assert list(load_robot(folder).joint_names) == ARM
    assert load_robot(folder, group="turret").joint_names == ("panda_joint1",)


def link_chain(names, base="base", kind="revolute"):
    """URDF text of links one after another, moved by joints called like them."""
    return "".join(
        f'<link name="{name}"/><joint name="j_{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
        '<origin xyz="0 0 0.1"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for parent, name in zip([base, *names[:-1]], names, strict=True)
    )


LEFT, RIGHT = ([f"{side}{k}" for k in range(1, 5)] for side in "lr")
TORSO_AND_ARMS = f'<link name="base"/>{link_chain(["t"])}{link_chain(LEFT, "t")}{link_chain(RIGHT, "t")}'
CLAMP = link_chain(["clamp"], "l4", "prismatic")
GROUPS = {
    "t": '<group name="torso"><joint name="j_t"/></group>',
    "l": '<group name="left"><chain base_link="t" tip_link="l4"/></group>',
    "r": '<group name="right"><chain base_link="t" tip_link="r4"/></group>',
    "tl": '<group name="left_torso"><chain base_link="base" tip_link="l4"/></group>',
    "tlr": '<group name="all"><group name="torso"/><group name="left"/><group name="right"/></group>',
    "h": '<group name="hand"><joint name="j_clamp"/></group><end_effector name="e" parent_link="l4" group="hand"/>',
}
BOTH = tuple(f"j_{name}" for name in LEFT + RIGHT)
# Links, groups, joints and tips that are right, words of the warnings.
SEVERAL = {
    "two arms": (TORSO_AND_ARMS, "lr", BOTH, ("l4", "r4"), "groups 'left', 'right' together.*2 tips"),
    "a group of both": (TORSO_AND_ARMS, "t l r tlr", ("j_t", *BOTH), ("l4", "r4"), "group 'all'; .*2 tips"),
    "with and without torso": (
        f'<link name="base"/>{link_chain(["t"])}{link_chain(LEFT, "t")}{CLAMP}',
        "l tl h",
        ("j_t", *BOTH[:4]),
        ("l4",),
        "group 'left_torso'; group= chooses another, of left$",
    ),
}


@pytest.mark.parametrize("case", SEVERAL)
def test_of_several_groups_those_joints_move_that_move_a_tip(tmp_path, case):
    links, groups, joints, tips, said = SEVERAL[case]
    config = tmp_path / "config"
    config.mkdir()
    (config / "a.urdf").write_text(f'<robot name="a">{links}</robot>')
    named = "".join(GROUPS[each] for each in (groups.split() if " " in groups else groups))
    (config / "a.srdf").write_text(f'<robot name="a">{named}</robot>')
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = load_robot(tmp_path)
    assert (robot.joint_names, robot.tips) == (joints, tips)
    told = " ".join(str(each.message) for each in caught if issubclass(each.category, ArmWarning))
    assert re.search(said, told), told


def test_joints_of_an_end_effector_are_fingers_whatever_they_are_called(tmp_path):
    links = f'<link name="base"/>{link_chain(LEFT)}{CLAMP}'
    (tmp_path / "a.urdf").write_text(f'<robot name="a">{links}</robot>')
    (tmp_path / "a.srdf").write_text(f'<robot name="a">{GROUPS["h"]}</robot>')
    assert load_robot(tmp_path / "a.urdf").dof == 5
    with pytest.warns(ArmWarning, match=r"held still: fingers \('j_clamp'\)"):
        robot = load_robot(tmp_path / "a.urdf", srdf=tmp_path / "a.srdf")
    assert (robot.joint_names, robot.tip, robot.gripper.joints) == (BOTH[:4], "l4", ("j_clamp",))


def test_a_limit_that_is_switched_off_may_say_anything(tmp_path):
    (tmp_path / "l.yaml").write_text("joint_limits: {a: {has_jerk_limits: false, max_jerk: 0, max_velocity: 0}}\n")
    with pytest.raises(InputError, match=r"max_velocity.* 0"):
        read_joint_limits(tmp_path / "l.yaml", ["a"])
    (tmp_path / "l.yaml").write_text("joint_limits: {a: {has_jerk_limits: false, max_jerk: 0}}\n")
    assert read_joint_limits(tmp_path / "l.yaml", ["a"]).limits["a"].jerk == np.inf


XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="reach" default="0.5"/><xacro:include filename="$(find parts)/turn.xacro"/>
  <link name="base"/><link name="hand"/><xacro:turn reach="$(arg reach)"/>
</robot>"""
TURN = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="turn" params="reach">
  <joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><origin xyz="${2 * reach} 0 0"/>
  <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></xacro:macro></robot>"""


@pytest.fixture
def xacro_file(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "turn.xacro").write_text(TURN)
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "arm.urdf.xacro").write_text(XACRO)
    return tmp_path / "arm" / "arm.urdf.xacro"


def test_without_the_package_xacro_one_line_names_it(xacro_file, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(InputError, match=r"arm.urdf.xacro.*pip install xacro.*xacro arm.urdf.xacro >"):
        load_robot(xacro_file)


def test_macros_are_expanded(xacro_file, tmp_path):
    pytest.importorskip("xacro")
    assert load_robot(xacro_file).fk([0.0]).translation[0] == 1.0
    robot = load_robot(xacro_file, xacro_args={"reach": 0.75})
    assert robot.fk([0.0]).translation[0] == 1.5
    Problem(World(robot), [0.0], [0.5]).save(tmp_path / "p.yaml")
    assert load_problem(tmp_path / "p.yaml").robot is robot


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("find parts", "find elsewhere", "package 'elsewhere' is not found; give packages="),
        ("turn.xacro", "tunr.xacro", "tunr.xacro"),
        ("</robot>", "", "arm.urdf.xacro: xacro: "),
        ("$(arg reach)", "${1 / 0}", "division by zero"),
        ("$(arg reach)", "$(arg rich)", "rich"),
    ],
)
def test_what_is_wrong_in_macros_is_one_line(xacro_file, old, new, said):
    pytest.importorskip("xacro")
    xacro_file.write_text(XACRO.replace(old, new))
    with pytest.raises(InputError, match=said) as error:
        load_robot(xacro_file)
    assert "\n" not in str(error.value)


def test_arguments_of_macros_are_for_macros():
    with pytest.raises(InputError, match=r"xacro_args.*\.xacro"):
        load_robot(data_folder() / "panda_description/urdf/panda.urdf", xacro_args={"a": 1})


def test_a_name_of_no_robot_lists_robots_still():
    with pytest.raises(UnknownNameError, match="no robot 'pandda'"):
        load_robot("pandda")


def test_a_joint_that_a_gripper_lacks_is_a_warning_and_the_arm_is_the_same(folder):
    broken(folder, "panda.srdf", '"panda_finger_', '"')
    with pytest.warns(DescriptionWarning, match=r"panda\.srdf:\d+: <joint>: no joint 'joint1'"):
        robot = load_robot(folder)
    assert list(robot.joint_names) == ARM


LENGTH = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="long" default="false"/><xacro:arg name="name" default="far"/>
<xacro:property name="l" value="${0.9 if '$(arg long)' == 'true' else 0.3}"/>
<link name="base"/><link name="a"/><link name="b"/><link name="$(arg name)"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 ${l}"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="jf" type="prismatic"><parent link="b"/><child link="$(arg name)"/><axis xyz="0 1 0"/>
<limit lower="0" upper="0.1" velocity="1" effort="1"/></joint></robot>"""
ARM_GROUP = '<robot name="arm"><group name="arm"><chain base_link="base" tip_link="b"/></group></robot>'


@pytest.fixture
def workspace(tmp_path):
    """A description with arguments, beside a configuration folder."""
    config = tmp_path / "arm_moveit_config" / "config"
    config.mkdir(parents=True)
    (config / "arm.srdf").write_text(ARM_GROUP)
    (tmp_path / "arm_description" / "urdf").mkdir(parents=True)
    (tmp_path / "arm_description" / "urdf" / "arm.urdf.xacro").write_text(LENGTH)
    assisted(config.parent, "''")
    return config.parent


def assisted(folder, xacro_args):
    (folder / ".setup_assistant").write_text(
        "moveit_setup_assistant_config:\n  URDF:\n    package: arm_description\n"
        f"    relative_path: urdf/arm.urdf.xacro\n    xacro_args: {xacro_args}\n"
        "  SRDF: {relative_path: config/arm.srdf}\n"
    )


def reach(robot):
    return float(robot.fk(np.zeros(robot.dof), "b").translation[2])


FORMS = {
    "one text": '"--inorder long:=true name:=finger"',
    "words on lines": "\n      --inorder\n      long:=true\n      name:=finger",
    "a list": "[long:=true, name:=finger]",
}


@pytest.mark.parametrize("form", FORMS)
def test_the_arm_is_the_one_that_the_assistant_has_expanded(workspace, form):
    pytest.importorskip("xacro")
    assert reach(load_robot(workspace)) == pytest.approx(0.3)
    assisted(workspace, FORMS[form])
    robot = load_robot(workspace)
    assert reach(robot) == pytest.approx(0.9)
    assert "finger" in robot.link_names
    own = load_robot(workspace, xacro_args={"long": "false"})
    assert reach(own) == pytest.approx(0.3)
    assert "finger" in own.link_names
    own_file = workspace.parent / "arm_description" / "urdf" / "arm.urdf.xacro"
    assert reach(load_robot(workspace, urdf=own_file)) == pytest.approx(0.3)
    Problem(World(robot), [0.1, 0.2], [0.3, 0.4]).save(workspace.parent / "p.yaml")
    assert load_problem(workspace.parent / "p.yaml").robot is robot


def test_the_urdf_for_gazebo_is_read_only_if_there_is_no_other(workspace):
    pytest.importorskip("xacro")
    old = LENGTH.replace("${l}", "0.1").replace("$(arg name)", "far").replace("xacro:", "")
    old = "\n".join(line for line in old.splitlines() if not line.startswith(("<arg", "<property")))
    (workspace / "config" / "gazebo_arm.urdf").write_text(old)
    assert reach(load_robot(workspace)) == pytest.approx(0.3)
    (workspace / "config" / "own.urdf").write_text(old.replace("0 0 0.1", "0 0 0.5"))
    assert reach(load_robot(workspace)) == pytest.approx(0.5)
    (workspace / "config" / "own.urdf").unlink()
    (workspace.parent / "arm_description" / "urdf" / "arm.urdf.xacro").unlink()
    assert reach(load_robot(workspace)) == pytest.approx(0.1)


LAUNCH = """<launch><arg name="load" default="true"/>
<param if="$(arg load)" name="robot_description" {}/>
<param name="robot_description_semantic" textfile="$(find arm_moveit_config)/config/arm.srdf"/></launch>"""
LOADED = {
    "macros": ("""command="$(find xacro)/xacro --inorder '$(find arm_description)/urdf/arm.urdf.xacro' long:=true"
        """, 0.9),
    "macros and an argument of the launch file": (
        """command="xacro $(find arm_description)/urdf/arm.urdf.xacro name:=$(arg load)" """, 0.3),
    "text": ('textfile="$(find arm_description)/urdf/plain.urdf"', 0.5),
}  # fmt: skip


@pytest.mark.parametrize("case", LOADED)
def test_without_the_assistants_file_the_launch_file_names_the_urdf(workspace, case):
    pytest.importorskip("xacro")
    (workspace / ".setup_assistant").unlink()
    (workspace / "package.xml").write_text("<package><name>arm_moveit_config</name></package>")
    plain = "\n".join(line for line in LENGTH.splitlines() if not line.startswith("<xacro:"))
    plain = plain.replace("${l}", "0.5").replace("$(arg name)", "far").replace("arm", "other")
    (workspace.parent / "arm_description" / "urdf" / "plain.urdf").write_text(plain)
    loaded, length = LOADED[case]
    (workspace / "launch").mkdir()
    (workspace / "launch" / "planning_context.launch").write_text(LAUNCH.format(loaded))
    (workspace / "config" / "arm.srdf").write_text(ARM_GROUP.replace('robot name="arm"', "robot"))
    assert reach(load_robot(workspace)) == pytest.approx(length)


def test_without_any_word_of_it_the_urdf_is_that_of_the_same_name_beside_the_folder(workspace):
    pytest.importorskip("xacro")
    (workspace / ".setup_assistant").unlink()
    (workspace / "package.xml").write_text("<package><name>arm_moveit_config</name></package>")
    with pytest.raises(InputError, match="no URDF in this folder"):
        load_robot(workspace)
    package = workspace.parent / "arm_description"
    (package / "package.xml").write_text("<package><name>arm_description</name></package>")
    (package / "urdf" / "other.urdf").write_text(LENGTH.replace('name="arm"', 'name="other"', 1))
    with pytest.warns(DescriptionWarning, match=r"arm\.srdf: no file says .* taken is .*arm\.urdf\.xacro"):
        assert reach(load_robot(workspace)) == pytest.approx(0.3)
    (package / "urdf" / "arm_blue.urdf").write_text(LENGTH)  # the name of the file decides
    with pytest.warns(DescriptionWarning, match=r"taken is .*arm\.urdf\.xacro"):
        robot_from_moveit(workspace)
    (package / "urdf" / "arm.urdf.xacro").rename(package / "urdf" / "arm_red.urdf")
    with pytest.raises(InputError, match=r"2 URDFs are of robot 'arm': .*arm_blue.* choose one by urdf=FILE"):
        load_robot(workspace)


TWO_GROUPS = """<robot name="arm"><group name="arm"><joint name="j1"/><joint name="j2"/></group>
<group name="gripper"><joint name="jf"/></group><end_effector name="ee" parent_link="b" group="{}"/></robot>"""


@pytest.mark.parametrize("solved", [("arm",), ("arm", "gripper"), ()])
@pytest.mark.parametrize("held", ["arm", "gripper"])
def test_the_arm_is_the_group_with_a_solver_and_no_gripper_that_has_fewer_joints(workspace, held, solved):
    pytest.importorskip("xacro")
    (workspace / "config" / "arm.srdf").write_text(TWO_GROUPS.format(held))
    solver = "".join(f"{group}: {{kinematics_solver: kdl}}\n" for group in solved)
    (workspace / "config" / "kinematics.yaml").write_text(solver or "{}")
    # Where the file calls the arm the gripper's end effector, names and numbers of joints decide.
    assert load_robot(workspace).joint_names == ("j1", "j2")
