"""Long work that is killed, interrupted, out of disk, or whose clock goes back: what it leaves, and whether it goes on.

Each trial runs in a forked child that has everything loaded, so that the moments of kills lie in the work itself, and a
trial costs no more than the work. Moments are of processor time: a busy machine does not move them.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.robustness.long_work import SUITE, UNFINISHED, WHOLE, WORK, LongWork, Reader
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.cli import BAD_INPUT, FOUND, INTERRUPTED, NOT_FOUND

KINDS = ("kill", "interrupt", "full disk", "clock")
MARK = "RRTIK_TRIAL"  # an environment variable by which what a child has started is found
OUTLIVE_SECONDS = 120.0  # in which what a killed process has started must have ended, too
BROKEN = 99  # exit code of a child that ended in no way of ours
LATEST = 1.15  # of the time that the work takes: a few moments are after its end
NOT_OURS = {"said", "errors", "suite.yaml"}


@dataclass(frozen=True)
class Ended:
    """How a child ended: by which signal or with which code, in how long, and what it has said."""

    signal: int
    code: int
    seconds: float
    said: str
    errors: str


def trials(name: str, kind: str, first: int, count: int) -> list[str]:
    """Trials ``first`` and on of a kind of fault in some work; what was lost, doubled, half, or said wrongly."""
    work, found = WORK[name], list[str]()
    if not work.waits:
        _load(work.work)
    with TemporaryDirectory() as folder:
        usual = _run(work.work, Path(folder), None)
        size = max((file.stat().st_size for file in _left(Path(folder))), default=0)
    if usual.code not in (FOUND, NOT_FOUND):
        return [f"without a fault: exit code {usual.code}: {usual.errors[-300:]}"]
    for number in range(first, first + count):
        rng = np.random.default_rng([sorted(WORK).index(name), KINDS.index(kind), number])
        with TemporaryDirectory() as folder:
            found += [f"{number}: {wrong}" for wrong in _trial(rng, work, kind, usual.seconds, size, Path(folder))]
    return found


def _trial(
    rng: np.random.Generator, work: LongWork, kind: str, seconds: float, size: int, folder: Path
) -> Iterator[str]:
    moment = float(rng.uniform(0.001, LATEST * seconds))
    fault: dict[str, Callable[[], object]] = {
        "kill": lambda: _timer(work.waits, moment, signal.SIG_DFL),
        "interrupt": lambda: _timer(work.waits, moment, lambda *_: signal.raise_signal(signal.SIGINT)),
        "full disk": lambda: _full_disk(int(rng.integers(0, size + 1))),
        "clock": _clock_goes_back,
    }
    ended = _run(work.work, folder, fault[kind], name := f"{os.getpid()}-{rng.integers(2**31)}")
    yield from _judged(kind, ended)
    yield from _half_files(folder, work.files)
    for line in ended.said.splitlines():
        if line.startswith("wrote ") and not (folder / line[6:].split(":")[0]).is_file():
            yield f"said '{line}', and it is not there"
    kept = {file: (folder / file).read_bytes() for file in work.grows if (folder / file).is_file()}
    if not _all_ended(name):
        yield "what it has started lives on"
    again = _run(work.again or work.work, folder, None)
    if again.code not in (FOUND, NOT_FOUND):
        yield f"after it, exit code {again.code}: {again.errors[-200:]}"
    yield from _half_files(folder, {**work.files, **{k: v for k, v in WHOLE.items() if k in work.files}})
    for file, before in kept.items():
        whole = before[: before.rfind(b"\n") + 1]
        if whole.count(b"\n") > 1 and not (folder / file).read_bytes().startswith(whole):
            yield f"{file}: lines that stood there are gone"


def _judged(kind: str, ended: Ended) -> Iterator[str]:
    """What is wrong with how a child ended."""
    usual = {FOUND, NOT_FOUND} | {"full disk": {BAD_INPUT}, "interrupt": {INTERRUPTED}}.get(kind, set())
    if kind == "kill" and ended.signal in (signal.SIGPROF, signal.SIGALRM):
        return
    if ended.signal or ended.code not in usual:
        yield f"signal {ended.signal}, exit code {ended.code}: {ended.errors[-300:]}"
    for line in ended.errors.splitlines():
        if not line.startswith("rrtik: "):
            yield f"a line that is none of ours: {line[:200]}"
            return


def _half_files(folder: Path, known: Mapping[str, Reader]) -> Iterator[str]:
    """Files that cannot be read, and such as nobody has asked for."""
    for file in _left(folder):
        name = file.relative_to(folder).as_posix()
        if name not in known:
            if file.name != UNFINISHED and not name.startswith("out/") and name != "second.jsonl":
                yield f"{name}: a file that nobody asked for"
            continue
        try:
            known[name](file)
        except (RrtikError, OSError, ValueError) as error:
            campaign_began = name.startswith("out/") and file.read_bytes().count(b"\n") == 0
            if not campaign_began:
                yield f"{name}: {error}"


def _left(folder: Path) -> list[Path]:
    return [file for file in folder.rglob("*") if file.is_file() and file.name not in NOT_OURS]


def _run(work: Callable[[], int], folder: Path, fault: Callable[[], object] | None, mark: str = "") -> Ended:
    """Do some work in a forked child, in a folder, with a fault."""
    (folder / "suite.yaml").write_text(SUITE)
    begin = time.monotonic()
    child = os.fork()
    if child == 0:
        _child(work, folder, fault, mark)
    _, status, used = os.wait4(child, 0)
    wall = time.monotonic() - begin
    said, errors = ((folder / name).read_text(errors="backslashreplace") for name in ("said", "errors"))
    code = os.WEXITSTATUS(status) if os.WIFEXITED(status) else -1
    ended_by = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    return Ended(ended_by, code, wall if work in _WAITING else used.ru_utime + used.ru_stime, said, errors)


def _load(work: Callable[[], int]) -> None:
    """Do some work here, so that all that it imports and loads is there for the children."""
    before = Path.cwd()
    with TemporaryDirectory() as folder, open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.chdir(folder)
        try:
            with redirect_stdout(nowhere), redirect_stderr(nowhere), suppress(Exception):
                work()
        finally:
            os.chdir(before)


_WAITING = [each.work for each in WORK.values() if each.waits]


def _child(work: Callable[[], int], folder: Path, fault: Callable[[], object] | None, mark: str) -> None:
    """Do some work, and end, whatever comes: no child may go on as if it were its parent."""
    try:
        os.chdir(folder)
        os.environ[MARK] = mark
        for number, name in ((1, "said"), (2, "errors")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.stdout, sys.stderr = (os.fdopen(os.dup(number), "w", encoding="utf-8") for number in (1, 2))
        code = _code_of(work, fault)
        for kind in (signal.ITIMER_PROF, signal.ITIMER_REAL):
            signal.setitimer(kind, 0.0)
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        except OSError:
            code = code if code != FOUND else BAD_INPUT
        os._exit(code)
    finally:
        os._exit(BROKEN)


def _code_of(work: Callable[[], int], fault: Callable[[], object] | None) -> int:
    """The exit code of some work; errors are printed as the command line prints them."""
    try:
        if fault is not None:
            fault()
        return int(work())
    except KeyboardInterrupt:
        return INTERRUPTED
    except RrtikError as error:
        print(f"rrtik: {error}", file=sys.stderr)
        return BAD_INPUT
    except BaseException:
        traceback.print_exc()
        return BROKEN


def _timer(waits: bool, moment: float, act: object) -> None:
    """Let a signal come after a time; its default action ends the process at once, as a kill does."""
    kind, number = (signal.ITIMER_REAL, signal.SIGALRM) if waits else (signal.ITIMER_PROF, signal.SIGPROF)
    signal.signal(number, act)  # type: ignore[arg-type]
    signal.setitimer(kind, moment)


def _full_disk(size: int) -> None:
    """From now on no file grows beyond a size."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def _clock_goes_back() -> None:
    """A wall clock that goes back by a minute each time that it is read."""
    ticks = iter(range(10**9))
    time.time = lambda: 1.7e9 - 60.0 * next(ticks)
    time.time_ns = lambda: int(1e9 * time.time())


def _all_ended(mark: str) -> bool:
    """Whether no process with this mark lives, soon."""
    wanted, end = f"{MARK}={mark}".encode(), time.monotonic() + OUTLIVE_SECONDS
    while any(wanted in _environment(pid) for pid in Path("/proc").glob("[0-9]*")):
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def _environment(process: Path) -> bytes:
    try:
        return (process / "environ").read_bytes()
    except OSError:
        return b""
