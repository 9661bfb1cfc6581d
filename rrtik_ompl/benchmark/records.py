"""The file of a campaign: a line of JSON about the suite, then one for every run, appended when the run is finished.

An interruption can at worst leave an incomplete line at the end, which is removed when the campaign is continued.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.run import SOLVED, STATUSES
from rrtik_ompl.files.line_file import LineFile, complete_lines

Record: TypeAlias = dict[str, Any]
Key: TypeAlias = tuple[str, str, int]  # problem, planner's label, number of the run

NAME = "runs.jsonl"
NUMBER = (int, float)
NEEDED = {
    **{"problem": str, "group": str, "axis": str, "value": NUMBER, "planner": str},
    **{"run": int, "seed": int, "status": str},
}
OF_A_PATH = ("plan_seconds", "length", "waypoints")
NO_NUMBERS = {"reason": str, "counts": dict, "waypoints": list, **NEEDED}  # all other values are numbers
# Entries of the head about the machine; the last one is the beginning of the campaign.
MACHINE = ("rrtik-ompl", "ompl", "pin", "coal", "numpy", "python", "system", "processor", "cores", "at a time", "begun")


def key_of(record: Mapping[str, Any]) -> Key:
    """Return the key of the run that a record describes."""
    return record["problem"], record["planner"], record["run"]


def read_head(file: Path) -> Record:
    """Return the first line, with suite and machine.

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
    """Yield all records in the order in which runs were finished; an incomplete last line is left out.

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
    """Return what is wrong with a record; "" if nothing is."""
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
    """Yield the complete lines with their numbers."""
    for number, line in complete_lines(file):
        yield number, _decoded(file, number, line)


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


class RecordFile(LineFile):
    """The file of a campaign, opened for appending; its head names suite and machine."""

    busy = "another campaign is writing it; wait for its end, or choose another --out"
    full = "all runs before are kept: make room, then continue with --resume"


def json_like(data: Mapping[str, Any]) -> Record:
    """Return data as they are read back from a file: tuples become lists."""
    found: Record = json.loads(json.dumps(data))
    return found
