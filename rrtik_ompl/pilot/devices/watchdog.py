"""A thread that stops the arm when another thread, which has to report at short intervals, falls silent."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

from rrtik_ompl.pilot.devices.arm import Arm

PATIENCE_SECONDS = 3.0  # longer than an arm or a camera takes to reconnect
LOOKS_PER_PATIENCE = 10  # checks within that time

Report = Callable[[], float]


class Watchdog:
    """Watch threads by the times of their last reports; use it as a context manager.

    Attributes:
        fault: Which threads are silent, and that the arm was stopped; "" while all report.
    """

    def __init__(
        self,
        arm: Arm,
        reports: Mapping[str, Report],
        *,
        patience: float = PATIENCE_SECONDS,
        tell: Callable[[str], object] | None = None,
    ) -> None:
        """Store what is watched.

        Args:
            arm: The arm, which is stopped once for each thread that falls silent.
            reports: By name, a function that returns the time of a thread's last report by ``time.monotonic()``; inf if
                the thread has ended normally.
            patience: How long a thread may be silent [s].
            tell: Called with each new fault, where no page shows it.
        """
        self.fault = ""
        self._arm = arm
        self._reports = dict(reports)
        self._patience = patience
        self._tell = tell
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Watchdog:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(timeout=5.0)

    def _watch(self) -> None:
        """Check the reports at regular intervals; stop the arm and publish a fault when a thread falls silent."""
        reported_silent: set[str] = set()
        begin = time.monotonic()
        while not self._ended.wait(self._patience / LOOKS_PER_PATIENCE):
            oldest = time.monotonic() - self._patience
            silent = {name for name, last in self._reports.items() if max(last(), begin) < oldest}
            if silent - reported_silent:
                with suppress(Exception):  # an error of the arm must not end the watch
                    self._arm.stop()

            message = f"{', '.join(sorted(silent))}: no report for {self._patience:g} s; the arm was stopped"
            self.fault = message if silent else ""  # one assignment, because another thread reads it
            if self._tell is not None and silent - reported_silent:
                with suppress(Exception):  # a closed terminal must not end the watch
                    self._tell(self.fault)
            reported_silent = silent
