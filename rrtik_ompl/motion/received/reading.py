"""Read the motions in files of other programs: messages of ROS and MoveIt, arrays, tables, bags, and our own files.

A file gives columns of numbers, which :func:`fitted` makes a motion of a robot: columns by the names of joints,
radians, times from 0. What cannot be meant is refused in one line.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, positive
from rrtik_ompl.base.errors import InputError, PathWarning, few, in_file, require
from rrtik_ompl.base.units import DEGREE
from rrtik_ompl.files.named_arrays import NamedArrays
from rrtik_ompl.files.tables import json_value, table_rows
from rrtik_ompl.files.text import file_name, known_ending, read_bytes, read_text
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.robot import LIMIT_TOLERANCE, Robot, inside_limits, joint_order, unnamed_joints
from rrtik_ompl.motion.received.points import ReceivedMotion
from rrtik_ompl.motion.trajectory import Trajectory
from rrtik_ompl.motion.trajectory.messages import seconds, yaml_documents
from rrtik_ompl.motion.trajectory.text import GRIPPER, is_own_mcap

BAGS = (".bag", ".db3", ".mcap")
PARQUET = ".parquet"
ENDINGS = (".json", ".yaml", ".yml", ".csv", ".txt", ".npz", ".npy", PARQUET, *BAGS)
LARGEST_FILE = 512 * 1024 * 1024  # [bytes]
DEEPEST = 20  # largest depth of lists and groups in which motions are sought
FAR_OUTSIDE = 0.5  # [rad] outside the limits, where a value is probably one of degrees

# Names of arrays in the files and results of other programs, the first that is there is taken.
POSITIONS = ("positions", "position", "waypoints", "q", "qpos", "joint_positions", "trajectory", "path")
STREAMS = ("action", "observation.state", "state")  # of LeRobot: each is a motion of its own
VELOCITIES = ("velocities", "velocity", "qvel", "joint_velocities")
ACCELERATIONS = ("accelerations", "acceleration", "qacc", "joint_accelerations")
TIMES = ("times", "time", "timestamps", "timestamp", "time_from_start", "t")
NAMES = ("joint_names", "names", "joints")
STEPS = ("dt", "interpolation_dt")
MARKS = {"positions": (".pos", " position", "/position"), "velocities": (".vel", " velocity", "/velocity")}
MARKS |= {"accelerations": (".acc", " acceleration", "/acceleration")}
BEFORE = ("action.", "observation.state.")


@dataclass(frozen=True, eq=False)
class Columns:
    """What a file holds of a motion, before it is known to fit a robot.

    Attributes:
        label: Which of the motions of the file it is; "" if there is one.
        positions: Rows of numbers.
        names: Names of the joints of the columns; None if the file does not say.
        times: Times [s]; None if there are none.
        velocities, accelerations: Rows; NaN at a point without any; None if no point has any.
        step: Time between two points [s], where there are no times; None if that is not known either.
    """

    label: str
    positions: object
    names: tuple[str, ...] | None = None
    times: object = None
    velocities: object = None
    accelerations: object = None
    step: object = None


def load_motions(
    file: str | os.PathLike[str], robot: Robot, *, degrees: bool = False, rate: float | None = None
) -> tuple[JointPath | Trajectory | ReceivedMotion, ...]:
    """Read the motions of a robot from a file of any program.

    Read are messages of ROS and MoveIt as JSON or YAML, also lists of them and messages that contain them
    (``JointTrajectory``, ``RobotTrajectory``, ``DisplayTrajectory``, a planner's response); bags of ROS 1 and 2 (with
    the package rosbags: these messages, or else the stream of ``JointState``); ``.csv`` with names of joints in its
    first line, and perhaps times, velocities and accelerations (``<joint> velocity``); ``.npz`` and ``.npy`` with
    arrays such as MPlib (``position``, ``velocity``, ``time``), cuRobo (``position``, ``dt``), roboplan (``positions``,
    ``times``, ``joint_names``) and LeRobot (``action``, ``observation.state``) have them; ``.parquet``, a table of a
    dataset of LeRobot (with the package pyarrow), whose episodes and streams are a motion each; and the paths and
    trajectories of this library. Nothing in a file is executed.

    Columns are found by the names of joints. Joints that the robot does not move may be in the file if they stay where
    the robot holds them. Without names the columns are the robot's joints in order.

    Args:
        file: The file; a folder of a ROS 2 bag.
        robot: The robot that moves.
        degrees: Whether angles are in degrees.
        rate: How many points there are in a second [1/s], for a file without times.

    Returns:
        Its motions in order, each for :func:`prove`: a :class:`JointPath` and a :class:`Trajectory` of our own files, a
        :class:`ReceivedMotion` of others.

    Raises:
        InputError: If the file cannot be read, or does not fit the robot; one line that names file and remedy.

    Example:
        >>> np.savez("motion.npz", position=np.zeros((2, 3)), time=[0.0, 0.1])
        >>> rrtik.load_motions("motion.npz", rrtik.load_robot("planar3"))
        (ReceivedMotion('motion.npz', 2 points, 0.1 s),)
    """
    require(robot, Robot, "robot of a motion", "use load_robot(name)")
    require(degrees, bool, "degrees")
    step = None if rate is None else 1.0 / positive(rate, "rate")
    path = file_name(file)
    own = _own(path, robot)
    if own is not None and degrees:
        raise InputError(f"{path}: a file of rrtik is in radians; leave degrees=True (--degrees) out")
    if own is not None:
        return own

    try:
        found = list(_columns_of(path, robot))
        if not found:
            raise InputError("holds no motion: no joint_names with points, and no array of positions")
        return tuple(_fitted(each, robot, path, step, degrees=degrees) for each in found)
    except InputError as error:
        raise in_file(file, error) from None


def _own(path: Path, robot: Robot) -> tuple[JointPath | Trajectory] | None:
    """Return the motion in a file of this library; None if it is another program's."""
    ending = path.suffix.lower()
    if ending == ".mcap" and path.is_file() and is_own_mcap(path):
        return (Trajectory.load(path, robot),)
    if path.is_dir() or ending in (".yaml", ".yml", ".npz", ".npy", PARQUET, *BAGS):
        return None
    known_ending(path, ENDINGS, "motion")
    if ending == ".json":
        document = _json(path)
        kind = document.get("kind") if isinstance(document, dict) else None
    elif ending == ".csv":
        first = read_text(path, LARGEST_FILE).partition("\n")[0]
        of_arm = [name for name in first.rstrip().split(",") if not name.startswith(GRIPPER)]
        timed = first.startswith("time,") and of_arm[-1].endswith(" acceleration")
        kind = "joint_trajectory" if timed else None
    else:
        kind = "joint_path"
    if kind == "joint_path":
        return (JointPath.load(path, robot),)
    return (Trajectory.load(path, robot),) if kind == "joint_trajectory" else None


