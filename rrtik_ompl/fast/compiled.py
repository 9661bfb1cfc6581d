"""How kernels are compiled: for this processor's width, once per machine.

Kernels are kept in numba's cache on disk. That cache knows neither the modules that a kernel draws on nor the width,
so both are made part of the kernel's name: another width or another version of this package finds nothing stale.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding as llvm
from numba import njit
from numba.core.caching import FunctionCache

Function = TypeVar("Function", bound=Callable[..., Any])


def processor_width() -> int:
    """Lanes that fill this processor's widest registers: 16 with AVX-512, 8 otherwise; RRTIK_LANES overrides it."""
    asked = os.environ.get("RRTIK_LANES", "")
    if asked in ("8", "16"):
        return int(asked)
    return 16 if llvm.get_host_cpu_features().get("avx512f", False) else 8


WIDTH = processor_width()

_SOURCES = sorted(Path(__file__).parent.glob("*.py"))
_IDENTITY = f"{WIDTH}_{sha256(b''.join(file.read_bytes() for file in _SOURCES)).hexdigest()[:16]}"


class _ForgivingCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache on disk; one that is damaged or cannot be written costs time, nothing else."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # what a damaged pickle raises can be anything
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(Exception):
            super().save_overload(sig, data)


def kernel(function: Function) -> Function:
    """Compile a function on its first call; kept on disk, and in memory alone where no folder can be written."""
    function.__qualname__ = f"{function.__qualname__}_{_IDENTITY}"
    compiled: Any = njit(nogil=True, error_model="numpy", boundscheck=False)(function)
    with suppress(RuntimeError):  # numba's word for "no place to keep it"
        compiled._cache = _ForgivingCache(function)
    kept: Function = compiled
    return kept


def entry(function: Function) -> Function:
    """Compile a function that Python calls: whole numbers (64 bits) in, one whole number out."""
    return kernel(function)


def inlined(function: Function) -> Function:
    """Compile a function into each of its callers."""
    compiled: Function = njit(forceinline=True, error_model="numpy", boundscheck=False)(function)
    return compiled
