"""A file of records: a line of JSON that says what they are, then one for each, appended when it is there.

An interruption can at worst leave an incomplete line at the end, which is removed when the file is continued.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import make_folder

if TYPE_CHECKING:
    from typing_extensions import Self


def complete_lines(file: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the complete lines with their numbers, from 1.

    Raises:
        InputError: If the file cannot be read.
    """
    try:
        with open(file, "rb") as stream:
            for number, line in enumerate(stream, start=1):
                if not line.endswith(b"\n"):
                    return
                yield number, line
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}") from error


class LineFile:
    """A file of records, opened for appending.

    Args:
        file: The file; it is created, with its folder, if it does not exist.
        head: First line of a new file.

    Attributes:
        busy: What is said if another process is writing it.
        full: What is said if it cannot be written.

    Raises:
        InputError: If it cannot be written, or another process is writing it.
    """

    busy: ClassVar[str] = "another process is writing it; wait for its end"
    full: ClassVar[str] = "what is there is kept: make room, then go on"

    def __init__(self, file: Path, head: Mapping[str, Any]) -> None:
        self._name = file
        make_folder(file.parent)

        try:
            self._file = open(file, "ab", buffering=0)  # noqa: SIM115 - closed by __exit__
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._cut_half_line()
        except BlockingIOError:
            self._file.close()
            raise InputError(f"{file}: {self.busy}") from None
        except OSError as error:
            raise self._failed(error) from error

        if self._end == 0:
            self.append(head)

    def append(self, record: Mapping[str, Any]) -> None:
        """Write a record without buffering; if there is no space, the incomplete line is removed.

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

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def _cut_half_line(self) -> None:
        """Remove an incomplete last line, and also a head without records, which the new head replaces."""
        data = self._name.read_bytes()
        self._end = data.rfind(b"\n") + 1 if data.count(b"\n") > 1 else 0
        if self._end < len(data):
            os.truncate(self._name, self._end)

    def _failed(self, error: OSError) -> InputError:
        return InputError(f"{self._name}: cannot be written: {error.strerror or error}; {self.full}")
