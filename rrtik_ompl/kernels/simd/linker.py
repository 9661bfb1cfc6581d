"""Object files of x86-64 made ready to run without LLVM, which takes 40 MB of memory and as many milliseconds to load.

Kernels have no data that can be written and need nothing but a few functions of the C library, so an object file (ELF,
on every system) is its read-only sections one behind the other. A place in it that says how far it is from another is
given that distance; a function of C is reached by a jump to the address that stands behind it. References: System V
ABI, AMD64 supplement, ch. 4; the generic ABI, "Object files".
"""

from __future__ import annotations

import ctypes
import mmap
import os
import sys
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

SECTION = np.dtype(
    [(name, "<u4") for name in ("name", "kind")]
    + [(name, "<u8") for name in ("flags", "address", "offset", "size")]
    + [(name, "<u4") for name in ("link", "info")]
    + [(name, "<u8") for name in ("alignment", "entry_size")]
)
SYMBOL = np.dtype(
    [("name", "<u4"), ("info", "u1"), ("other", "u1"), ("section", "<u2"), ("value", "<u8"), ("size", "<u8")]
)
RELOCATION = np.dtype([("offset", "<u8"), ("kind", "<u4"), ("symbol", "<u4"), ("addend", "<i8")])

X86_64 = b"\x3e\x00"  # e_machine
SYMBOLS, RELOCATIONS, ZEROS = 2, 4, 8  # sh_type
WRITTEN, LOADED = 1, 2  # sh_flags
DISTANCES = (2, 4)  # R_X86_64_PC32 and PLT32: symbol + addend - place, 32 bits

JUMP = b"\xff\x25\x02\x00\x00\x00\x0f\x0b"  # to the address that follows
STUB = len(JUMP) + 8
LINE = 64  # bytes; the largest alignment that constants of 16 lanes ask for

_WINDOWS = ("ucrtbase", "ntdll")  # the second for __chkstk, which looks at each page of a large stack frame
_APPLE_NAMES = {"sincos": "__sincos", "sincosf": "__sincosf"}
_READ, _EXECUTE, _WINDOWS_READ_WRITE, _WINDOWS_READ_EXECUTE, _RESERVE_AND_COMMIT = 1, 4, 0x04, 0x20, 0x3000

_kept: list[object] = []  # memory of code, for as long as the process lives


def linked(code: bytes, names: Iterable[str], find: Callable[[str], int] | None = None) -> dict[str, int] | None:
    """Load an object file; the addresses of its functions, or None if it asks for more than this module does.

    Args:
        code: The object file.
        names: The functions that are wanted.
        find: Gives the address of a function of C by its name; this process's if None.

    Raises:
        RuntimeError: If a function is neither in the file nor to be found.
    """
    if code[:6] != b"\x7fELF\x02\x01" or code[18:20] != X86_64:  # 64 bits, little-endian
        return None

    at = int.from_bytes(code[40:48], "little")
    sections = np.frombuffer(code, SECTION, int.from_bytes(code[60:62], "little"), at)
    loaded = np.flatnonzero(sections["flags"] & LOADED)
    if any(sections["flags"][loaded] & WRITTEN) or ZEROS in sections["kind"][loaded]:
        return None

    moved = [section for section in sections[sections["kind"] == RELOCATIONS] if section["info"] in loaded]
    changes = [(int(section["info"]), _rows(code, RELOCATION, section)) for section in moved]
    if not all(np.isin(rows["kind"], DISTANCES).all() for _, rows in changes):
        return None

    (table,) = sections[sections["kind"] == SYMBOLS]
    symbols = _rows(code, SYMBOL, table)
    text = int(sections["offset"][table["link"]])
    named = [code[text + start : code.index(b"\0", text + start)].decode() for start in symbols["name"].tolist()]

    # the sections one behind the other, then the jumps
    starts = np.zeros(len(sections), np.int64)
    end = 0
    for k in loaded.tolist():
        starts[k] = end
        end += -(-int(sections["size"][k]) // LINE) * LINE
    outside = {name: k for k, name in enumerate(named) if name and symbols["section"][k] == 0}
    image = np.zeros(end + STUB * len(outside), np.uint8)
    for k in loaded.tolist():
        content = _rows(code, np.dtype(np.uint8), sections[k])
        image[starts[k] : starts[k] + len(content)] = content

    places = np.where(symbols["section"] < len(sections), starts[symbols["section"] % len(sections)], 0)
    places += symbols["value"].astype(np.int64)
    for name, k in outside.items():
        places[k] = end
        jump = JUMP + ((find or _of_the_c_library)(name)).to_bytes(8, "little")
        image[end : end + STUB] = np.frombuffer(jump, np.uint8)
        end += STUB

    for section, rows in changes:
        at_rows = starts[section] + rows["offset"].astype(np.int64)
        distances = (places[rows["symbol"]] + rows["addend"] - at_rows).astype("<i4")
        image[at_rows[:, None] + np.arange(4)] = distances[:, None].view(np.uint8)

    defined = {name: int(place) for name, place, known in zip(named, places, symbols["section"], strict=True) if known}
    if missing := [name for name in names if name not in defined]:
        raise RuntimeError(f"no function {missing[0]} in an object file")
    base = _executable(image.tobytes())
    return {name: base + defined[name] for name in names}


def _rows(code: bytes, kind: np.dtype[Any], section: Any) -> np.ndarray[Any, Any]:
    """What a section of an object file holds."""
    return np.frombuffer(code, kind, int(section["size"]) // kind.itemsize, int(section["offset"]))


def _of_the_c_library(name: str) -> int:
    """Address of a function in this process."""
    if sys.platform == "darwin":
        name = _APPLE_NAMES.get(name, name)
    for library in _WINDOWS if sys.platform == "win32" else (None,):
        function = getattr(ctypes.CDLL(library), name, None)
        if function is not None:
            return ctypes.cast(function, ctypes.c_void_p).value or 0
    raise RuntimeError(f"a kernel needs {name}, which is not in the C library")


def _executable(image: bytes) -> int:
    """Address of a copy of some code that can be run, and no longer written."""
    if sys.platform == "win32":
        return _executable_on_windows(image)
    memory = mmap.mmap(-1, len(image))
    memory.write(image)
    view = ctypes.c_char.from_buffer(memory)
    _kept.append(view)
    address = ctypes.addressof(view)
    protect = ctypes.CDLL(None, use_errno=True).mprotect
    if protect(ctypes.c_void_p(address), ctypes.c_size_t(len(image)), _READ | _EXECUTE):
        raise RuntimeError(f"memory cannot be made executable: {os.strerror(ctypes.get_errno())}")
    return address


def _executable_on_windows(image: bytes) -> int:
    windows = getattr(ctypes, "WinDLL")("kernel32", use_last_error=True)  # noqa: B009 - no other system has it
    size = ctypes.c_size_t(len(image))
    windows.VirtualAlloc.restype = ctypes.c_void_p
    address = windows.VirtualAlloc(None, size, _RESERVE_AND_COMMIT, _WINDOWS_READ_WRITE)
    if not address:
        raise RuntimeError("Windows gives no memory for kernels")
    ctypes.memmove(address, image, len(image))
    before = ctypes.c_ulong()
    if not windows.VirtualProtect(ctypes.c_void_p(address), size, _WINDOWS_READ_EXECUTE, ctypes.byref(before)):
        raise RuntimeError("Windows does not let kernels run")
    return int(address)
