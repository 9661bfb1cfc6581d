"""Files that try to run something, read to where they may not, or fill the memory: whatever opens them, nothing runs.

Every function of the library that opens a file is found by its name and its first parameter, and every command that
opens one by its name; each gets every hostile file. A file that is executed leaves a marker behind.
"""

from __future__ import annotations

import ast
import os
import pickle
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from functools import cache, partial
from importlib import import_module
from inspect import Parameter, signature
from io import BytesIO, StringIO
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from bench.shared.parts import Parts
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import RrtikError

LIBRARY = Path(rrtik.__file__).parent
MARKER = "EXECUTED"
RUNS = f"touch {MARKER}"
OPENING = ("path", "file", "name_or_file", "name", "folder")  # first parameters of functions that open files
NO_LOADERS = ("rrtik_ompl.kernels",)  # where load_ and read_ are of tables in memory
MAY_LOAD = re.compile(r"^def (?:load|read_|\w*_from_)", re.MULTILINE)  # a quick look at a text, before all is parsed
ENDINGS = (
    ".yaml", ".yml", ".json", ".jsonl", ".csv", ".txt", ".xml", ".mjcf", ".urdf", ".xacro", ".srdf", ".stl", ".obj",
    ".dae", ".ply", ".pcd", ".npy", ".npz", ".bt", ".ot", ".png", ".jpg", ".pkl", ".pickle", ".ipynb", ".py", ".toml",
)  # fmt: skip
SYSTEM = (
    "(lambda: [c for c in ().__class__.__base__.__subclasses__() if c.__name__ == '_wrap_close'][0]"
    f".__init__.__globals__['system']('{RUNS}'))()"
)
ARM = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
%s
<link name="base"/><link name="hand"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="%s" velocity="1" effort="1"/></joint></robot>
"""
XACRO = ARM % (f'<xacro:property name="p" value="${{{SYSTEM}}}"/>', "${1 + p}")
EXPRESSIONS = (
    SYSTEM,
    f"[c for c in ().__class__.__base__.__subclasses__() if c.__name__ == '_wrap_close'][0]('{RUNS}')",
    f"[f for f in python.values()][0]('{RUNS}')",
    "python.vars(xacro)",
    f"list(map(lambda x: x, ['{RUNS}']))",
    "xacro.load_yaml.func_globals",
    "list.mro()",
    f"str.format('x', '{RUNS}')",
    f"python.type('a', tuple(), dict(b='{RUNS}'))",
    "python.isinstance.im_self",
    f"open('{MARKER}', 'w')",
    "eval('1')",
    f"(x := '{RUNS}')",
    "xacro.message.__globals__",
    "math.__loader__",
    f"(yield '{RUNS}')",
    "xacro.load_yaml('/etc/hostname')",
    "xacro.load_yaml('../../../../../../../../etc/hostname')",
)
ELEMENTS = {
    "an include of another place": '<xacro:include filename="/etc/hostname"/>',
    "an include of a folder that is no package": '<xacro:include filename="$(find etc)/hostname"/>',
    "an include by dots": '<xacro:include filename="../../../../../../../../../../etc/hostname"/>',
    "a format in a property": (
        '<xacro:property name="f" value="{0.__class__.__init__.__globals__}"/>'
        '<xacro:property name="p" value="${list(map(f.format, [xacro.load_yaml]))}"/><link name="${p}"/>'
    ),
    "an evaluation": f'<xacro:property name="p" value="$(eval open(\'{MARKER}\',\'w\')"/><link name="${{p}}"/>',
    "an evaluation of names": '<link name="$(eval [open][0])"/>',
    "a default of a parameter": (
        f'<xacro:macro name="m" params="a:=${{{SYSTEM}}}"><link name="${{a}}"/></xacro:macro><xacro:m/>'
    ),
    "a condition": f'<xacro:if value="${{{SYSTEM}}}"/>',
    "a dynamic call": f'<xacro:call macro="${{{SYSTEM}}}"/>',
}
BOMBS = {
    "a long list": ARM % ("", "${len(list(range(9**9)))}"),
    "a large number": ARM % ("", "${9**9**9}"),
    "a long text": ARM % ("", "${len('a' * 10**10)}"),
    "a wide number": ARM % ("", "${len('%999999999d' % 1)}"),
    "a macro that calls itself": ARM % ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', "1"),
    "macros that double": ARM
    % (
        '<xacro:macro name="m" params="n"><xacro:if value="${n &lt; 99}"><xacro:m n="${n + 1}"/>'
        '<xacro:m n="${n + 1}"/></xacro:if></xacro:macro><xacro:m n="0"/>',
        "1",
    ),
    "a file that includes itself": ARM % ('<xacro:include filename="arm.xacro"/>', "1"),
    "properties that double": ARM
    % (
        '<xacro:property name="p0" value="${[1, 2]}"/>'
        + "".join(f'<xacro:property name="p{k + 1}" value="${{[p{k}] * 99}}"/>' for k in range(9)),
        "${len(str(p9))}",
    ),
    "entities that double": "<!DOCTYPE robot [<!ENTITY a0 'aaaaaaaaaa'>"
    + "".join(f"<!ENTITY a{k + 1} '{f'&a{k};' * 10}'>" for k in range(9))
    + "]>"
    + ARM % ("<link name='&a9;'/>", "1"),
    "a deep expression": ARM % ("", "${" + "(" * 5000 + "1" + ")" * 5000 + "}"),
    "a deep document": ARM % ("<a>" * 20_000 + "</a>" * 20_000, "1"),
    "a factorial": ARM % ("", "${len(str(factorial(factorial(13))))}"),
    "turns of a loop": ARM % ("", "${len([a for a in range(1000000) for b in range(1000000)])}"),
}


class _Runs:
    """What a pickle makes when it is opened."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return os.system, (RUNS,)


