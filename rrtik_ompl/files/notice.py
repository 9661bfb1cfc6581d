"""Who is told what takes a while and happens once per machine: kernels compiled, meshes covered."""

from __future__ import annotations

from collections.abc import Callable

COMPILING = "compiling kernels for this processor, once per machine: up to some minutes"
COVERING = "covering the meshes of a robot that is new to this machine, once: a second or so for each"


def _silence(message: str) -> None:
    del message


listener: Callable[[str], None] = _silence  # may be replaced; is told each thing at most once in a process
_told: set[str] = set()


def tell_once(message: str) -> None:
    """Report what is being made."""
    if message not in _told:
        _told.add(message)
        listener(message)
