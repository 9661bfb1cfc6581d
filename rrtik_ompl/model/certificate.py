"""Certificates of paths: what a path is free of, and the separating planes that prove it; stored as JSON.

The format is described field by field in ``docs/science/certificate.md``, so that others can verify it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, finite_array, finite_number, frozen, not_negative
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.files.kinds import read
from rrtik_ompl.files.tables import checked_object, json_object, json_value
from rrtik_ompl.files.text import known_ending, read_text, write_text

VERSION = 2
KIND = "path_certificate"
TASK_KIND = "task_certificate"
MOST_PARTS = 10_000  # of a task
IN_PATHS = "certificate"  # key of the certificate in the file of a path
TIMED = ("times", "rates")  # fields of timed motions alone
FURTHER = (*TIMED, "tracks", "constraints", "held", "base")  # fields that may be absent
ORDERS = 5  # largest degree of the polynomials of timed motions
FIELDS = (
    *("version", "kind", "robot", "joints", "bodies", "unchecked"),
    *("clearance", "self_margin", "waypoints", "motions"),
)
DEEPEST = 10  # largest level of an interval
LARGEST_NUMBER = (1 << 30) - 1  # of a body, a node or an interval
MOST_CUTS = 100_000  # of a body
MOST_BODIES = 100_000
MOST_CONSTRAINTS = 1000
POSE = 12  # numbers of a pose, the first three rows of its matrix
# An entry has six integers: body, node, body, node, level, number. The three numbers of a plane's normal may follow.
WHOLE = 6
# An entry of two whole bodies whose distance is measured has four integers: body, body, level, number.
MEASURED = 4
LONGEST = 2.0  # largest size of a number of a normal
Made = TypeVar("Made")


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """A motion as a certificate has it: straight between waypoints, or by polynomials in time; numbers are not checked.

    Attributes:
        waypoints: Shape (k, dof) [rad or m].
        times: Times of the waypoints, increasing, shape (k,) [s]; None for a path.
        rates: Derivatives by time at the beginning of each motion, of orders 1, 2, and so on up to 5 at most, shape
            (k - 1, orders, dof); None for a path.
        moving: Whether obstacles move as the scene states, at the times of the waypoints; if not they are at rest.
    """

    waypoints: Matrix
    times: NDArray[np.float64] | None = None
    rates: NDArray[np.float64] | None = None
    moving: bool = False

    __reduce__ = as_value
    __repr__ = in_one_line


@dataclass(frozen=True, slots=True)
class ModelJoint:
    """A joint that moves, as a certificate lists it; number k + 1 stands in place k, number 0 is the world.

    Attributes:
        name: Its name.
        parent: Number of the joint that carries it.
        pose: Pose of its frame at value 0 in its parent's frame: 12 numbers, the first three rows of the matrix.
        axis: Unit vector in its own frame.
        slides: Whether it moves along the axis, not about it.
        gain, offset: Its value is ``gain . q + offset``.
    """

    name: str
    parent: int
    pose: list[float]
    axis: list[float]
    slides: bool
    gain: list[float]
    offset: float


@dataclass(frozen=True, slots=True)
class ModelBody:
    """A body, as a certificate lists it.

    Attributes:
        name: Name of the link, obstacle or attached object.
        number: Which geometry of that object it is, from 0.
        kind: "link", "obstacle" or "attached".
        joint: Number of the joint that carries it, 0 for the world; behind the joints come the tracks of what moves.
        pose: Pose of the shape's frame in the joint's frame, 12 numbers.
        shape: Its kind and measures.
        margin: Distance that is kept from an obstacle [m].
        padding: Thickness that is added around it [m].
        contacts: Objects that it is in contact with, and how near they may come [m].
        cuts: Node, axis and coordinate [m] of each cut that divides it into parts.
    """

    name: str
    number: int
    kind: str
    joint: int
    pose: list[float]
    shape: dict[str, Any]
    margin: float = 0.0
    padding: float = 0.0
    contacts: tuple[tuple[str, float], ...] = ()
    cuts: tuple[tuple[int, int, float], ...] = ()


@dataclass(frozen=True, slots=True)
class ModelConstraint:
    """A path constraint, as a certificate lists it: a region that a frame does not leave.

    Attributes:
        frame: Name of the link or the attached object.
        joint: Number of the joint that carries it, 0 for the world.
        pose: Pose of the frame in the joint's frame, 12 numbers.
        within: Pose of what is bounded in the frame, 12 numbers.
        region: Pose of the region in the world, 12 numbers.
        bounds: Lowest and highest x, y, z [m], roll, pitch and yaw [rad] of what is bounded, as seen from the region.
        tolerances: By how much position and orientation may be outside of these [m; rad].
    """

    frame: str
    joint: int
    pose: list[float]
    within: list[float]
    region: list[float]
    bounds: list[list[float]]
    tolerances: list[float]


@dataclass(frozen=True, slots=True, eq=False)
class MotionEntries:
    """The entries that show parts of bodies apart in one motion.

    A pair without an entry is shown apart on the whole motion by bounding balls or boxes.

    Attributes:
        solids: Body above the plane, its node, body below, its node, shape (n, 4). Nodes -1 and -1 stand for two whole
            bodies, whose distance is measured in the middle of the interval.
        intervals: Level and number of the interval from number / 2**level to (number + 1) / 2**level, shape (n, 2).
        normals: Normal of the plane in the frame that carries both bodies, shape (n, 3); zeros where balls and boxes,
            or the plane of a half-space, are sufficient.
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
        joints, bodies: What the claim is about.
        unchecked: Pairs of numbers of bodies that are not compared, each with the reason.
        clearance: Distance that the path keeps from every obstacle on top of its margin [m].
        self_margin: Distance that links and attached objects keep from each other [m].
        waypoints: The path, shape (k, dof), read-only.
        motions: The entries of each motion; a path of one waypoint has one motion that stands still.
        times: Times of the waypoints of a timed motion [s], shape (k,); None for a path.
        rates: Derivatives at the beginning of its motions, as of :class:`Route`; None for a path.
        tracks: Poses of each obstacle that moves, at the times of the waypoints, shape (tracks, k, 12).
        held: Values of joints that stand still where they are held, such as fingers, by name [rad or m].
        base: Pose of the robot's root link in the world, 12 numbers; None if it is that of its description. Like
            ``held`` it is for readers of the description: joints and bodies have it in their poses.
        constraints: Path constraints that the whole motion keeps.
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
    joints: tuple[ModelJoint, ...]
    bodies: tuple[ModelBody, ...]
    unchecked: tuple[tuple[int, int, str], ...]
    clearance: float
    self_margin: float
    waypoints: Matrix
    motions: tuple[MotionEntries, ...]
    times: NDArray[np.float64] | None = None
    rates: NDArray[np.float64] | None = None
    tracks: NDArray[np.float64] | None = field(default=None, repr=False)
    held: tuple[tuple[str, float], ...] = ()
    base: tuple[float, ...] | None = field(default=None, repr=False)
    constraints: tuple[ModelConstraint, ...] = ()
    version: int = VERSION

    __reduce__ = as_value
    __repr__ = in_one_line

    @property
    def entries(self) -> int:
        """Number of entries of all motions."""
        return sum(len(motion.solids) for motion in self.motions)

    def document(self) -> dict[str, Any]:
        """Return plain data for JSON. Each entry is a list of six numbers, nine with a plane, or four if measured."""
        motions = []
        for motion in self.motions:
            rows = np.column_stack([motion.solids, motion.intervals]).tolist()
            rows = [row if row[1] >= 0 else [*row[0:3:2], *row[4:]] for row in rows]
            ways = [way if any(way) else [] for way in (motion.normals + 0.0).tolist()]
            motions.append([row + way for row, way in zip(rows, ways, strict=True)])

        further: dict[str, Any] = {}
        if self.times is not None and self.rates is not None:
            further = {"times": self.times.tolist(), "rates": self.rates.tolist()}
        if self.tracks is not None:
            further["tracks"] = self.tracks.tolist()
        if self.constraints:
            further["constraints"] = [asdict(each) for each in self.constraints]
        if self.held:
            further["held"] = dict(self.held)
        if self.base is not None:
            further["base"] = list(self.base)
        return {
            "version": self.version,
            "kind": KIND,
            "robot": self.robot,
            "joints": [asdict(joint) for joint in self.joints],
            "bodies": [{k: v for k, v in asdict(body).items() if v != () or k != "cuts"} for body in self.bodies],
            "unchecked": self.unchecked,
            "clearance": self.clearance,
            "self_margin": self.self_margin,
            "waypoints": self.waypoints.tolist(),
            **further,
            "motions": motions,
        }

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the certificate to a JSON file, completely or not at all.

        Raises:
            InputError: If the file has another ending or cannot be written.
        """
        _write(self.document(), file)

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


@dataclass(frozen=True, slots=True, eq=False)
class TaskCertificate:
    """A proof that all motions of a task are free, each with what is held and what is in contact then.

    Attributes:
        parts: The certificates of the motions in their order. A motion during which contacts end has several.

    Example:
        >>> plan = rrtik.Task.load("titan4_drawer").plan(seed=1)
        >>> certificate = plan.certificate()
        >>> plan.verify(certificate)
        ''
    """

    parts: tuple[Certificate, ...]

    __reduce__ = as_value
    __repr__ = in_one_line

    def document(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {"version": VERSION, "kind": TASK_KIND, "parts": [part.document() for part in self.parts]}

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the certificate to a JSON file, completely or not at all.

        Raises:
            InputError: If the file has another ending or cannot be written.
        """
        _write(self.document(), file)

    @staticmethod
    def load(file: str | os.PathLike[str]) -> TaskCertificate:
        """Read a certificate of a task.

        Raises:
            InputError: If the file is missing, too large, or no such certificate; the message names file and field.
        """
        return read(TaskCertificate, file)