def _columns_of(path: Path, robot: Robot) -> Iterator[Columns]:
    """Yield what a file holds of each motion."""
    ending = path.suffix.lower()
    if path.is_dir() or ending in BAGS:
        from rrtik_ompl.motion.received.bags import messages_of_bag

        for topic, message in messages_of_bag(path):
            yield from _messages(message, topic)
    elif ending == PARQUET:
        from rrtik_ompl.motion.received.parquet import streams_of_parquet

        for label, arrays in streams_of_parquet(path, tuple(robot.movable)):
            yield from _of_arrays(arrays, label)
    elif ending == ".json":
        yield from _motions(_json(path), "")
    elif ending in (".yaml", ".yml"):
        documents = yaml_documents(read_text(path, LARGEST_FILE))
        for number, document in enumerate(documents, start=1):
            yield from _motions(document, f"document {number}" if len(documents) > 1 else "")
    elif ending == ".csv":
        yield _of_table(read_text(path, LARGEST_FILE))
    elif ending == ".npy":
        yield Columns("", _array(path))
    else:
        named = NamedArrays(path)
        yield from _of_arrays({name: named[name] for name in named.names}, "")


def _json(path: Path) -> object:
    try:
        return json_value(read_text(path, LARGEST_FILE))
    except InputError as error:
        raise in_file(path, error) from None


