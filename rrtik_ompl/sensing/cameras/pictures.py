"""Sources of pictures: an image file, a folder of images, a video file, or a camera device."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import whole_number
from rrtik_ompl.base.errors import InputError, at_most
from rrtik_ompl.files.text import file_name, write_bytes

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
VIDEO_ENDINGS = (".mp4", ".avi", ".webm", ".mkv", ".mov", ".m4v")
MOST_CAMERAS = 1_000_000  # limit of a device number; OpenCV adds hundreds to it
LOG_ERRORS = 2  # OpenCV's level of errors: its warnings are left out
MAX_FILE_BYTES = 512 * 1024 * 1024


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One picture.

    Attributes:
        pixels: Blue, green, red, shape (height, width, 3).
        name: Where it comes from.
        time: When it was taken [s].
        others: Pictures that the other cameras of a rig took at the same time.
        noisy: Whether it has sensor noise. Computed pictures of a scene at rest are identical, and only their times
            differ.
    """

    pixels: NDArray[np.uint8]
    name: str
    time: float
    others: tuple[Picture, ...] = ()
    noisy: bool = True

    def repeats(self, before: Picture) -> bool:
        """Check whether a picture repeats an earlier one; pictures of a live camera always differ by their noise."""
        if not self.noisy and self.time != before.time:
            return False
        return np.array_equal(self.pixels, before.pixels)


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.uint8]:
    """Read an image file as blue, green, red, shape (height, width, 3).

    Raises:
        InputError: If the file is missing or not an image.
    """
    file = file_name(path)
    try:
        size = file.stat().st_size
        if not os.path.isfile(file) or size > MAX_FILE_BYTES:
            raise InputError(f"{path}: is not an image file of at most 512 MiB")
        data = np.frombuffer(file.read_bytes(), dtype=np.uint8)
    except (OSError, ValueError) as error:  # an invalid file name is a ValueError
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: {why.lower()}; check the name") from None

    picture = None
    if size:
        with suppress(cv2.error):  # a header may claim a size larger than memory
            picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if picture is None:
        raise InputError(f"{path}: is not an image that can be read; use {', '.join(IMAGE_ENDINGS)}")
    return np.asarray(picture, dtype=np.uint8)


def write_picture(picture: NDArray[np.uint8], path: Path) -> None:
    """Write an image file in the format of its file name extension.

    Raises:
        InputError: If it cannot be written.
    """
    if path.suffix.lower() not in IMAGE_ENDINGS:
        raise InputError(f"{path}: an image ends in {', '.join(IMAGE_ENDINGS)}")
    write_bytes(path, cv2.imencode(path.suffix, picture)[1].tobytes())


def pictures_from(source: str | os.PathLike[str] | int) -> Iterator[Picture]:
    """Yield the pictures of an image file, of all images in a folder (by name), of a video file, or of a camera.

    Args:
        source: A path, or the number of a camera device (also as text: "0").

    Raises:
        InputError: If nothing can be read. A lost camera raises `CameraLostError`.
    """
    if isinstance(source, int) or str(source).isdecimal():
        number = source if isinstance(source, int) else int(str(source))
        yield from _device(whole_number(number, "number of a camera"))
        return

    path = file_name(source)
    if os.path.isdir(path):
        files = sorted(f for f in path.iterdir() if f.suffix.lower() in IMAGE_ENDINGS)
        if not files:
            raise InputError(f"{source}: no images in this folder; they end in {', '.join(IMAGE_ENDINGS)}")
        yield from (Picture(read_picture(file), file.name, float(k)) for k, file in enumerate(files))
    elif path.suffix.lower() in VIDEO_ENDINGS:
        yield from _video(path)
    else:
        yield Picture(read_picture(path), path.name, 0.0)


class CameraLostError(InputError):
    """A camera that delivered pictures before no longer does."""


def _video(path: Path) -> Iterator[Picture]:
    """Yield the pictures of a video file, with times by its frame rate."""
    if not os.path.isfile(path):
        raise InputError(f"{path}: no such file; check the name")
    with _opened(str(path)) as capture:
        if not capture.isOpened():
            raise InputError(f"{path}: is not a video that can be read")

        rate = capture.get(cv2.CAP_PROP_FPS) or 30.0
        count = 0
        while (frame := _next(capture)) is not None:
            yield Picture(frame, f"{path.name}[{count}]", count / rate)
            count += 1
        if count == 0:
            raise InputError(f"{path}: no picture in this video can be read")


def _device(number: int) -> Iterator[Picture]:
    at_most(number, MOST_CAMERAS, "number of a camera")
    with _opened(number) as capture:
        if not capture.isOpened():
            raise InputError(f"camera {number} cannot be opened; is it plugged in, free, and yours to read?")

        begin = time.monotonic()
        while True:
            frame = _next(capture)
            if frame is None:
                raise CameraLostError(f"camera {number} gives no more pictures; is it still plugged in?")
            yield Picture(frame, f"camera {number}", time.monotonic() - begin)


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress OpenCV's warnings, because our own error says in one line why something cannot be opened."""
    levels: Any = getattr(cv2.utils, "logging", cv2)  # some wheels of OpenCV 4.10 have it elsewhere
    before = levels.setLogLevel(LOG_ERRORS)
    try:
        yield
    finally:
        levels.setLogLevel(before)


@contextmanager
def _opened(source: str | int) -> Iterator[cv2.VideoCapture]:
    with quiet():
        capture = cv2.VideoCapture(source)
    try:
        yield capture
    finally:
        capture.release()


def _next(capture: cv2.VideoCapture) -> NDArray[np.uint8] | None:
    good, frame = capture.read()
    return np.asarray(frame, dtype=np.uint8) if good else None
