"""A peer in a process of its own, which may be absent, crash or hang; each of these is an answer."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from bench.peers.task import Rows, Task

ROOT = Path(__file__).resolve().parent.parent.parent
PLACES = [ROOT, *(ROOT / name for name in ("planners", "robots", "bench"))]
PATIENCE = 300.0  # [s] beyond the time limit before a process is killed; Genesis prepares for minutes on a busy machine


@dataclass(frozen=True)
class Answer:
    """What a peer made of a task: a path or why there is none, processor time and time by the clock [s]."""

    rows: Rows | None
    cpu: float
    wall: float
    failed: str = ""


def answered(data: dict[str, Any]) -> Answer:
    """An answer as :mod:`bench.peers.serve` writes it."""
    if "failed" in data:
        return Answer(None, 0.0, 0.0, data["failed"])
    rows = None if data["path"] is None else np.array(data["path"])
    return Answer(rows, data["cpu"], data["wall"])


class Host:
    """A peer's process, started again when it was lost.

    Args:
        module: Of `bench.peers.libraries`, with further words for its command line.
        python: Interpreter in whose environment the peer is installed.

    Attributes:
        versions: Of the peer and what it stands on; empty if it is absent.
        absent: Why it is absent, or "".
    """

    def __init__(self, module: str, python: str) -> None:
        name, *words = module.split()
        self._command = [python, "-m", f"bench.peers.libraries.{name}", *words]
        self.versions, self.absent = "", ""
        try:
            self._start()
        except OSError as error:
            self.absent = f"{python}: {error.strerror}"

    def ask(self, task: Task, seed: int) -> Answer:
        """Have a task done."""
        if self._process.poll() is not None:
            self._start()
        clock = threading.Timer(task.seconds + PATIENCE, self._process.kill)
        clock.start()
        try:
            data = self._answer({"task": asdict(task), "seed": seed})
        finally:
            clock.cancel()
        return answered({"failed": f"lost: {self._last_words()}"} if data is None else data)

    def __enter__(self) -> Host:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if hasattr(self, "_process"):
            self._process.kill()
            self._process.wait()

    def _start(self) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - kept open
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": self._errors}
        places = os.pathsep.join(map(str, PLACES))
        self._process = subprocess.Popen(self._command, env={**os.environ, "PYTHONPATH": places}, text=True, **pipes)
        hello = self._answer(None)
        if hello is None:
            self.absent = self._last_words()
        else:
            self.versions = ", ".join((*hello["versions"], f"Python {hello['python']}"))

    def _answer(self, question: dict[str, Any] | None) -> dict[str, Any] | None:
        """The next line of the process; None if it is lost."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            if question is not None:
                self._process.stdin.write(json.dumps(question) + "\n")
                self._process.stdin.flush()
            line = self._process.stdout.readline()
        except OSError:
            return None
        found: dict[str, Any] | None = json.loads(line) if line.endswith("\n") else None
        return found

    def _last_words(self) -> str:
        code = self._process.wait()
        self._errors.seek(0)
        lines = [line.strip() for line in self._errors.read().decode(errors="replace").splitlines() if line.strip()]
        return lines[-1] if lines else f"exit code {code}"
