"""Read ``.scene`` files, the text in which MoveIt and RViz save the objects of a planning scene."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.base.poses import pose_from_xyzw
from rrtik_ompl.files.text import read_text
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Cylinder, HalfSpace, Mesh, Shape, Sphere

ENDING = ".scene"
MOST = 1_000_000  # most shapes or subframes of an object
SIZES: dict[str, tuple[int, Callable[..., Shape]]] = {  # how many numbers a shape has, and what makes it of them
    "box": (3, lambda *sides: Box(sides)),
    "sphere": (1, Sphere),
    "cylinder": (2, Cylinder),
    "plane": (4, lambda a, b, c, d: HalfSpace([a, b, c], -d)),  # a x + b y + c z + d = 0
}


def read_scene_text(file: str | os.PathLike[str]) -> Scene:
    """Read the obstacles of a ``.scene`` file of MoveIt.

    Each shape of an object becomes an obstacle: "rack", "rack_2". Files of both formats are read, with poses of objects
    (MoveIt 1.1 and later) and without. What lies behind a plane is filled. Colours and subframes are left out.

    Raises:
        InputError: If the file cannot be read, or is not such a file; with its line.
    """
    cursor = _Cursor(os.fspath(file), read_text(file).splitlines())
    cursor.line()  # the name of the scene
    obstacles: list[Obstacle] = []
    while (marker := cursor.line()) != ".":
        if not marker.startswith("*"):
            raise cursor.error(f"expected '* NAME' of an object, or '.' at the end, found '{marker[:40]}'")
        name = marker[1:].strip()
        solids = _object(cursor)
        for number, (shape, place) in enumerate(solids, start=1):
            part = name if number == 1 else f"{name}_{number}"
            with cursor.at_line():
                obstacles.append(Obstacle(part, shape, place))
    try:
        return Scene(obstacles)
    except InputError as error:
        raise in_file(file, error) from None


@dataclass(slots=True)
class _Cursor:
    """Goes through the lines of a file; ``number`` is that of the line that was read last."""

    file: str
    lines: list[str]
    number: int = 0

    def line(self) -> str:
        """Return the next line that is not blank."""
        while self.number < len(self.lines):
            self.number += 1
            if text := self.lines[self.number - 1].strip():
                return text
        raise self.error("the file ends without the line '.'; is it cut off?")

    def numbers(self, count: int) -> list[float]:
        """Return the numbers of the next line."""
        text = self.line()
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or not np.isfinite(values).all():
            raise self.error(f"expected {count} finite numbers, found '{text[:40]}'")
        return values

    def count(self) -> int:
        """Return the whole number that is the next line."""
        (value,) = self.numbers(1)
        if not 0 <= value <= MOST or value != int(value):
            raise self.error(f"expected a whole number from 0 to {MOST}, found {value:g}")
        return int(value)

    def pose(self) -> pin.SE3:
        """Return the pose of the next two lines: a position, a quaternion x y z w."""
        position = self.numbers(3)
        turn = self.numbers(4)
        with self.at_line():
            return pose_from_xyzw(position, turn)

    @contextmanager
    def at_line(self) -> Iterator[None]:
        """Put the file and the line that was read last in front of the message of an error."""
        try:
            yield
        except InputError as error:
            raise in_file(f"{self.file}:{self.number}", error) from None

    def error(self, message: str) -> InputError:
        return InputError(f"{self.file}:{self.number}: {message}; is it a scene that MoveIt has saved?")


def _object(cursor: _Cursor) -> list[tuple[Shape, pin.SE3]]:
    """Read an object: its shapes, and their poses in the world."""
    # In the older format the count of shapes stands here, in the newer one the pose of the object.
    begin = cursor.number
    has_pose = len(cursor.line().split()) > 1
    cursor.number = begin
    T_world_object = cursor.pose() if has_pose else pin.SE3.Identity()

    solids = []
    for _ in range(cursor.count()):
        shape = _shape(cursor)
        solids.append((shape, T_world_object * cursor.pose()))
        cursor.numbers(4)  # the colour

    for _ in range(cursor.count() if has_pose else 0):
        cursor.line()  # the name of a subframe
        cursor.pose()
    return solids


def _shape(cursor: _Cursor) -> Shape:
    kind = cursor.line()
    if kind == "mesh":
        vertices, triangles = (int(each) for each in cursor.numbers(2))
        points = [cursor.numbers(3) for _ in range(vertices)]
        corners = [cursor.numbers(3) for _ in range(triangles)]
        with cursor.at_line():
            return Mesh(points, corners)

    if kind not in SIZES:
        raise cursor.error(f"shape '{kind[:40]}' is not read; have {', '.join(SIZES)}, mesh")
    count, shape = SIZES[kind]
    sizes = cursor.numbers(count)
    with cursor.at_line():
        return shape(*sizes)
