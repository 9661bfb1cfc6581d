"""Work that is spread over threads: kernels run side by side, for they let other threads of Python go on."""

from __future__ import annotations

import ctypes
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import TypeVar

from rrtik_ompl.base.arrays import whole_number

Given = TypeVar("Given")
Made = TypeVar("Made")
MOST_THREADS = 1024
PATIENCE = 0.03  # [s] that Ctrl-C waits for threads, whose kernels end sooner


class Halted(BaseException):
    """Ends the work of a thread whose caller was interrupted."""


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(work: Callable[[Given], Made], given: Iterable[Given], threads: int | None = None) -> list[Made]:
    """What some work makes of each thing, in their order.

    The calling thread takes part. Ctrl-C there ends the work of all threads as it would end it in one.

    Args:
        work: Called in several threads at once.
        given: The things.
        threads: How many at a time; as many as there are cores if None.

    Raises:
        InputError: If that is no whole number from 1 to 1024.
        Exception: That of the first thing for which the work raised; nothing else is begun then.

    Example:
        >>> in_threads(abs, [1, -2, -3], threads=2)
        [1, 2, 3]
    """
    count = cores() if threads is None else min(whole_number(threads, "threads", 1), MOST_THREADS)
    things = list(given)
    if min(count, len(things)) < 2:
        return [work(each) for each in things]

    left = deque(enumerate(things))
    made: dict[int, Made] = {}
    faults: dict[int, BaseException] = {}

    def take_part() -> None:
        while left and not faults:
            try:
                number, each = left.popleft()
            except IndexError:  # another thread was quicker
                return
            try:
                made[number] = work(each)
            except BaseException as error:
                faults[number] = error
                if not isinstance(error, Exception):
                    raise

    def help_out() -> None:
        with suppress(BaseException):  # which is among the faults, or Halted
            take_part()

    helpers = [threading.Thread(target=help_out, daemon=True) for _ in range(min(count, len(things)) - 1)]
    try:
        for helper in helpers:
            helper.start()
        take_part()
        for helper in helpers:
            helper.join()
    except BaseException:
        _halt(helpers)
        raise
    if faults:
        raise faults[min(faults)]
    return [made[number] for number in range(len(things))]


def _halt(helpers: list[threading.Thread]) -> None:
    """End what threads do, as Ctrl-C ends it in the main thread, and wait for them a moment."""
    for helper in helpers:
        if helper.ident is not None and helper.is_alive():
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(helper.ident), ctypes.py_object(Halted))
    until = time.monotonic() + PATIENCE
    for helper in helpers:
        if helper.is_alive():
            helper.join(max(until - time.monotonic(), 0.0))
