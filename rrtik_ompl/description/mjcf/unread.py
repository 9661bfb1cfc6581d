"""What an MJCF says about shapes, joints or limits and a robot does not get of it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from xml.etree.ElementTree import Element

from rrtik_ompl.base.errors import few
from rrtik_ompl.description.mjcf.bodies import Body

SHAPES = ("flex", "flexcomp", "skin", "composite")
OF_JOINTS = ("joint", "jointinparent")  # attributes of an actuator that name a joint


def unread_of_mjcf(
    root: Element, bodies: Mapping[str, Body], scenery: Sequence[str], joints: Collection[str]
) -> Iterator[str]:
    """What is left out, each kind of thing once, with the names of the first few.

    Args:
        root: Of the file.
        bodies: By name.
        scenery: Geoms that are left out.
        joints: Names of all joints.
    """
    free = [name for name, body in bodies.items() if "free" in body.joints]
    acting = [item for item in root.findall("actuator/*") if not any(item.get(key) in joints for key in OF_JOINTS)]
    tendons = [item for item in root.findall("tendon/*") if item.get("range") or item.get("limited") == "true"]
    kinds = {
        "of the scene (add it as obstacles)": scenery,
        "free bodies, held where they are:": _quoted(free),
        "mocap bodies, held where they are:": _names(each for each in root.iter("body") if each.get("mocap") == "true"),
        "loops, left open:": _loops(root),
        "joints held by <equality>:": _held(root),
        "actuators of no joint:": _names(acting),
        "limits of tendons:": _names(tendons),
        "pairs of <contact>:": _names(root.findall("contact/pair")),
        "flags:": _flags(root),
        "deformable bodies:": _names(item for tag in SHAPES for item in root.iter(tag)),
        "other files of <asset>:": _names(root.findall("asset/model")),
    }
    for kind, names in kinds.items():
        if names:
            yield f"{kind} {few(names)}"


def _flags(root: Element) -> list[str]:
    """Switches of what MuJoCo compares, where they do not have their usual position."""
    flags = [flag for flag in root.findall("option/flag") if flag.get("filterparent") == "disable"]
    return ["filterparent"] if flags else []


def _quoted(names: Sequence[str]) -> list[str]:
    return [f"'{name}'" for name in names]


def _names(elements: Iterable[Element]) -> list[str]:
    """How elements are called: by name, else by their tag."""
    return [f"'{item.get('name') or item.tag}'" for item in elements]


def _loops(root: Element) -> list[str]:
    """Equalities that are in force, other than those of two joints, by kind and by what they tie together."""
    found = []
    for item in root.findall("equality/*"):
        if item.tag == "joint" or item.get("active", "true") != "true":
            continue
        ends = [item.get(f"{kind}{number}") for kind in ("body", "site", "tendon") for number in (1, 2)]
        found.append(f"{item.tag} of {' and '.join(repr(end) for end in ends if end) or item.get('name', '')}")
    return found


def _held(root: Element) -> list[str]:
    """Joints that an equality in force holds at a value."""
    ties = (item for item in root.findall("equality/joint") if item.get("active", "true") == "true")
    return [f"'{item.get('joint1', '')}'" for item in ties if item.get("joint2") is None]
