"""The folder of demonstrations: a line for each attempt, and a file of arrays for each demonstration.

``attempts.jsonl`` begins with a line of all that the data depend on; a line follows for each attempt. An attempt counts
once its line is there, which is written after its file, so that a process that is killed leaves nothing half.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.demos.episode import Episode
from rrtik_ompl.files.line_file import LineFile, complete_lines
from rrtik_ompl.files.named_arrays import NamedArrays
from rrtik_ompl.files.text import make_folder, write_bytes, write_text

ATTEMPTS = "attempts.jsonl"
EPISODES = "episodes"
SUMMARY = "demos.json"
NEEDED = {"attempt": int, "found": bool, "reason": str, "ticks": int, "rejected": dict, "drawn": dict}
Record = dict[str, Any]


class AttemptFile(LineFile):
    """The file of attempts, opened for appending."""

    busy = "another rrtik demos is writing it; wait for its end, or choose another --out"
    full = "what is done is kept: make room, then give the same command again"


class Pictures(Protocol):
    """Draws pictures of demonstrations, such as `DemoPictures`."""

    names: tuple[str, ...]
    size: tuple[int, int]

    def of(self, arrays: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, NDArray[np.uint8]]]:
        """Yield the pictures at each tick, by camera: red, green, blue, shape (height, width, 3)."""
        ...


class DemoFolder:
    """A folder of demonstrations.

    Args:
        path: The folder, which need not exist.
        head: What the data depend on, as plain values.
        drawn: What draws the pictures of its datasets; None for none.

    Attributes:
        records: The lines of the attempts that are done, by their numbers.

    Raises:
        InputError: If the folder has demonstrations that depend on something else, or cannot be read.
    """

    def __init__(self, path: Path, head: Mapping[str, Any], drawn: Pictures | None = None) -> None:
        self.path = path
        self.drawn = drawn
        self.head = {"version": 1, "kind": "demos", **head}
        self.records: dict[int, Record] = {}
        file = path / ATTEMPTS
        if file.exists():
            for number, line in complete_lines(file):
                self._take(file, number, _decoded(file, number, line))

    def _take(self, file: Path, number: int, line: Record) -> None:
        """Take a line of the file."""
        if number == 1:
            changed = [name for name in self.head if line.get(name) != self.head[name]]
            if line.get("kind") != "demos":
                raise InputError(f"{file}:1: not the head of demonstrations; choose another --out")
            if changed:
                names = ", ".join(changed)
                raise InputError(f"{file}: was begun with another {names}; choose another --out, or delete the folder")
            return

        for name, kind in NEEDED.items():
            if type(line.get(name)) is not kind:
                raise InputError(f"{file}:{number}: {name} cannot be {line.get(name)!r:.40}; delete this line")
        attempt = line["attempt"]
        if not line["found"] or self.episode_file(attempt).is_file():
            self.records[attempt] = line

    def episode_file(self, number: int) -> Path:
        """Return the file of the demonstration of an attempt."""
        return self.path / EPISODES / f"{number:06d}.npz"

    def opened(self) -> AttemptFile:
        """Open the file of attempts for appending.

        Raises:
            InputError: If it cannot be written, or another process is writing it.
        """
        make_folder(self.path / EPISODES)
        return AttemptFile(self.path / ATTEMPTS, self.head)

    def keep(self, episode: Episode, out: AttemptFile) -> None:
        """Write what has come of an attempt.

        Raises:
            InputError: If there is no room; what was written before is kept.
        """
        if episode.found:
            buffer = BytesIO()
            np.savez(buffer, **episode.arrays)  # type: ignore[arg-type]
            try:
                write_bytes(self.episode_file(episode.number), buffer.getvalue())
            except InputError as error:
                raise InputError(f"{error}; {AttemptFile.full}") from None
        record = episode.record()
        out.append(record)
        self.records[episode.number] = record

    def finish(self, summary: Mapping[str, Any], last: int) -> None:
        """Write the summary, and the attempts up to the last one in their order.

        Raises:
            InputError: If there is no room; what was written before is kept.
        """
        done = {number: record for number, record in sorted(self.records.items())}
        lines = [json.dumps(line) for line in (self.head, *done.values())]
        write_text(self.path / ATTEMPTS, "\n".join(lines) + "\n")
        failed = [record for number, record in done.items() if number <= last and not record["found"]]
        text = {**self.head, **summary, "attempts": last + 1, "failed": len(failed)}
        write_text(self.path / SUMMARY, json.dumps(text, indent=2) + "\n")

    def pictures(self, arrays: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, NDArray[np.uint8]]]:
        """Yield the pictures of a demonstration at each tick, by camera."""
        return iter(()) if self.drawn is None else self.drawn.of(arrays)

    def episodes(self, count: int) -> Iterator[tuple[Record, Mapping[str, NDArray[Any]]]]:
        """Yield the line and the arrays of the first demonstrations, in the order of their attempts.

        Raises:
            InputError: If a file is damaged.
        """
        found = [record for _, record in sorted(self.records.items()) if record["found"]]
        for record in found[:count]:
            arrays = NamedArrays(self.episode_file(record["attempt"]))
            yield record, {name: arrays[name] for name in arrays.names}


def _decoded(file: Path, number: int, line: bytes) -> Record:
    """Return a line as an object.

    Raises:
        InputError: If it is none.
    """
    try:
        data = json.loads(line)
    except ValueError:
        data = None
    if not isinstance(data, dict):
        raise InputError(f"{file}:{number}: not a line of JSON; delete it to have the attempt done again")
    return data
