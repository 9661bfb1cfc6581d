"""Frames that MoveIt's messages name: the world, links, objects, fixed frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import pinocchio as pin

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.problem_files.moveit_messages import FixedFrame

WORLD = "world"


class _Carried(NamedTuple):
    """A frame: the link that carries it, "" for none, and T_link_frame."""

    link: str
    pose: pin.SE3


_STANDING = _Carried("", pin.SE3.Identity())


class Frames:
    """Poses of named frames in the world, while the arm stands somewhere.

    A frame is carried by a link, or stands still. An empty name is the world.

    Args:
        robot: The arm.
        q: Its configuration, shape (dof,).
        fixed: Frames of the scene that stand still in others, in any order.

    Raises:
        InputError: If fixed frames stand in each other.
    """

    def __init__(self, robot: Robot, q: Vector, fixed: Iterable[FixedFrame]) -> None:
        self._robot = robot
        self._q = q
        self._known: dict[str, _Carried] = {"": _STANDING, WORLD: _STANDING}

        for each in self._parents_first(fixed):
            parent = _bare(each.header.frame_id)
            if not self._has(parent):  # the frame in which all others are given is the world by another name
                self._known[parent] = _STANDING
            self.add(_bare(each.child_frame_id), self.pose(parent) * each.transform.build(), link=self.link(parent))

        if not self._has(robot.name):  # some files give coordinates in a frame of the robot's name
            self._known[robot.name] = _STANDING

    def moved_to(self, q: Vector) -> Frames:
        """The same frames while the arm stands at another configuration, shape (dof,)."""
        moved = Frames(self._robot, q, ())
        moved._known = dict(self._known)
        return moved

    def pose(self, name: str) -> pin.SE3:
        """``T_world_frame`` of a frame.

        Raises:
            UnknownNameError: If there is no such frame.
        """
        name = _bare(name)
        if name in self._known:
            known = self._known[name]
            return self._link_pose(known.link) * known.pose

        if not self._robot.model.existFrame(name):
            raise UnknownNameError("frame", name, filter(None, (*self._known, *self._robot.link_names)))
        return self._link_pose(name)

    def link(self, name: str) -> str:
        """The link that carries a frame; "" for one that stands still."""
        name = _bare(name)
        return self._known[name].link if name in self._known else name

    def moves(self, name: str) -> bool:
        """Whether a frame moves with the arm."""
        link = self.link(name)
        model = self._robot.model
        return bool(link and model.existFrame(link) and model.frames[model.getFrameId(link)].parentJoint > 0)

    def add(self, name: str, pose: pin.SE3, parts: Mapping[str, pin.SE3] | None = None, *, link: str = "") -> None:
        """Know a frame from now on, and frames in it, by their poses in it (``name/part``).

        Args:
            name: Of the frame.
            pose: T_world_frame.
            parts: T_frame_part, by name.
            link: That carries it; "" if it stands still.
        """
        T_link_frame = self._link_pose(link).actInv(pose)
        placed = {name: T_link_frame} | {
            f"{name}/{part}": T_link_frame * inner for part, inner in (parts or {}).items()
        }
        self._known |= {each: _Carried(link, place) for each, place in placed.items()}

    def forget(self, name: str) -> None:
        """Know a frame and those in it no longer."""
        for each in [each for each in self._known if each == name or each.startswith(f"{name}/")]:
            del self._known[each]

    def _has(self, name: str) -> bool:
        return name in self._known or self._robot.model.existFrame(name)

    def _link_pose(self, link: str) -> pin.SE3:
        return self._robot.fk(self._q, link) if link else pin.SE3.Identity()

    def _parents_first(self, fixed: Iterable[FixedFrame]) -> Iterator[FixedFrame]:
        """Fixed frames, each after the one in which it stands."""
        left = list(fixed)
        while left:
            children = {_bare(each.child_frame_id) for each in left}
            ready = [each for each in left if _bare(each.header.frame_id) not in children]
            if not ready:
                raise InputError(
                    f"fixed frames stand in each other: {', '.join(sorted(children))}; place one in the world"
                )
            yield from ready
            left = [each for each in left if each not in ready]


def _bare(name: str) -> str:
    return name.removeprefix("/")
