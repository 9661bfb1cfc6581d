"""Read pictures from a camera in a thread, so that nothing waits if the camera is slow, stops, or comes back."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.sensing.cameras.pictures import CameraLostError, Picture

RETRY_SECONDS = 2.0  # [s]; pause before a lost camera is opened again
ENDED = "no more pictures: the last one stays"


class PictureSource(Protocol):
    """A source of pictures, one at a time."""

    def latest(self) -> Picture | None:
        """Return the newest picture; None if there is none since the last call.

        Raises:
            CameraLostError: While there is no camera.
        """

    def close(self) -> None:
        """Release the camera."""


class Feed:
    """Hold the newest picture of a camera, a video or a folder; older pictures are dropped.

    Attributes:
        reported: Time of the last sign of life of its thread, by ``time.monotonic()``; inf if the thread may be silent:
            with recorded pictures, and after the last one.
    """

    def __init__(self, open_pictures: Callable[[], Iterator[Picture]], *, paced: bool = False) -> None:
        """Start the thread that reads.

        Args:
            open_pictures: Opens the source; called again after the camera was lost.
            paced: Whether the pictures are recorded: they are delivered at the times at which they were taken, and the
                feed ends with the last one.

        Raises:
            InputError: If not even the first picture can be read.
        """
        self._open = open_pictures
        self._paced = paced

        pictures = open_pictures()
        self._newest: Picture | None = next(pictures, None)
        self._lost = ""
        self.reported = np.inf if paced else time.monotonic()

        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, args=(pictures,), daemon=True)
        self._thread.start()

    def latest(self) -> Picture | None:
        """Return the newest picture; None if there is none since the last call.

        Raises:
            CameraLostError: While there is no camera.
        """
        with self._lock:
            picture = self._newest
            self._newest = None
            if picture is None and self._lost:
                raise CameraLostError(self._lost)
        return picture

    def close(self) -> None:
        """Release the camera."""
        self._ended.set()
        self._thread.join(timeout=5.0)

    def _read(self, pictures: Iterator[Picture]) -> None:
        """Read pictures until the feed is closed; reopen a live camera whenever it is lost."""
        while not self._ended.is_set():
            self._lose(self._read_until_lost(pictures))
            self._report()
            if self._paced or self._ended.wait(RETRY_SECONDS):
                self.reported = np.inf
                return
            pictures = self._opened()

    def _read_until_lost(self, pictures: Iterator[Picture]) -> str:
        """Deliver pictures until there are no more, and return the reason."""
        begin = time.monotonic()
        try:
            for picture in pictures:
                if self._ended.wait(max(begin + picture.time - time.monotonic(), 0.0) if self._paced else 0.0):
                    break
                with self._lock:
                    self._newest = picture
                    self._lost = ""
                self._report()
        except RrtikError as error:
            return str(error)
        except Exception as error:  # libraries and drivers may raise anything; the thread must survive
            return f"the camera broke: {str(error) or type(error).__name__}"
        return ENDED

    def _opened(self) -> Iterator[Picture]:
        """Open the source again; errors appear only when the first picture is read."""
        yield from self._open()

    def _report(self) -> None:
        if not self._paced:
            self.reported = time.monotonic()

    def _lose(self, reason: str) -> None:
        with self._lock:
            self._lost = reason


class FurtherCamera(Protocol):
    """A camera that is shown in addition to the first one."""

    def picture(self) -> NDArray[np.uint8] | None:
        """Return the newest picture, shape (height, width, 3); None if there is none yet."""

    def close(self) -> None:
        """Release the camera."""


class LiveCamera:
    """A further camera whose pictures come from a camera or a film."""

    def __init__(self, source: PictureSource) -> None:
        self._source = source
        self._last: NDArray[np.uint8] | None = None

    def picture(self) -> NDArray[np.uint8] | None:
        """Return the newest picture, shape (height, width, 3), darkened while the camera is lost; None without one."""
        try:
            taken = self._source.latest()
        except RrtikError:
            return None if self._last is None else np.asarray(self._last // 3, dtype=np.uint8)

        if taken is not None:
            grey = taken.pixels.ndim == 2
            self._last = np.repeat(taken.pixels[..., None], 3, axis=2) if grey else taken.pixels
        return self._last

    def close(self) -> None:
        """Release the camera."""
        self._source.close()