def _array() -> bytes:
    stream = BytesIO()
    np.save(stream, np.array([_Runs()], dtype=object), allow_pickle=True)
    return stream.getvalue()


def _arrays() -> bytes:
    stream = BytesIO()
    np.savez(stream, a=np.array([_Runs()], dtype=object))
    return stream.getvalue()


CONTENTS: Mapping[str, bytes] = {
    "a pickle": pickle.dumps(_Runs()),
    "a pickle of the first protocol": pickle.dumps(_Runs(), protocol=0),
    "an array of objects": _array(),
    "arrays of objects": _arrays(),
    "YAML with a tag": f'version: !!python/object/apply:os.system ["{RUNS}"]\n'.encode(),
    "YAML with a tag at the top": f'!!python/object/apply:os.system ["{RUNS}"]\n'.encode(),
    "a program": f"import os\nos.system('{RUNS}')\n".encode(),
    "a notebook": f'{{"cells": [{{"cell_type": "code", "source": ["!{RUNS}"]}}], "nbformat": 4}}'.encode(),
    "macros": XACRO.encode(),
    "an entity": (
        b'<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="&x;"><link name="&x;"/></robot>'
    ),
    "macros in JSON": (
        b'{"version": 1, "robot": {"urdf": "arm.xacro"}, "start": {"joints": [0]}, "goal": {"joints": [0]}}'
    ),
}


@cache
def loaders() -> dict[str, Callable[..., Any]]:
    """All functions of the library that open a file, by module and name."""
    found = {}
    for source in sorted(LIBRARY.rglob("*.py")):
        module = ".".join(("rrtik_ompl", *source.relative_to(LIBRARY).with_suffix("").parts)).removesuffix(".__init__")
        text = source.read_text(encoding="utf-8")
        if module.startswith(NO_LOADERS) or not MAY_LOAD.search(text):
            continue
        for node in ast.parse(text).body:
            if isinstance(node, ast.FunctionDef) and _opens(node):
                found[f"{module}.{node.name}"] = getattr(import_module(module), node.name)
    return found


def _opens(node: ast.FunctionDef) -> bool:
    named = node.name == "load" or node.name.startswith(("load_", "read_")) or "_from_" in node.name
    first = node.args.args[0] if node.args.args else None
    kind = "" if first is None or first.annotation is None else ast.unparse(first.annotation)
    return named and first is not None and first.arg in OPENING and ("Path" in kind)


