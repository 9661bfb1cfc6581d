"""Records of sessions: lines of JSON, and optionally the pictures in a second file, both written as they happen.

The lines contain objects seen, commands with the page that gave them, set points, what the pilot was told, and
configurations of the arm. A thread brings them to the disk twice a second: if the power fails, no more is lost.
Pictures are stored as JPEGs one after the other, and a line of the record gives the position of each. Such a stream
(Motion JPEG) can be played by video players and needs no codec. However the session ends, all lines and pictures
written before remain readable.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError

RECORD_VERSION = 2  # in records before the second, nothing resets a stop
SYNC_SECONDS = 0.5
SUFFIX = ".mjpeg"
QUALITY = 85


class GrowingFile:
    """A file of a session, which ends with the session, or earlier if it cannot be written.

    Attributes:
        fault: Why the file ended before the session, for example because the disk is full; "" if it did not.
    """

    fault = ""
    _file: IO[bytes] | None = None
    _told = False

    def news(self) -> str:
        """Return why the record has ended, at the first call after that; otherwise ""."""
        said = "" if self._told else self.fault
        self._told = bool(self.fault)
        return said

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            with suppress(OSError):
                self._file.close()
            self._file = None


class Record(GrowingFile):
    """A record that is written line by line."""

    def __init__(self, path: str | os.PathLike[str] | None) -> None:
        """Open a record; with a path of None nothing is recorded.

        Raises:
            InputError: If the file cannot be written, or is not empty: a session cannot be repeated.
        """
        self._path = path
        self._end = 0
        self._written = threading.Event()
        if path is not None:
            try:
                self._file = open(path, "ab", buffering=0)  # noqa: SIM115 - open as long as the session
                if self._file.tell() > 0:
                    self.close()
                    raise InputError(f"{path}: holds something already; choose another name, or delete it")
            except OSError as error:
                raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
            threading.Thread(target=self._sync, daemon=True).start()

    def write(self, kind: str, at: float, /, **values: object) -> None:
        """Add a line of a kind, at a time of the session [s].

        If the disk is full, the incomplete line is removed and the record ends; the session goes on.
        """
        if self._file is None:
            return

        line = (json.dumps({"time": round(at, 6), "kind": kind, **values}) + "\n").encode()
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
        self._written.set()

    def _sync(self) -> None:
        """Bring what was written to the disk, again and again, without holding up the session."""
        while (file := self._file) is not None:
            if self._written.wait(SYNC_SECONDS):
                self._written.clear()
                with suppress(OSError, ValueError):  # the record may have been closed meanwhile
                    os.fsync(file.fileno())
                time.sleep(SYNC_SECONDS)


def read_record(path: str | os.PathLike[str]) -> Iterator[dict[str, Any]]:
    """Yield the entries of a record in their order; an incomplete last line is left out.

    Raises:
        InputError: If the file cannot be read, or a line is not that of a record.
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


def beside(record: Path) -> Path:
    """Return the file of the pictures of a record."""
    return record.with_name(record.name + SUFFIX)


class PictureRecord(GrowingFile):
    """A record of pictures, which is written picture by picture."""

    def __init__(self, record: Record, path: Path) -> None:
        """Create the file of the pictures.

        Args:
            record: Record of the session, which gets a line for each picture.
            path: File of that record.

        Raises:
            InputError: If the file beside it cannot be written, or exists already.
        """
        self._record = record
        self._path = beside(path)
        self._last: NDArray[np.uint8] | None = None
        try:
            self._file = open(self._path, "xb")  # noqa: SIM115 - open as long as the session
        except FileExistsError:
            raise InputError(f"{self._path}: is there already; choose another --record, or delete it") from None
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written: {error.strerror or error}") from None

    def add(self, picture: NDArray[np.uint8], time: float) -> None:
        """Add a picture taken at a time [s], unless it is the same array as the last one."""
        if self._file is None or picture is self._last:
            return

        self._last = picture
        _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])

        begin = self._file.tell()
        try:
            self._file.write(bytes(data))
            self._file.flush()
        except OSError as error:
            self.fault = f"{self._path}: the pictures end here: {error.strerror or error}; the session goes on"
            self.close()
            return
        self._record.write("picture", time, at=begin, size=len(data))


class RecordedPictures:
    """The pictures of a record, read by position and size."""

    def __init__(self, path: Path) -> None:
        """Open the file.

        Raises:
            InputError: If it cannot be read.
        """
        self._path = path
        try:
            self._file = open(path, "rb")  # noqa: SIM115 - open as long as the session
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None

    def at(self, begin: int, size: int, like: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
        """Return a picture.

        Args:
            begin: Position of its first byte in the file.
            size: Number of bytes.
            like: A picture of the expected shape, (height, width, 3).

        Returns:
            None if there is no such picture, for example because the file was cut off.
        """
        self._file.seek(begin)
        data = np.frombuffer(self._file.read(size), dtype=np.uint8)
        found = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) == size > 0 else None
        return None if found is None or found.shape != like.shape else np.asarray(found, dtype=np.uint8)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