def _array(path: Path) -> NDArray[Any]:
    """Read a ``.npy`` file; pickled objects are never read."""
    from io import BytesIO

    try:
        return np.asarray(np.load(BytesIO(read_bytes(path, LARGEST_FILE)), allow_pickle=False))
    except (ValueError, EOFError, OSError, MemoryError, OverflowError):
        raise InputError("not a whole .npy file of numbers; save it again") from None


# --- messages and arrays ----------------------------------------------------------------------------------------------


def _motions(document: object, label: str) -> Iterator[Columns]:
    """Yield the motions of a document: its messages, or else its arrays."""
    messages = list(_messages(document, label))
    if messages:
        yield from messages
    elif isinstance(document, list) and document and all(isinstance(row, list) for row in document):
        yield Columns(label, document)
    elif isinstance(document, Mapping):
        yield from _of_arrays(document, label)


def _messages(document: object, label: str, depth: int = 0) -> Iterator[Columns]:
    """Yield the messages JointTrajectory in a document, however deep they are."""
    if depth > DEEPEST:
        raise InputError("its lists and groups are nested too deeply")
    if isinstance(document, list):
        numbered = [each for each in document if isinstance(each, Mapping | list)]
        for number, each in enumerate(numbered, start=1):
            yield from _messages(each, f"{label} {number}".strip() if len(numbered) > 1 else label, depth + 1)
    if not isinstance(document, Mapping):
        return
    if "joint_names" in document and "points" in document:
        if document["points"] != []:  # as of a group that does not move
            yield _of_message(document, label)
        return

    several = document.get("multi_dof_joint_trajectory")
    if isinstance(several, Mapping) and several.get("points"):
        raise InputError("multi_dof_joint_trajectory: it moves a base, which is not read; take it out if it stands")
    for key, each in document.items():
        if isinstance(each, Mapping | list):
            yield from _messages(each, label, depth + 1) if key != "points" else ()


def _of_message(message: Mapping[str, Any], label: str) -> Columns:
    """Return the columns of a JointTrajectory.

    Raises:
        InputError: If it has no points, or one has no positions or no time.
    """
    points = message["points"]
    if not isinstance(points, list) or not points or not all(isinstance(each, Mapping) for each in points):
        raise InputError(f"{_of(label)}points: expected a list of points with positions and time_from_start")

    names = message["joint_names"]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{_of(label)}joint_names: expected a list of names")
    for number, point in enumerate(points, start=1):
        if not _given(point.get("positions")):
            raise InputError(f"{_of(label)}point {number}: no positions; a motion needs them")
        if point.get("time_from_start") is None and len(points) > 1:
            raise InputError(f"{_of(label)}point {number}: no time_from_start; a JointTrajectory needs it")

    def column(key: str) -> list[object] | None:
        rows = [point.get(key) for point in points]
        missing = [np.nan] * len(names)
        return [row if _given(row) else missing for row in rows] if any(map(_given, rows)) else None

    times = [seconds(point.get("time_from_start", 0.0)) for point in points]
    if isinstance(times[0], float | int) and times[0] > 0.0 and len(points) > 1:
        warnings.warn(
            f"{_of(label)}begins at {times[0]:g} s: the way from where the arm stands to the first point is not judged",
            PathWarning,
            stacklevel=2,
        )
    positions = [point["positions"] for point in points]
    return Columns(label, positions, tuple(names), times, column("velocities"), column("accelerations"))


def _given(row: object) -> bool:
    return row is not None and len(row) > 0 if isinstance(row, list | np.ndarray) else row is not None


