"""Conversion between the ``start:`` and ``goal:`` sections of a problem file and configurations and goals."""

from __future__ import annotations

from functools import singledispatch
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.files.pose_entry import PoseEntry, pose_data
from rrtik_ompl.files.sections import (
    Name,
    NotNegative,
    Numbers,
    Positive,
    Section,
    Vector2,
    Vector3,
    tag,
    told_apart_by,
)
from rrtik_ompl.model.goal import JOINT_TOLERANCE, Goal, GoalPart, GoalSet, JointGoal, MultiGoal, PoseGoal, PositionGoal
from rrtik_ompl.model.goal_kind import COORDINATES, TaskRegion
from rrtik_ompl.model.robot import Robot


class JointsDeg(Section):
    """A configuration in degrees, one number per joint; joints that slide (prismatic) in metres."""

    joints_deg: Numbers = Field(description="revolute and continuous joints [deg], prismatic joints [m]")

    def configuration(self, robot: Robot) -> Vector:
        """Return the configuration, shape (dof,) [rad or m]."""
        return robot.configuration_deg(self.joints_deg, "joints_deg")


class Joints(Section):
    """A configuration in radians, one number per joint; joints that slide (prismatic) in metres."""

    joints: Numbers = Field(description="revolute and continuous joints [rad], prismatic joints [m]")

    def configuration(self, robot: Robot) -> Vector:
        """Return the configuration, shape (dof,) [rad or m]."""
        return robot.configuration(self.joints, "joints")


class Posture(Section):
    """A configuration that the robot has a name for."""

    posture: Name

    def configuration(self, robot: Robot) -> Vector:
        """Return the configuration, shape (dof,) [rad or m]."""
        return robot.posture(self.posture)


class PoseTarget(Section):
    """A pose of the tip in the world, within tolerances."""

    pose: PoseEntry
    position_tolerance: Positive = Field(1e-3, description="[m]")
    orientation_tolerance: Positive = Field(1e-2, description="angle of the remaining rotation [rad]")

    def build(self) -> PoseGoal:
        """Return the goal."""
        return PoseGoal(self.pose.build(), self.position_tolerance, self.orientation_tolerance)


class PositionTarget(Section):
    """A point of the world that the tip reaches, orientation free."""

    position: Vector3 = Field(description="[m]")
    tolerance: Positive = Field(1e-3, description="[m]")

    def build(self) -> PositionGoal:
        """Return the goal."""
        return PositionGoal(self.position, self.tolerance)


class TaskRegionEntry(Section):
    """Poses of the tip: its place in a frame that may be displaced within ranges from a frame of the world."""

    frame: PoseEntry = Field(description="of the region, in the world")
    tip: PoseEntry | None = Field(None, description="in that frame, not displaced; the frame itself if absent")
    x: Vector2 = Field([0.0, 0.0], description="lowest and highest displacement along x of the frame [m]")
    y: Vector2 = Field([0.0, 0.0], description="[m]")
    z: Vector2 = Field([0.0, 0.0], description="[m]")
    roll: Vector2 | None = Field(None, description="lowest and highest turn about the fixed x axis of the frame [rad]")
    pitch: Vector2 | None = Field(None, description="about its fixed y axis, after roll [rad]")
    yaw: Vector2 | None = Field(None, description="about its fixed z axis, after roll and pitch [rad]")
    roll_deg: Vector2 | None = Field(None, description="[deg]")
    pitch_deg: Vector2 | None = Field(None, description="[deg]")
    yaw_deg: Vector2 | None = Field(None, description="[deg]")
    position_tolerance: Positive = Field(1e-3, description="[m]")
    orientation_tolerance: Positive = Field(1e-2, description="angle of the remaining rotation [rad]")

    @model_validator(mode="after")
    def _one_unit(self) -> TaskRegionEntry:
        for angle in COORDINATES[3:]:
            if getattr(self, angle) is not None and getattr(self, f"{angle}_deg") is not None:
                raise PydanticCustomError("two_units", "give {angle} or {angle}_deg, not both", {"angle": angle})
        return self

    def build(self) -> TaskRegion:
        """Return the goal."""
        bounds = [self.x, self.y, self.z]
        for angle in COORDINATES[3:]:
            degrees = getattr(self, f"{angle}_deg") or [0.0, 0.0]
            bounds.append(getattr(self, angle) or np.radians(degrees).tolist())

        tip = pose() if self.tip is None else self.tip.build()
        return TaskRegion(
            self.frame.build(), np.array(bounds), tip, self.position_tolerance, self.orientation_tolerance
        )


class TaskRegionTarget(Section):
    """A task-space region."""

    task_region: TaskRegionEntry

    def build(self) -> TaskRegion:
        """Return the goal."""
        return self.task_region.build()


class AboutAxisEntry(PoseTarget):
    """A pose that may be turned about a line of the world and moved along it, as a gripper round a bar."""

    axis: Vector3 = Field(description="direction of the line in the world, of length 1")
    through: Vector3 | None = Field(None, description="a point of the line [m]; the tip's if absent")
    turn_deg: Vector2 = Field([-180.0, 180.0], description="lowest and highest angle from the pose [deg]")
    slide: Vector2 = Field([0.0, 0.0], description="lowest and highest displacement along the line [m]")


class AboutAxis(Section):
    """A grasp of a bar; written back as a task_region."""

    about_axis: AboutAxisEntry

    def build(self) -> TaskRegion:
        """Return the goal."""
        entry = self.about_axis
        return TaskRegion.about_axis(
            entry.pose.build(),
            entry.axis,
            through=entry.through,
            turn=np.radians(entry.turn_deg),
            slide=entry.slide,
            position_tolerance=entry.position_tolerance,
            orientation_tolerance=entry.orientation_tolerance,
        )


