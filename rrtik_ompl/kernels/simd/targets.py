"""The kinds of machine that kernels run on, each with a name of its own; a wheel brings bitcode that fits all of them.

Kernels use LLVM's portable vectors and call nothing but C's mathematics, so the bitcode that numba makes on one kind is
that of all others of the same number of lanes once their triple and data layout are named in it.
"""

from __future__ import annotations

import platform
import sys
from dataclasses import dataclass
from functools import cache

from rrtik_ompl.kernels.simd.processor import WIDTH


@dataclass(frozen=True, slots=True)
class Target:
    """A kind of machine.

    Attributes:
        name: Ours.
        triple: LLVM's name for it.
        lanes: The numbers of lanes that its registers may ask for.
        code: The triple that machine code is made for. x86-64 has object files in ELF on every system, which
            :mod:`rrtik_ompl.kernels.simd.linker` links; macOS on Intel calls functions as Linux does.
    """

    name: str
    triple: str
    lanes: tuple[int, ...]
    code: str


_LINUX = "x86_64-unknown-linux-gnu"
_ARM_LINUX = "aarch64-unknown-linux-gnu"
_ARM_MACOS = "arm64-apple-macosx15.0.0"
_WINDOWS = "x86_64-pc-windows-msvc"

TARGETS = (
    Target("x86_64-linux", _LINUX, (8, 16), _LINUX),
    Target("x86_64-macos", "x86_64-apple-macosx15.0.0", (8, 16), _LINUX),
    Target("x86_64-windows", _WINDOWS, (8, 16), f"{_WINDOWS}-elf"),
    Target("aarch64-linux", _ARM_LINUX, (8,), _ARM_LINUX),
    Target("arm64-macos", _ARM_MACOS, (8,), _ARM_MACOS),
)
KNOWN = "x86-64 with Linux, macOS or Windows, and for ARM of 64 bits with Linux or macOS"
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "arm", "arm64": "arm"}
_SYSTEMS = ("linux", "apple", "windows")  # as triples name them
_PYTHON_S_NAMES = {"linux": "linux", "darwin": "apple", "win32": "windows"}


class UnknownMachineError(RuntimeError):
    """Kernels have never been made for this kind of machine."""


def target_of(triple: str) -> Target | None:
    """The kind of machine that an LLVM triple speaks of; None if kernels have never been made for it."""
    kind = _kind(triple)
    return next((target for target in TARGETS if kind is not None and _kind(target.triple) == kind), None)


def _kind(triple: str) -> tuple[str, str] | None:
    """Processor and system of a triple, whose vendor and versions do not matter."""
    first, *rest = triple.lower().split("-")
    system = next((name for name in _SYSTEMS if name in rest), "")
    return (_PROCESSORS[first], system) if first in _PROCESSORS and system else None


@cache
def this_target() -> Target:
    """The kind of this machine.

    Raises:
        UnknownMachineError: If kernels have never been made for it.
    """
    machine = platform.machine()
    system = _PYTHON_S_NAMES.get(sys.platform, sys.platform)
    found = target_of(f"{machine}-{system}")
    if found is None or sys.maxsize < 2**32:
        raise UnknownMachineError(f"there are no kernels for {machine} with {system} (there are for {KNOWN})")
    return found


def targets_of_this_width() -> list[Target]:
    """The kinds of machine whose kernels may have as many lanes as those of this process."""
    return [target for target in TARGETS if WIDTH in target.lanes]
