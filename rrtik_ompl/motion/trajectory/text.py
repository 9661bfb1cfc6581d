"""Write and read files of trajectories: JSON like ROS's JointTrajectory, that message itself, CSV, and MCAP."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable, Sequence
from io import BytesIO
from typing import Any

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.tables import json_object, table_rows
from rrtik_ompl.files.text import file_name, known_ending, read_bytes, write_bytes
from rrtik_ompl.model.gripper import Events, GripperEvent, states_at, targets_at
from rrtik_ompl.motion.trajectory.gripper_text import events_of_document, gripper_document
from rrtik_ompl.motion.trajectory.messages import NANOSECONDS, duration, from_yaml, seconds, to_yaml

FORMATS = (".json", ".csv", ".yaml")
ROS_JSON = ".ros.json"  # A file with just the message, as ROS rejects fields that it does not know.
KIND = "joint_trajectory"
LIBRARY = "rrtik-ompl"  # says in an MCAP file that we have written it
STATES, COMMANDS = "/joint_states", "/gripper_command"
GRIPPER = "gripper "  # begins the name of a column of CSV that has where a joint of the gripper has been told to go
FIELDS = ("positions", "velocities", "accelerations")  # fields of a point; the last one may be missing
_SCHEMA = {
    "type": "object",
    "properties": {
        "name": {"type": "array", "items": {"type": "string"}},
        **{
            key: {"type": "array", "items": {"type": "number"}}
            for key in ("position", "velocity", "acceleration", "effort")
        },
    },
}


def dumps(
    robot: str,
    names: Sequence[str],
    units: Sequence[str],
    columns: Sequence[list[Any]],
    ending: str,
    gripper: Events = (),
) -> str:
    """Return the text of a trajectory file.

    Args:
        robot: Name of the robot, or "".
        names: Names of the n joints.
        units: Unit of each joint, "rad" or "m".
        columns: Lists of m entries each: times [s], positions, velocities and, optionally, accelerations; entries but
            times have one number per joint.
        ending: An ending of ``FORMATS`` or ``ROS_JSON``.
        gripper: Commands to a gripper, which .json and .csv have too.
    """
    if ending == ".yaml":
        return to_yaml(joint_trajectory(names, columns))
    if ending == ROS_JSON:
        return json.dumps(joint_trajectory(names, columns), indent=1) + "\n"
    if ending == ".json":
        points = [
            dict(zip(FIELDS, values, strict=False)) | {"time_from_start": time}
            for time, *values in zip(*columns, strict=True)
        ]
        head = {"version": 1, "kind": KIND, "robot": robot, "joint_names": list(names), "units": list(units)}
        commands = {"gripper": gripper_document(gripper)} if gripper else {}
        return json.dumps(head | {"points": points} | commands, indent=1) + "\n"

    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_header(names) + [GRIPPER + joint for event in gripper[:1] for joint in event.joints])
    commanded = [targets_at(gripper, columns[0]).tolist()] if gripper else []
    for time, *values in zip(*columns, *commanded, strict=True):
        table.writerow([repr(number) for number in (time, *(x for value in values for x in value))])
    return text.getvalue()


def _header(names: Iterable[str]) -> list[str]:
    joint_names = list(names)
    return [
        "time",
        *joint_names,
        *(f"{name} velocity" for name in joint_names),
        *(f"{name} acceleration" for name in joint_names),
    ]


def written_ending(file: str | os.PathLike[str]) -> str:
    """Return the format that is written to a file of this name: an ending of ``FORMATS``, ``ROS_JSON`` or ".mcap".

    Raises:
        InputError: If the ending is unknown.
    """
    ending = known_ending(file, (*FORMATS, ".mcap"), "trajectory")
    return ROS_JSON if file_name(file).name.lower().endswith(ROS_JSON) else ending


def loads(text: str, ending: str) -> dict[str, Any]:
    """Read what :func:`dumps` wrote.

    Args:
        text: The text of the file.
        ending: An ending of ``FORMATS``.

    Returns:
        A dictionary with ``times``, the lists ``FIELDS`` of one entry per point (accelerations may be None),
        ``joint_names`` and ``units`` (may be None), ``robot``, and the commands to a ``gripper``.

    Raises:
        InputError: If the text is malformed; the message names the line, the point or the key.
    """
    if ending == ".csv":
        return _from_csv(text)
    return _from_message(json_object(text, KIND, "points") if ending == ".json" else from_yaml(text, "points"))


def _from_csv(text: str) -> dict[str, Any]:
    """Read the columns of a CSV file; see :func:`loads`."""
    names, rows = table_rows(text, ",")
    fingers = [name for name in names or () if name.startswith(GRIPPER)]
    arm = (names or [])[: len(names or ()) - len(fingers)]
    count = (len(arm) - 1) // 3
    joints = arm[1 : 1 + count]
    if count < 1 or names != _header(joints) + fingers:
        expected_columns = "time,<joint>...,<joint> velocity...,<joint> acceleration..."
        raise InputError(f"line 1: expected the columns {expected_columns}; is this a trajectory file?")
    document: dict[str, Any] = {"times": [row[0] for row in rows], "joint_names": joints, "units": None, "robot": ""}
    for k, field in enumerate(FIELDS):
        document[field] = [row[1 + k * count : 1 + (k + 1) * count] for row in rows]
    document["gripper"] = _events_of_rows([name.removeprefix(GRIPPER) for name in fingers], rows)
    return document


def _events_of_rows(joints: list[str], rows: list[list[float]]) -> Events:
    """Return a command for each row in which the last columns, those of a gripper's joints, differ from the row before.

    How long the joints take is not in such a file.
    """
    events: list[GripperEvent] = []
    for time, *values in rows if joints else ():
        positions = tuple(values[-len(joints) :])
        if not events or positions != events[-1].positions:
            events.append(GripperEvent(time, tuple(joints), positions))
    return tuple(events)


def _from_message(document: dict[str, Any]) -> dict[str, Any]:
    """Check the points of a JointTrajectory message and return its columns; see :func:`loads`.

    Accelerations are only used if all points have them.
    """
    points = document["points"]
    if not isinstance(points, list) or not all(isinstance(point, dict) for point in points):
        raise InputError("points: expected a list of objects with positions, velocities and time_from_start")

    for number, point in enumerate(points, start=1):
        for key in ("positions", "velocities", "time_from_start"):
            # The time of a point may be 0; a list may not be empty.
            if point.get(key) in (None, [], {}, ""):
                raise InputError(
                    f"point {number}: no {key}; a Trajectory needs positions, velocities and time_from_start, "
                    "load_motions(file, robot) reads what has fewer"
                )

    accelerations = [point.get("accelerations") for point in points]
    return {
        "times": [seconds(point["time_from_start"]) for point in points],
        "positions": [point["positions"] for point in points],
        "velocities": [point["velocities"] for point in points],
        "accelerations": accelerations if all(accelerations) else None,
        "joint_names": document.get("joint_names"),
        "units": document.get("units"),
        "robot": str(document.get("robot", "")),
        "gripper": events_of_document(document["gripper"]) if "gripper" in document else (),
    }


def joint_trajectory(names: Sequence[str], columns: Sequence[list[Any]]) -> dict[str, Any]:
    """Return the message ``trajectory_msgs/JointTrajectory`` with just the fields that ROS 2 knows.

    Args:
        names: Names of the joints.
        columns: Times, positions and velocities, one entry each per point, and accelerations if there are four columns.
    """
    points = []
    for time, *values in zip(*columns, strict=True):
        points.append(dict(zip(FIELDS, values, strict=False)) | {"time_from_start": duration(time)})
    stamp = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": stamp, "joint_names": list(names), "points": points}


def write_mcap(
    file: str | os.PathLike[str],
    robot: str,
    names: Sequence[str],
    columns: Sequence[list[Any]],
    gripper: Events = (),
) -> None:
    """Write joint states over time as JSON messages of the topic ``/joint_states``, for Foxglove and other programs.

    The states of a gripper's joints are among them. The commands to it are messages of ``/gripper_command``, each with
    names, positions and, if it is known, effort.

    Args:
        file: The file to write.
        robot: Name of the robot.
        names: Names of the joints.
        columns: Times [s], positions, velocities and accelerations, one entry each per message.
        gripper: Commands to a gripper.

    Raises:
        InputError: If the package mcap is not installed, or the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise InputError("MCAP files need the package mcap: pip install 'rrtik-ompl[mcap]'") from None

    sink = BytesIO()
    writer = Writer(sink)
    writer.start(profile="", library=LIBRARY)
    schema = writer.register_schema("sensor_msgs/JointState", "jsonschema", json.dumps(_SCHEMA).encode())
    channel = writer.register_channel(STATES, "json", schema, {"robot": robot})

    joints = [*names, *(joint for event in gripper[:1] for joint in event.joints)]
    none: list[list[float]] = [[]] * len(columns[0])
    fingers = [states.tolist() for states in states_at(gripper, columns[0])] if gripper else [none, none]
    for number, (time, *values, held, speed) in enumerate(zip(*columns, *fingers, strict=True)):
        stamp = round(time * NANOSECONDS)
        of_fingers = (held, speed, [0.0] * len(held))
        rows = (arm + more for arm, more in zip(values, of_fingers, strict=True))
        state = {"name": joints, **dict(zip(("position", "velocity", "acceleration"), rows, strict=True))}
        writer.add_message(channel, stamp, json.dumps(state).encode(), stamp, number)

    if gripper:
        told = writer.register_channel(COMMANDS, "json", schema, {"gripper": gripper[0].gripper})
    for number, event in enumerate(gripper):
        stamp = round(event.time * NANOSECONDS)
        effort = [] if event.effort is None else [event.effort] * len(event.joints)
        command = {"name": event.joints, "position": event.positions, "effort": effort}
        writer.add_message(told, stamp, json.dumps(command).encode(), stamp, number)

    writer.finish()
    write_bytes(file, sink.getvalue())