def other_arguments(function: Callable[..., Any]) -> dict[str, Any]:
    """Values of what a loader needs besides the file.

    Raises:
        KeyError: If none is known; add it here.
    """
    known: dict[str, Callable[[], Any]] = {
        "world": _world,
        "robot": _robot,
        "cell": lambda: 0.1,
        "joints": lambda: ["turn"],
        "limit": lambda: 2**20,
        "readers": dict,
        "scale": lambda: np.ones(3),
    }
    _, *others = signature(function).parameters.values()
    needed = [each for each in others if each.default is Parameter.empty and each.kind is not Parameter.VAR_KEYWORD]
    return {each.name: known[each.name]() for each in needed}


def _robot() -> rrtik.Robot:
    return rrtik.load_robot("planar", parameters={"lengths": [1.0]})


def _world() -> rrtik.World:
    return rrtik.World(_robot())


def command_calls(folder: Path) -> dict[str, list[list[str]]]:
    """What is asked of each command, by its name: hostile files in all places where it takes one."""
    problem = str(folder / "problem.yaml")
    arm = str(folder / "arm.xacro")
    files = [str(folder / name) for name in ("path.json", "path.csv", "path.pkl")]
    with_paths = [[problem], *([problem, each] for each in files)]
    return {
        "plan": [[problem]],
        "straight": [[problem, "--xyz", "0,0,0"]],
        "task": [[str(folder / "task.yaml")]],
        "demos": [[str(folder / "task.yaml"), "--out", str(folder / "demos")]],
        "check": [*with_paths, [problem, files[0], "--certificate", files[2]]],
        "prove": [*([problem, each] for each in files), [arm, files[0], "--scene", files[2]]],
        "show": [*with_paths, [arm]],
        "play": with_paths,
        "moves": [[each] for each in files],
        "time": with_paths,
        "replan": [[problem]],
        "ik": [[arm, "--xyz", "0,0,0"], ["--problem", problem]],
        "reach": [[arm]],
        "overlay": [[str(folder / "a.png"), problem], [files[2], problem]],
        "pilot": [[problem]],
        "reproduce": [[problem]],
        "bench": [[str(folder / "suite.yaml")], [files[2]]],
        "checker": [[files[2]]],
        "list": [[problem]],
        "warmup": [],
        "convert": [[problem, str(folder / "out.yaml")], [files[0], str(folder / "out.csv")]],
        "markers": [["sense", files[2]], ["calibrate", files[2]], ["print", files[2]]],
    }


