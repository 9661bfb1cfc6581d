"""A thread that stops the arm when one of those who have to report at short intervals does not."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

from rrtik_ompl.pilot.devices.arm import Arm

PATIENCE_SECONDS = 3.0  # longer than it takes to connect again to an arm or a camera
LOOKS_PER_PATIENCE = 10  # in that time

Report = Callable[[], float]


class Watchdog:
    """Watches threads by the times of their last reports; use it as a context manager.

    Attributes:
        fault: Who does not report, and that the arm was stopped; "" while all do.
    """

    def __init__(
        self,
        arm: Arm,
        reports: Mapping[str, Report],
        *,
        patience: float = PATIENCE_SECONDS,
        tell: Callable[[str], object] | None = None,
    ) -> None:
        """Take what is watched.

        Args:
            arm: It is stopped, once for each thread that falls silent.
            reports: By name, the time of the last report of each thread by ``time.monotonic()``; inf: it has ended in
                good order.
            patience: How long a thread may be silent [s].
            tell: Called with each new fault, for where no page shows it.
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
        reported_silent: set[str] = set()
        begin = time.monotonic()
        while not self._ended.wait(self._patience / LOOKS_PER_PATIENCE):
            oldest = time.monotonic() - self._patience
            silent = {name for name, last in self._reports.items() if max(last(), begin) < oldest}
            if silent - reported_silent:
                with suppress(Exception):  # whatever is wrong with the arm, the others are watched on
                    self._arm.stop()

            message = f"{', '.join(sorted(silent))}: no report for {self._patience:g} s; the arm was stopped"
            self.fault = message if silent else ""  # in one step: another thread reads it
            if self._tell is not None and silent - reported_silent:
                with suppress(Exception):  # a terminal that has gone must not end the watch
                    self._tell(self.fault)
            reported_silent = silent
