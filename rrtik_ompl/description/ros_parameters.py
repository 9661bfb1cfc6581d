"""Groups of parameters in MoveIt's files: some have them at the top, others within the names that ROS gives them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rrtik_ompl.files.strict_yaml import Location, YamlDocument

ROS = ("/**", "ros__parameters")  # around the parameters of a node of ROS 2


def parameters(document: YamlDocument, name: str) -> tuple[Location, Mapping[str, Any]]:
    """Where the parameters of a file stand, and what they are.

    Args:
        document: The file.
        name: What they are called on ROS's parameter server, such as "robot_description_planning".
    """
    location: Location = ()
    found: Mapping[str, Any] = document.data
    for key in (*ROS, name):
        below = found.get(key)
        if isinstance(below, Mapping):
            location = (*location, key)
            found = below
    return location, found
