"""A session as lines of JSON: objects seen, commands, configurations of the arm; written as it happens."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from rrtik_ompl.base.errors import InputError


class GrowingFile:
    """A file of a session, which ends with a fault or with the session.

    Attributes:
        fault: Why it has ended before the session, as where the disk is full; "" if it has not.
    """

    fault = ""
    _file: IO[bytes] | None = None
    _told = False

    def news(self) -> str:
        """Why the record has ended, the first time that this is asked; else ""."""
        said = "" if self._told else self.fault
        self._told = bool(self.fault)
        return said

    def close(self) -> None:
        """End the record."""
        if self._file is not None:
            with suppress(OSError):
                self._file.close()
            self._file = None


class Record(GrowingFile):
    """A file that grows line by line; whatever ends the session, the lines before it are there."""

    def __init__(self, path: str | os.PathLike[str] | None) -> None:
        """Begin a record; None keeps none.

        Raises:
            InputError: If the file cannot be written, or holds something: a session cannot be repeated.
        """
        self._path = path
        self._end = 0
        if path is not None:
            try:
                self._file = open(path, "ab", buffering=0)  # noqa: SIM115 - open as long as the session
                if self._file.tell() > 0:
                    self.close()
                    raise InputError(f"{path}: holds something already; choose another name, or delete it")
            except OSError as error:
                raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None

    def write(self, kind: str, time: float, **values: object) -> None:
        """Add a line. Where there is no room for it the record ends with the line before: the session goes on."""
        if self._file is None:
            return

        line = (json.dumps({"time": round(time, 6), "kind": kind, **values}) + "\n").encode()
        written = 0
        try:
            while written < len(line):
                written += self._file.write(line[written:])
        except OSError as error:
            self.fault = f"{self._path}: the record ends here: {error.strerror or error}; what was before is kept"
            with suppress(OSError):
                self._file.truncate(self._end)
            self.close()
        self._end += len(line)


def read_record(path: str | os.PathLike[str]) -> Iterator[dict[str, Any]]:
    """The lines of a record, in their order; a last line that was cut off is left out.

    Raises:
        InputError: If the file cannot be read, or a line is none of a record.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise InputError(f"{path}: {reason.lower()}; give a record of rrtik pilot") from None

    for number, line in enumerate(lines, start=1):
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            if number == len(lines):
                return
            raise InputError(f"{path}:{number}: is no line of a record of rrtik pilot") from None
        if not isinstance(entry, dict) or not {"time", "kind"} <= entry.keys():
            raise InputError(f"{path}:{number}: a line of a record needs 'time' and 'kind'")
        yield entry
