"""What a person sees of the command line: text and tables on standard output, progress and warnings on the other."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer

TRAJECTORY_FORMATS = (".json", ".csv", ".yaml", ".mcap")


def warn(message: Warning | str, *_: Any, **__: Any) -> None:
    """Say a warning in one line, in place of ``warnings.showwarning``."""
    print(f"rrtik: warning: {message}", file=sys.stderr)


def note(message: str) -> None:
    """Say in one line, on standard error, what takes a while."""
    print(f"rrtik: {message}", file=sys.stderr)


def prepare_streams() -> None:
    """Make printing safe: a stream that was closed leads nowhere, a letter that a terminal lacks is spelt out."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - open until the process ends
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def drop_output() -> None:
    """Let what could not be printed go, so that the end of the process does not try again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def say(*items: Any) -> None:
    """Print texts and tables on standard output."""
    from rich.console import Console

    # Wider than any table: where there is less room lines are broken, but no number is cut.
    console = Console(highlight=False, soft_wrap=True, markup=False, width=1000)
    with console.capture() as captured:
        for item in items:
            console.print(item)
    print(captured.get(), end="")


def suggest(*steps: str) -> None:
    """Say in a last line what may come next, where a person reads it: on a terminal, not in a file or a pipe."""
    if steps and sys.stdout.isatty():
        say(f"next: {'; '.join(steps)}")


def command(*words: object) -> str:
    """A command of ours as it is typed."""
    return shlex.join(["rrtik", *map(str, words)])


@contextmanager
def progress(message: str) -> Iterator[None]:
    """A spinner on standard error while something takes time; nothing unless that is a terminal."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(message):
        yield


@contextmanager
def counter(message: str, total: int) -> Iterator[Callable[[int], object]]:
    """A bar on standard error, showing how many of ``total`` are done; nothing unless that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(message, total=total)
        yield lambda done: bar.update(task, completed=done)


def problem_names(incomplete: str) -> list[str]:
    """Shipped problems that begin so: what a shell completes."""
    from rrtik_ompl.catalog import list_problems

    return [name for name in list_problems() if name.startswith(incomplete)]


def shown_names(incomplete: str) -> list[str]:
    """Shipped problems and robots that begin so."""
    from rrtik_ompl.catalog import list_robots

    return problem_names(incomplete) + [name for name in list_robots() if name.startswith(incomplete)]


ProblemName = Annotated[
    str,
    typer.Argument(help="A shipped problem (see: rrtik list problems) or a YAML file.", autocompletion=problem_names),
]
