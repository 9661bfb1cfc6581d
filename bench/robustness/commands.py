"""The command line with odd words: commands, options and arguments as the parser knows them, files that are spoilt."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator
from enum import Enum
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import typer

from bench.robustness.spoilt_files import FILES, Drawn, spoilt, write
from rrtik_ompl.cli import BAD_INPUT, FOUND, NOT_FOUND
from rrtik_ompl.cli.app import command_line, run

# Servers and minutes: a page that is served, sessions, campaigns and tables that are measured.
NEEDED = {"show": ("--html", "page.html"), "reproduce": ("--list",)}
FORBIDDEN = {"pilot": ("--simulated", "--vehicle", "--camera"), "reproduce": ("--all",), "bench": ("--scheduler",)}
SHORT = ("0.2", "0", "-1", "nan", "x", "", "3")  # where a good number means work
WORKING = {"--seconds", "--samples", "--runs", "--restarts", "--frames", "--views", "--jobs", "--ghosts", "--improve"}
WORKING |= {"--columns", "--rows", "--rate", "--cell"}
SUITE = "version: 1\nproblems: [planar3_a]\nplanners: [bicrdt]\nruns: 1\nseconds: 0.2\n"
FILE_NAMES = (
    *FILES,
    "suite.yaml",
    "none.yaml",
    "out.json",
    "out.csv",
    "out.yaml",
    "out.html",
    "out.txt",
    "out.png",
    ".",
)
WORDS = (
    *("planar3_a", "planar3", "bicrdt", "auto", "axis", "1", "0.5", "2", "1,2", "a=1", "range=0.1", "joint1", "home"),
    *("", "-1", "nan", "inf", "1e999", "9" * 400, "[" * 50, "\udcff", "\x1b[2J", "a" * 5000, "/dev/zero", "../..", "-"),
    *("--", "--help", "range=", "=", "1e-300", "0x10", "\u0661", "None", "{}", "'", "*", "~", "$HOME", "\n"),
)


class UnfitAnswer(Exception):
    """A command has answered as none may."""


@cache
def commands() -> dict[tuple[str, ...], list[Any]]:
    """Every command with its parameters, as the parser has them."""
    found: dict[tuple[str, ...], list[Any]] = {}
    for name, command in typer.main.get_command(command_line([])).commands.items():  # type: ignore[attr-defined]
        under = getattr(command, "commands", None)
        found |= {(name,): command.params} if under is None else {(name, k): each.params for k, each in under.items()}
    return found


def draw(rng: np.random.Generator) -> Drawn:
    """A command, most often with good files beside a spoilt one.

    Making it raises :class:`UnfitAnswer` if it ends with another code than 0, 1 or 2, says nothing of bad input, or
    says it in another way than in lines of its own.
    """
    bad = FILE_NAMES[rng.integers(len(FILES))] if rng.random() < 0.5 else ""
    files = {**{file: text for file, (text, _) in FILES.items()}, "suite.yaml": SUITE}
    if bad:
        files[bad] = spoilt(rng, files[bad])
    names = list(commands())
    name = names[rng.integers(len(names))]
    words = [*name, *_words(rng, name[0], commands()[name]), *NEEDED.get(name[0], ())]
    beside = f" {bad}: {files[bad]}" if bad else ""
    return Drawn(lambda: f"rrtik {words!r}"[:2000] + beside, partial(_call, words, files))


def _call(words: list[str], files: dict[str, str], folder: Path) -> None:
    os.chdir(folder)
    for name, text in files.items():
        _put(folder / name, text)
    judge(*said(words))


def _put(file: Path, text: str) -> None:
    """Write a file, unless it is known to be as it shall be: most are, and writing takes longer than most commands."""
    with contextlib.suppress(OSError):
        if _WRITTEN.get(file) == (text, *_mark(file)):
            return
    write(file, text)
    _WRITTEN[file] = (text, *_mark(file))


def _mark(file: Path) -> tuple[int, int, int]:
    found = file.stat()
    return found.st_mtime_ns, found.st_ino, found.st_size


_WRITTEN: dict[Path, tuple[str, int, int, int]] = {}


def said(words: list[str]) -> tuple[int, str]:
    """Exit code, and what a command says on standard error."""
    out, errors = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.TextIOWrapper(io.BytesIO(), "utf-8")
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        code = run(words)
        errors.flush()
    return code, errors.buffer.getvalue().decode("utf-8")


def judge(code: int, errors: str) -> None:
    """Refuse an answer that is none.

    Raises:
        UnfitAnswer: See :func:`draw`.
    """
    lines = errors.removesuffix("\n").split("\n") if errors else []
    if code not in (FOUND, NOT_FOUND, BAD_INPUT):
        raise UnfitAnswer(f"exit code {code}: {errors[:200]!r}")
    if code == BAD_INPUT and not lines:
        raise UnfitAnswer("exit code 2 without a word")
    for line in lines:
        if not line.startswith("rrtik: ") or not line.isprintable():
            raise UnfitAnswer(f"exit code {code}, a line that is none of ours: {line[:200]!r}")


def _words(rng: np.random.Generator, command: str, parameters: list[Any]) -> Iterator[str]:
    for parameter in parameters:
        names = [name for name in parameter.opts if name not in FORBIDDEN.get(command, ())]
        if not names or "--help" in names:
            continue
        if parameter.param_type_name == "argument":
            if rng.random() < 0.9:
                yield _value(rng, parameter, "")
        elif rng.random() < (0.8 if parameter.required else 0.2):
            yield names[0]
            if not parameter.is_flag:
                yield from (_value(rng, parameter, names[0]) for _ in range(parameter.nargs))
        elif names[0] == "--seconds":
            yield from ("--seconds", "0.2")


def _value(rng: np.random.Generator, parameter: Any, name: str) -> str:
    kind = parameter.bare_type()
    choices = [str(each.value) for each in kind] if isinstance(kind, type) and issubclass(kind, Enum) else []
    if choices and rng.random() < 0.7:
        return choices[rng.integers(len(choices))]
    if name in WORKING:
        return SHORT[rng.integers(len(SHORT))]
    places: tuple[str, ...] = FILE_NAMES if rng.random() < 0.6 else WORDS
    return places[rng.integers(len(places))]
