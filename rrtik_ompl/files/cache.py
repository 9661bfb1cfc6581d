"""Files in the user's cache folder. Failures are ignored: without a cache everything is computed anew.

Files are written under a temporary name and then renamed, so several processes may share the folder.
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from rrtik_ompl.files.notice import tell_once

FOLDER_VARIABLE = "RRTIK_CACHE"  # environment variable that names another folder, or switches the cache off if empty

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_folder(kind: str) -> Path | None:
    """Return the folder of cached files of a kind, or None if the cache is off or there is no home folder."""
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
    """Check whether a file and all folders above it belong to the user or root, and nobody else can write to them.

    Code that is executed, and data that decide what counts as free, must not come from other files: whoever can write
    to a folder can replace the folders and files in it. Above the file's own folder, a folder like ``/tmp`` is
    accepted, where everybody can write but nobody can move the files of others (sticky bit). The result is False if the
    file does not exist. A refusal is reported once.

    Args:
        file: The file.
        among: Permission bits, none of which may be set.
    """
    # Check the path as it is named and as it is with all links resolved.
    named = Path(os.path.abspath(file))
    try:
        places = {named, *named.parents, *(real := named.resolve(strict=True)).parents, real}
        states = {place: os.lstat(place) for place in places}
    except (OSError, RuntimeError):  # a RuntimeError is raised for a loop of links
        return False

    if not hasattr(os, "geteuid"):  # Windows keeps a user's folders from others by itself
        return True

    trusted = {os.geteuid(), 0, states[Path(named.anchor)].st_uid}
    own = {named, named.parent, real, real.parent}
    for place, state in states.items():
        closed = stat.S_ISLNK(state.st_mode) or not state.st_mode & among  # the mode of a link has no effect
        sticky = place not in own and bool(state.st_mode & stat.S_ISVTX)
        if state.st_uid not in trusted or not (closed or sticky):
            tell_once(f"nothing is taken from {named.parent}, for others can write to {place}; chmod go-w closes it")
            return False
    return True


def write_whole(file: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file by calling ``write`` with a stream, so that it appears complete, or not at all if it cannot be."""
    with contextlib.suppress(OSError):
        _make_closed(file.parent)
        import tempfile  # few calls write, and it loads random numbers

        handle, aside = tempfile.mkstemp(dir=file.parent, prefix=".writing-")
        try:
            with os.fdopen(handle, "wb") as stream:
                write(stream)
            os.replace(aside, file)
        except BaseException:  # Ctrl-C too: nothing half written stays behind
            with contextlib.suppress(OSError):
                os.unlink(aside)
            raise


def _make_closed(folder: Path) -> None:
    """Create a folder and all missing ones above it, and let only the user write to them."""
    new = [place for place in folder.parents if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for place in {folder, *new}:
        mode = stat.S_IMODE(place.stat().st_mode)
        if mode & OTHERS_WRITE:  # set by the umask of many systems
            place.chmod(mode & ~OTHERS_WRITE)


@contextlib.contextmanager
def one_at_a_time(file: Path | None) -> Iterator[None]:
    """Hold a lock while a file is made, so that no other process makes it at the same time.

    After waiting, the caller should check whether the file exists by now. The lock is released when its process ends
    for any reason. Without file locks, as on Windows, or without a file, nothing is locked.
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