def _of_arrays(arrays: Mapping[str, Any], label: str) -> Iterator[Columns]:
    """Yield the motions in named arrays, such as a planner's result; LeRobot's streams are a motion each."""
    values = {name: each for name, each in arrays.items() if not isinstance(each, Mapping)}

    def first(names: tuple[str, ...]) -> Any:  # noqa: ANN401 - an array, a list or a number
        return next((values[name] for name in names if name in values), None)

    names = first(NAMES)
    known = None if names is None else tuple(_joint(str(name))[1] for name in np.ravel(np.asarray(names)).tolist())
    given = first(POSITIONS)
    if given is not None:
        times = first(TIMES)
        yield Columns(label, given, known, times, first(VELOCITIES), first(ACCELERATIONS), first(STEPS))
        return
    streams = [name for name in STREAMS if name in values]
    for name in streams:
        yield Columns(name if len(streams) > 1 else label, values[name], known, first(TIMES), step=first(STEPS))
    for name, each in arrays.items() if not streams else ():
        if isinstance(each, Mapping):
            yield from _of_arrays(each, f"{label} {name}".strip())


def _of_table(text: str) -> Columns:
    """Return the columns of a CSV file by the names in its first line."""
    names, rows = table_rows(text, ",")
    numbers = np.array(rows)
    of_kind: dict[str, dict[str, Vector]] = {"positions": {}, "velocities": {}, "accelerations": {}}
    times = None
    for k, name in enumerate(names or ()):
        kind, joint = _joint(name)
        if joint in TIMES:
            times = numbers[:, k]
        else:
            of_kind[kind][joint] = numbers[:, k]

    joints = tuple(of_kind["positions"])

    def rows_of(kind: str) -> Matrix | None:
        columns = of_kind[kind]
        if not columns:
            return None
        if set(columns) != set(joints):
            raise InputError(f"line 1: {kind} of {few(sorted(columns))}, but positions of {few(joints)}")
        return np.stack([columns[joint] for joint in joints], axis=1)

    return Columns("", rows_of("positions"), joints, times, rows_of("velocities"), rows_of("accelerations"))


def _joint(name: str) -> tuple[str, str]:
    """Return of what kind a column is by its name, "positions" or another key of ``MARKS``, and of which joint."""
    for prefix in BEFORE:
        name = name.removeprefix(prefix)
    marks = ((kind, mark) for kind, every in MARKS.items() for mark in every if name.endswith(mark))
    kind, mark = next(marks, ("positions", ""))
    return kind, name.removesuffix(mark)


# --- a motion of a robot ----------------------------------------------------------------------------------------------


def _of(label: str) -> str:
    return f"{label}: " if label else ""


def _fitted(found: Columns, robot: Robot, path: Path, step: float | None, *, degrees: bool) -> ReceivedMotion:
    """Return what a file holds as a motion of a robot.

    Raises:
        InputError: If names, units, times or shapes do not fit.
    """
    label = _of(found.label)
    derivatives = (None if each is None else _rows(each, label) for each in (found.velocities, found.accelerations))
    positions = _rows(found.positions, label)
    name = f"{path.name} {found.label}".strip()
    try:
        whole = ReceivedMotion(name, positions, _times(found, len(positions), step, label), *derivatives)
    except InputError as error:
        raise InputError(f"{label}{error}") from None

    columns = _columns(found, whole.positions, robot, path.name, degrees=degrees)
    scale = np.where(robot.prismatic | (not degrees), 1.0, DEGREE)
    own = whole.positions[:, columns] * scale
    others = (None if each is None else each[:, columns] * scale for each in (whole.velocities, whole.accelerations))
    if not degrees:
        _refuse_degrees(own, robot, label)
    return ReceivedMotion(name, own, whole.times, *others)


def _rows(values: object, label: str) -> NDArray[np.float64]:
    """Return rows of numbers; leading axes of length 1, such as those of a batch, are dropped.

    Raises:
        InputError: If they are none, or if a printed message was cut short.
    """
    if isinstance(values, list) and any(
        isinstance(row, str) or (isinstance(row, list) and "..." in row) for row in values
    ):
        raise InputError(f"{label}a list is cut short by '...'; print it with: ros2 topic echo --full-length")
    try:
        rows = np.asarray(values, dtype=np.float64)  # text such as 1e-05, which YAML does not take for a number
    except (TypeError, ValueError):
        raise InputError(f"{label}expected rows of numbers, one for each point, all of the same length") from None
    while rows.ndim > 2 and rows.shape[0] == 1:
        rows = rows[0]
    return rows