def write_files(folder: Path) -> list[Path]:
    """Hostile files that name others, in the forms that the library takes; returns those to be opened."""
    (folder / "arm.xacro").write_text(XACRO)
    (folder / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"><collision><geometry><mesh filename="evil.stl"/></geometry></collision>'
        "</link></robot>"
    )
    (folder / "arm.xml").write_text(
        '<mujoco><include file="evil.xml"/><asset><mesh name="m" file="evil.stl"/><texture name="t" type="2d" '
        'file="evil.png"/></asset><worldbody><body><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    (folder / "dh.yaml").write_text(f'version: 1\nname: !!python/object/apply:os.system ["{RUNS}"]\ndh: {{rows: []}}\n')
    for name in ("evil.stl", "evil.png", "evil.xml", "evil.ply", "evil.npz", "path.pkl", "path.csv", "a.png"):
        (folder / name).write_bytes(CONTENTS["a pickle"])
    (folder / "evil.py").write_text(f"import os\nos.system('{RUNS}')\nclass Evil: pass\n")
    (folder / "path.json").write_text('{"version": 1, "robot": {"urdf": "arm.xacro"}, "waypoints": [[0], [1]]}')

    ends = "start: {joints: [0]}\ngoal: {joints: [0.5]}\n"
    planar = "version: 1\nrobot: {planar: {lengths: [1]}}\n"
    problems = {
        "problem": f"version: 1\nrobot: {{urdf: arm.xacro}}\n{ends}run: {{step: 0.05, rate: 50}}\n",
        "trusting": f"version: 1\nrobot: {{urdf: arm.xacro, trust_xacro: true}}\n{ends}",
        "trusting_name": f"version: 1\nrobot: {{name: arm.xacro, trust_xacro: true}}\n{ends}",
        "by_name": f"version: 1\nrobot: arm.xacro\n{ends}",
        "moveit": f"version: 1\nrobot: {{moveit: moveit}}\n{ends}",
        "semantics": f"version: 1\nrobot: {{urdf: good.urdf, srdf: arm.xacro}}\n{ends}",
        "mjcf": f"version: 1\nrobot: {{mjcf: arm.xml}}\n{ends}",
        "mesh_of_robot": f"version: 1\nrobot: {{urdf: arm.urdf}}\n{ends}",
        "dh_of_robot": f"version: 1\nrobot: {{dh: dh.yaml}}\n{ends}",
        "mesh": f"{planar}scene: {{obstacles: [{{name: a, mesh: evil.stl}}]}}\n{ends}",
        "cloud": f"{planar}scene: {{obstacles: [{{name: a, cloud: evil.ply}}]}}\n{ends}",
        "arrays": f"{planar}scene: {{obstacles: [{{name: a, cloud: evil.npz}}]}}\n{ends}",
        "planner": f"{planar}{ends}planner: {{name: 'evil.py:Evil'}}\n",
        "task": "version: 1\nrobot: {urdf: arm.xacro}\nstart: {joints: [0]}\ntask: [{move_to: {joints: [0.5]}}]\n",
    }
    (folder / "good.urdf").write_text(ARM % ("", "1"))
    for name, text in problems.items():
        (folder / f"{name}.yaml").write_text(text)
    (folder / "suite.yaml").write_text(
        "version: 1\ntitle: t\nproblems: [problem.yaml]\nplanners: [bicrdt]\nruns: 1\nseconds: 1\nseed: 1\n"
    )
    (folder / "plan.json").write_text(
        '{"version": 1, "kind": "task_plan", "joint_names": ["turn"], "chosen": [], "motion_resolution": 0.01, '
        '"self_margin": 0.0, "motions": [{"stage": {"move_to": {"joints": [0.5]}}, "robot": {"urdf": "arm.xacro"}, '
        '"scene": {}, "waypoints": [[0.0], [0.5]]}], "notes": []}'
    )
    moveit = folder / "moveit"
    (moveit / "config").mkdir(parents=True)
    (moveit / ".setup_assistant").write_text(
        "moveit_setup_assistant_config:\n  URDF: {package: hostile, relative_path: arm.xacro}\n"
        "  SRDF: {relative_path: config/arm.srdf}\n"
    )
    (moveit / "config" / "arm.srdf").write_text(
        '<robot name="arm"><group name="arm"><joint name="turn"/></group></robot>'
    )
    (moveit / "hostile").mkdir()
    (moveit / "hostile" / "arm.xacro").write_text(XACRO)
    named = [folder / f"{name}.yaml" for name in problems]
    return [*named, moveit, *(folder / name for name in ("plan.json", "arm.xacro", "arm.urdf", "arm.xml", "dh.yaml"))]


def executed_by(name: str, every: int) -> list[str]:
    """Which files a loader of that name has executed, or not refused well.

    Args:
        name: Of `loaders`.
        every: 1 for every kind of content under every ending; n for each n-th of these.
    """
    function = loaders()[name]
    bad = []
    with TemporaryDirectory() as place:
        folder = Path(place)
        named = write_files(folder)
        others = other_arguments(function)
        for file in [*named, *_unnamed(folder, len(name) % every, every)]:
            if wrong := opened(folder, partial(function, file, **others)):
                bad.append(f"{name}({file.name}): {wrong}")
    return bad


def _unnamed(folder: Path, first: int, every: int) -> Iterator[Path]:
    for number, (content, ending) in enumerate(product(CONTENTS.values(), ENDINGS)):
        if number % every == first:
            file = folder / f"hostile{number}{ending}"
            file.write_bytes(content)
            yield file


def executed_by_command(name: str, *more: str) -> list[str]:
    """Which files a command has executed, with more words behind those of `command_calls`."""
    from rrtik_ompl.cli.app import run

    bad = []
    with TemporaryDirectory() as place:
        folder = Path(place)
        write_files(folder)
        for words in command_calls(folder)[name]:
            if wrong := opened(folder, partial(run, [name, *words, *more])):
                bad.append(f"rrtik {name} {' '.join(words)}: {wrong}")
    return bad


def executed_expression(text: str) -> list[str]:
    """Whether macros were refused that hold this expression or element; what went wrong if not."""
    content = ARM % (text, "1") if text.startswith("<") else ARM % ("", "${" + text + "}")
    return _refused(content.replace(" < ", " &lt; "), None)


def survived_bomb(name: str, seconds: float, gigabytes: float) -> list[str]:
    """Whether a file that fills time or memory ended with one line, within its limits; what went wrong if not."""
    return _refused(BOMBS[name], {"seconds": seconds, "gigabytes": gigabytes})


def _refused(text: str, limits: dict[str, float] | None) -> list[str]:
    with TemporaryDirectory() as place:
        file = Path(place) / "arm.xacro"
        file.write_text(text)
        wrong = opened(Path(place), lambda: rrtik.load_robot(file, xacro_limits=limits), must_fail=True, limits=limits)
    return [f"{text[:80]}: {wrong}"] if wrong else []


def opened(
    folder: Path, work: Callable[[], Any], *, must_fail: bool = False, limits: dict[str, float] | None = None
) -> str:
    """What is wrong with how a file was opened; nothing if it was refused in one line or taken, and ran nothing."""
    before = Path.cwd()
    os.chdir(folder)
    begin = time.perf_counter()
    wrong = "was taken" if must_fail else ""
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            answer = work()
            if isinstance(answer, Iterator):
                list(answer)
    except RrtikError as error:
        wrong = "more than one line" if "\n" in str(error) else ""
    except Exception as error:  # which is what is looked for
        wrong = f"{type(error).__name__}: {error}"
    finally:
        os.chdir(before)
    if limits is not None and time.perf_counter() - begin > limits["seconds"] + 5.0:  # another process may be slow
        wrong = f"took {time.perf_counter() - begin:.1f} s"
    for marker in folder.rglob(MARKER):
        marker.unlink()
        wrong = "EXECUTED"
    return wrong


def section(parts: Parts, size: float) -> Report:
    """The rows of hostile files."""
    report = Report("Hostile files", "")
    names = list(loaders())
    commands = list(command_calls(Path()))
    bombs = list(BOMBS)
    texts = [*EXPRESSIONS, *ELEMENTS.values()]
    few = slice(None) if size >= 0.1 else slice(None, 5)
    every = 1 if size >= 0.1 else 9

    opened = [each for found in parts(executed_by, [(name, every) for name in names[few]]) for each in found]
    files = len(CONTENTS) * len(ENDINGS)
    count = f"{len(names[few])} functions that open files, {files} hostile files and more that name others"
    _row(report, f"{count}, to each", "nothing is executed, each refused in one line or read", opened)

    asked = [each for found in parts(executed_by_command, [(name,) for name in commands[few]]) for each in found]
    _row(report, f"{len(commands[few])} commands with hostile files", "nothing is executed", asked)

    written = [each for found in parts(executed_expression, [(text,) for text in texts[few]]) for each in found]
    _row(report, f"{len(texts[few])} macros that reach for more than the list", "each is refused in one line", written)

    ended = [each for found in parts(survived_bomb, [(name, 10.0, 1.0) for name in bombs[few]]) for each in found]
    _row(report, f"{len(bombs[few])} bombs of macros", "one line, within 10 s and 1 GB", ended)
    return report


def _row(report: Report, what: str, wanted: str, wrong: list[str]) -> None:
    report.bar(what, wanted, f"{len(wrong)} otherwise", not wrong)
    if wrong:
        report.note(f"Otherwise: {what}", "\n".join(f"- {each}" for each in wrong))
