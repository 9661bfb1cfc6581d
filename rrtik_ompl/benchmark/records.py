"""The file of a campaign: a line of JSON about the suite, then one for every run, appended as runs are finished.

An interruption can leave nothing worse than half a line at the end, which is cut off when the campaign goes on.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, TypeAlias

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.run import SOLVED, STATUSES
from rrtik_ompl.files.text import make_folder

Record: TypeAlias = dict[str, Any]
Key: TypeAlias = tuple[str, str, int]  # problem, planner's label, number of the run

NAME = "runs.jsonl"
NUMBER = (int, float)
NEEDED = {
    **{"problem": str, "group": str, "axis": str, "value": NUMBER, "planner": str},
    **{"run": int, "seed": int, "status": str},
}
OF_A_PATH = ("plan_seconds", "length", "waypoints")
NO_NUMBERS = {"reason": str, "counts": dict, "waypoints": list, **NEEDED}  # whatever else was measured is a number
# What the head says of the machine, the beginning of the campaign last.
MACHINE = ("rrtik-ompl", "ompl", "pin", "coal", "numpy", "python", "system", "processor", "cores", "at a time", "begun")


def key_of(record: Mapping[str, Any]) -> Key:
    """Which run a record is about."""
    return record["problem"], record["planner"], record["run"]


def read_head(file: Path) -> Record:
    """The first line: the suite and the machine.

    Raises:
        InputError: If the file cannot be read or is something else.
    """
    for _, data in _lines(file):
        suite = data.get("suite")
        machine = data.get("machine")
        known = data.get("version") == 1 and data["version"] is not True
        if not known or not isinstance(suite, dict) or not isinstance(machine, dict):
            raise InputError(f"{file}:1: not the head of a campaign; choose another --out, or delete the file")
        lacking = [name for name in MACHINE if name not in machine]
        if lacking:
            raise InputError(f"{file}:1: machine lacks {', '.join(lacking)}; put it back, or choose another --out")
        return data
    raise InputError(f"{file}: holds nothing; delete it to begin anew")


def read_records(file: Path) -> Iterator[Record]:
    """All records in the order in which runs were finished; half a line at the end is left out.

    Raises:
        InputError: If the file cannot be read, or a line in its middle is no record.
    """
    lines = _lines(file)
    next(lines, None)
    for number, data in lines:
        fault = _fault(data)
        if fault:
            raise _corrupt(file, number, fault)
        yield data


def _fault(data: Record) -> str:
    """What is wrong with a record; "" if nothing is."""
    status = data.get("status")
    for name in (*NEEDED, *(OF_A_PATH if status == SOLVED else ())):
        if name not in data:
            return f"{name} is missing"

    if status not in STATUSES:
        return f"status {status!r} is none of {', '.join(STATUSES)}"
    for name, value in data.items():
        kind: Any = NO_NUMBERS.get(name, (*NUMBER, type(None)))
        if not isinstance(value, kind):
            return f"{name} cannot be {value!r:.40}"

    counts = data.get("counts", {})
    return next((f"count {key} cannot be {n!r:.40}" for key, n in counts.items() if not isinstance(n, NUMBER)), "")


def _lines(file: Path) -> Iterator[tuple[int, Record]]:
    """Whole lines with their numbers."""
    try:
        with open(file, "rb") as stream:
            for number, line in enumerate(stream, start=1):
                if not line.endswith(b"\n"):
                    return
                yield number, _decoded(file, number, line)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}") from error


def _decoded(file: Path, number: int, line: bytes) -> Record:
    try:
        data = json.loads(line)
    except ValueError as error:
        raise _corrupt(file, number, str(error)) from None
    if not isinstance(data, dict):
        raise _corrupt(file, number, f"found {type(data).__name__}")
    return data


def _corrupt(file: Path, number: int, why: str) -> InputError:
    return InputError(f"{file}:{number}: not a record of a run ({why}); delete this line to have its run done again")


class RecordFile:
    """A file of records that is open for appending.

    Args:
        file: The file; it is made, with its folder, unless it is there.
        head: Its first line.

    Raises:
        InputError: If it cannot be written, or another process is writing it.
    """

    def __init__(self, file: Path, head: Mapping[str, Any]) -> None:
        self._name = file
        make_folder(file.parent)

        try:
            self._file = open(file, "ab", buffering=0)  # noqa: SIM115 - closed by __exit__
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._cut_half_line()
        except BlockingIOError:
            self._file.close()
            raise InputError(
                f"{file}: another campaign is writing it; wait for its end, or choose another --out"
            ) from None
        except OSError as error:
            raise self._failed(error) from error

        if self._end == 0:
            self.append(head)

    def append(self, record: Mapping[str, Any]) -> None:
        """Write a record through to the disk's care; if there is no room, what was there before stays whole.

        Raises:
            InputError: If it cannot be written.
        """
        line = (json.dumps(record) + "\n").encode()
        written = 0
        try:
            while written < len(line):
                written += self._file.write(line[written:])
        except OSError as error:
            os.truncate(self._name, self._end)
            raise self._failed(error) from error

        self._end += len(line)

    def __enter__(self) -> RecordFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def _cut_half_line(self) -> None:
        """What is not whole goes; so does a head without runs, for that of this campaign takes its place."""
        data = self._name.read_bytes()
        self._end = data.rfind(b"\n") + 1 if data.count(b"\n") > 1 else 0
        if self._end < len(data):
            os.truncate(self._name, self._end)

    def _failed(self, error: OSError) -> InputError:
        return InputError(
            f"{self._name}: cannot be written: {error.strerror or error}; all runs before are kept: "
            f"make room, then continue with --resume"
        )


def json_like(data: Mapping[str, Any]) -> Record:
    """The same as it reads back from a file: tuples are lists."""
    found: Record = json.loads(json.dumps(data))
    return found
