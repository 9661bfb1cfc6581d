"""Conversion between the ``path_constraints:`` section of a problem file and task-space regions along a path."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, Tag

from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.shorthands import inside, on_line, on_plane, orientation_of, upright
from rrtik_ompl.files.pose_entry import PoseEntry
from rrtik_ompl.files.sections import Name, NotNegative, Positive, Section, Vector3, tag, told_apart_by
from rrtik_ompl.files.strict_yaml import YamlDocument
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.problem_files.goal import TaskRegionEntry, goal_data


class Constraint(Section):
    """Keys of all path constraints."""

    frame: Name | None = Field(None, description="link or attached object that is constrained; the tip if absent")


class UprightEntry(Section):
    """An axis of the frame keeps the direction that it has at the start."""

    axis: Literal["x", "y", "z"] = Field("z", description="of the frame")
    tolerance_deg: Positive = Field(5.0, description="largest angle from the direction at the start [deg]")
    allowance_deg: NotNegative = Field(0.0, description="more, of motions between waypoints [deg]")


class Upright(Constraint):
    """A cup that must not spill."""

    upright: UprightEntry

    def build(self, robot: Robot) -> TaskRegion:
        """Return the constraint."""
        entry = self.upright
        return upright(
            robot,
            entry.axis,
            tolerance_deg=entry.tolerance_deg,
            frame=self.frame,
            allowance_deg=entry.allowance_deg,
        )


class OnPlaneEntry(Section):
    """A plane of the world."""

    point: Vector3 = Field(description="[m]")
    normal: Vector3 = Field(description="of length 1")
    tolerance: Positive = Field(1e-3, description="[m]")
    allowance: NotNegative = Field(0.0, description="more, of motions between waypoints [m]")


class OnPlane(Constraint):
    """The frame's origin stays on a plane."""

    on_plane: OnPlaneEntry

    def build(self, robot: Robot) -> TaskRegion:
        """Return the constraint."""
        del robot
        entry = self.on_plane
        amounts = {"tolerance": entry.tolerance, "allowance": entry.allowance}
        return on_plane(entry.point, entry.normal, frame=self.frame, **amounts)


class OnLineEntry(Section):
    """A straight line of the world."""

    point: Vector3 = Field(description="[m]")
    direction: Vector3 = Field(description="of length 1")
    tolerance: Positive = Field(1e-3, description="[m]")
    allowance: NotNegative = Field(0.0, description="more, of motions between waypoints [m]")


class OnLine(Constraint):
    """The frame's origin stays on a line."""

    on_line: OnLineEntry

    def build(self, robot: Robot) -> TaskRegion:
        """Return the constraint."""
        del robot
        entry = self.on_line
        amounts = {"tolerance": entry.tolerance, "allowance": entry.allowance}
        return on_line(entry.point, entry.direction, frame=self.frame, **amounts)


class OrientationEntry(Section):
    """An orientation, and how far the frame may turn away from it."""

    pose: PoseEntry
    tolerance_deg: Positive | None = Field(None, description="largest angle from it [deg]; 1 if nothing is said")
    tolerances_deg: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] | None = Field(
        None, description="in place of it, of roll, pitch and yaw about the axes of the pose [deg]"
    )
    allowance_deg: NotNegative = Field(0.0, description="more, of motions between waypoints [deg]")


class OrientationOf(Constraint):
    """The frame keeps an orientation."""

    orientation_of: OrientationEntry

    def build(self, robot: Robot) -> TaskRegion:
        """Return the constraint."""
        del robot
        entry = self.orientation_of
        if entry.tolerance_deg is not None and entry.tolerances_deg is not None:
            raise InputError("give tolerance_deg or tolerances_deg, not both")
        tolerances = entry.tolerances_deg or entry.tolerance_deg or 1.0
        return orientation_of(entry.pose.build(), tolerances, frame=self.frame, allowance_deg=entry.allowance_deg)


