"""Entry point of the command `rrtik`, loaded before anything else, so that Ctrl-C ends it with one line at any time."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from contextlib import suppress

from rrtik_ompl.base.floors import DependencyError, fitting_packages
from rrtik_ompl.cli import BAD_INPUT, INTERRUPTED


def main() -> None:
    """Run the command line and exit with its code."""
    # Our matrices are small, and starting numpy's threads takes as long as importing the rest of numpy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.default_int_handler:  # in a shell's background Ctrl-C is ignored, and stays so
        signal.signal(signal.SIGINT, _leave)

    try:
        with fitting_packages():  # typer, too
            from rrtik_ompl.cli.app import run
    except DependencyError as error:
        print(f"rrtik: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT)

    signal.signal(signal.SIGINT, usual)
    code = run()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # all output is complete
    _end(code, everything_else=code != INTERRUPTED)


def _end(code: int, *, everything_else: bool) -> None:
    """Exit without the shutdown of all libraries, which would take a tenth of a second.

    Functions registered by ``atexit`` are called first if ``everything_else`` is true; an interrupted command skips
    them.
    """
    if everything_else:
        # A debugger or profiler needs the normal exit.
        watched = sys.gettrace() is not None or sys.getprofile() is not None
        if watched or any(not t.daemon and t is not threading.main_thread() for t in threading.enumerate()):
            sys.exit(code)
        atexit._run_exitfuncs()  # noqa: SLF001 - as the interpreter would at its end

    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # the reader may have gone
            stream.flush()
    os._exit(code)


def _leave(*_: object) -> None:
    """Exit at once: nothing has been done yet, and half-loaded libraries would turn an exception into another error."""
    os.write(2, b"rrtik: interrupted; no file is half-written\n")
    os._exit(INTERRUPTED)
