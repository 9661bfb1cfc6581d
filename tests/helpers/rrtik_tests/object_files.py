"""Names that object files of 64 bits define and ask for: ELF (System V ABI, ch. 4) and Mach-O (loader.h, nlist.h)."""

from __future__ import annotations

import struct

ELF, MACH_O = b"\x7fELF", b"\xcf\xfa\xed\xfe"
SYMBOL_TABLE, SYMBOL_COMMAND = 2, 2


def symbols(data: bytes) -> tuple[set[str], set[str]]:
    """Names, as C writes them, that an object file defines for others, and those that it needs from others."""
    rows = _elf_symbols(data) if data.startswith(ELF) else _mach_o_symbols(data)
    defined = {name for name, shown, here in rows if shown and here}
    return defined, {name for name, _, here in rows if name and not here}


def _elf_symbols(data: bytes) -> list[tuple[str, bool, bool]]:
    (start,) = struct.unpack_from("<Q", data, 40)
    size, count = struct.unpack_from("<HH", data, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, start + k * size) for k in range(count)]
    rows = []
    for _, kind, _, _, offset, length, link, _, _, step in sections:
        if kind == SYMBOL_TABLE:
            names = sections[link][4]
            for place in range(offset, offset + length, step):
                name, info, _, section = struct.unpack_from("<IBBH", data, place)
                rows.append((_text(data, names + name), info >> 4 != 0, section != 0))
    return rows


def _mach_o_symbols(data: bytes) -> list[tuple[str, bool, bool]]:
    assert data.startswith(MACH_O)
    (count,) = struct.unpack_from("<I", data, 16)
    place, rows = 32, []
    for _ in range(count):
        command, size = struct.unpack_from("<II", data, place)
        if command == SYMBOL_COMMAND:
            offset, number, names, _ = struct.unpack_from("<IIII", data, place + 8)
            for k in range(number):
                name, kind = struct.unpack_from("<IB", data, offset + 16 * k)
                rows.append((_text(data, names + name).removeprefix("_"), bool(kind & 1), bool(kind & 0x0E)))
        place += size
    return rows


def _text(data: bytes, place: int) -> str:
    return data[place : data.index(b"\0", place)].decode()
