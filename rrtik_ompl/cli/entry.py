"""The command `rrtik` before anything else is loaded, so that Ctrl-C ends it with one line from the first moment on."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress


def main() -> None:
    """Run the command line and exit with its code."""
    # The threads that numpy starts for its matrices: ours are small, and starting them takes as long as all of numpy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.default_int_handler:  # not in a shell's background, where Ctrl-C is ignored
        signal.signal(signal.SIGINT, _leave)
    from rrtik_ompl.cli.app import INTERRUPTED, run

    signal.signal(signal.SIGINT, usual)
    code = run()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # everything is written and said
    if code == INTERRUPTED:  # whoever interrupts does not wait until all libraries are taken down
        with suppress(OSError):  # the reader may have gone
            sys.stdout.flush()
        os._exit(code)
    sys.exit(code)


def _leave(*_: object) -> None:
    """End at once: nothing has been done, and half-loaded libraries turn an exception into something else."""
    os.write(2, b"rrtik: interrupted; no file is half-written\n")
    os._exit(130)
