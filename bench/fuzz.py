"""Calls the public face with odd values and spoilt files, and writes down what is no answer and no error of ours.

    python bench/fuzz.py --file finds.jsonl --calls 100000

Calls are numbered; a number is the seed of its call, so that ``--first 4711 --calls 1`` repeats one. They run in forked
children with limits of memory and time: a child that crashes or hangs loses one call. The file holds one line for each
find, and one for each batch that is done: the next run goes on behind it. Functions are called by their signatures.
"""

from __future__ import annotations

import argparse
import faulthandler
import inspect
import json
import os
import resource
import signal
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.errors import RrtikError
from rrtik_ompl.files.messages import message_in

BATCH = 200  # calls of a child
FILE_SHARE = 0.3  # of the calls
MEMORY_BYTES = 4 << 30  # that the calls of a child may take beside what its parent has
SECONDS = 30  # of a call
LEFT_OUT = {"view", "plan_batch", "replan", "GoalSampler"}  # a server, processes, minutes; an object of OMPL
URDF = """<robot name="arm"><link name="base"/><link name="hand"><collision><geometry><sphere radius="0.1"/></geometry>
</collision></link><joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
PROBLEM = """version: 1
robot: {planar: {lengths: [1, 1], limits_deg: [[-90, 90], [-90, 90]], radius: 0.01}}
scene:
  obstacles:
    - {name: wall, box: [0.2, 0.2, 1], pose: {xyz: [-1.5, 0, 0], rpy_deg: [0, 0, 10]}, margin: 0.01}
    - {name: ball, sphere: 0.1, pose: {xyz: [-3, 0, 0], quat_xyzw: [0, 0, 0, 1]}}
