"""What a wheel brings beside its sources, for the width of this process: ``python -m rrtik_ompl.fast.shipped FOLDER``.

The bitcode of all kernels for all kinds of machine, and the WebAssembly module of pages that plan.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rrtik_ompl.fast.simd.bitcode import write_bitcode
from rrtik_ompl.fast.wasm.page_kernels import write_page_kernels

if __name__ == "__main__":
    write_bitcode(Path(sys.argv[1]))
    write_page_kernels(Path(sys.argv[1]))
