"""The process in which runs take place: it reads pickled jobs, and writes a pickled record for each.

Planners in C++ may crash, hang or exhaust the memory, so this process is expendable. A hang is ended by an alarm of the
operating system, which depends neither on Python, whose lock may never be released, nor on the parent, which may have
ended.
"""

from __future__ import annotations

import os
import pickle
import resource
import signal
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from rrtik_ompl.many.guard import PARCEL

BUILDING = 600.0  # [s]; time limit for building a problem
MEGABYTE = 2**20


def main() -> None:
    """Read jobs and write their records until the input ends."""
    with _answers() as answers:
        from rrtik_ompl.kernels import warm_up

        warm_up(lambda _: None)
        parcel = None
        while True:
            try:
                job = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            parcel = parcel if job.get(PARCEL) is None else job[PARCEL]
            pickle.dump(guarded({**job, PARCEL: parcel}), answers)
            answers.flush()


def guarded(job: Mapping[str, Any]) -> dict[str, Any]:
    """Run one job under its limits of time and memory.

    The function ``prepared`` of the job's module takes the job, does what these limits do not count, and returns a
    function that runs the job and returns its record.
    """
    _alarm(BUILDING)
    run = import_module(job["module"]).prepared(job)
    _alarm(job["patience"])

    limits = resource.getrlimit(resource.RLIMIT_DATA)
    held = _data_bytes()

    try:
        if held is not None:
            resource.setrlimit(resource.RLIMIT_DATA, (held + int(job["memory_mb"] * MEGABYTE), limits[1]))
        record: dict[str, Any] = run()
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, limits)
        _alarm(0.0)

    return record | {"memory_mb": _resident()}


def _answers() -> BinaryIO:
    """Return a stream to the parent; redirect everything that is printed to the file of errors."""
    stream = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return stream


def _alarm(seconds: float) -> None:
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # the default action ends the process
    signal.setitimer(signal.ITIMER_REAL, seconds)


def _data_bytes() -> int | None:
    """Return the memory that counts towards the data limit [bytes]; None if the system does not report it (macOS)."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData:")), None)


def _resident() -> float:
    """Return the resident memory of the process [MB]; its maximum if the system does not report the present value."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / MEGABYTE
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE


if __name__ == "__main__":
    main()
