"""What a wheel brings beside its sources, for the width of this process.

    python -m rrtik_ompl.kernels.shipped FOLDER [PART PARTS]

The bitcode of all kernels, the same for all kinds of machine, and the WebAssembly module of pages that plan. Several
processes may share the work, each with a part of the kernels; the first one makes the module.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from rrtik_ompl.kernels.simd.bitcode import retargeted
from rrtik_ompl.kernels.simd.bitcode_store import own_bitcode
from rrtik_ompl.kernels.simd.code_files import bitcode_key, bitcode_name, kernels_by_size, write_code
from rrtik_ompl.kernels.simd.targets import targets_of_this_width
from rrtik_ompl.kernels.wasm.page_kernels import write_page_kernels


def write_bitcode(folder: Path, names: Sequence[str]) -> None:
    """Make files of kernel modules that :mod:`rrtik_ompl.kernels.simd.library` takes instead of compiling.

    There is one file a module, written as for the first kind of machine that has this width, and checked for all.
    """
    for name in names:
        code = own_bitcode(name)
        forms = [retargeted(code, target) for target in targets_of_this_width()]
        write_code(folder / bitcode_name(name), bitcode_key(name), forms[0])


if __name__ == "__main__":
    folder, (part, parts) = Path(sys.argv[1]), map(int, sys.argv[2:] or ("0", "1"))
    write_bitcode(folder, kernels_by_size()[part::parts])
    if part == 0:
        write_page_kernels(folder)
