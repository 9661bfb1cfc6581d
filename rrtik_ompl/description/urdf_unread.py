"""What a URDF says about shapes, joints or limits and nobody here reads."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from rrtik_ompl.base.errors import few

# Elements that are read, or that say nothing about shapes, joints and limits.
OF_ROBOT = {"gazebo", "joint", "link", "material", "mujoco", "plugin", "ros2_control", "sensor", "transmission"}
OF_LINK = {
    "collision",
    "collision_checking",
    "contact",
    "gazebo",
    "inertial",
    "material",
    "origin",
    "self_collision_checking",
    "sensor",
    "visual",
}
OF_JOINT = {
    "axis",
    "calibration",
    "child",
    "dynamics",
    "gazebo",
    "joint_properties",
    "limit",
    "mimic",
    "origin",
    "parent",
    "safety_controller",
}
OF_LIMIT = {"effort", "lower", "upper", "velocity"}
OF_MIMIC = {"joint", "multiplier", "offset"}
SOFT = (("soft_lower_limit", "lower", 1.0), ("soft_upper_limit", "upper", -1.0))
NARROWER = 1e-6  # [rad or m] from which a soft limit is another one


def unread_of_urdf(robot: Element) -> list[str]:
    """What is not read of a URDF, each thing once: "<capsule_chain>", "<limit jerk> of joints 'a', 'b'"."""
    found = [f"<{tag}>" for tag in _others(robot, OF_ROBOT)]
    if robot.find("gazebo/joint") is not None:
        found.append("joints within <gazebo>")

    for tag, known in (("link", OF_LINK), ("joint", OF_JOINT)):
        named: dict[str, list[str]] = {}
        for element in robot.findall(tag):
            for what in (*_others(element, known), *(_of_joint(element) if tag == "joint" else ())):
                named.setdefault(what, []).append(f"'{element.get('name', '')}'")
        found += [f"<{what}> of {tag} {few(names, 3)}" for what, names in named.items()]
    return found


def _others(element: Element, known: set[str]) -> list[str]:
    """Tags of the parts of an element that are not known; each once, without the address of its namespace."""
    tags = (part.tag for part in element if isinstance(part.tag, str) and part.tag not in known)
    return list(dict.fromkeys(tag.rpartition("}")[2] for tag in tags))


def _of_joint(joint: Element) -> Iterator[str]:
    for tag, known in (("limit", OF_LIMIT), ("mimic", OF_MIMIC)):
        part = joint.find(tag)
        yield from (f"{tag} {key}" for key in (() if part is None else part.keys()) if key not in known)

    soft = joint.find("safety_controller")
    hard = joint.find("limit")
    if soft is not None and hard is not None and any(_narrower(soft, hard, *names) for names in SOFT):
        yield "safety_controller"


def _narrower(soft: Element, hard: Element, own: str, other: str, way: float) -> bool:
    """Whether a soft limit leaves less than the limit that is read."""
    try:
        gap = float(soft.get(own, "nan")) - float(hard.get(other, "0"))
    except ValueError:
        return False
    return way * gap > NARROWER
