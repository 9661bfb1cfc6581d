"""Inputs that are all bad, made by rules, each given to a command: it says so in one line, at once, and ends with 2.

The rules: every option with values that it cannot have, misspelt, or without its value; arguments that are missing;
every number of every kind of file replaced by what is none; files that end too early.
"""

from __future__ import annotations

import os
import re
import resource
import signal
import time
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from bench.robustness.commands import SUITE, commands, said
from bench.robustness.spoilt_files import FILES, PROBLEM, STL, URDF, write
from rrtik_ompl.cli import BAD_INPUT

SECONDS, MEMORY_BYTES = 2.0, 1 << 30  # of the processor, and beside what a command has when it begins
HANG_SECONDS, ENDLESS_SECONDS = 120, 20.0  # of wall time, on a busy machine, and of the processor: then it is ended
UNFIT, CRASHED = 8, 9  # exit codes of a child

PATH = '{"version": 1, "waypoints": [[0, 0], [0.5, 0]]}'
PATH3 = '{"version": 1, "joint_names": ["joint1", "joint2", "joint3"], "waypoints": [[0, 0, 0], [0.5, 0, 0]]}'
OF_URDF = "version: 1\nrobot: {urdf: arm.urdf}\nstart: {joints: [0]}\ngoal: {joints: [0.5]}\n"
OF_MESH = PROBLEM.replace("box: [0.2, 0.2, 1]", "mesh: mesh.stl")
GOOD: dict[tuple[str, ...], tuple[str, ...]] = {
    ("plan",): ("planar3_a",),
    ("straight",): ("planar3_a", "--by", "0", "0.01", "0"),
    ("task",): ("titan4_drawer",),
    ("demos",): ("panda_pick_place", "--out", "demos", "--count", "1", "--jobs", "1"),
    ("check",): ("planar3_a",),
    ("prove",): ("planar3_a", "path3.json"),
    ("checker",): ("checker.html",),
    ("show",): ("planar3_a", "--html", "page.html"),
    ("play",): ("planar3_a",),
    ("moves",): ("path3.json",),
    ("time",): ("planar3_a", "path3.json"),
    ("replan",): ("replan_walls",),
    ("ik",): ("planar3", "--position", "1", "1", "0"),
    ("reach",): ("planar3",),
    ("overlay",): ("none.png", "planar3_a", "--camera-file", "none.yaml", "--map", "none.yaml", "--out", "out.png"),
    ("pilot",): ("titan4_sdu", "--simulated", "--no-browser"),
    ("reproduce",): ("drrt-con-arm", "--quick"),
    ("bench",): ("suite.yaml", "--out", "runs", "--views", "0"),
    ("list",): ("robots",),
    ("warmup",): (),
    ("convert",): ("problem.yaml", "other.yaml"),
    ("markers", "print"): ("sheet.pdf",),
    ("markers", "calibrate"): ("photographs", "--out", "camera.yaml"),
    ("markers", "map"): ("photographs", "--camera-file", "none.yaml", "--out", "map.yaml"),
    ("markers", "sense"): ("none.png", "--camera-file", "none.yaml", "--map", "none.yaml"),
}
NO_NUMBERS = {int: ("x", "", "1.5", "nan", "1e3", "0x10"), float: ("x", "", "nan", "inf", "-inf", "1e999", "1,5")}
NO_NAMES = ("nowhere/none.xyz", "\ud800", "\x00")
FOLDERS = {(("bench",), "--out"), (("demos",), "--out"), (("reproduce",), "--plot")}  # options that make folders
NO_FOLDER = "suite.yaml/none"  # where none can be made
ANY_TEXT = {"--token", "--grasp"}  # a word as good as any other
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.])")


class BadInput(NamedTuple):
    """Files beside the usual ones, and the words of a command."""

    files: Mapping[str, str]
    words: tuple[str, ...]


