"""Run jobs in expendable processes: a crash, a hang or too much memory becomes the record of a failed run."""

from __future__ import annotations

import inspect
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.description.catalog import is_auto
from rrtik_ompl.ompl_bridge.ownership import PLAIN_HINT, is_plain
from rrtik_ompl.ompl_bridge.planner_names import find_planner, label_of

COMMAND = (sys.executable, "-m", "rrtik_ompl.many.child")
OUT_OF_MEMORY, CRASH, HANG = "out of memory", "crash", "hang"  # statuses of lost runs
# Key of what is large in a job: a process gets it only once as long as consecutive jobs have the same object.
PARCEL = "parcel"
MEMORY_WORDS = ("bad_alloc", "MemoryError", "Cannot allocate memory")
TAIL = 4000  # bytes of a lost process's output that are examined
LINES_OF_CODE = re.compile(r'^  File "(.+)", line (\d+) in ', re.MULTILINE)


class Closed(RrtikError):
    """A run was requested after closing."""


class Guard:
    """A process that is started on demand, reused from run to run, and replaced when it is lost."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._sent: object = None  # the parcel that the process has
        self._closed = False

    def run(self, job: Mapping[str, Any]) -> dict[str, Any]:
        """Run a job and return its record, even if the process is lost.

        Raises:
            Closed: If the guard was closed.
        """
        process = self._started()
        self._forget_words()
        began = time.perf_counter()
        parcel = job.get(PARCEL)
        record = _asked(process, {**job, PARCEL: None if parcel is self._sent else parcel})

        if self._closed:
            raise Closed("the guard was closed")
        if record is None:
            return self._lost(process, job) | {"seconds": time.perf_counter() - began}

        self._sent = self._sent if parcel is None else parcel
        if record["status"] == OUT_OF_MEMORY:  # its state may be corrupt
            self._end(process)
        return record

    def close(self) -> None:
        """End the process, also in the middle of a run."""
        self._closed = True
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _started(self) -> subprocess.Popen[bytes]:
        """Return the process, started if there is none."""
        if self._closed:
            raise Closed("the guard was closed")
        if self._process is None:
            self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - kept open
            self._sent = None
            self._process = subprocess.Popen(
                COMMAND,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                start_new_session=True,  # Ctrl-C must reach only the parent, which writes the records
            )
        return self._process

    def _lost(self, process: subprocess.Popen[bytes], job: Mapping[str, Any]) -> dict[str, Any]:
        """Return the record of a job whose process was lost, with the cause by exit code and output."""
        code = self._end(process)
        said = self._last_words()

        if code == -signal.SIGALRM:
            return {"status": HANG, "reason": f"killed after {job['patience']:g} s"}
        if any(word in said for word in MEMORY_WORDS):
            return {"status": OUT_OF_MEMORY, "reason": f"more than {job['memory_mb']:g} MB"}

        ended = f"exit code {code}" if code >= 0 else signal.Signals(-code).name
        if code < 0 and (why := _why_plain_planners_crash(job["planner"], said)):
            return {"status": CRASH, "reason": f"{ended}: {why}"}

        last = next((line.strip() for line in reversed(said.splitlines()) if line.strip()), "")
        return {"status": CRASH, "reason": f"{ended}: {last}".rstrip(": ")}

    def _end(self, process: subprocess.Popen[bytes]) -> int:
        """Kill the process, which may have closed only its output, and return its exit code."""
        self._process = None
        process.kill()
        return process.wait()

    def _forget_words(self) -> None:
        """Empty the file of the output of earlier runs; the process shares its file position."""
        if self._errors is not None:
            self._errors.seek(0)
            self._errors.truncate()

    def _last_words(self) -> str:
        if self._errors is None:
            return ""
        with self._errors as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - TAIL))
            return file.read().decode(errors="replace")


def out_of_memory(job: Mapping[str, Any], error: MemoryError) -> dict[str, Any]:
    """Return the record of a job that has met its limit of memory."""
    return {"status": OUT_OF_MEMORY, "reason": f"more than {job['memory_mb']:g} MB: {error}".rstrip(": ")}


def _asked(process: subprocess.Popen[bytes], job: Mapping[str, Any]) -> dict[str, Any] | None:
    """Send a job to a process, and return its record; None if the process is lost."""
    if process.stdin is None or process.stdout is None:
        return None
    try:
        pickle.dump(job, process.stdin)
        process.stdin.flush()
        record: dict[str, Any] = pickle.load(process.stdout)
    except (OSError, EOFError, pickle.UnpicklingError):
        return None
    return record


def _why_plain_planners_crash(name: str | None, said: str) -> str:
    """Return the usual cause of a crash in a planner derived from OMPL's own class, in one line; "" for other planners.

    Args:
        name: Name of the planner.
        said: Output of the process before it was lost, perhaps with its stack, by :mod:`faulthandler`.
    """
    if name is None or is_auto(name):
        return ""

    try:
        planner = find_planner(name)
    except RrtikError:
        return ""

    if not is_plain(planner):
        return ""

    places = [(Path(file), line) for file, line in LINES_OF_CODE.findall(said)]  # innermost frame first
    own = next((place for place in places if place[0] == Path(inspect.getfile(planner))), None)
    where = "" if own is None else f" ({own[0].name}, line {own[1]})"
    return f"{label_of(name)} is derived from ompl.base.Planner{where}; {PLAIN_HINT}"


class Guards:
    """One guard for each calling thread."""

    def __init__(self) -> None:
        self._mine = threading.local()
        self._all: list[Guard] = []
        self._lock = threading.Lock()
        self._closed = False

    def run(self, job: Mapping[str, Any]) -> dict[str, Any]:
        """See :meth:`Guard.run`."""
        if not hasattr(self._mine, "guard"):
            with self._lock:
                if self._closed:
                    raise Closed("the guards were closed")
                self._mine.guard = Guard()
                self._all.append(self._mine.guard)

        record: dict[str, Any] = self._mine.guard.run(job)
        return record

    def close(self) -> None:
        """End all processes."""
        with self._lock:
            self._closed = True
        for guard in self._all:
            guard.close()
