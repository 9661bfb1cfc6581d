"""Ctrl-C while a library works that catches it and goes on; signals that end the process before it has tidied up."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType

ENDING = ("SIGTERM", "SIGHUP")  # of a supervisor, and of a terminal that is closed


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C end the block with KeyboardInterrupt, at its end at the latest, whatever is caught inside.

    trimesh, for one, takes whatever is raised for a feature that is not there, and goes on.
    """
    usual = signal.getsignal(signal.SIGINT)
    if not callable(usual) or current_thread() is not main_thread():
        yield
        return

    came = False

    def noted(number: int, frame: FrameType | None) -> None:
        nonlocal came
        came = True
        usual(number, frame)

    signal.signal(signal.SIGINT, noted)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
        if came:
            raise KeyboardInterrupt


@contextmanager
def tidied_before_the_end() -> Iterator[None]:
    """Let a signal that ends the process leave the block as an exception does, with all that is to be tidied up.

    The process then ends by the signal all the same. Handlers of the program's own stay.
    """
    if current_thread() is not main_thread():
        yield
        return

    came: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        came.append(number)
        raise SystemExit

    ending = [signal.Signals[name] for name in ENDING if name in signal.Signals.__members__]
    ours = [number for number in ending if signal.getsignal(number) is signal.SIG_DFL]
    for number in ours:
        signal.signal(number, leave)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)
        for ending_signal in came:
            signal.raise_signal(ending_signal)
