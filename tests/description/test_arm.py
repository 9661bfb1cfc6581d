"""Which joints move by default, where the tip is, and which joints are a gripper, where a description does not say."""

import re
import warnings

import numpy as np
import pytest

from rrtik_ompl.base.errors import ArmWarning, InputError
from rrtik_ompl.description.arm import arms_of
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.robot_build import build_robot
from rrtik_ompl.description.tree import Joint, Link, Tree
from rrtik_ompl.model.goal import MultiGoal, PoseGoal
from rrtik_ompl.tasks.setting import with_gripper
from rrtik_ompl.tasks.stages import Gripper
from rrtik_robots.example_arms import data_folder

PR2_ARM = ("shoulder_pan", "shoulder_lift", "upper_arm_roll", "elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll")

# File of example-robot-data: its tips, its joints by number or name, words of the warning ("" if there is none).
DEFAULTS = {
    "panda_description/urdf/panda.urdf": (["panda_hand_tcp"], 7, r"fingers \('panda_finger_joint1'\)"),
    "so_arm_description/urdf/so100.urdf": (["gripper"], 5, r"fingers \('gripper'\)"),
    "kinova_description/robots/kinova.urdf": (["j2s6s200_end_effector"], 6, ""),
    "xarm_description/urdf/xarm7.urdf": (["link_eef"], 7, ""),
    "ur_description/urdf/ur10_robot.urdf": (["tool0"], 6, ""),
    "tiago_description/robots/tiago_no_hand.urdf": (
        ["arm_tool_link"],
        8,
        "move no tip .*wheel_right_joint.*head_1_joint",
    ),
    "tiago_description/robots/tiago_dual.urdf": (
        ["hand_left_grasping_frame", "hand_right_grasping_frame"],
        15,
        "2 tips: .*wheel_right_joint.*fingers",
    ),
    "talos_data/robots/talos_left_arm.urdf": (["gripper_left_base_link"], 6, r"fingers \('gripper_left_joint'\)"),
    "talos_data/robots/talos_reduced.urdf": (
        ["gripper_left_base_link", "gripper_right_base_link"],
        16,
        "2 tips: .*leg_left_1_joint",
    ),
    "baxter_description/urdf/baxter.urdf": (["right_gripper_base_link", "left_gripper_base_link"], 14, "'head_pan'"),
    "pr2_description/urdf/pr2.urdf": (
        ["r_gripper_tool_frame", "l_gripper_tool_frame"],
        ("torso_lift_joint", *(f"{side}_{joint}_joint" for side in "rl" for joint in PR2_ARM)),
        "2 tips: .*fingers .*r_gripper_",
    ),
    "anymal_b_simple_description/robots/anymal-kinova.urdf": (["j2s6s200_end_effector"], 6, "'LF_HAA'"),
    "solo_description/robots/solo12.urdf": (["FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"], 12, "4 tips"),
    "allegro_hand_description/urdf/allegro_right_hand.urdf": (
        [f"link_{k}.0_tip" for k in (3, 7, 11, 15)],  # a hand alone: its fingers are the limbs
        16,
        "4 tips",
    ),
}


@pytest.mark.parametrize("file", DEFAULTS)
def test_an_arm_moves_what_moves_its_tip(file):
    tips, joints, said = DEFAULTS[file]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = load_robot(data_folder() / file)
    assert list(robot.tips) == tips
    assert robot.tip == tips[0]
    assert (robot.joint_names if isinstance(joints, tuple) else robot.dof) == joints

    told = [str(each.message) for each in caught if issubclass(each.category, ArmWarning)]
    assert len(told) == bool(said)
    assert re.search(said, "".join(told))


def chain(first, names, kind="revolute", base=None):
    """Joints one after another, called like the links that they move."""
    bounds = {"lower": -1.0, "upper": 1.0} if kind != "continuous" else {}
    return [
        Joint(name, kind, parent, name, axis=(0, 0, 1), **bounds)
        for parent, name in zip([base or first, *names[:-1]], names, strict=True)
    ]