def read_task_certificate(file: str | os.PathLike[str]) -> TaskCertificate:
    """Read a certificate of a task; see :meth:`TaskCertificate.load`.

    Raises:
        InputError: If the file is missing, too large, or no such certificate; the message names file and field.
    """
    return _read(file, task_from_document)


def task_from_document(document: object) -> TaskCertificate:
    """Create a certificate of a task from plain data, the inverse of :meth:`TaskCertificate.document`.

    Raises:
        InputError: If a field is missing, unknown or of the wrong type; the message names it.
    """
    if not isinstance(document, dict) or set(document) != {"version", "kind", "parts"}:
        raise InputError("expected an object with version, kind and parts; is this a certificate of a task?")
    if document["kind"] != TASK_KIND or type(document["version"]) is not int or document["version"] != VERSION:
        raise InputError(f"kind: expected {TASK_KIND!r}, version {VERSION}")
    parts = _list(document["parts"], "parts", MOST_PARTS)
    if not parts:
        raise InputError("parts: expected at least one")
    found = []
    for k, part in enumerate(parts):
        try:
            if not isinstance(part, dict):
                raise InputError("expected an object")
            found.append(from_document(part))
        except InputError as error:
            raise InputError(f"parts[{k}]: {error}") from None
    return TaskCertificate(tuple(found))


