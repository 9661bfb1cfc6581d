"""Work that is spread over threads: kernels run side by side, for they let other threads of Python go on."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import TypeVar

from rrtik_ompl.base.arrays import whole_number

Given = TypeVar("Given")
Made = TypeVar("Made")
MOST_THREADS = 1024


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(work: Callable[[Given], Made], given: Iterable[Given], threads: int | None = None) -> list[Made]:
    """What some work makes of each thing, in their order.

    Args:
        work: Called in several threads at once.
        given: The things.
        threads: How many at a time; as many as there are cores if None.

    Raises:
        InputError: If that is no whole number from 1 to 1024.
        Exception: The first that the work raised; nothing else is begun then.

    Example:
        >>> in_threads(abs, [1, -2, -3], threads=2)
        [1, 2, 3]
    """
    count = cores() if threads is None else min(whole_number(threads, "threads", 1), MOST_THREADS)
    if count == 1:
        return [work(each) for each in given]
    from concurrent.futures import ThreadPoolExecutor  # it loads more than a first plan needs

    with ThreadPoolExecutor(count) as pool:
        asked = [pool.submit(work, each) for each in given]
        try:
            return [each.result() for each in asked]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
