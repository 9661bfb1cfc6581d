"""Compiled kernels as files: which functions there are, and their code, behind a checksum and a key.

The key names all that the code depends on. A file that is damaged, or another's, reads as absent.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from rrtik_ompl.files.cache import nobody_else_s, one_at_a_time, write_whole
from rrtik_ompl.files.digest import sha256
from rrtik_ompl.kernels.simd.processor import WIDTH, processor_identity

LAYOUT = 3
CHECK_BYTES = 32
PACKAGE = "rrtik_ompl.kernels"
FOLDER = Path(__file__).parent.parent  # of the package's sources
# Its own imports (caches, the processor) do not change what it makes of a kernel, but for what tables are to numba.
COMPILER, RECORDS = "simd.compiled", "simd.records"
PREFIX = "rrtik_"  # of the functions' names in the code

_IMPORT = re.compile(rf"^from {re.escape(PACKAGE)}(?:\.([\w.]+))? import (\([^)]*\)|.*)$", re.MULTILINE)


@dataclass(frozen=True, slots=True, eq=False)
class Code:
    """Functions by name with their numbers of arguments, and LLVM bitcode or machine code that defines them."""

    entries: dict[str, int]
    code: bytes


def kernel_modules() -> list[str]:
    """Names, below this package, of the modules that are libraries."""
    return sorted(_dotted(file) for file in FOLDER.rglob("*.py") if "\n@entry\n" in file.read_text(encoding="utf-8"))


def kernels_by_size() -> list[str]:
    """The same, the smallest first: numba keeps what they compile of the larger ones."""
    return sorted(kernel_modules(), key=lambda name: sum(len(source_text(module)) for module in kernel_sources(name)))


def kernel_sources(name: str) -> list[str]:
    """Names of all modules of this package whose source a kernel module's code depends on: what it imports, and so on.

    Kernels, layouts and the decorators that compile them: an edit of any other module makes no kernel anew.
    """
    found: set[str] = set()
    open_ = [name]
    while open_:
        module = open_.pop()
        if module not in found:
            found.add(module)
            open_ += [RECORDS] if module == COMPILER else _imported(module)
    return sorted(found)


@cache
def sources_digest(name: str) -> str:
    """A hash of the sources of a kernel module: a change of any of them makes its kernels anew.

    For a module of somebody else, such as a test, all kernels of this package count as its sources.
    """
    names = [name] if _is_module(name) else kernel_modules()
    sources = sorted({module for own in names for module in kernel_sources(own)})
    return sha256("\0".join(source_text(module) for module in sources).encode()).hexdigest()


@cache
def source_text(module: str) -> str:
    """The source of a module of this package; empty if it has none."""
    if not _is_module(module):
        return ""
    with open(_source_file(module), encoding="utf-8") as file:
        return file.read()


@cache
def _imported(module: str) -> list[str]:
    """Modules of this package that a module imports when it is loaded."""
    imported = []
    for parent, names in _IMPORT.findall(source_text(module)):
        if _is_module(parent):
            imported.append(parent)
        else:
            plain = [name.split(" as ")[0].strip() for name in names.strip("()").split(",")]
            imported += [name for name in (f"{parent}.{item}".lstrip(".") for item in plain) if _is_module(name)]
    return imported


@cache
def _is_module(name: str) -> bool:
    return bool(name) and os.path.isfile(_source_file(name))


def _source_file(module: str) -> str:
    return f"{FOLDER}/{module.replace('.', '/')}.py"  # a Path takes ten times as long, and there are many


def _dotted(file: Path) -> str:
    return ".".join(file.relative_to(FOLDER).with_suffix("").parts)


def _contents(name: str) -> str:
    return f"layout {LAYOUT} {name} {WIDTH} lanes sources {sources_digest(name)}"


def bitcode_key(name: str) -> str:
    """What the bitcode of a kernel module depends on; the same for every kind of machine."""
    return f"{_contents(name)} bitcode"


def machine_key(name: str) -> str:
    """What the machine code of a kernel module depends on."""
    return f"{_contents(name)} {processor_identity()}"


def file_name(name: str, key: str, ending: str = "code") -> str:
    """Name of the file of a kernel module's code in the user's cache."""
    return f"{name}-{sha256(key.encode()).hexdigest()[:24]}.{ending}"


def bitcode_name(name: str) -> str:
    """Name of the file of the bitcode that the package may bring, for this process's number of lanes."""
    return f"{name}-{WIDTH}.bitcode"


def read_code(file: Path, key: str) -> Code | None:
    """The code in a file, or None if it is absent, damaged or has another key."""
    try:
        data = file.read_bytes()
    except OSError:
        return None
    body = data[CHECK_BYTES:]
    if data[:CHECK_BYTES] != sha256(body).digest():
        return None
    head, _, code = body.partition(b"\n")
    described = json.loads(head)  # written by write_code: the checksum says so
    return Code(described["entries"], code) if described["key"] == key else None


def write_code(file: Path, key: str, code: Code) -> None:
    """Write code to a file that appears whole, or not at all where it cannot be written."""
    body = json.dumps({"key": key, "entries": code.entries}).encode() + b"\n" + code.code
    write_whole(file, lambda stream: stream.write(sha256(body).digest() + body))


def kept_code(file: Path | None, key: str) -> Code | None:
    """The code in a file of the user's cache, or None as for `read_code`, or if others can write to it."""
    return read_code(file, key) if file is not None and nobody_else_s(file) else None


def kept_or_made(file: Path | None, key: str, make: Callable[[], Code]) -> Code:
    """The code in a file of the user's cache, which is made, and kept there, if it is absent.

    Processes that start at once would all make it, for minutes; so one does, and the others wait.
    """
    with one_at_a_time(file):
        code = kept_code(file, key)
        if code is None:
            code = make()
            if file is not None:
                write_code(file, key, code)
        return code
