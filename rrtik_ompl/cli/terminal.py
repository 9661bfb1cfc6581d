"""Output of the command line: text and tables on standard output, progress and warnings on standard error."""

from __future__ import annotations

import os
import shlex
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, main_thread
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rrtik_ompl.base.errors import InputError, printable
from rrtik_ompl.cli.table import Table, columns_of, folded
from rrtik_ompl.files import notice
from rrtik_ompl.files.text import PAGE_FORMATS as PAGE_FORMATS

if TYPE_CHECKING:
    from rich.status import Status

TRAJECTORY_FORMATS = (".json", ".csv", ".yaml", ".mcap")
# [s]; a spinner appears only after this time, because shorter tasks end before the message can be read.
SPINNER_AFTER = 0.3
RANDOM = "random"  # a seed that is drawn
AGAIN_SECONDS = 0.02  # delay after which a lost Ctrl-C is repeated


def warn(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a warning; a replacement for ``warnings.showwarning``."""
    note(f"warning: {message}")


def note(message: str) -> None:
    """Print a message in one line, which folds on a terminal, on standard error."""
    print(folded(f"rrtik: {printable(message)}", columns_of(sys.stderr)), file=sys.stderr)


def prepare_terminal() -> None:
    """Redirect warnings and notices to this module, and make printing safe.

    A closed stream is replaced by the null device; letters that a terminal lacks are escaped.
    """
    warnings.showwarning = warn
    notice.listener = note
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - open until the process ends
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def drop_output() -> None:
    """Discard output that could not be printed, so that the end of the process does not try again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def stoppable() -> Iterator[None]:
    """Make Ctrl-C end the block with KeyboardInterrupt, wherever it occurs.

    While numpy compares rows, it converts KeyboardInterrupt to another error, which is converted back here. In a
    callback of the garbage collector, Python prints it and goes on; while it imports a module, an error may only mean
    that another one is taken. Then the signal is sent again.
    """
    usual = signal.getsignal(signal.SIGINT)
    unraised = sys.unraisablehook
    came = in_hook = is_due = False

    def interrupted(_: int, frame: FrameType | None) -> None:
        nonlocal came, is_due
        came = True
        is_due = in_hook or _is_import(frame)
        if not is_due:
            raise KeyboardInterrupt
        once_more()  # Python would lose this one, too

    def lost(what: sys.UnraisableHookArgs) -> None:
        nonlocal in_hook
        if not issubclass(what.exc_type, KeyboardInterrupt):
            unraised(what)
            return
        in_hook = True
        once_more()
        in_hook = False

    def once_more() -> None:
        again = Timer(AGAIN_SECONDS, os.kill, (os.getpid(), signal.SIGINT))  # a signal also ends blocking calls
        again.daemon = True
        again.start()

    if usual is not signal.default_int_handler or current_thread() is not main_thread():
        yield
        return

    signal.signal(signal.SIGINT, interrupted)
    sys.unraisablehook = lost

    try:
        yield
        if is_due:
            raise KeyboardInterrupt
    except Exception as error:
        if came and not isinstance(error, InputError):
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, usual)
        sys.unraisablehook = unraised


def _is_import(frame: FrameType | None) -> bool:
    """Check whether a frame stands in an import that a command makes."""
    while frame is not None and frame.f_globals.get("__name__") != "rrtik_ompl.cli.app":
        if frame.f_globals.get("__name__") == "importlib._bootstrap":
            return True
        frame = frame.f_back
    return False


def say(*items: str | Table) -> None:
    """Print texts, whose lines fold on a terminal, and tables on standard output."""
    for item in items:
        print(folded(item, columns_of(sys.stdout)) if isinstance(item, str) else item)


def suggest(*steps: str) -> None:
    """Print possible next steps, one a line, but only on a terminal, not to a file or a pipe.

    They do not fold, so that a command can be copied.
    """
    if sys.stdout.isatty():
        for number, step in enumerate(steps):
            print(f"{' ' * 5 if number else 'next:'} {step}")


def plural(number: int, noun: str) -> str:
    """Return a number with its noun: "1 pose", "2 poses"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def command(*words: object) -> str:
    """Return a command of `rrtik` as it is typed."""
    return shlex.join(["rrtik", *map(str, words)])


@contextmanager
def progress(message: str) -> Iterator[None]:
    """Show a spinner on standard error if a task takes time; nothing unless that is a terminal."""
    if not sys.stderr.isatty():
        yield
        return

    shown: list[Status] = []

    def show() -> None:
        from rich.console import Console

        shown.append(Console(stderr=True).status(message))
        shown[0].start()

    timer = Timer(SPINNER_AFTER, show)
    timer.daemon = True  # must not delay the end of the program
    timer.start()

    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        for status in shown:
            status.stop()


@contextmanager
def counter(message: str, total: int) -> Iterator[Callable[..., object]]:
    """Show a bar on standard error with the progress up to ``total``; nothing unless that is a terminal.

    Yields:
        A function that is called with the number of completed steps, and with that of all if it was not known before.
    """
    if not sys.stderr.isatty():
        yield lambda *_: None
        return

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(message, total=total)
        yield lambda done, all_steps=total: bar.update(task, completed=done, total=all_steps)


def problem_names(incomplete: str) -> list[str]:
    """Return the shipped problems that begin with a text, for the completion of a shell."""
    from rrtik_ompl.description.catalog import list_problems

    return [name for name in list_problems() if name.startswith(incomplete)]


def shown_names(incomplete: str) -> list[str]:
    """Return the shipped problems and robots that begin with a text, for the completion of a shell."""
    from rrtik_ompl.description.catalog import list_robots

    return problem_names(incomplete) + [name for name in list_robots() if name.startswith(incomplete)]


ProblemName = Annotated[
    str,
    typer.Argument(help="A shipped problem (see: rrtik list problems) or a YAML file.", autocompletion=problem_names),
]


def _seed(text: object) -> int:
    """Parse a seed: a whole number, or "random" to draw one."""
    from rrtik_ompl.base.arrays import seed_of  # with numpy, which help texts do without

    try:
        return seed_of(None if text == RANDOM else int(str(text)))
    except (ValueError, InputError):
        raise typer.BadParameter(f"'{text}' is neither a whole number of at least 0 nor '{RANDOM}'.") from None


Seed = Annotated[
    int,
    typer.Option(
        parser=_seed, metavar=f"[N|{RANDOM}]", help=f"The same seed gives the same result; {RANDOM}: one is drawn."
    ),
]
