"""Expand xacro (macros of XML) by the package xacro, which is optional, in a process with limits."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import threading
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rrtik_ompl.base.arrays import positive
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.files.text import MAX_BYTES, read_text

CHILD = Path(__file__).with_name("xacro_child.py")
MORE = 'give xacro_limits={"seconds": .., "gigabytes": ..}'
_MACRO = re.compile(r"<xacro:\w")
MAX_CACHED = 32  # most expanded texts that are kept


@dataclass(frozen=True, slots=True)
class Expansion:
    """Settings for the expansion of macros.

    Attributes:
        trusted: Whether expressions are evaluated by xacro's own evaluator, which can run any code.
        seconds: Time limit of an expansion, for both processor and wall time [s].
        gigabytes: Memory limit of an expansion [1e9 bytes].
    """

    trusted: bool = False
    seconds: float = 10.0
    gigabytes: float = 1.0


@dataclass(frozen=True, slots=True)
class _CachedText:
    """An expanded text, and the files that it came from with their times and sizes."""

    text: str
    files: tuple[str, ...]
    stamps: tuple[tuple[int, int] | None, ...]


_expansion: ContextVar[Expansion] = ContextVar("expansion", default=Expansion())  # noqa: B039 - it is frozen
_lock = threading.Lock()
_cached_texts: OrderedDict[str, _CachedText] = OrderedDict()


@contextmanager
def expanding(*, trusted: bool = False, limits: Mapping[str, float] | None = None) -> Iterator[None]:
    """Set how macros are expanded inside the ``with`` block, in this thread.

    Only a caller can set this, never a file. Settings of an outer block apply inside as well.

    Args:
        trusted: Whether expressions are evaluated by xacro's own evaluator, and files anywhere may be read.
        limits: ``{"seconds": 60, "gigabytes": 4}`` or one of these.

    Raises:
        InputError: If a value is not valid.
    """
    outer = _expansion.get()
    if not isinstance(trusted, bool):
        raise InputError(f"trust_xacro: expected True or False, got {trusted!r}")

    limits_read = {"seconds": outer.seconds, "gigabytes": outer.gigabytes}
    for key, value in (limits or {}).items():
        if key not in limits_read:
            raise UnknownNameError("key", key, limits_read, where="xacro_limits")
        limits_read[key] = positive(value, f"xacro_limits: {key}")

    token = _expansion.set(Expansion(trusted or outer.trusted, **limits_read))
    try:
        yield
    finally:
        _expansion.reset(token)


def is_xacro(path: Path, text: str) -> bool:
    """Check whether a file contains macros: by its name, or by elements of xacro in it."""
    return path.suffix.lower() == ".xacro" or _MACRO.search(text) is not None


def robot_text(path: Path, packages: Iterable[Path] = (), arguments: Mapping[str, object] | None = None) -> str:
    """Return the text of a URDF or SRDF file, with its macros expanded if it has any.

    ``$(find NAME)`` is a folder of that name in ``packages``, or in a folder above the file, or what ROS finds. A file
    is expanded in a separate process, with the settings of `expanding`; the result is reused until a file changes.

    Args:
        path: The file.
        packages: Folders that contain packages, or are packages.
        arguments: Arguments of the macros, as for the command xacro: ``{"ur_type": "ur5e"}``.

    Raises:
        InputError: If the file cannot be read or expanded, contains an expression that is not on the list, reads a file
            elsewhere, takes too long or too much memory, or the package xacro is not installed.
    """
    text = read_text(path)
    if not is_xacro(path, text):
        if arguments:
            raise InputError(f"{path}: xacro_args are for macros, and there are none in it (.xacro); leave them out")
        return text

    argument_texts = {str(key): str(value) for key, value in (arguments or {}).items()}
    roots = [str(each) for each in packages]
    key = json.dumps([str(path), os.getcwd(), roots, argument_texts, dict(os.environ)], sort_keys=True)
    with _lock:
        cached = _cached_texts.get(key)
    if cached is not None and cached.stamps == _stamps(cached.files):
        return cached.text

    if find_spec("xacro") is None:
        stem = path.name.removesuffix(".xacro").removesuffix(".urdf")
        expanded = f"{stem}.urdf" if path.name.endswith(".xacro") else f"{stem}_expanded.urdf"
        raise InputError(
            f"{path}: holds macros, and the package xacro is not installed: pip install xacro, "
            f"or expand it by hand: xacro {path.name} > {expanded}"
        )

    answer = _expand_in_child(path, roots, argument_texts, _expansion.get())
    files = tuple(dict.fromkeys(answer["files"]))
    with _lock:
        _cached_texts[key] = _CachedText(answer["text"], files, _stamps(files))
        if len(_cached_texts) > MAX_CACHED:
            _cached_texts.popitem(last=False)

    return str(answer["text"])


def _expand_in_child(
    path: Path, packages: list[str], argument_texts: Mapping[str, str], expansion: Expansion
) -> dict[str, Any]:
    """Expand macros in a child process and return its answer: ``{"text": .., "files": [..]}``."""
    job = {
        "path": [*filter(None, sys.path), str(Path(__file__).parents[2])],
        "file": str(path),
        "packages": packages,
        "arguments": argument_texts,
        "trust": expansion.trusted,
        "seconds": expansion.seconds,
        "bytes": expansion.gigabytes * 1e9,
        "longest": MAX_BYTES,
        "more": MORE,
    }

    environment = os.environ | {"PYTHONHASHSEED": "0"}  # This makes the order of sets the same in each run.
    too_slow = f"{path}: xacro: takes more than {expansion.seconds:g} s; does a macro call itself? else {MORE}"

    import subprocess  # few descriptions are expanded

    try:
        process = subprocess.run(
            [sys.executable, str(CHILD)],
            input=json.dumps(job).encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=expansion.seconds,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise InputError(too_slow) from None
    except OSError as error:
        raise InputError(f"{path}: no process could be started to expand it: {error.strerror or error}") from None

    if process.returncode == -getattr(signal, "SIGXCPU", 0):
        raise InputError(too_slow)
    try:
        answer: dict[str, Any] = json.loads(process.stdout)
    except ValueError:
        raise InputError(
            f"{path}: xacro: its process ended with code {process.returncode}; expand it by hand"
        ) from None

    if "error" in answer:
        raise InputError(f"{answer.get('where') or path}: xacro: {answer['error']}")
    return answer


def _stamps(files: Iterable[str]) -> tuple[tuple[int, int] | None, ...]:
    """Return modification time [ns] and size of each file; None for a missing one."""
    return tuple(_stamp(file) for file in files)


def _stamp(file: str) -> tuple[int, int] | None:
    try:
        state = os.stat(file)
    except (OSError, ValueError):
        return None
    return state.st_mtime_ns, state.st_size
