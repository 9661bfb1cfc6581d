"""The processor that kernels run on: how many lanes fill its registers, and what LLVM needs to know to make its code.

Nothing here needs numba. On Linux the processor is what the system says of it, because LLVM takes 40 MB of memory to
say the same; whoever finds his kernels made does without.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Any

from rrtik_ompl.base.installed import version_of

WIDTH_VARIABLE = "RRTIK_LANES"
SYSTEM_S_WORD = Path("/proc/cpuinfo")

# Of that file's lines those that do not change while the machine runs: x86-64's, then ARM's.
_KINDS = {"vendor_id", "cpu family", "model", "model name", "stepping", "flags"}
_KINDS |= {"CPU implementer", "CPU architecture", "CPU variant", "CPU part", "CPU revision", "Features"}


@cache
def _system_s_word() -> str:
    """What Linux says of the processors, a line each; empty on other systems."""
    try:
        lines = SYSTEM_S_WORD.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return ""
    pairs = [line.partition(":") for line in lines]
    said = [f"{kind.strip()} {value.strip()}" for kind, _, value in pairs if kind.strip() in _KINDS]
    return "; ".join(dict.fromkeys(said))  # several processors mostly say the same


@cache
def _features() -> dict[str, bool]:
    """Features of this processor as LLVM names them; none where LLVM does not know."""
    try:
        import llvmlite.binding as llvm

        return dict(llvm.get_host_cpu_features())
    except (ImportError, RuntimeError):
        return {}


def processor_width() -> int:
    """Lanes that fill this processor's widest registers: 16 with AVX-512, 8 otherwise; RRTIK_LANES overrides it.

    Eight lanes are right everywhere: LLVM spreads them over as many registers as they need, one with AVX, two with
    SSE or NEON (AArch64).
    """
    chosen = os.environ.get(WIDTH_VARIABLE, "")
    if chosen in ("8", "16"):
        return int(chosen)
    words = _system_s_word().split()
    return 16 if "avx512f" in (words or [name for name, there in _features().items() if there]) else 8


WIDTH = processor_width()


def target_machine(triple: str) -> Any:
    """LLVM's code generator for this processor; the triple says how functions are called and what files look like."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(triple)
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_feature_list(), opt=3, reloc="pic", codemodel="default"
    )


@cache
def processor_identity() -> str:
    """All that machine code depends on besides its source: processor, system and LLVM.

    Raises:
        ImportError: Without llvmlite.
    """
    version = version_of("llvmlite")
    if not version:
        raise ImportError("llvmlite is not installed")
    return f"{_system_s_word() or _llvm_s_word()} llvmlite {version}"


def _llvm_s_word() -> str:
    import llvmlite.binding as llvm

    return f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {_feature_list()}"


def _feature_list() -> str:
    return ",".join(f"{'+' if there else '-'}{name}" for name, there in sorted(_features().items()))