@cache
def bad_inputs() -> tuple[BadInput, ...]:
    """All of them, shuffled always alike, so that the first ones are of every kind."""
    every = [*_of_commands(), *_of_files()]
    return tuple(every[k] for k in np.random.default_rng(0).permutation(len(every)))


def _of_commands() -> Iterator[BadInput]:
    for name, parameters in commands().items():
        good = (*name, *GOOD[name])
        for parameter in parameters:
            option = parameter.opts[0]
            if parameter.param_type_name == "argument" or option == "--help":
                continue
            yield BadInput({}, (*good, f"{option}x"))
            if parameter.is_flag:
                yield BadInput({}, (*good, f"{option}=maybe"))
                continue
            yield BadInput({}, (*good, option))
            for value in _no_values(name, option, parameter):
                yield BadInput({}, (*good, option, *[value] * parameter.nargs))
        if any(parameter.required for parameter in parameters):
            yield BadInput({}, name)
        yield BadInput({}, (*good, *["one too many"] * 3))


def _no_values(name: tuple[str, ...], option: str, parameter: Any) -> tuple[str, ...]:
    kind = parameter.bare_type()
    if kind in NO_NUMBERS:
        return NO_NUMBERS[kind]
    if option in ANY_TEXT:
        return ()
    return (NO_FOLDER, *NO_NAMES[1:]) if (name, option) in FOLDERS else NO_NAMES


def _of_files() -> Iterator[BadInput]:
    no_yaml = (".nan", ".inf", "-.inf", "[1]", "{a: 1}", "x", "1e999", "true", "'1'", "2001-01-01", "!!float 1")
    for text in _replaced(PROBLEM, no_yaml):
        yield BadInput({"problem.yaml": text}, ("check", "problem.yaml"))
    for text in _replaced(FILES["dh.yaml"][0], no_yaml):
        yield BadInput({"dh.yaml": text}, ("ik", "dh.yaml", "--position", "1", "0", "0"))
    for text in _replaced(SUITE.replace("planar3_a", "planar"), no_yaml):
        yield BadInput({"suite.yaml": text.replace("planar]", "planar3_a]")}, ("bench", "suite.yaml", "--out", "runs"))
    for text in (*_replaced(URDF, ("nan", "inf", "1e999", "x", "1 2 3 4 5")), *_cut(URDF)):
        yield BadInput({"arm.urdf": text, "of_urdf.yaml": OF_URDF}, ("check", "of_urdf.yaml"))
    for text in (*_replaced(FILES["arm.xml"][0], ("nan", "1e999", "x")), *_cut(FILES["arm.xml"][0])):
        yield BadInput({"arm.xml": text}, ("ik", "arm.xml", "--position", "1", "0", "0"))
    for text in (*_replaced(PATH, ("NaN", "1e999", '"x"', "null", "[1]", "{}", "true")), *_cut(PATH)):
        yield BadInput({"path.json": text}, ("check", "problem.yaml", "path.json"))
    for text in (*_replaced(PATH3, ("NaN", "1e999", '"x"', "null")), *_cut(PATH3)):
        yield BadInput({"path3.json": text}, ("time", "planar3_a", "path3.json"))
    for text in _replaced("joint1,joint2\n0,0\n0.5,0\n", ("nan", "x", "", "1e999", "1;2")):
        yield BadInput({"path.csv": text}, ("moves", "path.csv"))
    normal = "normal 0 0 0\n"  # normals are not read: those of triangles follow from their corners
    spoilt = (text for text in _replaced(STL, ("nan", "x", "1e999")) if text.count(normal) == STL.count(normal))
    for text in (*spoilt, *_cut(STL[:60])):
        yield BadInput({"mesh.stl": text, "of_mesh.yaml": OF_MESH}, ("check", "of_mesh.yaml"))


def _replaced(text: str, others: tuple[str, ...]) -> Iterator[str]:
    for number in NUMBER.finditer(text):
        for other in others:
            yield text[: number.start()] + other + text[number.end() :]


