"""The pictures of a recorded session: JPEGs one after the other in a file beside the record, which says when each was.

Such a stream (Motion JPEG) is read by video players, needs no codec, and whatever ends the session, the pictures before
it are there.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.records.record import GrowingFile, Record

SUFFIX = ".mjpeg"
QUALITY = 85


def beside(record: Path) -> Path:
    """The file of the pictures of a record."""
    return record.with_name(record.name + SUFFIX)


class PictureRecord(GrowingFile):
    """Grows picture by picture."""

    def __init__(self, record: Record, path: Path) -> None:
        """Begin.

        Args:
            record: Of the session; it gets a line for each picture.
            path: Of the record.

        Raises:
            InputError: If the file beside it cannot be written, or is there already.
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
        """Add a picture of a time [s], unless it is the same as the last one."""
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
    """Pictures of a record, by place and size."""

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
        """A picture of the same shape as another; None where there is none, as where the file was cut off."""
        self._file.seek(begin)
        data = np.frombuffer(self._file.read(size), dtype=np.uint8)
        found = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) == size > 0 else None
        return None if found is None or found.shape != like.shape else np.asarray(found, dtype=np.uint8)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
