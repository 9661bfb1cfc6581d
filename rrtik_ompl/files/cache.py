"""Files in the user's cache folder. Nothing here ever fails: no cache, no gain.

Files appear whole (written aside, then renamed), so processes may share the folder.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO

FOLDER_VARIABLE = "RRTIK_CACHE"  # another folder; empty: no cache


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


def write_whole(file: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let ``write`` fill a file that appears all at once or, where it cannot be written, not at all."""
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(dir=file.parent, prefix=".writing-")
        try:
            with os.fdopen(handle, "wb") as stream:
                write(stream)
            os.replace(aside, file)
        except OSError:
            with contextlib.suppress(OSError):
                os.unlink(aside)
