"""Who is told that kernels are being compiled: it takes seconds, and happens once per machine."""

from __future__ import annotations

from collections.abc import Callable


def _silence(message: str) -> None:
    del message


on_compile: Callable[[str], None] = _silence  # may be replaced; is called at most once in a process
_told = False


def announce_compiling() -> None:
    """Report that kernels are being compiled, once."""
    global _told
    if not _told:
        _told = True
        on_compile("compiling kernels for this processor, once per machine: 10 to 80 s")