def _cut(text: str) -> Iterator[str]:
    for length in range(0, len(text.rstrip())):
        yield text[:length]


@cache
def prepare() -> None:
    """Load what commands load, once for all children."""
    before = Path.cwd()
    with TemporaryDirectory() as folder:
        try:
            os.chdir(folder)
            for words in (
                ("check", "planar3_a"), ("check", "titan4_sdu"), ("ik", "planar3", "--position", "1", "1", "0"),
                ("plan", "planar3_a", "--html", "page.html", "--seconds", "0.2"), ("bench", "none.yaml"),
                ("moves", "none.csv"), ("markers", "print", "none"), ("markers", "sense", *GOOD["markers", "sense"]),
                ("reach", "planar3", "--samples", "10"), ("replan", "none"), ("task", "none"), ("convert", "a", "b"),
                ("reproduce", "none"), ("overlay", *GOOD["overlay",]), ("pilot", "none"), ("time", "none", "none"),
            ):  # fmt: skip
                said(list(words))
        finally:
            os.chdir(before)


def bad(first: int, count: int) -> list[str]:
    """Give some of the bad inputs to their commands, each in a child; what was not as it must be."""
    prepare()
    wrong = []
    for number in range(first, min(first + count, len(bad_inputs()))):
        given = bad_inputs()[number]
        with TemporaryDirectory() as folder:
            fault = _fault(given, Path(folder))
        if fault:
            shown = {name: text[:200] for name, text in given.files.items()}
            wrong.append(f"{number}: rrtik {' '.join(map(repr, given.words))} {shown or ''}: {fault}")
    return wrong


def _fault(given: BadInput, folder: Path) -> str:
    """What is wrong with the answer to a bad input; "" if nothing is."""
    for name, text in {**{name: text for name, (text, _) in FILES.items()}, **OTHERS, **given.files}.items():
        write(folder / name, text)
    child = os.fork()
    if child == 0:
        _child(given, folder)
    _, status, used = os.wait4(child, 0)
    seconds = used.ru_utime + used.ru_stime
    note = folder / "fault"
    if os.WIFSIGNALED(status):
        return "hang" if os.WTERMSIG(status) in (signal.SIGALRM, signal.SIGPROF) else f"signal {os.WTERMSIG(status)}"
    if os.WEXITSTATUS(status):
        return note.read_text(errors="backslashreplace") if note.exists() else f"exit code {os.WEXITSTATUS(status)}"
    return f"{seconds:.1f} s of the processor" if seconds > SECONDS else ""


OTHERS = {"suite.yaml": SUITE, "path3.json": PATH3}


def _child(given: BadInput, folder: Path) -> None:
    code = CRASHED
    try:
        os.chdir(folder)
        most = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (most + MEMORY_BYTES, most + MEMORY_BYTES))
        for name in (signal.SIGALRM, signal.SIGPROF):
            signal.signal(name, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, ENDLESS_SECONDS)
        signal.alarm(HANG_SECONDS)
        for number in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
        began = time.process_time()
        try:
            ended, errors = said(list(given.words))
            fault = _unfit(ended, errors)
        except BaseException as error:
            fault = f"{type(error).__name__}: {error}"
        if not fault and time.process_time() - began > SECONDS:
            fault = f"{time.process_time() - began:.1f} s of the processor"
        if fault:
            Path("fault").write_text(fault[:300], errors="backslashreplace")
        code = UNFIT if fault else 0
    finally:
        os._exit(code)


def _unfit(code: int, errors: str) -> str:
    lines = errors.removesuffix("\n").split("\n")
    if code != BAD_INPUT:
        return f"exit code {code}: {errors[:150]!r}"
    if len(lines) != 1 or not lines[0].startswith("rrtik: ") or not lines[0].isprintable():
        return f"not one line of ours: {errors[:200]!r}"
    return ""