def read_certificate(file: str | os.PathLike[str]) -> Certificate:
    """Read a certificate; see :meth:`Certificate.load`.

    Raises:
        InputError: If the file is missing, too large, or no certificate; the message names the file and the field.
    """
    return _read(file, lambda document: from_document(_inside(document)))


def _write(document: dict[str, Any], file: str | os.PathLike[str]) -> None:
    """Write plain data as the file of a certificate."""
    known_ending(file, (".json",), "certificate")
    write_text(file, json.dumps(document, separators=(",", ":")) + "\n")


def _read(file: str | os.PathLike[str], parse: Callable[[object], Made]) -> Made:
    """Return what ``parse`` makes of the JSON in the file of a certificate, whose name then is in messages."""
    known_ending(file, (".json",), "certificate")
    text = read_text(file)
    try:
        return parse(json_value(text))
    except InputError as error:
        raise in_file(file, error) from None


def _inside(document: object) -> dict[str, Any]:
    """Return the JSON object of a certificate from that of its own file, or of a path's that contains one."""
    if isinstance(document, dict) and document.get("kind", KIND) != KIND and IN_PATHS in document:
        document = checked_object(document, "joint_path", IN_PATHS)[IN_PATHS]
    if not isinstance(document, dict) or "motions" not in document:
        raise InputError("expected an object with the key 'motions'; is this a certificate?")
    return document


