"""How kernels are compiled with numba: the decorators, and numba's cache on disk.

That cache saves those who work on kernels some time: a kernel that several libraries call is compiled once. It knows
neither the modules that a kernel draws on nor the width, so both are made part of the kernel's name: another width or
another version of this package finds nothing stale.
"""

from __future__ import annotations

import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from numba import njit
from numba.core.caching import FunctionCache
from numba.core.sigutils import normalize_signature

import rrtik_ompl.kernels.simd.records  # noqa: F401  what tables and arrays are to numba
from rrtik_ompl.files.cache import nobody_else_s
from rrtik_ompl.kernels.simd.code_files import PACKAGE, sources_digest
from rrtik_ompl.kernels.simd.processor import WIDTH

__all__ = ["WIDTH", "entries", "entry", "inlined", "kernel"]

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS = {"error_model": "numpy", "boundscheck": False, "no_cfunc_wrapper": True}
_entries: dict[str, dict[str, Any]] = {}


class _ForgivingCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache on disk; one that is damaged or cannot be written costs time, nothing else.

    Processes that fill it at once give different overloads of a function the same file, and the last one is kept.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # beside the sources, where the umask of many systems lets the user's own group write
        if not nobody_else_s(Path(self._cache_file._index_path), among=stat.S_IWOTH):
            return None  # a pickle that somebody else may have written
        try:
            found = super().load_overload(sig, target_context)
            return found if found is None or found.signature.args == normalize_signature(sig)[0] else None
        except Exception:  # what a damaged pickle raises can be anything
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(Exception):
            super().save_overload(sig, data)


def kernel(function: Function) -> Function:
    """Compile a function on its first call; kept on disk, and in memory alone where no folder can be written."""
    module = function.__module__.removeprefix(f"{PACKAGE}.")
    function.__qualname__ = f"{function.__qualname__}_{WIDTH}_{sources_digest(module)[:16]}"
    # said, or numba takes it over from the caller, and all that an inlined function calls is inlined again and again
    compiled: Any = njit(nogil=True, forceinline=False, **_OPTIONS)(function)
    with suppress(RuntimeError):  # numba's word for "no place to keep it"
        compiled._cache = _ForgivingCache(function)
    kept: Function = compiled
    return kept


def entry(function: Function) -> Function:
    """Compile a function that Python calls: whole numbers (64 bits) in, one whole number out.

    Python finds it in the :func:`rrtik_ompl.kernels.simd.library.library` of its module, by its name.
    """
    compiled = kernel(function)
    _entries.setdefault(function.__module__, {})[function.__name__] = compiled
    return compiled


def entries(module: str) -> dict[str, Any]:
    """Numba's compiled functions that Python calls, by name, of a module that has been imported."""
    return dict(_entries.get(module, {}))


def inlined(function: Function) -> Function:
    """Compile a function into each of its callers."""
    compiled: Function = njit(forceinline=True, no_cpython_wrapper=True, **_OPTIONS)(function)
    return compiled
