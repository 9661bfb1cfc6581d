"""Replay a recorded session; the scene is drawn by a simulated camera unless its pictures were recorded, too."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Vector, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.pilot.devices.simulation import SimulatedCamera
from rrtik_ompl.pilot.record import RecordedPictures, read_record
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.surroundings import Structure
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.scene_from_view import SIGMAS, SeenObject

Entry = dict[str, Any]


class RecordedArm:
    """An arm at the configuration of the record; commands do not move it."""

    def __init__(self, robot: Robot, start: Vector) -> None:
        """Begin at a configuration, shape (dof,)."""
        self.robot = robot
        self.lost = ""
        self.q = robot.configuration(start, "start")

    def read(self) -> Vector:
        """Return the joint values, shape (dof,) [rad or m]."""
        return self.q.copy()

    def move(self, joint: int, target: float) -> None:
        """Do nothing: the record contains the result."""

    def follow(self, q: ArrayLike) -> None:
        """Do nothing: the record contains the result."""

    def stop(self) -> None:
        """Do nothing: the record contains the result."""

    def grip(self, closed: bool) -> None:
        """Do nothing: the record contains the result."""


class RecordedPerception:
    """Pass the entries of a record to a session when their time has come."""

    def __init__(
        self,
        entries: list[Entry],
        arm: RecordedArm,
        world: SimulatedCamera,
        structure: Structure | None = None,
        pictures: RecordedPictures | None = None,
    ) -> None:
        """Start at the beginning of a record.

        Args:
            entries: Entries of the record; see `entries_for`.
            arm: The arm of the session.
            world: Draws the pictures; the places of its objects follow the record.
            structure: The object to which the obstacles are fixed; None if they move with the base.
            pictures: The recorded pictures; None if there are none, and the scene is drawn.
        """
        self._structure = structure
        self._entries = entries
        self._arm = arm
        self._world = world
        self._next = 0
        self.camera = world.camera
        self.T_base_camera = world.T_base_camera
        self.arm_in_picture = True
        self.picture: NDArray[np.uint8] = np.zeros((self.camera.height, self.camera.width, 3), dtype=np.uint8)
        self.lost = self.hint = ""
        self._pictures = pictures

    def update(self, session: Session, time: float) -> None:
        """Apply the entries up to a time of the record [s]."""
        while self._next < len(self._entries) and self._entries[self._next]["time"] <= time:
            self._apply(self._entries[self._next], session)
            self._next += 1
        session.see((), time)
        if self._pictures is None:
            self.picture = self._world.picture(self._arm.q, time).pixels
        self.lost = "the record ends here" if self._next == len(self._entries) else ""

    def close(self) -> None:
        """Close the file of the pictures."""
        if self._pictures is not None:
            self._pictures.close()

    def _place(self, seen: list[SeenObject]) -> None:
        """Move objects to where they were seen, and the obstacles with the structure to which they are fixed."""
        fixed = next((each for each in seen if self._structure and each.object.name == self._structure.name), None)
        if fixed is not None and self._structure is not None:
            self._world.T_start_base = self._structure.T_base_object * fixed.T_base_object.inverse()
        self._world.places = {each.object.name: self._world.T_start_base * each.T_base_object for each in seen}

    def _apply(self, entry: Entry, session: Session) -> None:
        """Apply one entry to the arm, the session or the picture, by its kind."""
        time = entry["time"]
        if entry["kind"] == "joints":
            self._arm.q = self._arm.robot.configuration(entry["q"], "q")
            session.tick(time)
        elif entry["kind"] == "command":
            session.tick(time)  # the live session also ticked before every command
            session.command(entry["name"], time, **entry["arguments"])
        elif entry["kind"] == "seen":
            seen = [_seen(self._world.marker_map, each) for each in entry["objects"]]
            self._place(seen)
            session.see(seen, time)
        elif entry["kind"] == "picture" and self._pictures is not None:
            found = self._pictures.at(entry["at"], entry["size"], self.picture)
            self.picture = self.picture if found is None else found


def entries_for(path: str | os.PathLike[str], problem: str, robot: Robot, marker_map: MarkerMap) -> list[Entry]:
    """Return the entries of a record after checking them.

    Raises:
        InputError: If the file cannot be read, belongs to another problem, or an entry does not fit.
    """
    entries = list(read_record(path))
    begin = _begin(entries)
    if begin.get("problem", problem) != problem:
        raise InputError(f"{path}: is a record of the problem '{begin['problem']}', not of '{problem}'")

    for count, entry in enumerate(entries, start=1):
        try:
            _check(entry, robot, marker_map)
        except (KeyError, TypeError, ValueError, InputError) as error:
            why = f"lacks {error}" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{path}:{count}: a line '{str(entry['kind'])[:20]}' that does not fit: {why}") from None

    if not begin:
        raise InputError(f"{path}: holds no line 'begin'; give a record of rrtik pilot")
    return entries if begin.get("record") else list(_with_resets(entries))


def start_of(entries: list[Entry], usual: Vector) -> tuple[Vector, int]:
    """Return the configuration of the arm when a record began, shape (dof,), and the seed of its random numbers.

    Args:
        entries: Entries of the record.
        usual: The configuration if the record does not contain one, shape (dof,).
    """
    begin = _begin(entries)
    return np.asarray(begin.get("q", usual)), int(begin.get("seed", 0))


def _with_resets(entries: list[Entry]) -> Iterator[Entry]:
    """Yield the entries of a record of the first version, in which a stop did not have to be reset."""
    for entry in entries:
        yield entry
        if entry["kind"] == "command" and entry["name"] == "stop":
            yield entry | {"name": "reset", "arguments": {}}


def _begin(entries: list[Entry]) -> Entry:
    """Return the first entry of kind "begin"; an empty one if there is none."""
    return next((entry for entry in entries if entry["kind"] == "begin"), {})


def _check(entry: Entry, robot: Robot, marker_map: MarkerMap) -> None:
    """Check that an entry has the values of its kind; raises KeyError, TypeError, ValueError or InputError if not."""
    float(entry["time"])
    if entry["kind"] in ("begin", "joints"):
        robot.configuration(entry["q"], "q")
    elif entry["kind"] == "command":
        dict(**entry["arguments"])
        if not isinstance(entry["name"], str):
            raise TypeError("the name of a command is a word")
    elif entry["kind"] == "picture":
        if not all(type(entry[key]) is int and entry[key] >= 0 for key in ("at", "size")):
            raise ValueError("'at' and 'size' must be whole numbers")
    elif entry["kind"] == "seen":
        for each in entry["objects"]:
            _seen(marker_map, each)


def _seen(marker_map: MarkerMap, entry: Entry) -> SeenObject:
    thing = marker_map.named(entry["name"])
    xyz = finite_array(entry["xyz"], (3,), "xyz")
    turn = finite_array(entry["rotation"], (3, 3), "rotation")
    spread = finite_array(entry.get("covariance", np.zeros((6, 6))), (6, 6), "covariance")
    return SeenObject(thing, pin.SE3(turn, xyz), spread, None, entry.get("sigmas", SIGMAS))
