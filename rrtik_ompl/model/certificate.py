"""Certificates of paths: the waypoints, the clearance and the separating planes that prove it; stored as JSON."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, finite_array, finite_number, frozen, not_negative
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.tables import checked_object, json_object
from rrtik_ompl.files.text import known_ending, read_text, write_text

VERSION = 1
KIND = "path_certificate"
IN_PATHS = "certificate"  # key of the certificate in the file of a path
FIELDS = (
    "version",
    "kind",
    "robot",
    "robot_digest",
    "scene_digest",
    "clearance",
    "self_margin",
    "waypoints",
    "motions",
)
DEEPEST = 30  # largest level of an interval that is accepted
# An entry has six integers: body, part, body, part, level, number. The three numbers of a plane's normal may follow.
WHOLE = 6
# An entry of two links whose distance coal measures has four integers: body, body, level, number.
MEASURED = 4


@dataclass(frozen=True, slots=True, eq=False)
class MotionEntries:
    """The entries that show pairs of solids apart in one motion.

    A pair without an entry is shown apart on the whole motion by bounding balls or boxes.

    Attributes:
        solids: Body above the plane, its part, body below, its part, shape (n, 4). Parts -1 and -1 stand for two whole
            links, whose distance coal measures in the middle of the interval.
        intervals: Level and number of the interval from number / 2**level to (number + 1) / 2**level, shape (n, 2).
        normals: Unit normal of the plane in the frame that carries both bodies, shape (n, 3); zeros where balls, or a
            ball and a box, are sufficient.
    """

    solids: NDArray[np.int64]
    intervals: NDArray[np.int64]
    normals: Matrix

    __reduce__ = as_value
    __repr__ = in_one_line


@dataclass(frozen=True, slots=True, eq=False)
class Certificate:
    """A proof that a path is free, in a form that others can verify by their own computation.

    Attributes:
        robot: Name of the robot.
        robot_digest, scene_digest: Digests of the geometry, see :mod:`rrtik_ompl.geometry.collision.digests`.
        clearance: Distance that the path keeps from every obstacle on top of its margin [m].
        self_margin: Distance that links and attached objects keep from each other [m].
        waypoints: The path, shape (k, dof), read-only.
        motions: The entries of each motion; a path of one waypoint has one motion that stands still.
        version: Version of the format.

    Example:
        >>> problem = rrtik.load_problem("planar3_boxes")
        >>> path = rrtik.plan(problem, seed=1).path
        >>> certificate = problem.world.certificate(path)
        >>> problem.world.verify(certificate, path)
        ''
        >>> problem.world.verify(certificate, path.waypoints[::-1])
        'it is for another path: waypoints differ'
    """

    robot: str
    robot_digest: str
    scene_digest: str
    clearance: float
    self_margin: float
    waypoints: Matrix
    motions: tuple[MotionEntries, ...]
    version: int = VERSION

    __reduce__ = as_value
    __repr__ = in_one_line

    @property
    def entries(self) -> int:
        """Number of entries of all motions."""
        return sum(len(motion.solids) for motion in self.motions)

    def document(self) -> dict[str, Any]:
        """Return plain data for JSON. Each entry is a list of six numbers, nine with a plane, or four for coal."""
        motions = []
        for motion in self.motions:
            rows = np.column_stack([motion.solids, motion.intervals]).tolist()
            rows = [row if row[1] >= 0 else [*row[0:3:2], *row[4:]] for row in rows]
            ways = [way if any(way) else [] for way in motion.normals.tolist()]
            motions.append([row + way for row, way in zip(rows, ways, strict=True)])

        return {
            "version": self.version,
            "kind": KIND,
            "robot": self.robot,
            "robot_digest": self.robot_digest,
            "scene_digest": self.scene_digest,
            "clearance": self.clearance,
            "self_margin": self.self_margin,
            "waypoints": self.waypoints.tolist(),
            "motions": motions,
        }

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the certificate to a JSON file, completely or not at all.

        Raises:
            InputError: If the file has another ending or cannot be written.
        """
        known_ending(file, (".json",), "certificate")
        write_text(file, json.dumps(self.document(), separators=(",", ":")) + "\n")

    @staticmethod
    def load(file: str | os.PathLike[str]) -> Certificate:
        """Read a certificate, from a file of its own or from a path saved with its proof.

        Raises:
            InputError: If the file is missing, too large, or no certificate; the message names the file and the field.

        Example:
            >>> rrtik.Certificate.load("absent.json")
            Traceback (most recent call last):
            rrtik_ompl.base.errors.InputError: absent.json: ...
        """
        return read(Certificate, file)