start: {joints_deg: [0, 0]}
goal: {joints_deg: [45, 30]}
"""
STL = "solid a\n" + "".join(
    f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"
    for corners in ("vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n", "vertex 0 0 1\nvertex 1 0 0\nvertex 0 1 0\n")
)
MJCF = """<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="base"><geom size=".1"/>
<body name="hand" pos="0.5 0 0"><joint name="turn" axis="0 0 1" range="-1 1"/><geom type="box" size=".1 .1 .1"/>
<site name="tip"/></body></body></worldbody><keyframe><key name="home" qpos="0"/></keyframe></mujoco>"""
FILES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "problem.yaml": (PROBLEM, rrtik.load_problem),
    "arm.urdf": (URDF, rrtik.load_robot),
    "arm.xml": (MJCF, rrtik.load_robot),
    "dh.yaml": (
        "version: 1\nname: arm\ndh: {convention: standard, rows: [{a: 1, limits_deg: [-90, 90]}]}\n",
        rrtik.load_robot,
    ),
    "path.json": ('{"version": 1, "joint_names": ["a", "b"], "waypoints": [[0, 0], [0.5, 0]]}', rrtik.load_path),
    "path.csv": ("a,b\n0,0\n1,0.5\n", rrtik.load_path),
    "mesh.stl": (STL, rrtik.load_mesh),
    "message": ('{"name": "jog", "direction": 0.1, "press": 2, "seq": 3}', lambda path: message_in(path.read_bytes())),
}
BITS = (
    "nan",
    "1e999",
    "-1",
    "0",
    "[" * 50,
    "]",
    "{",
    "}",
    '"',
    "\x1b[2J",
    "\ud7ff",
    "null",
    "9" * 400,
    ":",
    "<",
    "&a;",
    "",
)


@cache
def corpus() -> list[Any]:
    """Values that arguments are drawn from: good ones of every kind, and odd ones."""
    robot = rrtik.load_robot("planar3")
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("far", rrtik.Sphere(0.1), rrtik.pose([9, 9, 9]))]))
    problem = rrtik.Problem(world, [0, 0, 0], [0.5, 0.2, 0])
    path = rrtik.JointPath.of(robot, [[0, 0, 0], [0.5, 0.2, 0]])
    good = [robot, world, problem, path, world.scene, rrtik.pose([1, 0, 0]), rrtik.PositionGoal([1, 1, 0]), "planar3"]
    good += [rrtik.TaskRegion([1, 1, 0], np.zeros((6, 2))), rrtik.MoveRules(["a", "b", "c"]), rrtik.GoalSet([good[6]])]
    good += [rrtik.PoseGoal(rrtik.pose([1, 1, 0])), rrtik.Sphere(0.1), [0, 0, 0], [1.0, 0.5, 0.1], "auto", "RRTConnect"]
    good += [np.zeros((2, 3)), np.eye(4), 1, 2, 0.5, True, world.scene.obstacles, ["joint1"], {"range": 0.1}]
    odd = [None, -1, 0, 10**400, float("nan"), float("inf"), 1e300, 1j, "", "\x00", "\ud800", "a" * 5000, b"x", [], {}]
    odd += [
        [[]],
        [[1, 2], [3]],
        "\ud7ff\udc00",
        [None],
        ["a"],
        {"a": 1},
        {1: 2},
        object(),
        int,
        len,
        np.zeros(0),
        np.zeros((0, 3)),
        np.full(3, np.nan),
    ]
    odd += [np.array(["a"]), np.array([None]), np.zeros((2, 3, 4)), -np.eye(4), iter([1]), range(3), Path("/none"), ...]
    return [*good, *good, *odd]


@cache
def functions() -> list[tuple[str, Callable[..., Any]]]:
    """Public functions and classes, and the public methods of what the corpus holds."""
    names = [name for name in rrtik.__all__ if name not in LEFT_OUT]
    found = [(name, getattr(rrtik, name)) for name in names]
    for thing in corpus():
        if type(thing).__module__.startswith("rrtik_ompl"):
            methods = inspect.getmembers(thing, inspect.ismethod)
            found += [(f"{type(thing).__name__}.{name}", each) for name, each in methods if not name.startswith("_")]
    return list(dict(found).items())


def call(seed: int, folder: Path) -> str:
    """Make the call of a number and say what it was; three in ten read a spoilt file."""
    rng = np.random.default_rng(seed)
    if rng.random() < FILE_SHARE:
        return _spoilt_file(rng, folder)
    name, function = functions()[rng.integers(len(functions()))]
    args, options = _arguments(rng, function)
    said = f"{name}({', '.join([*map(_short, args), *(f'{k}={_short(v)}' for k, v in options.items())])})"
    (folder / "now").write_text(said, errors="backslashreplace")
    os.chdir(folder)
    function(*args, **options)
    return said


def _arguments(rng: np.random.Generator, function: Callable[..., Any]) -> tuple[list[Any], dict[str, Any]]:
    values, args, options = corpus(), [], dict[str, Any]()
    for parameter in inspect.signature(function).parameters.values():
        value = values[rng.integers(len(values))]
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY:
            if rng.random() < 0.3:
                options[parameter.name] = value
        elif parameter.default is parameter.empty or rng.random() < 0.5:
            args.append(value)
        else:
            break
    return args, options


def _spoilt_file(rng: np.random.Generator, folder: Path) -> str:
    name = list(FILES)[rng.integers(len(FILES))]
    text, load = FILES[name]
    for _ in range(rng.integers(1, 4)):
        at, length = rng.integers(len(text) + 1), int(rng.integers(0, 12))
        text = text[:at] + BITS[rng.integers(len(BITS))] + text[at + length :]
    (folder / name).write_bytes(text.encode("utf-8", errors="surrogatepass"))
    (folder / "now").write_text(f"{name}: {text}", errors="backslashreplace")
    load(folder / name)
    return f"{name}: {text}"


def _short(value: object) -> str:
    try:
        return repr(value)[:60]
    except Exception:
        return type(value).__name__


def outcome(seed: int, folder: Path) -> str | None:
    """What is wrong with the outcome of a call; None if it is an answer, or an error of ours in one line."""
    try:
        call(seed, folder)
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


def _child(first: int, count: int, folder: Path, write: int) -> None:
    """Make calls; one line of JSON each to a pipe."""
    most = _address_space() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    faulthandler.disable()
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # ends the child, whatever it is in
    for name in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), name)
    for seed in range(first, first + count):
        signal.alarm(SECONDS)
        os.write(write, (json.dumps([seed, outcome(seed, folder)]) + "\n").encode())
    os._exit(0)


def run(first: int, count: int, folder: Path) -> Iterator[tuple[int, str]]:
    """Numbers of calls and what is wrong with them, of ``count`` calls from ``first`` on."""
    end = first + count
    while first < end:
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(read)
            _child(first, min(BATCH, end - first), folder, write)
        os.close(write)
        with os.fdopen(read) as lines:
            for line in lines:
                seed, wrong = json.loads(line)
                first = seed + 1
                if wrong is not None:
                    yield seed, f"{wrong} | {_now(folder)}"
        status = os.waitpid(child, 0)[1]
        if status != 0:
            what = "hang" if os.WTERMSIG(status) == signal.SIGALRM else f"crash, status {status}"
            yield first, f"{what} | {_now(folder)}"
            first += 1


def _now(folder: Path) -> str:
    """What the child was at, or nearly: it may be further than its last line."""
    note = folder / "now"
    return note.read_text()[:300] if note.exists() else ""


def main() -> None:
    """Run, and go on where the last run ended."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", type=Path, default=Path("finds.jsonl"))
    parser.add_argument("--calls", type=int, default=10_000)
    parser.add_argument("--first", type=int)
    given = parser.parse_args()
    lines = [json.loads(line) for line in given.file.read_text().splitlines()] if given.file.exists() else []
    first = given.first if given.first is not None else max((line.get("done", 0) for line in lines), default=0)
    corpus(), functions()
    with given.file.open("a") as log, tempfile.TemporaryDirectory() as folder:
        for begin in range(first, first + given.calls, BATCH):
            count = min(BATCH, first + given.calls - begin)
            for seed, wrong in run(begin, count, Path(folder)):
                log.write(json.dumps({"seed": seed, "wrong": wrong}) + "\n")
                print(seed, wrong, flush=True)
            log.write(json.dumps({"done": begin + count}) + "\n")
            log.flush()


if __name__ == "__main__":
    main()
