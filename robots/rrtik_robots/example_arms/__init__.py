"""The fixed-base arms of the package example-robot-data, by name; hands and fingers are held still."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rrtik_ompl.base.errors import DescriptionWarning, InputError
from rrtik_ompl.description.robot_build import JointLimits
from rrtik_ompl.description.urdf import robot_from_urdf
from rrtik_ompl.model.gripper import GripperJoints
from rrtik_ompl.model.robot import Robot

if TYPE_CHECKING:
    from rrtik_ompl.description.robot_source import BasePose


PACKAGE = "example-robot-data"
INSIDE = "cmeel.prefix/share/example-robot-data/robots"


def data_folder() -> Path:
    """Folder of the package's robots.

    Raises:
        InputError: If the package is not installed.
    """
    for place in sys.path:  # importlib.metadata takes longer to be loaded than an arm
        folder = Path(place, INSIDE)
        if folder.is_dir():
            return folder
    raise InputError(f"the robot files of {PACKAGE} are not installed; pip install {PACKAGE}")


@dataclass(frozen=True, slots=True, eq=False)
class ExampleArm:
    """One arm of the package; calling it loads it.

    Attributes:
        name: Name of the robot.
        urdf: File, relative to the package's folder of robots.
        tip: Link that goals refer to.
        joints: Actuated joints.
        srdf: File with postures and allowed collisions, if there is one.
        postures: Further named postures, one number [rad] per joint.
        acceleration, jerk: Limits that the URDF cannot state, one per joint [rad/s^2, rad/s^3]; empty if unknown.
        gripper: Joints that open and close its gripper, if it can.
    """

    name: str
    urdf: str
    tip: str
    joints: tuple[str, ...]
    srdf: str = ""
    postures: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    acceleration: tuple[float, ...] = ()
    jerk: tuple[float, ...] = ()
    gripper: GripperJoints | None = None

    def __call__(
        self, *, tip: str | None = None, locked: Mapping[str, float] | None = None, base_pose: BasePose = None
    ) -> Robot:
        """Load the arm.

        Args:
            tip: Link that goals refer to.
            locked: Values [rad or m] of joints that are held still, such as fingers.
            base_pose: ``pinocchio.SE3`` T_world_base.

        Raises:
            InputError: If the package is not installed, or an option makes no sense.
        """
        folder = data_folder()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DescriptionWarning)  # known: an SRDF of a whole robot serves one arm of it
            robot = robot_from_urdf(
                folder / self.urdf,
                name=self.name,
                srdf=folder / self.srdf if self.srdf else None,
                joints=self.joints,
                tip=self.tip if tip is None else tip,
                locked=locked,
                base_pose=base_pose,
                postures={key: dict(zip(self.joints, q, strict=True)) for key, q in self.postures.items()},
                limits={
                    joint: JointLimits(acceleration=acceleration, jerk=jerk)
                    for joint, acceleration, jerk in zip(self.joints, self.acceleration, self.jerk, strict=False)
                },
            )
        return replace(robot, gripper=self.gripper or robot.gripper)


def _numbered(prefix: str, count: int, first: int = 1) -> tuple[str, ...]:
    return tuple(f"{prefix}{k}" for k in range(first, first + count))


_UR = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
_SO = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
_BAXTER = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
_UR_SRDF = "ur_description/srdf/ur5_joint_limited_robot.srdf"  # link names are the same for all three sizes
_UR_UP = {"up": (0.0, -1.5707963267948966, 0.0, -1.5707963267948966, 0.0, 0.0)}

panda = ExampleArm(
    "panda",
    "panda_description/urdf/panda.urdf",
    "panda_hand_tcp",
    _numbered("panda_joint", 7),
    "panda_description/srdf/panda.srdf",
    acceleration=(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
    jerk=(7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
    postures={
        "ready": (0.0, -0.7853981633974483, 0.0, -2.356194490192345, 0.0, 1.5707963267948966, 0.7853981633974483)
    },
    gripper=GripperJoints(  # the other finger follows
        ("panda_finger_joint1",), (0.04,), (0.0,), 0.08, "hand", (True,), velocity=(0.2,)
    ),
)
panda_primitives = replace(panda, name="panda_primitives", urdf="panda_description/urdf/panda_collision.urdf")
ur3 = ExampleArm("ur3", "ur_description/urdf/ur3_robot.urdf", "tool0", _UR, _UR_SRDF, postures=_UR_UP)
ur5 = ExampleArm("ur5", "ur_description/urdf/ur5_robot.urdf", "tool0", _UR, _UR_SRDF, postures=_UR_UP)
ur10 = ExampleArm("ur10", "ur_description/urdf/ur10_robot.urdf", "tool0", _UR, _UR_SRDF, postures=_UR_UP)
ur3_limited = ExampleArm(
    "ur3_limited", "ur_description/urdf/ur3_joint_limited_robot.urdf", "tool0", _UR, _UR_SRDF, postures=_UR_UP
)
ur5_limited = ExampleArm(
    "ur5_limited", "ur_description/urdf/ur5_joint_limited_robot.urdf", "tool0", _UR, _UR_SRDF, postures=_UR_UP
)
ur10_limited = ExampleArm(
    "ur10_limited", "ur_description/urdf/ur10_joint_limited_robot.urdf", "tool0", _UR, _UR_SRDF, postures=_UR_UP
)
ur3_gripper = ExampleArm(
    "ur3_gripper",
    "ur_description/urdf/ur3_gripper.urdf",
    "tool0",
    _UR,
    "ur_description/srdf/ur3_gripper.srdf",
    postures=_UR_UP,
)
ur5_gripper = ExampleArm(
    "ur5_gripper",
    "ur_description/urdf/ur5_gripper.urdf",
    "tool0",
    _UR,
    "ur_description/srdf/ur5_gripper.srdf",
    postures=_UR_UP,
)
kinova = ExampleArm(
    "kinova",
    "kinova_description/robots/kinova.urdf",
    "j2s6s200_end_effector",
    _numbered("j2s6s200_joint_", 6),
    "kinova_description/srdf/kinova.srdf",
)
xarm7 = ExampleArm(
    "xarm7",
    "xarm_description/urdf/xarm7.urdf",
    "link_eef",
    _numbered("joint", 7),
    "xarm_description/srdf/xarm7.srdf",
)
z1 = ExampleArm(
    "z1",
    "z1_description/urdf/z1.urdf",
    "gripperStator",
    _numbered("joint", 6),
    "z1_description/srdf/z1.srdf",
)
so100 = ExampleArm("so100", "so_arm_description/urdf/so100.urdf", "gripper", _SO)
so101 = ExampleArm("so101", "so_arm_description/urdf/so101.urdf", "gripper_frame_link", _SO)
talos_left_arm = ExampleArm(
    "talos_left_arm",
    "talos_data/robots/talos_left_arm.urdf",
    "gripper_left_base_link",
    tuple(f"arm_left_{k}_joint" for k in range(2, 8)),
    "talos_data/srdf/talos.srdf",
)
baxter_left = ExampleArm(
    "baxter_left",
    "baxter_description/urdf/baxter.urdf",
    "left_gripper",
    tuple(f"left_{joint}" for joint in _BAXTER),
    "baxter_description/srdf/baxter_manipulation.srdf",
)
baxter_right = ExampleArm(
    "baxter_right",
    "baxter_description/urdf/baxter.urdf",
    "right_gripper",
    tuple(f"right_{joint}" for joint in _BAXTER),
    "baxter_description/srdf/baxter_manipulation.srdf",
)
baxter = replace(baxter_left, name="baxter", joints=(*baxter_left.joints, *baxter_right.joints))  # both arms, two tips
