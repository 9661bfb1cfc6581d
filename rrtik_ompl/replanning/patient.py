"""Feeds that may hang, such as those of cameras: asked in a thread of their own, with a deadline for each answer."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from rrtik_ompl.base.errors import InputError

Answer = TypeVar("Answer")

PATIENCE_SECONDS = 30.0  # far more than any picture takes, on a busy machine too


class PatientFeed(Generic[Answer]):
    """A function of time that is made and called in one thread; use it as a context manager.

    Args:
        made: Makes the function; that may already wait for a first picture.
        patience: How long an answer may take [s], by the wall clock.
        what: Its name, for messages.
    """

    def __init__(self, made: Callable[[], Callable[[float], Answer]], patience: float, what: str) -> None:
        self._made = made
        self._patience = patience
        self._what = what
        self._times: queue.SimpleQueue[float | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[tuple[Answer | None, BaseException | None]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._answer, daemon=True)

    def __enter__(self) -> PatientFeed[Answer]:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._times.put(None)

    def __call__(self, time: float) -> Answer:
        """The answer for a time [s]; what the function raises is raised here.

        Raises:
            InputError: If there is no answer in time; the thread is given up then.
        """
        self._times.put(time)
        try:
            answer, error = self._answers.get(timeout=self._patience)
        except queue.Empty:
            late = f"no answer for {time:g} s within {self._patience:g} s, and the run was ended"
            raise InputError(f"{self._what}: {late}; is its source still there? feed_patience allows more") from None

        if error is not None:
            raise error
        return answer  # type: ignore[return-value]

    def _answer(self) -> None:
        feed: Callable[[float], Answer] | None = None
        while (time := self._times.get()) is not None:
            try:
                feed = self._made() if feed is None else feed
                self._answers.put((feed(time), None))
            except BaseException as error:
                self._answers.put((None, error))
