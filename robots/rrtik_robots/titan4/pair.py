"""Two TITAN 4 side by side on one frame, as on a work-class vehicle: one robot of twelve joints and two tips."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, fromstring, tostring

from rrtik_ompl.base.arrays import length
from rrtik_ompl.description.joint_limits import read_joint_limits
from rrtik_ompl.description.robot_build import JointLimits
from rrtik_ompl.description.srdf import read_srdf
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.files.text import read_text
from rrtik_ompl.model.robot import Robot
from rrtik_robots.titan4.geometry import JOINTS
from rrtik_robots.titan4.urdf import titan4_urdf

if TYPE_CHECKING:
    from rrtik_ompl.description.robot_source import BasePose

FOLDER = Path(__file__).parent
SIDES = ("left_", "right_")
POSTURES = ("zero", "stowed", "ready")  # of both arms
APART = 0.9  # [m] between the azimuth axes; chosen here
NAMED = ("link", "parent", "child", "joint", "collision", "capsule")  # elements that name parts of an arm


def two_titan4(*, apart: float = APART, tip: str = "left_grip_point", base_pose: BasePose = None) -> Robot:
    """Make a robot of two arms that face along x, the left one at positive y, with the origin midway between them.

    Names of links and joints are those of the single arm after ``left_`` and ``right_``. A
    :class:`rrtik_ompl.MultiGoal` has a goal for ``left_grip_point`` and one for ``right_grip_point``.

    Args:
        apart: Distance between the azimuth axes [m].
        tip: Link that goals of a single tip refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.

    Raises:
        InputError: If the distance or the tip makes no sense.
    """
    single = read_srdf(read_text(FOLDER / "titan4.srdf"), "titan4.srdf")
    states = single.postures(None)
    rates = read_joint_limits(FOLDER / "joint_limits.yaml", JOINTS).limits
    limits: dict[str, JointLimits] = {f"{side}{joint}": rates[joint] for side in SIDES for joint in JOINTS}
    return robot_from_urdf_text(
        two_titan4_urdf(length(apart, "apart")),
        name="two_titan4",
        where="two_titan4",
        joints=[f"{side}{joint}" for side in SIDES for joint in JOINTS],
        tip=tip,
        base_pose=base_pose,
        limits=limits,
        postures={
            name: {f"{side}{joint}": value for side in SIDES for joint, value in states[name].items()}
            for name in POSTURES
        },
        allowed_collisions=[[f"{side}{link}" for link in pair] for side in SIDES for pair in single.allowed],
    )


def two_titan4_urdf(apart: float = APART) -> str:
    """Return the URDF text of both arms, whose azimuth axes are ``apart`` [m]."""
    pair = Element("robot", name="two_titan4")
    SubElement(pair, "link", name="frame")
    for side, y in zip(SIDES, (0.5 * apart, -0.5 * apart), strict=True):
        for element in fromstring(titan4_urdf()):
            if element.tag != "material":
                _rename(element, side)
                pair.append(element)
            elif side == SIDES[0]:  # Both arms share the materials.
                pair.append(element)

        mount = SubElement(pair, "joint", name=f"{side}mount", type="fixed")
        SubElement(mount, "parent", link="frame")
        SubElement(mount, "child", link=f"{side}base")
        SubElement(mount, "origin", xyz=f"0 {y!r} 0")
    return tostring(pair, encoding="unicode") + "\n"


def _rename(element: Element, side: str) -> None:
    """Put the side before every name of a link, a joint or a collision body, in place."""
    for each in element.iter():
        if each.tag in NAMED:
            for key in ("name", "link"):
                if key in each.attrib:
                    each.set(key, side + each.attrib[key])
