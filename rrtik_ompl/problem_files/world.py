"""The keys of our YAML files that say how a world checks <-> the settings of a world beside its robot and scene."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any

from pydantic import Field

from rrtik_ompl.base.choices import Accuracy
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.sections import NotNegative, Positive, Section
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.model.world_settings import FINEST_RESOLUTION, MOTION_RESOLUTION, WorldSettings

ELSEWHERE = ("robot", "scene", "constraints")  # settings that have sections of their own


class WorldKeys(Section):
    """How a world checks. Lengths in metres."""

    motion_resolution: Positive = Field(
        MOTION_RESOLUTION,
        ge=FINEST_RESOLUTION,
        description="largest step of any point of the arm between two checked configurations [m]",
    )
    self_margin: NotNegative = Field(
        0.0, description="[m] that links, and what they hold, keep from each other wherever they must not touch"
    )
    accuracy: Accuracy = Field(
        "exact", description="exact, or conservative: what kernels cannot prove free counts as blocked"
    )
    clearance: NotNegative = Field(0.0, description="[m] that is kept from obstacles on top of their margins")
    proving: NotNegative | None = Field(
        None,
        description="[m] of clearance with which motions must be proven to count as free; in steps if absent",
    )

    def settings(self, robot: Robot, scene: Scene) -> WorldSettings:
        """Of the world of a robot in a scene.

        Raises:
            InputError: If the robot is none that a world can be made of.
        """
        return WorldSettings(robot, scene, **{name: getattr(self, name) for name in WorldKeys.model_fields})


def world_data(settings: WorldSettings) -> dict[str, Any]:
    """What the keys of a file say about settings: those that are not the default, and the motion resolution.

    Raises:
        InputError: If the format has no word for one of them.
    """
    data: dict[str, Any] = {"motion_resolution": settings.motion_resolution}
    for each in fields(settings):
        value = getattr(settings, each.name)
        if each.name in ELSEWHERE or each.default is MISSING or value == each.default:
            continue
        if each.name not in WorldKeys.model_fields:
            raise InputError(f"world: the file has no key for {each.name}={value}; leave it out")
        data[each.name] = value
    return data
