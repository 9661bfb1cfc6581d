"""Where the bitcode of a kernel module comes from: the package, the user's cache, or numba, once for all processes."""

from __future__ import annotations

from pathlib import Path

from rrtik_ompl.files.cache import cache_folder
from rrtik_ompl.files.notice import COMPILING, tell_once
from rrtik_ompl.kernels.simd.code_files import (
    FOLDER,
    Code,
    bitcode_key,
    bitcode_name,
    file_name,
    kept_code,
    kept_or_made,
    machine_key,
    read_code,
)


def packaged_bitcode(name: str) -> Code | None:
    """The bitcode that the package brings for this width; None if there is none for these sources."""
    return read_code(FOLDER / bitcode_name(name), bitcode_key(name))


def has_bitcode(name: str) -> bool:
    """Whether LLVM alone, in about half a second, makes a library, for its bitcode is there."""
    file, key = _own_file(name)
    return packaged_bitcode(name) is not None or kept_code(file, key) is not None


def own_bitcode(name: str) -> Code:
    """The bitcode that this machine has made of the sources; made now if it is not in the user's cache.

    Raises:
        ImportError: Without numba.
        RuntimeError: If a kernel needs Python or numba to run.
    """
    file, key = _own_file(name)

    def make() -> Code:
        from rrtik_ompl.kernels.simd.bitcode import compiled_module

        tell_once(COMPILING)
        return compiled_module(name)

    return kept_or_made(file, key, make)


def _own_file(name: str) -> tuple[Path | None, str]:
    """Where the user's cache keeps the bitcode of a library, None without a cache, and its key."""
    key = f"bitcode {machine_key(name)}"
    folder = cache_folder("kernels")
    return None if folder is None else folder / file_name(name, key, "bitcode"), key
