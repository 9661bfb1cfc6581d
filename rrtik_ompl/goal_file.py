"""The ``start:`` and ``goal:`` sections of a problem file <-> configurations and goals."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, Tag

from rrtik_ompl.arrays import Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.file_format import Name, NotNegative, Numbers, Positive, Section, Vector3, tag, told_apart_by
from rrtik_ompl.goal import JOINT_TOLERANCE, Goal, GoalRegion, JointGoal, PoseGoal, PositionGoal
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene_file import PoseEntry, pose_data


class JointsDeg(Section):
    """A configuration in degrees, one number per joint; joints that slide (prismatic) in metres."""

    joints_deg: Numbers = Field(description="revolute and continuous joints [deg], prismatic joints [m]")

    def configuration(self, robot: Robot) -> Vector:
        """Shape (dof,), rad or m."""
        values = robot.configuration(self.joints_deg, "joints_deg")
        return np.where(robot.prismatic, values, np.radians(values))


class Joints(Section):
    """A configuration in radians, one number per joint; joints that slide (prismatic) in metres."""

    joints: Numbers = Field(description="revolute and continuous joints [rad], prismatic joints [m]")

    def configuration(self, robot: Robot) -> Vector:
        """Shape (dof,), rad or m."""
        return robot.configuration(self.joints, "joints")


class Posture(Section):
    """A configuration that the robot has a name for."""

    posture: Name

    def configuration(self, robot: Robot) -> Vector:
        """Shape (dof,), rad or m."""
        return robot.posture(self.posture)


class PoseTarget(Section):
    """A pose of the tip in the world, within tolerances."""

    pose: PoseEntry
    position_tolerance: Positive = Field(1e-3, description="[m]")
    orientation_tolerance: Positive = Field(1e-2, description="angle of the remaining rotation [rad]")

    def build(self) -> PoseGoal:
        """The goal."""
        return PoseGoal(self.pose.build(), self.position_tolerance, self.orientation_tolerance)


class PositionTarget(Section):
    """A point of the world that the tip reaches, orientation free."""

    position: Vector3 = Field(description="[m]")
    tolerance: Positive = Field(1e-3, description="[m]")

    def build(self) -> PositionGoal:
        """The goal."""
        return PositionGoal(self.position, self.tolerance)


class AnyOf(Section):
    """Several poses or positions of which one is enough."""

    any_of: Annotated[
        list[
            Annotated[
                Annotated[PoseTarget, Tag(tag("pose"))] | Annotated[PositionTarget, Tag(tag("position"))],
                told_apart_by("pose", "position", what="a member of any_of"),
            ]
        ],
        Field(min_length=1),
    ]

    def build(self) -> GoalRegion:
        """The goal."""
        return GoalRegion(member.build() for member in self.any_of)


class RegionEntry(PoseTarget):
    """A pose that leaves freedom: a rotation about an axis of its frame, a box of positions in its frame."""

    free_rotation_axis: Literal["x", "y", "z"] | None = None
    box: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] = Field(
        default=[0.0, 0.0, 0.0], description="full side lengths, in the frame of the pose [m]"
    )


class Region(Section):
    """A goal region."""

    region: RegionEntry

    def build(self) -> GoalRegion:
        """The goal."""
        return GoalRegion([self.region.build()], self.region.free_rotation_axis, self.region.box)


StartSection: TypeAlias = Annotated[
    Annotated[JointsDeg, Tag(tag("joints_deg"))]
    | Annotated[Joints, Tag(tag("joints"))]
    | Annotated[Posture, Tag(tag("posture"))],
    told_apart_by("joints_deg", "joints", "posture", what="start"),
]

GoalSection: TypeAlias = Annotated[
    Annotated[JointsDeg, Tag(tag("joints_deg"))]
    | Annotated[Joints, Tag(tag("joints"))]
    | Annotated[Posture, Tag(tag("posture"))]
    | Annotated[PoseTarget, Tag(tag("pose"))]
    | Annotated[PositionTarget, Tag(tag("position"))]
    | Annotated[AnyOf, Tag(tag("any_of"))]
    | Annotated[Region, Tag(tag("region"))],
    told_apart_by("joints_deg", "joints", "posture", "pose", "position", "any_of", "region", what="goal"),
]


def build_goal(section: GoalSection, robot: Robot) -> Goal:
    """The goal that a section asks for.

    Raises:
        InputError: If it does not fit the robot: number of joints, name of a posture, length of a quaternion.
    """
    if isinstance(section, JointsDeg | Joints | Posture):
        return JointGoal(section.configuration(robot))
    return section.build()


def goal_data(goal: Goal) -> dict[str, Any]:
    """What the ``goal:`` section of a file says about a goal.

    Raises:
        InputError: If the format has no words for it.
    """
    if isinstance(goal, JointGoal):
        if goal.tolerance != JOINT_TOLERANCE:
            raise InputError(f"goal: a problem file cannot say the tolerance {goal.tolerance:g} of a joint goal")
        return {"joints": goal.q.tolist()}
    if isinstance(goal, PoseGoal | PositionGoal):
        return _target_data(goal)
    if goal.free_rotation_axis is None and not goal.box.any():
        return {"any_of": [_target_data(member) for member in goal.members]}
    if len(goal.members) > 1 or isinstance(goal.members[0], PositionGoal):
        raise InputError("goal: a problem file can say a region with freedom only about a single pose")
    axis = {} if goal.free_rotation_axis is None else {"free_rotation_axis": goal.free_rotation_axis}
    return {"region": {**_target_data(goal.members[0]), **axis, "box": goal.box.tolist()}}


def _target_data(goal: PoseGoal | PositionGoal) -> dict[str, Any]:
    if isinstance(goal, PositionGoal):
        return {"position": goal.position.tolist(), "tolerance": float(goal.tolerance)}
    return {
        "pose": pose_data(goal.T_world_tip),
        "position_tolerance": float(goal.position_tolerance),
        "orientation_tolerance": float(goal.orientation_tolerance),
    }
