"""ROS's JointTrajectory message, as a dict and as YAML, and joint states over time in an MCAP file."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from io import BytesIO
from typing import Any

import yaml

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import write_bytes

FIELDS = ("positions", "velocities", "accelerations")  # of a point; the last one may be left out
NANOSECONDS = 1_000_000_000
_SCHEMA = {
    "type": "object",
    "properties": {
        "name": {"type": "array", "items": {"type": "string"}},
        **{key: {"type": "array", "items": {"type": "number"}} for key in ("position", "velocity", "acceleration")},
    },
}


def joint_trajectory(names: Sequence[str], columns: Sequence[list[Any]]) -> dict[str, Any]:
    """The message ``trajectory_msgs/JointTrajectory`` with the fields that ROS 2 knows, and no others.

    Args:
        names: Of the joints.
        columns: Times, positions and velocities, one entry each per point; accelerations if there are four.
    """
    points = []
    for time, *values in zip(*columns, strict=True):
        whole, rest = divmod(round(time * NANOSECONDS), NANOSECONDS)
        points.append(dict(zip(FIELDS, values, strict=False)) | {"time_from_start": {"sec": whole, "nanosec": rest}})
    stamp = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": stamp, "joint_names": list(names), "points": points}


def to_yaml(message: dict[str, Any]) -> str:
    """A message as YAML, as ``ros2 topic pub`` takes it: one line a field of a point."""
    text: str = yaml.dump(message, Dumper=_dumper(), sort_keys=False, default_flow_style=None, width=10**6)
    return text


def _dumper() -> type[yaml.SafeDumper]:
    dumper: type[yaml.SafeDumper] = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return dumper


def from_yaml(text: str) -> dict[str, Any]:
    """A message from YAML.

    Raises:
        InputError: If it is none; the message names the line.
    """
    try:
        document = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except yaml.YAMLError as error:
        problem_mark = getattr(error, "problem_mark", None)
        where = "" if problem_mark is None else f"line {problem_mark.line + 1}: "
        raise InputError(f"{where}not YAML; is this a trajectory file?") from None
    except (RecursionError, ValueError):
        raise InputError("not YAML that can be read; is this a trajectory file?") from None
    if not isinstance(document, dict) or "points" not in document:
        raise InputError("expected an object with the key 'points'; is this a trajectory file?")
    return document


def write_mcap(file: str | os.PathLike[str], robot: str, names: Sequence[str], columns: Sequence[list[Any]]) -> None:
    """Write joint states over time, as JSON in the topic ``/joint_states``, for Foxglove and others.

    Raises:
        InputError: If the package mcap is not installed, or the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise InputError("MCAP files need the package mcap: pip install 'rrtik-ompl[mcap]'") from None

    sink = BytesIO()
    writer = Writer(sink)
    writer.start(profile="", library="rrtik-ompl")
    schema = writer.register_schema("sensor_msgs/JointState", "jsonschema", json.dumps(_SCHEMA).encode())
    channel = writer.register_channel("/joint_states", "json", schema, {"robot": robot})

    for number, (time, position, velocity, acceleration) in enumerate(zip(*columns, strict=True)):
        stamp = round(time * NANOSECONDS)
        state = {"name": list(names), "position": position, "velocity": velocity, "acceleration": acceleration}
        writer.add_message(channel, stamp, json.dumps(state).encode(), stamp, number)

    writer.finish()
    write_bytes(file, sink.getvalue())
