"""Processor time and memory, of this process and of others."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")


def spent(call: Callable[[], Result]) -> tuple[float, Result]:
    """Processor time of this process that a call took [s], and what it returned."""
    begin = time.process_time()
    result = call()
    return time.process_time() - begin, result


def least(call: Callable[[], Result], rounds: int) -> tuple[float, Result]:
    """The least of several rounds [s], and what the last one returned."""
    runs = [spent(call) for _ in range(rounds)]
    return min(taken for taken, _ in runs), runs[-1][1]


def of_children(call: Callable[[], Result]) -> tuple[float, Result]:
    """Processor time of the processes that a call started and waited for [s], and what it returned."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = call()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, result


def of_process(number: int) -> float:
    """Processor time of a process so far, its children's left out, to the tick of the system's clock [s]."""
    after_the_name = Path(f"/proc/{number}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    user, system = after_the_name[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def resident() -> float:
    """Resident memory of this process [MB]."""
    words = Path("/proc/self/statm").read_text(encoding="ascii").split()
    return int(words[1]) * resource.getpagesize() / 1e6
