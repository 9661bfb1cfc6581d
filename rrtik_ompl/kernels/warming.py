"""Several libraries of kernels made at once by processes, so that every core takes part."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from rrtik_ompl.files.cache import nobody_else_s
from rrtik_ompl.files.notice import COMPILING, tell_once
from rrtik_ompl.kernels.simd.bitcode_store import has_bitcode, packaged_bitcode
from rrtik_ompl.kernels.simd.code_files import kernel_modules, kernels_by_size
from rrtik_ompl.kernels.simd.library import code_file, is_loaded, library
from rrtik_ompl.kernels.threads import cores

ROOT = Path(__file__).parents[2]  # where this package stands: another process shall take no other
# Reads names, a line each; writes an empty line as soon as such a library is made.
MAKE = """
import sys; sys.path.insert(0, sys.argv[1])
from rrtik_ompl.kernels.simd.library import library
for name in sys.stdin:
    library(name.strip())
    print(flush=True)
"""


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


def load_together(names: Sequence[str]) -> None:
    """Load libraries that are about to be used; processes share in making those whose bitcode is there.

    A library takes LLVM half a second, once on a machine, and LLVM makes one at a time in a process.
    """
    if all(map(is_loaded, names)):
        return
    missing = [name for name in dict.fromkeys(names) if not is_loaded(name) and _missing(name) and has_bitcode(name)]
    if len(missing) > 1:
        _share(missing)
    for name in names:
        library(name)


def _share(names: list[str]) -> None:
    """Make libraries here and in other processes, which end with this call."""
    shares = [names[k :: cores()] for k in range(min(cores(), len(names)))]
    others: list[_Maker] = []
    try:
        with suppress(OSError):  # no process can be begun: all is made here
            for share in shares[1:]:
                other = _Maker()
                others.append(other)
                other.begin(share)
        for name in shares[0]:
            library(name)
        for other, share in zip(others, shares[1:], strict=False):
            for _ in share:
                other.has_made_one()
    finally:
        for other in others:
            other.end()


class _Maker:
    """A process that makes libraries and keeps them in the user's cache. What several share it compiles once."""

    def __init__(self) -> None:
        import subprocess  # where all kernels are made nobody needs it

        command = [sys.executable, "-W", "ignore", "-c", MAKE, str(ROOT)]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True)

    def begin(self, names: Iterable[str]) -> None:
        """Have libraries made, one after the other."""
        assert self._process.stdin is not None
        self._process.stdin.write("".join(f"{name}\n" for name in names))
        self._process.stdin.flush()

    def has_made_one(self) -> bool:
        """Wait for the next library; False if the process has ended before."""
        assert self._process.stdout is not None
        return bool(self._process.stdout.readline())

    def end(self) -> None:
        """End the process, whatever it does."""
        self._process.terminate()
        with suppress(OSError), self._process:  # closes the pipes
            pass


def _missing(name: str) -> bool:
    """Whether another process can make a library and keep it for this one."""
    file = code_file(name)
    return file is not None and not nobody_else_s(file)  # one that is spoilt is found out by whoever loads it


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
    idle: list[_Maker] = []
    others: list[_Maker] = []

    def make(name: str) -> None:
        with suppress(OSError):  # no process can be begun
            try:
                maker = idle.pop()
            except IndexError:
                maker = _Maker()
                others.append(maker)
            maker.begin([name])
            if maker.has_made_one():
                idle.append(maker)

    from concurrent.futures import ThreadPoolExecutor  # whoever finds all kernels made needs no threads

    pool = ThreadPoolExecutor(jobs)
    made = {name: pool.submit(make, name) for name in names}
    try:
        yield lambda name: made[name].result() if name in made else None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for maker in others:
            maker.end()
