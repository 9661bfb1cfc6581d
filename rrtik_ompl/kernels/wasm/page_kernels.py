"""The WebAssembly module of pages: from the package, from the user's cache, or made of the kernels' sources."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path

from rrtik_ompl.files.cache import cache_folder
from rrtik_ompl.files.notice import tell_once
from rrtik_ompl.kernels.simd.code_files import (
    FOLDER,
    Code,
    file_name,
    kept_or_made,
    read_code,
    sources_digest,
    write_code,
)
from rrtik_ompl.kernels.simd.library import reason_of
from rrtik_ompl.kernels.simd.processor import WIDTH

# Libraries that a page has, by what the names of their functions begin with there.
LIBRARIES = {
    "connect": "search.connect_kernels",
    "shortcut": "search.shortcut_kernels",
    "crdt": "search.crdt.kernels",
    "ik": "ik.ik_kernels",
    "check": "checks.check_kernels",
    "distance": "checks.distance_kernels",
}
LAYOUT = 2
COMPILING_PAGES = "compiling the kernels of pages that plan, once per machine: some 20 s"


def page_kernels_name() -> str:
    """Name of the file that the package may bring."""
    return f"page-{WIDTH}.wasm"


def page_kernels_key() -> str:
    """What the module depends on."""
    sources = " ".join(f"{name} {module} {sources_digest(module)}" for name, module in LIBRARIES.items())
    return f"layout {LAYOUT} {WIDTH} lanes {sources}"


def made_page_kernels() -> bytes:
    """The module, made anew.

    Raises:
        ImportError: Without numba.
        RuntimeError: If this LLVM cannot make it.
    """
    from rrtik_ompl.kernels.simd.bitcode_store import own_bitcode
    from rrtik_ompl.kernels.wasm.emit import wasm_module

    return wasm_module({name: own_bitcode(module) for name, module in LIBRARIES.items()})


def write_page_kernels(folder: Path) -> None:
    """Make the file that :func:`page_kernels` takes instead of compiling."""
    write_code(folder / page_kernels_name(), page_kernels_key(), Code({}, made_page_kernels()))


@cache
def page_kernels() -> bytes | None:
    """The module; None, and a warning that says why, where it can be neither found nor made."""
    key = page_kernels_key()
    packaged = read_code(FOLDER / page_kernels_name(), key)
    if packaged is not None:
        return packaged.code
    folder = cache_folder("kernels")
    file = None if folder is None else folder / file_name("page", key)
    try:
        return kept_or_made(file, key, _code).code
    except Exception as error:  # as in `library`: a compiler may fail in any way, and pages are good without it
        warnings.warn(f"pages do not plan by themselves: {reason_of(error)}", RuntimeWarning, stacklevel=2)
        return None


def _code() -> Code:
    tell_once(COMPILING_PAGES)
    return Code({}, made_page_kernels())