def fixed(parent, *names):
    return [Joint(f"{name}_fixed", "fixed", parent, name) for name in names]


def tree(*parts):
    joints = [joint for part in parts for joint in part]
    links = dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child))
    return Tree("test", [Link(name) for name in links], joints)


ARM = chain("base", ["a1", "a2", "a3", "a4", "a5"])
JAW = chain("a5", ["jaw"])
WIDE = [Joint(f"{side}_slide", "prismatic", "a5", side, lower=0.0, upper=0.04) for side in ("left", "right")]
SHAPES = {
    "a jaw": (tree(ARM, JAW), ["a5"], {"fingers": ("jaw",)}),
    "two slides alike, without names": (tree(ARM, WIDE), ["a5"], {"fingers": ("left_slide", "right_slide")}),
    "a frame beyond the hand": (tree(ARM, WIDE, fixed("a5", "my_hand"), fixed("my_hand", "my_tcp")), ["my_tcp"], None),
    "a camera is no tool": (tree(ARM, fixed("a5", "plate", "tool_camera"), JAW), ["a5"], {"fingers": ("jaw",)}),
    "a gripper that closes": (tree(ARM, chain("a5", ["gripper"])), ["a5"], {"fingers": ("gripper",)}),
    "a jaw behind the tip, without a name": (
        tree(ARM, fixed("a5", "my_tcp"), chain("a5", ["a6"])), ["my_tcp"], {"fingers": ("a6",)}
    ),
    "a wrist that carries a fixed jaw": (
        tree(ARM, [Joint("wrist_roll", "revolute", "a5", "Fixed_Jaw")], chain("Fixed_Jaw", ["jaw"])),
        ["Fixed_Jaw"],
        {"fingers": ("jaw",)},
    ),
    "a gripper that rolls": (tree(ARM, chain("a5", ["gripper_roll"])), ["gripper_roll"], {}),
    "wheels": (
        tree(ARM, *(chain("base", [f"wheel{k}"], "continuous") for k in range(4))),
        ["a5"],
        {"joints that move no tip": ("wheel0", "wheel1", "wheel2", "wheel3")},
    ),
    "a base that drives": (
        tree(
            [Joint(name, "prismatic", before, name, axis=axis, lower=-np.inf, upper=np.inf)
             for before, name, axis in (("world", "x", (1, 0, 0)), ("x", "y", (0, 1, 0)))],
            [Joint("turn", "continuous", "y", "base")],
            ARM,
        ),
        ["a5"],
        {"endless slides of a base": ("x", "y", "turn")},
    ),
    "two arms": (tree(ARM, chain("base", ["b1", "b2", "b3", "b4"])), ["a5", "b4"], {}),
    "a head": (tree(ARM, chain("base", ["pan", "tilt"])), ["a5"], {"joints that move no tip": ("pan", "tilt")}),
    "legs": (
        tree(ARM, chain("base", ["hip", "thigh", "knee", "ankle", "foot"])),
        ["a5"],
        {"joints that move no tip": ("hip", "thigh", "knee", "ankle", "foot")},
    ),
    "a finger alone": (tree(chain("base", ["finger_1", "finger_2"])), ["finger_2"], {}),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_has_its_tips_and_its_joints_that_are_held(shape):
    built, tips, held = SHAPES[shape]
    arms = arms_of(built, {})
    assert [limb.tip for limb in arms.limbs] == tips
    assert held is None or dict(arms.held) == held


def test_the_joint_that_another_one_follows_moves_though_it_stands_beside_the_arm():
    """A rod drives the forearm: the joint of the arm follows that of the rod."""
    arms = arms_of(tree(chain("base", ["a1", "a2", "a3"]), chain("a1", ["rod"])), {"a2": "rod"})
    assert set(arms.joints) == {"a1", "rod", "a3"}


def test_joints_that_are_all_in_loops_are_no_arm():
    bars = tree(chain("base", ["a1", "a2"]))
    loops = {"a1": 0.0, "a2": 0.0}
    with pytest.raises(InputError, match=r"no arm in it, only joints in loops \('a1', 'a2'\); joints="):
        build_robot("bars", bars, loops=loops)
    assert build_robot("bars", bars, loops=loops, joints=["a1"]).dof == 1


def test_joints_that_are_asked_for_come_back_without_a_word():
    file = data_folder() / "panda_description/urdf/panda.urdf"
    names = (*(f"panda_joint{k}" for k in range(1, 8)), "panda_finger_joint1")
    with warnings.catch_warnings():
        warnings.simplefilter("error", ArmWarning)
        robot = load_robot(file, joints=names)
    assert (robot.joint_names, robot.tip, robot.gripper) == (names, "panda_hand_tcp", None)


def test_a_goal_names_one_of_two_tips():
    robot = load_robot(data_folder() / "baxter_description/urdf/baxter.urdf")
    q = 0.1 * np.arange(robot.dof)
    goal = MultiGoal({robot.tips[1]: PoseGoal(robot.fk(q, robot.tips[1]))})
    assert goal.satisfied(robot, [q]).all()
    assert not goal.satisfied(robot, [q + 0.1]).any()


# File, joints, open and closed [rad or m], how far it opens [m] (None: not known).
GRIPPERS = {
    "panda_description/urdf/panda.urdf": (["panda_finger_joint1"], [0.04], [0.0], 0.08),
    "so_arm_description/urdf/so101.urdf": (["gripper"], [1.74533], [-0.174533], None),
    "talos_data/robots/talos_left_arm.urdf": (["gripper_left_joint"], [0.0], [-1.0472], None),
}


@pytest.mark.parametrize("file", GRIPPERS)
def test_a_gripper_is_found_by_the_shape_of_its_fingers(file):
    joints, opened, closed, width = GRIPPERS[file]
    robot = load_robot(data_folder() / file)
    assert list(robot.gripper.joints) == joints
    assert set(joints).isdisjoint(robot.joint_names)
    np.testing.assert_allclose(robot.gripper.opened, opened, atol=1e-3)
    np.testing.assert_allclose(robot.gripper.closed, closed, atol=1e-3)
    assert robot.gripper.width == pytest.approx(width or 0.0, abs=1e-3)
    assert with_gripper(robot, Gripper("close")).source["locked"] == dict(
        zip(joints, robot.gripper.closed, strict=True)
    )


BY_VALUES = {"open": {"panda_finger_joint1": 0.03}, "closed": {"panda_finger_joint1": 0.01}}


def test_a_gripper_is_what_two_joint_values_say():
    file = data_folder() / "panda_description/urdf/panda.urdf"
    robot = load_robot(file, gripper=BY_VALUES)
    assert robot.gripper.width == pytest.approx(0.04, abs=1e-6)
    assert robot.gripper.close_on(0.02) == pytest.approx({"panda_finger_joint1": 0.02})
    closed = with_gripper(robot, Gripper("close"))
    assert closed.gripper == robot.gripper
    assert dict(closed.source["locked"]) == BY_VALUES["closed"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"open": {"panda_finger_joint1": 0.03}}, "for open and closed"),
        ({"open": {"panda_joint1": 0.03}, "closed": {"panda_joint1": 0.0}}, "'panda_joint1'"),
        (BY_VALUES | {"closed": {"knob": 0.0}}, "'knob'"),
        (BY_VALUES | {"closed": {"panda_finger_joint1": np.nan}}, "finite"),
    ],
)
def test_a_gripper_that_cannot_be_is_one_line(given, said):
    with pytest.raises(InputError, match=said):
        load_robot(data_folder() / "panda_description/urdf/panda.urdf", gripper=given)
