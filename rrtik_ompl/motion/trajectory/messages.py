"""Times and YAML of the messages of ROS."""

from __future__ import annotations

from typing import Any

import yaml

from rrtik_ompl.base.errors import InputError

NANOSECONDS = 1_000_000_000
MOST_UNFOLDED = 10_000_000  # largest number of values of a file of YAML, its aliases written out
_DURATION = (("sec", "secs"), ("nanosec", "nsecs"))


def duration(time: float) -> dict[str, int]:
    """Return a time [s] as ROS 2 writes a duration."""
    whole, rest = divmod(round(time * NANOSECONDS), NANOSECONDS)
    return {"sec": whole, "nanosec": rest}


def seconds(time: object) -> object:
    """Return a duration as a number of seconds; it may also be written as in the messages of ROS 1 and 2."""
    if not isinstance(time, dict):
        return time
    whole, fraction = (next((time[key] for key in keys if key in time), 0) for keys in _DURATION)
    try:
        return whole + 1e-9 * fraction
    except TypeError:
        raise InputError(f"time_from_start: expected seconds, or sec and nanosec, got {time!r}") from None


def to_yaml(message: dict[str, Any]) -> str:
    """Return a message as YAML, as ``ros2 topic pub`` takes it, with one line for each field of a point."""
    text: str = yaml.dump(message, Dumper=_dumper(), sort_keys=False, default_flow_style=None, width=10**6)
    return text


def _dumper() -> type[yaml.SafeDumper]:
    dumper: type[yaml.SafeDumper] = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return dumper


def from_yaml(text: str, key: str) -> dict[str, Any]:
    """Read an object from YAML that has a key, such as a message.

    Raises:
        InputError: If the text is not such an object; the error names the line.
    """
    document, *others = yaml_documents(text) or [None]
    if others or not isinstance(document, dict) or key not in document:
        raise InputError(f"expected one object with the key '{key}'; is this a trajectory file?")
    return document


def yaml_documents(text: str) -> list[object]:
    """Read the documents of YAML that any program wrote, without empty ones; tags are refused.

    Raises:
        InputError: If it is malformed, where the error names the line, or if its aliases unfold to very many values.
    """
    try:
        read = list(yaml.load_all(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
        if "*" in text and _unfolded(read, {}) > MOST_UNFOLDED:
            raise InputError(f"its aliases unfold to more than {MOST_UNFOLDED} values; write them out")
        return [document for document in read if document is not None]
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = "" if mark is None else f"line {mark.line + 1}: "
        raise InputError(f"{where}not YAML; is this a trajectory file?") from None
    except (RecursionError, ValueError):
        raise InputError("not YAML that can be read; is this a trajectory file?") from None


def _unfolded(value: object, known: dict[int, int]) -> int:
    """Return the number of values that a value has with all aliases written out; one inside itself has too many."""
    if not isinstance(value, dict | list):
        return 1
    if id(value) not in known:
        known[id(value)] = MOST_UNFOLDED + 1
        parts = value.values() if isinstance(value, dict) else value
        known[id(value)] = 1 + sum(_unfolded(part, known) for part in parts)
    return known[id(value)]