def is_own_mcap(file: str | os.PathLike[str]) -> bool:
    """Check whether :func:`write_mcap` wrote a file; False, too, without the package mcap."""
    try:
        from mcap.reader import make_reader
    except ImportError:
        return False
    try:
        with open(file, "rb") as stream:  # bags may be large, and the header stands first
            return bool(make_reader(stream).get_header().library == LIBRARY)
    except Exception:  # whatever a damaged file leads the package to
        return False


def read_mcap(file: str | os.PathLike[str]) -> dict[str, Any]:
    """Read what :func:`write_mcap` wrote, as :func:`loads` does; how long a gripper takes is not in such a file.

    Raises:
        InputError: If the package mcap is not installed, or the file is another one or not whole.
    """
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise InputError("MCAP files need the package mcap: pip install 'rrtik-ompl[mcap]'") from None
    data = read_bytes(file)
    if not is_own_mcap(file):
        raise InputError("not an MCAP file of Trajectory.save; load_motions(file, robot) reads bags of ROS")

    states: list[tuple[float, dict[str, Any]]] = []
    told: list[tuple[float, dict[str, Any]]] = []
    about: dict[str, dict[str, str]] = {STATES: {}, COMMANDS: {}}
    try:
        for _, channel, message in make_reader(BytesIO(data)).iter_messages():
            about[channel.topic] = channel.metadata
            row = message.log_time / NANOSECONDS, json.loads(message.data)
            (states if channel.topic == STATES else told).append(row)

        fingers = told[0][1]["name"] if told else []
        joints = states[0][1]["name"][: len(states[0][1]["name"]) - len(fingers)]
        events = tuple(
            GripperEvent(
                time,
                each["name"],
                each["position"],
                about[COMMANDS]["gripper"],
                effort=max(each["effort"], default=None),
            )
            for time, each in told
        )
        fields = zip(FIELDS, ("position", "velocity", "acceleration"), strict=True)
        rows = {field: [state[name][: len(joints)] for _, state in states] for field, name in fields}
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file leads the package to
        raise InputError(f"not a whole MCAP file: {error}; save the motion again") from None
    times = [time for time, _ in states]
    return {
        "times": times,
        **rows,
        "joint_names": joints,
        "units": None,
        "robot": about[STATES]["robot"],
        "gripper": events,
    }
