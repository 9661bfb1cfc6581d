"""All kernels made at once: processes make a library each, so that every core takes part."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from rrtik_ompl.fast.simd.bitcode_store import packaged_bitcode
from rrtik_ompl.fast.simd.code_files import kept_code, kernel_modules, kernels_by_size, machine_key
from rrtik_ompl.fast.simd.library import code_file, library
from rrtik_ompl.fast.threads import cores
from rrtik_ompl.files.notice import COMPILING, tell_once

ROOT = Path(__file__).parents[2]  # where this package stands: another process shall take no other
MAKE = "import sys; sys.path.insert(0, sys.argv[1]); from rrtik_ompl.fast.simd.library import library; "
MAKE += "sys.exit(library(sys.argv[2]) is None)"


def warm_up(report: Callable[[str], None], *, jobs: int | None = None) -> bool:
    """Make or load all kernels, so that nobody waits for them later.

    Args:
        report: Is told what is done, line by line.
        jobs: Processes that make libraries side by side; as many as there are cores if None.

    Returns:
        Whether there are compiled kernels now; if not, a warning has said why.
    """
    names = kernel_modules()
    missing = [name for name in kernels_by_size() if _missing(name)]
    with _made_by_others(missing, jobs or cores()) as wait_for:
        for name in names:
            wait_for(name)
            if library(name) is not None:
                report(f"{name}: ready")
    return all(library(name) is not None for name in names)


def _missing(name: str) -> bool:
    """Whether another process can make a library and keep it for this one."""
    file = code_file(name)
    return file is not None and kept_code(file, machine_key(name)) is None


@contextmanager
def _made_by_others(names: list[str], jobs: int) -> Iterator[Callable[[str], None]]:
    """Have libraries made by other processes, which end with the block; what waits for one of them.

    What fails is made, and told, here.
    """
    if min(jobs, len(names)) < 2:
        yield lambda name: None
        return
    if any(packaged_bitcode(name) is None for name in names):
        tell_once(COMPILING)
    others: list[subprocess.Popen[bytes]] = []

    def make(name: str) -> None:
        command = [sys.executable, "-W", "ignore", "-c", MAKE, str(ROOT), name]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            others.append(process)

    pool = ThreadPoolExecutor(jobs)
    made = {name: pool.submit(make, name) for name in names}
    try:
        yield lambda name: made[name].result() if name in made else None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in others:
            process.terminate()
