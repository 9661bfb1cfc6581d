"""The command `rrtik` before anything else is loaded, so that Ctrl-C ends it with one line from the first moment on."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from contextlib import suppress

from rrtik_ompl.cli import INTERRUPTED


def main() -> None:
    """Run the command line and exit with its code."""
    # The threads that numpy starts for its matrices: ours are small, and starting them takes as long as all of numpy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.default_int_handler:  # not in a shell's background, where Ctrl-C is ignored
        signal.signal(signal.SIGINT, _leave)

    from rrtik_ompl.cli.app import run

    signal.signal(signal.SIGINT, usual)
    code = run()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # everything is written and said
    _end(code, everything_else=code != INTERRUPTED)


def _end(code: int, *, everything_else: bool) -> None:
    """End before all libraries are taken down, a tenth of a second for which nobody who waits has any use.

    What was to be done at the end (``everything_else``) is done, but whoever interrupts does not wait for it.
    """
    if everything_else:
        watched = sys.gettrace() is not None or sys.getprofile() is not None  # by who wants to see the end
        if watched or any(not t.daemon and t is not threading.main_thread() for t in threading.enumerate()):
            sys.exit(code)
        atexit._run_exitfuncs()  # noqa: SLF001 - as the interpreter would at its end

    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # the reader may have gone
            stream.flush()
    os._exit(code)


def _leave(*_: object) -> None:
    """End at once: nothing has been done, and half-loaded libraries turn an exception into something else."""
    os.write(2, b"rrtik: interrupted; no file is half-written\n")
    os._exit(INTERRUPTED)
