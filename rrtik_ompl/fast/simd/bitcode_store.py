"""Where the bitcode of a kernel module comes from: the package, the user's cache, or numba, once for all processes."""

from __future__ import annotations

from rrtik_ompl.fast.simd.code_files import (
    FOLDER,
    Code,
    bitcode_key,
    bitcode_name,
    file_name,
    machine_key,
    read_code,
    write_code,
)
from rrtik_ompl.fast.simd.targets import this_target
from rrtik_ompl.files.cache import cache_folder, nobody_else_s, one_at_a_time
from rrtik_ompl.files.notice import COMPILING, tell_once


def packaged_bitcode(name: str) -> Code | None:
    """The bitcode that the package brings for this kind of machine; None if there is none for these sources."""
    target = this_target()
    return read_code(FOLDER / bitcode_name(name, target), bitcode_key(name, target))


def own_bitcode(name: str) -> Code:
    """The bitcode that this machine has made of the sources; made now if it is not in the user's cache.

    Raises:
        ImportError: Without numba.
        RuntimeError: If a kernel needs Python or numba to run.
    """
    key, folder = f"bitcode {machine_key(name)}", cache_folder("kernels")
    file = None if folder is None else folder / file_name(name, key, "bitcode")
    with one_at_a_time(file):  # processes that start at once would all compile, for minutes
        kept = read_code(file, key) if file is not None and nobody_else_s(file) else None
        if kept is None:
            from rrtik_ompl.fast.simd.bitcode import compiled_module

            tell_once(COMPILING)
            kept = compiled_module(name)
            if file is not None:
                write_code(file, key, kept)
    return kept
