"""Compiled kernels as files: which functions there are, and their code, behind a checksum and a key.

The key names all that the code depends on. A file that is damaged, or another's, reads as absent.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from rrtik_ompl.fast.cache_files import write_whole
from rrtik_ompl.fast.processor import WIDTH, processor_identity

LAYOUT = 1
CHECK_BYTES = 32
FOLDER = Path(__file__).parent  # of the kernels' sources
PREFIX = "rrtik_"  # of the functions' names in the code


@dataclass(frozen=True, slots=True, eq=False)
class Code:
    """Functions by name with their numbers of arguments, and LLVM bitcode or machine code that defines them."""

    entries: dict[str, int]
    code: bytes


def kernel_modules() -> list[str]:
    """Names of the modules that are libraries."""
    return sorted(file.stem for file in FOLDER.glob("*.py") if "\n@entry\n" in file.read_text(encoding="utf-8"))


@cache
def sources_digest() -> str:
    """A hash of this package's sources: a change of any of them makes all kernels anew."""
    return sha256(b"".join(file.read_bytes() for file in sorted(FOLDER.glob("*.py")))).hexdigest()


def bitcode_key(name: str) -> str:
    """What the bitcode of a kernel module depends on; the same for every processor of a kind."""
    return f"layout {LAYOUT} {name} {WIDTH} lanes sources {sources_digest()}"


def machine_key(name: str) -> str:
    """What the machine code of a kernel module depends on."""
    return f"{bitcode_key(name)} {processor_identity()}"


def file_name(name: str, key: str) -> str:
    """Name of the file of a kernel module's code."""
    return f"{name}-{sha256(key.encode()).hexdigest()[:24]}.code"


def bitcode_name(name: str) -> str:
    """Name of the file of the bitcode that the package may bring."""
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