def certificate_beside(path: str | os.PathLike[str]) -> Certificate | None:
    """Read the certificate that a path's file contains in addition to its waypoints; None if it has none.

    Raises:
        InputError: If it is malformed; the message names the file and the field.
    """
    if not str(path).endswith(".json"):
        return None
    try:
        found = json_object(read_text(path), "joint_path", "waypoints").get(IN_PATHS)
        if found is None:
            return None
        if not isinstance(found, dict):
            raise InputError(f"{IN_PATHS}: expected an object")
        return from_document(found)
    except InputError as error:
        raise in_file(path, error) from None


def from_document(document: Mapping[str, Any]) -> Certificate:
    """Create a certificate from plain data, the inverse of :meth:`Certificate.document`.

    Raises:
        InputError: If a field is missing, unknown or of the wrong type or shape; the message names it.
    """
    if document.get("kind", KIND) != KIND:
        raise InputError(f"kind: expected {KIND!r}, got {document['kind']!r}")
    if type(document.get("version")) is not int or document["version"] != VERSION:
        remedy = "; make it again by rrtik plan --certificate" if document.get("version") == 1 else ""
        raise InputError(f"version: expected {VERSION}, got {document.get('version')!r}{remedy}")

    timed = TIMED if any(name in document for name in (*TIMED, "tracks")) else ()
    for name in (*FIELDS, *timed, *document):
        if name not in document or name not in (*FIELDS, *FURTHER):
            raise InputError(f"{name}: " + ("unknown field" if name in document else "missing; every field is needed"))

    robot = _text(document["robot"], "robot")
    clearance, self_margin = (_distance(document[name], name) for name in ("clearance", "self_margin"))
    waypoints = _numbers(document["waypoints"], (None, None), "waypoints")
    if len(waypoints) == 0:
        raise InputError("waypoints: expected a list of lists of numbers")

    count = max(1, len(waypoints) - 1)
    motions = _list(document["motions"], "motions")
    if len(motions) != count:
        raise InputError(f"motions: expected a list of {count}, one for each motion between waypoints")

    times = rates = tracks = None
    if timed:
        times = _numbers(document["times"], (len(waypoints),), "times")
        rates = _numbers(document["rates"], (count, None, waypoints.shape[1]), "rates")
        if len(waypoints) < 2 or not (np.diff(times) > 0.0).all():
            raise InputError("times: expected two or more, each later than the one before it")
        if not 1 <= rates.shape[1] <= ORDERS:
            raise InputError(f"rates: expected derivatives of 1 to {ORDERS} orders for each motion")
    if "tracks" in document:
        tracks = _numbers(document["tracks"], (None, len(waypoints), POSE), "tracks")

    return Certificate(
        robot,
        tuple(_joint(each, f"joints[{k}]") for k, each in enumerate(_list(document["joints"], "joints"))),
        tuple(_body(each, f"bodies[{k}]") for k, each in enumerate(_list(document["bodies"], "bodies", MOST_BODIES))),
        tuple(_unchecked(each, f"unchecked[{k}]") for k, each in enumerate(_list(document["unchecked"], "unchecked"))),
        clearance,
        self_margin,
        waypoints,
        tuple(_entries(motion, f"motions[{k}]") for k, motion in enumerate(motions)),
        times,
        rates,
        tracks,
        _held(document.get("held", {})),
        tuple(_numbers(document["base"], (POSE,), "base").tolist()) if "base" in document else None,
        _constraints(document["constraints"]) if "constraints" in document else (),
    )


