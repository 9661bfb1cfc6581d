"""Kernels as libraries of machine code: made once for a processor by LLVM, kept in the user's cache.

Each module with functions that Python calls (``@entry``) is a library of its own, so nobody waits for kernels that he
does not use. Numba takes part only in making one, and not even then if the package brings it as bitcode. Loading one
that is kept takes LLVM on ARM alone, see :mod:`rrtik_ompl.kernels.simd.linker`.
"""

from __future__ import annotations

import ctypes
import os
import warnings
from collections.abc import Callable
from functools import cache
from itertools import count
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any

from rrtik_ompl.files.cache import cache_folder
from rrtik_ompl.kernels.simd.bitcode_store import own_bitcode, packaged_bitcode
from rrtik_ompl.kernels.simd.code_files import PREFIX, Code, file_name, kept_code, machine_key, write_code
from rrtik_ompl.kernels.simd.linker import linked
from rrtik_ompl.kernels.simd.processor import target_machine
from rrtik_ompl.kernels.simd.targets import UnknownMachineError, target_of, this_target

MAX_REASON = 300  # [letters]
SWITCH = "RRTIK_KERNELS"  # environment variable; 0 for none


class Library:
    """The functions of a kernel module that Python calls, as attributes.

    They take ``int`` alone (64 bits, ``bool`` too, numbers of numpy not) and return one; a call costs 0.7 us. Other
    threads run meanwhile. They work as long as the process lives.
    """

    def __init__(self, counts: dict[str, int], addresses: dict[str, int]) -> None:
        """Args: numbers of arguments, and where the functions are, both by name."""
        for entry, address in addresses.items():
            kind = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * counts[entry])
            setattr(self, entry, kind(address))

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Callable[..., int]: ...


_libraries: dict[str, Library | None] = {}
_lock = RLock()


def library(name: str) -> Library | None:
    """The kernels of a module of ``fast`` (``"checks.check_kernels"``); None if there can be none.

    Why is said in a warning, once for each reason.
    """
    if name in _libraries:
        return _libraries[name]
    with _lock:
        if name not in _libraries:
            _libraries[name] = _tried(name)
        return _libraries[name]


def is_loaded(name: str) -> bool:
    """Whether this process has asked for the kernels of a module before."""
    return name in _libraries


_said: set[str] = set()  # reasons


def _tried(name: str) -> Library | None:
    if os.environ.get(SWITCH) == "0":
        return None  # as wished, so that nothing need be said
    try:
        this_target()  # code is not even tried on a machine that it has never been made for
        return _kept(name) or _made(name)
    except Exception as error:  # another version of a compiler may fail in any way, and numpy has the same answers
        if (why := reason_of(error)) not in _said:  # without numba it is the same for all, an edit may break one
            _said.add(why)
            message = f"there are no kernels {name}: what they do is done in plain numpy, many times slower: {why}"
            warnings.warn(message, RuntimeWarning, stacklevel=4)
        return None


def reason_of(error: Exception) -> str:
    """Why there are no kernels, in a line."""
    if isinstance(error, ImportError):
        return f"{error}; install numba"
    text = str(error) if isinstance(error, UnknownMachineError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())[:MAX_REASON]  # a compiler's is a page


def code_file(name: str) -> Path | None:
    """Where the user's cache keeps a library; None without a cache."""
    folder = cache_folder("kernels")
    return None if folder is None else folder / file_name(name, machine_key(name))


def _kept(name: str) -> Library | None:
    """The library from the user's cache, if it is there."""
    file = code_file(name)
    code = kept_code(file, machine_key(name))
    if code is None:
        return None
    try:
        return Library(code.entries, _addresses(name, code))
    except (RuntimeError, KeyError):  # not what LLVM takes for machine code with these functions
        return None


def _made(name: str) -> Library:
    """The library from the package's bitcode or else its source; kept in the user's cache if that can be written."""
    packaged = packaged_bitcode(name)
    code = (None if packaged is None else machine_code(packaged)) or machine_code(own_bitcode(name))
    if code is None:
        raise RuntimeError("LLVM does not take the code that numba made")
    made = Library(code.entries, _addresses(name, code))
    file = code_file(name)
    if file is not None:
        write_code(file, machine_key(name), code)
    return made


def machine_code(bitcode: Code) -> Code | None:
    """Bitcode of any kind of machine as code of this processor; None if a newer LLVM or an unknown kind made it."""
    import llvmlite.binding as llvm

    machine = target_machine(this_target().code)
    try:
        module = llvm.parse_bitcode(bitcode.code)
    except RuntimeError:
        return None
    if target_of(module.triple) is None:
        return None
    module.triple = machine.triple  # as the text at the head of `targets` says
    module.data_layout = str(machine.target_data)
    return Code(bitcode.entries, machine.emit_object(module))


@cache
def _linker() -> Any:
    import llvmlite.binding as llvm

    return llvm.create_lljit_compiler(target_machine(this_target().code), use_jit_link=True, suppress_errors=True)


_loaded: list[Any] = []  # machine code goes away with LLVM's handle of it
_numbers = count()


def _addresses(name: str, code: Code) -> dict[str, int]:
    """Load machine code; where its functions are."""
    found = linked(code.code, [PREFIX + entry for entry in code.entries])
    if found is None:
        found = _linked_by_llvm(name, code)
    return {entry: found[PREFIX + entry] for entry in code.entries}


def _linked_by_llvm(name: str, code: Code) -> dict[str, int]:
    import llvmlite.binding as llvm

    builder = llvm.JITLibraryBuilder().add_object_img(code.code).add_current_process()
    for entry in code.entries:
        builder.export_symbol(PREFIX + entry)
    handle = builder.link(_linker(), f"{name}-{next(_numbers)}")
    _loaded.append(handle)
    return {PREFIX + entry: handle[PREFIX + entry] for entry in code.entries}
