"""The process in which runs take place: one job a line comes in, one record a line goes out.

Planners of C++ may crash, hang or eat the memory, so this process is one that may be lost. The system itself ends a
hang: its alarm needs neither Python, whose lock may be held for ever, nor a parent, who may be gone.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
from pathlib import Path
from typing import Any, TextIO

from rrtik_ompl.benchmark.run import execute, prepare

BUILDING = 600.0  # [s] for building a problem
MEGABYTE = 2**20


def main() -> None:
    """Answer jobs until there are no more."""
    with _answers() as answers:
        from rrtik_ompl.kernels import warm_up

        warm_up(lambda _: None)
        for line in sys.stdin:
            print(json.dumps(guarded(json.loads(line))), file=answers, flush=True)


def guarded(job: dict[str, Any]) -> dict[str, Any]:
    """Do one job under its limits of time and memory."""
    _alarm(BUILDING)
    prepare(job)
    _alarm(job["patience"])

    limits = resource.getrlimit(resource.RLIMIT_DATA)
    held = _data_bytes()

    try:
        if held is not None:
            resource.setrlimit(resource.RLIMIT_DATA, (held + int(job["memory_mb"] * MEGABYTE), limits[1]))
        record = execute(job)
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, limits)
        _alarm(0.0)

    return record | {"memory_mb": _resident()}


def _answers() -> TextIO:
    """A stream of our own to the parent; what anybody prints goes to the file of errors instead."""
    stream = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return stream


def _alarm(seconds: float) -> None:
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # which ends the process
    signal.setitimer(signal.ITIMER_REAL, seconds)


def _data_bytes() -> int | None:
    """What the system counts against the limit of data by now; None where it does not say (macOS)."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData:")), None)


def _resident() -> float:
    """Memory of the process [MB]: now, or its most where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / MEGABYTE
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE


if __name__ == "__main__":
    main()