def _constraints(given: object) -> tuple[ModelConstraint, ...]:
    found = []
    for k, each in enumerate(_list(given, "constraints", MOST_CONSTRAINTS)):
        where = f"constraints[{k}]"
        made = ModelConstraint(**_checked(each, where, ModelConstraint, _CONSTRAINT))
        if any(low > high for low, high in made.bounds):
            raise InputError(f"{where}.bounds: expected the lowest and the highest value of each")
        if any(value < 0.0 for value in made.tolerances):
            raise InputError(f"{where}.tolerances: expected two numbers that are not negative")
        found.append(made)
    if not found:
        raise InputError("constraints: expected at least one; without any the field is left out")
    return tuple(found)


def _held(given: object) -> tuple[tuple[str, float], ...]:
    if not isinstance(given, dict):
        raise InputError("held: expected names of joints with values")
    return tuple((name, _number(value, f"held: '{name}'")) for name, value in given.items())


def _joint(given: object, where: str) -> ModelJoint:
    return ModelJoint(**_checked(given, where, ModelJoint, _JOINT))


def _body(given: object, where: str) -> ModelBody:
    return ModelBody(**_checked(given, where, ModelBody, _BODY))


def _checked(given: object, where: str, of: type, kinds: Mapping[str, Callable[[Any, str], Any]]) -> dict[str, Any]:
    """Return the checked fields of a joint, a body or a constraint; ``cuts`` may be absent."""
    if not isinstance(given, dict):
        raise InputError(f"{where}: expected an object")
    names = [field.name for field in fields(of)]
    for name in (*names, *given):
        if name not in names or (name not in given and name != "cuts"):
            raise InputError(f"{where}.{name}: " + ("unknown field" if name in given else "missing"))
    return {name: kinds[name](value, f"{where}.{name}") for name, value in given.items()}


def _text(value: object, where: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{where}: expected text")
    return value


def _truth(value: object, where: str) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{where}: expected true or false")
    return value


def _list(value: object, where: str, most: int | None = None) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"{where}: expected a list")
    if most is not None and len(value) > most:
        raise InputError(f"{where}: {len(value)} are too many; {most} at most")
    return value


def _whole(value: object, where: str) -> int:
    if type(value) is not int or not 0 <= value <= LARGEST_NUMBER:
        raise InputError(f"{where}: expected a whole number, not negative")
    return value


def _number(value: object, where: str) -> float:
    if not _is_number(value):
        raise InputError(f"{where}: expected a number")
    return finite_number(value, where)  # type: ignore[arg-type]


def _distance(value: object, where: str) -> float:
    return not_negative(_number(value, where), where)


def _numbers(given: object, shape: tuple[int | None, ...], where: str) -> Matrix:
    """Return an array of finite numbers, from lists of numbers alone: no text, no truth values."""

    def plain(values: object, depth: int) -> bool:
        if depth == 0:
            return _is_number(values)
        return isinstance(values, list) and all(plain(value, depth - 1) for value in values)

    if not plain(given, len(shape)):
        raise InputError(f"{where}: expected a list of {'lists of ' * (len(shape) - 1)}numbers")
    return frozen(finite_array(given, shape, where))  # type: ignore[arg-type]