def read_certificate(file: str | os.PathLike[str]) -> Certificate:
    """Read a certificate; see :meth:`Certificate.load`.

    Raises:
        InputError: If the file is missing, too large, or no certificate; the message names the file and the field.
    """
    known_ending(file, (".json",), "certificate")
    text = read_text(file)
    try:
        return from_document(_inside(text))
    except InputError as error:
        raise in_file(file, error) from None


def _inside(text: str) -> dict[str, Any]:
    """Return the JSON object of a certificate from its own file, or from the file of a path that contains one."""
    try:
        return json_object(text, KIND, "motions")
    except InputError as error:
        try:
            found = json_object(text, "joint_path", IN_PATHS)[IN_PATHS]
        except InputError:
            raise error from None
        return checked_object(found, KIND, "motions")


def certificate_beside(path: str | os.PathLike[str]) -> Certificate | None:
    """Read the certificate that a path's file contains in addition to its waypoints; None if it has none.

    Raises:
        InputError: If it is malformed; the message names the file and the field.
    """
    if not str(path).endswith(".json"):
        return None
    try:
        found = json_object(read_text(path), "joint_path", "waypoints").get(IN_PATHS)
        return None if found is None else from_document(checked_object(found, KIND, "motions"))
    except InputError as error:
        raise in_file(path, error) from None


def from_document(document: dict[str, Any]) -> Certificate:
    """Create a certificate from plain data, the inverse of :meth:`Certificate.document`.

    Raises:
        InputError: If a field is missing, unknown or of the wrong type or shape; the message names it.
    """
    for name in (*FIELDS, *document):
        if name not in document or name not in FIELDS:
            raise InputError(f"{name}: " + ("unknown field" if name in document else "missing; every field is needed"))
    if type(document["version"]) is not int or document["version"] != VERSION:
        raise InputError(f"version: expected {VERSION}, got {document['version']!r}")
    for name in ("robot", "robot_digest", "scene_digest"):
        if not isinstance(document[name], str):
            raise InputError(f"{name}: expected text")

    clearance, self_margin = (_distance(document[name], name) for name in ("clearance", "self_margin"))
    waypoints = _waypoints(document["waypoints"])

    motions = document["motions"]
    count = max(1, len(waypoints) - 1)
    if not isinstance(motions, list) or len(motions) != count:
        raise InputError(f"motions: expected a list of {count}, one for each motion between waypoints")

    entries = tuple(_entries(motion, f"motions[{k}]") for k, motion in enumerate(motions))
    names = (document["robot"], document["robot_digest"], document["scene_digest"])
    return Certificate(*names, clearance, self_margin, waypoints, entries)


def _distance(value: object, name: str) -> float:
    if not _is_number(value):
        raise InputError(f"{name}: expected a number")
    return not_negative(finite_number(value, name), name)  # type: ignore[arg-type]


def _waypoints(rows: object) -> Matrix:
    plain = isinstance(rows, list) and all(isinstance(row, list) and all(map(_is_number, row)) for row in rows)
    if not plain or not rows:
        raise InputError("waypoints: expected a list of lists of numbers")
    return frozen(finite_array(rows, (None, None), "waypoints"))  # type: ignore[arg-type]


def _entries(rows: object, where: str) -> MotionEntries:
    if not isinstance(rows, list):
        raise InputError(f"{where}: expected a list of entries")
    for k, row in enumerate(rows):
        if fault := _entry_fault(row):
            raise InputError(f"{where}[{k}]: {fault}")

    whole = np.array([_six(row) for row in rows], dtype=np.int64).reshape(-1, WHOLE)
    normals = np.array([row[WHOLE:] or [0.0] * 3 for row in rows], dtype=np.float64).reshape(-1, 3)
    return MotionEntries(frozen(whole[:, :4], np.int64), frozen(whole[:, 4:], np.int64), frozen(normals))


def _six(row: list[Any]) -> list[int]:
    """Return the six integers of an entry; for an entry of four the parts are -1."""
    return [row[0], -1, row[1], -1, *row[2:]] if len(row) == MEASURED else row[:WHOLE]


def _entry_fault(row: object) -> str:
    """Return a message about a malformed entry; "" if it is well-formed."""
    if not isinstance(row, list) or len(row) not in (MEASURED, WHOLE, WHOLE + 3):
        return "expected a list of 4 or 6 whole numbers, or of 6 and the 3 numbers of a plane"
    if not all(type(number) is int and 0 <= number < 1 << DEEPEST for number in row[:WHOLE]):
        return "body, part, body, part, level and number must be whole numbers"
    level, number = row[:WHOLE][-2:]
    if level > DEEPEST or number >= 1 << level:
        return f"no interval {number} of level {level}"
    if not all(_is_number(each) and math.isfinite(each) for each in row[WHOLE:]) or not any(row[WHOLE:] or [1]):
        return "the normal of a plane must be three finite numbers, not all of them 0"
    return ""


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
