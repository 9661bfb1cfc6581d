"""The kinds of machine that kernels run on, each with a name of its own; a wheel brings bitcode that fits all of them.

Kernels use LLVM's portable vectors and call nothing but C's mathematics, so the bitcode that numba makes on one kind is
that of all others of the same number of lanes once their triple and data layout are named in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from rrtik_ompl.kernels.simd.processor import WIDTH


@dataclass(frozen=True, slots=True)
class Target:
    """A kind of machine: its name, LLVM's triple for it, and the numbers of lanes that its registers may ask for."""

    name: str
    triple: str
    lanes: tuple[int, ...]


TARGETS = (
    Target("x86_64-linux", "x86_64-unknown-linux-gnu", (8, 16)),
    Target("aarch64-linux", "aarch64-unknown-linux-gnu", (8,)),
    Target("arm64-macos", "arm64-apple-macosx15.0.0", (8,)),
)
KNOWN = "x86-64 and AArch64 Linux, and macOS on Apple's ARM"
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "arm", "arm64": "arm"}


class UnknownMachineError(RuntimeError):
    """Kernels have never been made for this kind of machine."""


def target_of(triple: str) -> Target | None:
    """The kind of machine that an LLVM triple speaks of; None if kernels have never been made for it."""
    kind = _kind(triple)
    return next((target for target in TARGETS if kind is not None and _kind(target.triple) == kind), None)


def _kind(triple: str) -> tuple[str, str] | None:
    """Processor and system of a triple, whose vendor and versions do not matter."""
    first, *rest = triple.lower().split("-")
    system = "linux" if "linux" in rest else "apple" if "apple" in rest else ""
    return (_PROCESSORS[first], system) if first in _PROCESSORS and system else None


@cache
def this_target() -> Target:
    """The kind of this machine.

    Raises:
        UnknownMachineError: If kernels have never been made for it.
    """
    import llvmlite.binding as llvm

    triple = llvm.get_process_triple()
    found = target_of(triple)
    if found is None:
        raise UnknownMachineError(f"there are no kernels for {triple} (there are for {KNOWN})")
    return found


def targets_of_this_width() -> list[Target]:
    """The kinds of machine whose kernels may have as many lanes as those of this process."""
    return [target for target in TARGETS if WIDTH in target.lanes]