def _fixed_list(count: int) -> Callable[[object, str], list[float]]:
    return lambda value, where: _numbers(value, (count,), where).tolist()


def _shape(given: object, where: str) -> dict[str, Any]:
    """Return what a certificate says of a shape: numbers and lists of numbers by name."""
    if not isinstance(given, dict) or not given:
        raise InputError(f"{where}: expected an object")
    for name, value in given.items():
        if name == "points":
            _numbers(value, (None, 3), f"{where}.{name}")
        elif not isinstance(value, str):
            _numbers(value if isinstance(value, list) else [value], (None,), f"{where}.{name}")
    return given


def _contacts(given: object, where: str) -> tuple[tuple[str, float], ...]:
    rows = _list(given, where)
    if not all(isinstance(row, list) and len(row) == 2 for row in rows):
        raise InputError(f"{where}: expected a list of a name and a distance each")
    return tuple((_text(name, where), _number(distance, where)) for name, distance in rows)


def _cuts(given: object, where: str) -> tuple[tuple[int, int, float], ...]:
    cuts = []
    for k, row in enumerate(_list(given, where, MOST_CUTS)):
        if not isinstance(row, list) or len(row) != 3 or row[1] not in (0, 1, 2):
            raise InputError(f"{where}[{k}]: expected a node, an axis (0, 1 or 2) and a coordinate")
        cuts.append((_whole(row[0], where), _whole(row[1], where), _number(row[2], where)))
    return tuple(cuts)


def _unchecked(given: object, where: str) -> tuple[int, int, str]:
    if not isinstance(given, list) or len(given) != 3:
        raise InputError(f"{where}: expected two numbers of bodies and a reason")
    return _whole(given[0], where), _whole(given[1], where), _text(given[2], where)


_JOINT: dict[str, Callable[[Any, str], Any]] = {
    "name": _text,
    "parent": _whole,
    "pose": _fixed_list(POSE),
    "axis": _fixed_list(3),
    "slides": _truth,
    "gain": lambda value, where: _numbers(value, (None,), where).tolist(),
    "offset": _number,
}
_BODY: dict[str, Callable[[Any, str], Any]] = {
    "name": _text,
    "number": _whole,
    "kind": _text,
    "joint": _whole,
    "pose": _fixed_list(POSE),
    "shape": _shape,
    "margin": _distance,
    "padding": _distance,
    "contacts": _contacts,
    "cuts": _cuts,
}
_CONSTRAINT: dict[str, Callable[[Any, str], Any]] = {
    "frame": _text,
    "joint": _whole,
    "pose": _fixed_list(POSE),
    "within": _fixed_list(POSE),
    "region": _fixed_list(POSE),
    "bounds": lambda value, where: _numbers(value, (6, 2), where).tolist(),
    "tolerances": _fixed_list(2),
}


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
    """Return the six integers of an entry; for an entry of four the nodes are -1."""
    return [row[0], -1, row[1], -1, *row[2:]] if len(row) == MEASURED else row[:WHOLE]


def _entry_fault(row: object) -> str:
    """Return a message about a malformed entry; "" if it is well-formed."""
    if not isinstance(row, list) or len(row) not in (MEASURED, WHOLE, WHOLE + 3):
        return "expected a list of 4 or 6 whole numbers, or of 6 and the 3 numbers of a plane"
    if not all(type(number) is int and 0 <= number <= LARGEST_NUMBER for number in row[:WHOLE]):
        return "body, node, body, node, level and number must be whole numbers"
    level, number = row[:WHOLE][-2:]
    if level > DEEPEST or number >= 1 << level:
        return f"no interval {number} of level {level}"
    if not all(_is_number(each) and abs(each) <= LONGEST for each in row[WHOLE:]) or not any(row[WHOLE:] or [1]):
        return f"the normal of a plane must be three finite numbers up to {LONGEST:g}, not all of them 0"
    return ""


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
