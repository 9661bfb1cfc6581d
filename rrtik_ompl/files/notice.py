"""Reports of slow work: what happens once per machine, as compiling kernels, and what lacks them."""

from __future__ import annotations

import warnings
from collections.abc import Callable

COMPILING = "compiling kernels for this processor, once per machine: up to some minutes"
COVERING = "covering the meshes of a robot that is new to this machine, once: about a second"


def _silence(message: str) -> None:
    del message


listener: Callable[[str], None] = _silence  # may be replaced; receives each message at most once per process
_told: set[str] = set()


def tell_once(message: str) -> None:
    """Report a message to the listener, unless this process has reported it already."""
    if message not in _told:
        _told.add(message)
        listener(message)


def warn_of_minutes(what: str) -> None:
    """Warn before something takes minutes because there are no kernels."""
    warnings.warn(f"there are no kernels: {what} take minutes in numpy; Ctrl-C ends them", RuntimeWarning, stacklevel=3)
