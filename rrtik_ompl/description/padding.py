"""Links thicker than a description says: hoses, covers and cables that it lacks, or room around a link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TypeAlias

from rrtik_ompl.base.arrays import not_negative
from rrtik_ompl.base.errors import require
from rrtik_ompl.description.named_numbers import by_name
from rrtik_ompl.model.robot import Robot

Padding: TypeAlias = float | Mapping[str, float]


def padded(robot: Robot, padding: Padding) -> Robot:
    """The robot with thicker links, to obstacles and to each other.

    All checks and proofs keep the padding on top of the margins of obstacles and of :class:`rrtik_ompl.World`'s
    ``self_margin``; between two links that both have one, the sum. What an obstacle or link that no joint moves must
    keep from another such one stays 0. MoveIt's ``link_padding`` counts for obstacles alone.

    Args:
        robot: The robot; a padding that it has already is replaced.
        padding: By name of link [m], at least 0; or one number for all links.

    Raises:
        UnknownNameError: If the robot has no link of a name.
        InputError: If a number is negative or not finite.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> arm = rrtik.padded(rrtik.load_robot("panda"), {"panda_hand": 0.01})
        >>> arm.padding["panda_hand"]
        0.01
    """
    require(robot, Robot, "robot to pad", "use load_robot(name or file)")

    padding_by_link = padding if isinstance(padding, Mapping) else dict.fromkeys(robot.link_names, padding)
    checked = by_name(robot, "padding", "link", robot.link_names, padding_by_link, not_negative)
    source = dict(robot.source) | {"padding": dict(checked) if isinstance(padding, Mapping) else float(padding)}
    not_zero = {link: value for link, value in checked.items() if value > 0.0}
    return replace(robot, padding=MappingProxyType(not_zero), source=MappingProxyType(source))