class InsideEntry(Section):
    """A box of the world."""

    pose: PoseEntry = Field(description="of its centre")
    sides: Vector3 = Field(description="full side lengths [m]")
    tolerance: Positive = Field(1e-3, description="[m]")
    allowance: NotNegative = Field(0.0, description="more, of motions between waypoints [m]")


class Inside(Constraint):
    """The frame's origin stays in a box."""

    inside: InsideEntry

    def build(self, robot: Robot) -> TaskRegion:
        """Return the constraint."""
        del robot
        entry = self.inside
        amounts = {"tolerance": entry.tolerance, "allowance": entry.allowance}
        return inside(entry.pose.build(), entry.sides, frame=self.frame, **amounts)


class HeldRegionEntry(TaskRegionEntry):
    """A task-space region, and how far motions may leave it."""

    position_allowance: NotNegative = Field(0.0, description="more, of motions between waypoints [m]")
    orientation_allowance_deg: NotNegative = Field(0.0, description="more, of motions between waypoints [deg]")


class InTaskRegion(Constraint):
    """The frame stays in a task-space region."""

    task_region: HeldRegionEntry

    def build(self, robot: Robot) -> TaskRegion:
        """Return the constraint."""
        del robot
        entry = self.task_region
        return replace(
            entry.build(),
            frame=self.frame,
            position_allowance=entry.position_allowance,
            orientation_allowance=np.radians(entry.orientation_allowance_deg),
        )


KEYS = ("upright", "on_plane", "on_line", "orientation_of", "inside", "task_region")

ConstraintSection: TypeAlias = Annotated[
    Annotated[Upright, Tag(tag("upright"))]
    | Annotated[OnPlane, Tag(tag("on_plane"))]
    | Annotated[OnLine, Tag(tag("on_line"))]
    | Annotated[OrientationOf, Tag(tag("orientation_of"))]
    | Annotated[Inside, Tag(tag("inside"))]
    | Annotated[InTaskRegion, Tag(tag("task_region"))],
    told_apart_by(*KEYS, what="a path constraint"),
]


def build_constraints(
    document: YamlDocument, sections: Iterable[ConstraintSection], robot: Robot
) -> tuple[TaskRegion, ...]:
    """Return the constraints that a file describes.

    Raises:
        InputError: If one of them is invalid; with file, line and key.
    """
    built = []
    for number, section in enumerate(sections):
        with document.at(("path_constraints", number)):
            built.append(section.build(robot))
    return tuple(built)


def constraint_data(region: TaskRegion) -> dict[str, Any]:
    """Return the content of an entry of the ``path_constraints:`` section.

    Raises:
        InputError: If the region is ``from_start`` but not one of :func:`upright`, because the format cannot express
            it.
    """
    data = _upright_data(region) if region.from_start else _region_data(region)
    return data if region.frame is None else {**data, "frame": region.frame}


def _region_data(region: TaskRegion) -> dict[str, Any]:
    data = goal_data(region)
    if region.position_allowance:
        data["task_region"]["position_allowance"] = region.position_allowance
    if region.orientation_allowance:
        data["task_region"]["orientation_allowance_deg"] = float(np.degrees(region.orientation_allowance))
    return data


def _upright_data(region: TaskRegion) -> dict[str, Any]:
    """Returns the entry of an `upright` constraint, after a check that the region is one."""
    seen = region.T_world_w.rotation[:, 2]
    free = region.bounds
    axis = int(np.argmax(seen))
    usual = (
        np.array_equal(free[3:5], np.zeros((2, 2)))
        and (free[[0, 1, 2, 5], 1] - free[[0, 1, 2, 5], 0] > TAU - 1e-9).all()
    )
    if seen[axis] < 1.0 - 1e-9 or not usual:
        raise InputError("path constraint: a file cannot say a region from_start other than upright")

    tolerance = float(np.degrees(region.orientation_tolerance))
    data: dict[str, Any] = {"axis": "xyz"[axis], "tolerance_deg": tolerance}
    if region.orientation_allowance:
        data["allowance_deg"] = float(np.degrees(region.orientation_allowance))
    return {"upright": data}
