"""Files in the user's cache folder. Nothing here ever fails: no cache, no gain.

Files appear whole (written aside, then renamed), so processes may share the folder.
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from rrtik_ompl.files.notice import tell_once

FOLDER_VARIABLE = "RRTIK_CACHE"  # another folder; empty: no cache

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_folder(kind: str) -> Path | None:
    """Return the folder of cached files of a kind, or None if the cache is switched off or nobody's home is known."""
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
    """Check whether a file, and all folders above it, belong to the user or root and nobody else can write to them.

    What is executed, or decides what is free, is taken from no other file: whoever may write to a folder may put other
    folders and files in place of those in it. Above the file's own folder one like ``/tmp`` is good enough, where
    everybody may write but nobody may move what is another's (the sticky bit). False if there is no such file. What
    is refused is told once.

    Args:
        file: The file.
        among: Bits of a mode, none of which may be set.
    """
    named = Path(os.path.abspath(file))
    try:
        places = {named, *named.parents, *(real := named.resolve(strict=True)).parents, real}
        states = {place: os.lstat(place) for place in places}
    except (OSError, RuntimeError):  # a loop of links
        return False

    if not hasattr(os, "geteuid"):  # Windows keeps a user's folders from others by itself
        return True

    trusted = {os.geteuid(), 0, states[Path(named.anchor)].st_uid}
    own = {named, named.parent, real, real.parent}
    for place, state in states.items():
        closed = stat.S_ISLNK(state.st_mode) or not state.st_mode & among  # a link's own mode means nothing
        sticky = place not in own and bool(state.st_mode & stat.S_ISVTX)
        if state.st_uid not in trusted or not (closed or sticky):
            tell_once(f"nothing is taken from {named.parent}, for others can write to {place}; chmod go-w closes it")
            return False
    return True


def write_whole(file: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let ``write`` fill a file that appears all at once or, where it cannot be written, not at all."""
    with contextlib.suppress(OSError):
        _make_closed(file.parent)
        handle, aside = tempfile.mkstemp(dir=file.parent, prefix=".writing-")
        try:
            with os.fdopen(handle, "wb") as stream:
                write(stream)
            os.replace(aside, file)
        except OSError:
            with contextlib.suppress(OSError):
                os.unlink(aside)


def _make_closed(folder: Path) -> None:
    """Make a folder, and those above it that are missing, to which only the user can write."""
    new = [place for place in folder.parents if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for place in {folder, *new}:
        mode = stat.S_IMODE(place.stat().st_mode)
        if mode & OTHERS_WRITE:  # by the umask of many systems
            place.chmod(mode & ~OTHERS_WRITE)


@contextlib.contextmanager
def one_at_a_time(file: Path | None) -> Iterator[None]:
    """Wait until no other process makes ``file``, and let none begin meanwhile; none waits where there is no lock.

    Whoever has waited looks again whether the file is there. A process that ends in any way gives its lock back.
    """
    try:
        import fcntl  # not on Windows
    except ImportError:
        yield
        return

    lock = None
    with contextlib.suppress(OSError):
        if file is not None:
            _make_closed(file.parent)
            lock = os.open(file.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(lock, fcntl.LOCK_EX)

    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)