def _columns(found: Columns, positions: Matrix, robot: Robot, file: str, *, degrees: bool) -> list[int]:
    """Return which columns are the robot's joints, in its order; a warning says if the file has another one.

    Raises:
        InputError: If one is missing, or a joint moves that the robot does not.
    """
    label = _of(found.label)
    count = positions.shape[1]
    if found.names is None or found.names == unnamed_joints(robot.dof):
        if count != robot.dof:
            raise InputError(
                f"{label}positions have {count} columns, and robot '{robot.name}' {robot.dof} joints; "
                f"name the columns (joint_names)"
            )
        return list(range(count))

    names = list(found.names)
    if len(names) != count or len(set(names)) != count:
        raise InputError(f"{label}{len(names)} joint names, {len(set(names))} different ones, for {count} columns")
    missing = [name for name in robot.joint_names if name not in names]
    if missing:
        others = few([name for name in names if name not in robot.joint_names]) or "no others"
        raise InputError(
            f"{label}no values of {few(missing)}, which robot '{robot.name}' moves (the file has {others}); "
            "it is another robot's, or only a part of it moves"
        )

    rest = [name for name in names if name not in robot.joint_names]
    _refuse_moving(rest, positions[:, [names.index(name) for name in rest]], robot, label, degrees=degrees)
    joint_order(robot, [name for name in names if name in robot.joint_names], f"{file} {found.label}".strip())
    return [names.index(name) for name in robot.joint_names]


def _refuse_moving(names: Iterable[str], rows: Matrix, robot: Robot, label: str, *, degrees: bool) -> None:
    """Refuse values of joints that a robot does not move, unless it holds them there.

    Raises:
        InputError: If one is no joint of the robot, moves, or stands elsewhere.
    """
    held = robot.source.get("locked", {})
    for name, column in zip(names, rows.T, strict=True):
        if name not in robot.movable:
            raise InputError(f"{label}'{name}' is no joint of robot '{robot.name}'; it is another robot's motion")
        values = np.deg2rad(column) if degrees else column
        if np.ptp(values) > LIMIT_TOLERANCE:
            raise InputError(
                f"{label}joint '{name}' moves, and robot '{robot.name}' holds it: "
                f"load the robot with it among joints=, or take it out of the file"
            )
        if abs(values[0] - float(held.get(name, 0.0))) > LIMIT_TOLERANCE:
            raise InputError(
                f"{label}joint '{name}' stands at {values[0]:g}, and robot '{robot.name}' holds it at "
                f"{float(held.get(name, 0.0)):g}: load the robot with locked={{'{name}': {values[0]:g}}}"
            )


def _refuse_degrees(positions: Matrix, robot: Robot, label: str) -> None:
    """Refuse values far outside the limits that would be inside if they were degrees.

    Raises:
        InputError: If so.
    """
    far = inside_limits(robot, positions, FAR_OUTSIDE)
    as_radians = np.where(robot.prismatic, positions, np.deg2rad(positions))
    if not far.all() and inside_limits(robot, as_radians).all():
        k, joint = np.argwhere((positions < robot.lower - FAR_OUTSIDE) | (positions > robot.upper + FAR_OUTSIDE))[0]
        raise InputError(
            f"{label}point {k + 1}: joint '{robot.joint_names[joint]}' is at {positions[k, joint]:g}, far outside its "
            f"limits in radians; if these are degrees, say degrees=True (--degrees)"
        )


def _times(found: Columns, count: int, step: float | None, label: str) -> NDArray[np.float64] | None:
    """Return the times of points; None if there are none."""
    if count < 2:
        return None
    if found.times is not None:
        return np.ravel(_rows(found.times, label))
    given = step if found.step is None else positive(np.ravel(_rows(found.step, label))[0], f"{label}dt")
    return None if given is None else np.asarray(given * np.arange(count))
