"""The processor that kernels run on: how many lanes fill its registers, and what LLVM needs to know to make its code.

Nothing here needs numba. Without llvmlite there are no kernels, and nothing here is used.
"""

from __future__ import annotations

import os
from functools import cache
from typing import Any

WIDTH_VARIABLE = "RRTIK_LANES"


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
    return 16 if _features().get("avx512f", False) else 8


WIDTH = processor_width()


def target_machine() -> Any:
    """LLVM's code generator for this processor."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_feature_list(), opt=3, reloc="pic", codemodel="default"
    )


@cache
def processor_identity() -> str:
    """All that machine code depends on besides its source: processor, system and LLVM."""
    import llvmlite
    import llvmlite.binding as llvm

    version = ".".join(map(str, llvm.llvm_version_info))
    name = llvm.get_host_cpu_name()
    triple = llvm.get_process_triple()
    return f"{triple} {name} {_feature_list()} LLVM {version} llvmlite {llvmlite.__version__}"


def _feature_list() -> str:
    return ",".join(f"{'+' if there else '-'}{name}" for name, there in sorted(_features().items()))
