"""Files in the user's cache folder. Nothing here ever fails: no cache, no gain.

Files appear whole (written aside, then renamed), so processes may share the folder.
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO

FOLDER_VARIABLE = "RRTIK_CACHE"  # another folder; empty: no cache

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_folder(kind: str) -> Path | None:
    """The folder of cached files of a kind, or None if the cache is switched off or nobody's home is known."""
    named = os.environ.get(FOLDER_VARIABLE)
    if named is not None:
        return Path(named) / kind if named else None
    try:
        home = Path.home()
    except RuntimeError:
        return None
    default = home / "Library" / "Caches" if sys.platform == "darwin" else home / ".cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or default) / "rrtik-ompl" / kind


def nobody_else_s(file: Path, *, among: int = OTHERS_WRITE) -> bool:
    """Whether a file, and the folder that it lies in, belong to the user or root and nobody else can write to them.

    What is executed, or decides what is free, is taken from no other file. False if there is none.

    Args:
        file: The file.
        among: Bits of a mode, none of which may be set.
    """
    try:
        states = [os.stat(place) for place in (file, file.parent)]
    except OSError:
        return False
    if not hasattr(os, "geteuid"):  # Windows keeps a user's folders from others by itself
        return True
    return all(state.st_uid in (os.geteuid(), 0) and not state.st_mode & among for state in states)


def write_whole(file: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let ``write`` fill a file that appears all at once or, where it cannot be written, not at all."""
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        mode = stat.S_IMODE(file.parent.stat().st_mode)
        if mode & OTHERS_WRITE:  # by the umask of many systems
            file.parent.chmod(mode & ~OTHERS_WRITE)
        handle, aside = tempfile.mkstemp(dir=file.parent, prefix=".writing-")
        try:
            with os.fdopen(handle, "wb") as stream:
                write(stream)
            os.replace(aside, file)
        except OSError:
            with contextlib.suppress(OSError):
                os.unlink(aside)
