"""Frames that MoveIt's messages name, resolved at the start of a path: the world, links, objects, fixed frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import pinocchio as pin

from rrtik_ompl.arrays import Vector
from rrtik_ompl.errors import UnknownNameError
from rrtik_ompl.problem_files.moveit_messages import FixedFrame
from rrtik_ompl.robot import Robot

WORLD = "world"


class Frames:
    """Poses of named frames in the world.

    Links and what they hold are where the start of the path has them. An empty name is the world.

    Args:
        robot: The arm.
        start: Its first configuration, shape (dof,).
        fixed: Frames of the scene that stand still in others.
    """

    def __init__(self, robot: Robot, start: Vector, fixed: Iterable[FixedFrame]) -> None:
        self._robot, self._start = robot, start
        self._known: dict[str, pin.SE3] = {"": pin.SE3.Identity(), WORLD: pin.SE3.Identity()}
        self._moving: set[str] = set()
        for each in fixed:
            parent = _bare(each.header.frame_id)
            if not self._has(parent):  # the frame in which all others are given is the world by another name
                self._known[parent] = pin.SE3.Identity()
            self.add(_bare(each.child_frame_id), self.pose(parent) * each.transform.build(), moves=self.moves(parent))
        if not self._has(robot.name):  # some files give coordinates in a frame of the robot's name
            self._known[robot.name] = pin.SE3.Identity()

    def pose(self, name: str) -> pin.SE3:
        """``T_world_frame`` of a frame.

        Raises:
            UnknownNameError: If there is no such frame.
        """
        name = _bare(name)
        if name in self._known:
            return self._known[name].copy()
        if not self._robot.model.existFrame(name):
            raise UnknownNameError("frame", name, filter(None, (*self._known, *self._robot.link_names)))
        return self._robot.fk(self._start, name)

    def moves(self, name: str) -> bool:
        """Whether a frame moves with the arm."""
        name = _bare(name)
        if name in self._known:
            return name in self._moving
        model = self._robot.model
        return bool(model.existFrame(name) and model.frames[model.getFrameId(name)].parentJoint > 0)

    def add(self, name: str, pose: pin.SE3, parts: Mapping[str, pin.SE3] | None = None, *, moves: bool = False) -> None:
        """Know a frame from now on, and frames in it, by their poses in it (``name/part``)."""
        placed = {name: pose} | {f"{name}/{part}": pose * inner for part, inner in (parts or {}).items()}
        self._known |= placed
        self._moving = (self._moving - set(placed)) | (set(placed) if moves else set())

    def forget(self, name: str) -> None:
        """Know a frame and those in it no longer."""
        for each in [each for each in self._known if each == name or each.startswith(f"{name}/")]:
            del self._known[each]

    def _has(self, name: str) -> bool:
        return name in self._known or self._robot.model.existFrame(name)


def _bare(name: str) -> str:
    return name.removeprefix("/")
