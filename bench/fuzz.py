"""Calls the public face with odd values, files and words, and writes down what is no answer and no error of ours.

Calls are numbered; a number is the seed of its call, so that ``--first 4711 --calls 1`` repeats one. They run in forked
children with limits of memory, of processor time and, far above that, of wall time: a child that crashes or hangs loses
one call. The file holds one line for each find, and one for each batch that is done: the next run goes on behind it.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import mmap
import os
import resource
import signal
import struct
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from bench.robustness import bad_inputs, calls, commands, spoilt_files, values
from bench.robustness.spoilt_files import Drawn
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.kernels import warm_up
from rrtik_ompl.viewer.serve import PageServer

BATCH = 5000  # calls of a child
KINDS = ((spoilt_files.draw, 0.25), (commands.draw, 0.3), (calls.draw, 1.0))  # up to which share each is drawn
MEMORY_BYTES = 4 << 30  # that the calls of a child may take beside what its parent has
PROCESSOR_SECONDS = 30.0  # of a call
WALL_SECONDS = 1200.0  # of a call; what waits uses no processor time, and a busy machine is no hang
PLACE = struct.Struct("q")  # of the call that a child is at


def draw(seed: int) -> Drawn:
    """The call of a number."""
    rng = np.random.default_rng(seed)
    place = rng.random()
    return next(kind for kind, end in KINDS if place < end)(rng)


def outcome(drawn: Drawn, folder: Path) -> str | None:
    """What is wrong with the outcome of a call; None if it is an answer, or an error of ours in one line."""
    try:
        drawn.make(folder)
    except RrtikError as error:
        return None if str(error).isprintable() and str(error) else f"an error that cannot be shown: {str(error)!r}"
    except MemoryError:
        return "out of memory"
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        ours = [f"{Path(f.filename).name}:{f.lineno}" for f in frames if "/rrtik_" in f.filename]
        wrong_call = isinstance(error, TypeError) and not ours  # refused by Python itself: too few arguments
        return None if wrong_call else f"{type(error).__name__}: {str(error)[:150]} at {' < '.join(ours[::-1][:3])}"
    return None


def _address_space() -> int:
    """Bytes of address space that this process has; 0 where /proc does not tell."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    return 0


def _child(first: int, count: int, folder: Path, write: int, at: mmap.mmap) -> None:
    """Make calls; to a pipe one line of JSON for each that something is wrong with."""
    most = _address_space() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    faulthandler.disable()
    for name in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(name, signal.SIG_DFL)  # ends the child, whatever it is in
    for number in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), number)
    setattr(PageServer, "wait", lambda _: None)  # noqa: B010 - Ctrl-C is pressed as soon as a page is served
    for seed in range(first, first + count):
        PLACE.pack_into(at, 0, seed)
        signal.setitimer(signal.ITIMER_PROF, PROCESSOR_SECONDS)
        signal.setitimer(signal.ITIMER_REAL, WALL_SECONDS)
        wrong = outcome(drawn := draw(seed), folder)
        if wrong is not None:
            os.write(write, (json.dumps([seed, f"{wrong} | {drawn.said()[:300]}"]) + "\n").encode())
    os._exit(0)


def run(first: int, count: int, folder: Path) -> Iterator[tuple[int, str]]:
    """Numbers of calls and what is wrong with them, of ``count`` calls from ``first`` on."""
    prepare()
    end, at = first + count, mmap.mmap(-1, PLACE.size)
    gc.collect()
    gc.freeze()  # what a child never looks at, it never copies
    while first < end:
        read, write = os.pipe()
        last = min(first + BATCH, end)
        child = os.fork()
        if child == 0:
            os.close(read)
            _child(first, last - first, folder, write, at)
        os.close(write)
        with os.fdopen(read) as lines:
            for line in lines:
                seed, wrong = json.loads(line)
                yield seed, wrong
        status = os.waitpid(child, 0)[1]
        first = last
        if status != 0:
            (lost,) = PLACE.unpack_from(at)
            hangs = os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGALRM, signal.SIGPROF)
            yield lost, f"{'hang' if hangs else f'crash, status {status}'} | {draw(lost).said()[:300]}"
            first = lost + 1


@cache
def prepare() -> None:
    """Make what no call shall wait for: the values that are given, all kernels, and what commands load."""
    calls.functions(), values.every(), commands.commands()
    warm_up(lambda _: None)
    bad_inputs.prepare()


def main(
    file: Annotated[Path, Option(help="Of the finds.")] = Path("finds.jsonl"),
    count: Annotated[int, Option("--calls")] = 10_000,
    first: Annotated[int | None, Option(help="Number of the first call. Without: behind the last run.")] = None,
) -> None:
    """Run, and go on where the last run ended."""
    lines = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    start = max((line.get("done", 0) for line in lines), default=0) if first is None else first
    with file.open("a") as log, tempfile.TemporaryDirectory() as folder:
        for begin in range(start, start + count, BATCH):
            size = min(BATCH, start + count - begin)
            for seed, wrong in run(begin, size, Path(folder)):
                log.write(json.dumps({"seed": seed, "wrong": wrong}) + "\n")
                print(seed, wrong, flush=True)
            log.write(json.dumps({"done": begin + size}) + "\n")
            log.flush()