Member: TypeAlias = Annotated[
    Annotated[PoseTarget, Tag(tag("pose"))]
    | Annotated[PositionTarget, Tag(tag("position"))]
    | Annotated[TaskRegionTarget, Tag(tag("task_region"))]
    | Annotated[AboutAxis, Tag(tag("about_axis"))],
    told_apart_by("pose", "position", "task_region", "about_axis", what="a goal of the tip"),
]


class AnyOf(Section):
    """Several goals of the tip of which one is enough."""

    any_of: Annotated[list[Member], Field(min_length=1)]

    def build(self) -> GoalSet:
        """Return the goal."""
        return GoalSet(member.build() for member in self.any_of)


class Tips(Section):
    """Goals of several tips, all of them at once."""

    tips: dict[Name, Member] = Field(min_length=1, description="a goal for each tip, by the name of its link")

    def build(self) -> MultiGoal:
        """Return the goal."""
        return MultiGoal({frame: goal.build() for frame, goal in self.tips.items()})


class RegionEntry(PoseTarget):
    """A pose that leaves freedom: a rotation about an axis of its frame, a box of positions in its frame."""

    free_rotation_axis: Literal["x", "y", "z"] | None = None
    box: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] = Field(
        default=[0.0, 0.0, 0.0], description="full side lengths, in the frame of the pose [m]"
    )


class Region(Section):
    """A goal region."""

    region: RegionEntry

    def build(self) -> GoalSet:
        """Return the goal."""
        return GoalSet([self.region.build()], self.region.free_rotation_axis, self.region.box)


JOINT_KEYS = ("joints_deg", "joints", "posture")
TIP_KEYS = ("pose", "position", "any_of", "region", "task_region", "about_axis", "tips")

StartSection: TypeAlias = Annotated[
    Annotated[JointsDeg, Tag(tag("joints_deg"))]
    | Annotated[Joints, Tag(tag("joints"))]
    | Annotated[Posture, Tag(tag("posture"))],
    told_apart_by(*JOINT_KEYS, what="start"),
]

GoalSection: TypeAlias = Annotated[
    Annotated[JointsDeg, Tag(tag("joints_deg"))]
    | Annotated[Joints, Tag(tag("joints"))]
    | Annotated[Posture, Tag(tag("posture"))]
    | Annotated[PoseTarget, Tag(tag("pose"))]
    | Annotated[PositionTarget, Tag(tag("position"))]
    | Annotated[AnyOf, Tag(tag("any_of"))]
    | Annotated[Region, Tag(tag("region"))]
    | Annotated[TaskRegionTarget, Tag(tag("task_region"))]
    | Annotated[AboutAxis, Tag(tag("about_axis"))]
    | Annotated[Tips, Tag(tag("tips"))],
    told_apart_by(*JOINT_KEYS, *TIP_KEYS, what="goal"),
]


def build_goal(section: GoalSection, robot: Robot) -> Goal:
    """Return the goal that a section describes.

    Raises:
        InputError: If it does not fit the robot: number of joints, name of a posture, length of a quaternion.
    """
    if isinstance(section, JointsDeg | Joints | Posture):
        return JointGoal(section.configuration(robot))
    return section.build()


@singledispatch
def goal_data(goal: Goal) -> dict[str, Any]:
    """Return the content of the ``goal:`` section for a goal; each kind of goal is registered below.

    Raises:
        InputError: If the format cannot express the goal.
    """
    raise InputError(f"goal: a problem file has no words for a {type(goal).__name__}")


@goal_data.register
def _joints(goal: JointGoal) -> dict[str, Any]:
    if goal.tolerance != JOINT_TOLERANCE:
        raise InputError(f"goal: a problem file cannot say the tolerance {goal.tolerance:g} of a joint goal")
    return {"joints": goal.q.tolist()}


@goal_data.register
def _position(goal: PositionGoal) -> dict[str, Any]:
    return {"position": goal.position.tolist(), "tolerance": float(goal.tolerance)}


@goal_data.register
def _pose(goal: PoseGoal) -> dict[str, Any]:
    return {"pose": pose_data(goal.T_world_tip), **_tolerances(goal)}


@goal_data.register
def _task_region(goal: TaskRegion) -> dict[str, Any]:
    places = {"frame": pose_data(goal.T_world_w), "tip": pose_data(goal.T_w_tip)}
    ranges = {
        name: bounds.tolist()
        for name, bounds, free in zip(COORDINATES, goal.bounds, goal.free, strict=True)
        if free or bounds.any()
    }
    return {"task_region": {**places, **ranges, **_tolerances(goal)}}


@goal_data.register
def _any_of(goal: GoalSet) -> dict[str, Any]:
    """Return a single pose with free directions as a region; several goals as a list, each with its freedom."""
    if len(goal.members) > 1 or goal.parts[0] is goal.members[0]:
        return {"any_of": [goal_data(part) for part in goal.parts]}
    axis = {} if goal.free_rotation_axis is None else {"free_rotation_axis": goal.free_rotation_axis}
    return {"region": {**goal_data(goal.members[0]), **axis, "box": goal.box.tolist()}}


@goal_data.register
def _tips(goal: MultiGoal) -> dict[str, Any]:
    return {"tips": {frame: goal_data(part) for frame, part in zip(goal.frames, goal.parts, strict=True)}}


def _tolerances(goal: GoalPart) -> dict[str, float]:
    near, turned = goal.tolerances
    return {"position_tolerance": float(near), "orientation_tolerance": float(turned)}
