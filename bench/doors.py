"""Descriptions of robots that others wrote: which of them load at the first call, and whether as the right robot.

Give it folders: unpacked wheels, copies of repositories. Every URDF, xacro, MJCF and MoveIt folder below them is loaded
with default options, in a process of its own. Whether a description is whole (its files are there, its XML is valid, a
joint moves) is judged without rrtik_ompl: by ElementTree, by the package xacro, which can run anything, and by looking
for the file names anywhere below the folder. The tip of each URDF is compared with Pinocchio's own reading of it.

A description whose path below its folder has a SHA-256 that is divisible by three is held out: it is counted apart, and
neither its name nor why it was refused is shown, so that nobody mends the library for it.
"""

from __future__ import annotations

import io
import re
import shlex
import signal
import time
import warnings
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
import yaml
from typer import Argument, Option

import rrtik_ompl as rrtik
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.model.robot import Robot

KINDS = ("MoveIt", "URDF", "xacro", "MJCF")
MOVES = ("revolute", "continuous", "prismatic")
POSTURES = 50
AGREE = 1e-6  # [m], and of the entries of a rotation
SECONDS = 90.0
XACRO = "{http://www.ros.org/wiki/xacro}"
PACKAGE = re.compile(r"^(?:package|model)://|^file://\$\(find ")


@dataclass
class Outcome:
    """What became of a description.

    Attributes:
        whole: Whether it can be loaded at all, as far as others can tell; else ``lacks`` says why not.
        loaded: Whether it was.
        said: The message of the refusal.
        off: Largest difference of the tip from Pinocchio's [m, or of an entry of the rotation]; None if not compared.
        seconds: Processor time.
        robot: Joints and tip.
    """

    whole: bool = True
    lacks: str = ""
    loaded: bool = False
    said: str = ""
    off: float | None = None
    seconds: float = 0.0
    robot: str = ""


class LacksError(Exception):
    """A description is not whole."""


def held_out(name: str) -> bool:
    """Whether a description is only measured, never looked at."""
    return int(sha256(name.encode()).hexdigest(), 16) % 3 == 0


def descriptions(folder: Path) -> Iterator[tuple[str, str]]:
    """Kind and path below a folder of each description in it."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_dir():
            if (path / ".setup_assistant").is_file() or list(path.glob("config/*.srdf")):
                yield "MoveIt", name
        elif path.suffix == ".urdf":
            yield "URDF", name
        elif path.suffix == ".xacro" and _is_robot(path):
            yield "xacro", name
        elif path.suffix == ".xml" and b"<mujoco" in _start(path) and _has_joint(path):
            yield "MJCF", name


def _start(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(2000)


def _has_joint(path: Path) -> bool:
    return re.search(rb"<(joint|freejoint|include)\b", path.read_bytes()) is not None


def _is_robot(path: Path) -> bool:
    """Whether macros are those of a whole robot: it has a name, and uses a macro or has joints outside of macros."""
    if ".srdf" in path.name:
        return False
    try:
        robot = ElementTree.fromstring(path.read_bytes())
    except ElementTree.ParseError:
        return False
    own = [element.tag for element in robot if element.tag.startswith(XACRO) or element.tag in ("joint", "link")]
    calls = [
        tag for tag in own if tag.removeprefix(XACRO) not in ("include", "macro", "property", "arg", "insert_block")
    ]
    return robot.tag == "robot" and bool(robot.get("name")) and bool(calls)


@dataclass(frozen=True)
class Files:
    """The files below a folder: their names, by their last part, and the folders of packages by name."""

    by_name: Mapping[str, Sequence[str]]
    packages: Mapping[str, Path]


@lru_cache(maxsize=1)
def files_below(folder: Path) -> Files:
    """Look through a folder."""
    by_name: dict[str, list[str]] = {}
    packages: dict[str, Path] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            by_name.setdefault(path.name, []).append(path.as_posix())
        elif path.is_dir():
            packages.setdefault(path.name, path)
    for file in by_name.get("package.xml", ()):
        named = re.search(r"<name>\s*(\S+)\s*</name>", Path(file).read_text("utf-8", "replace"))
        if named:
            packages[named[1]] = Path(file).parent
    return Files(by_name, packages)


def expanded(file: Path, files: Files, arguments: Mapping[str, str]) -> str:
    """The text of a URDF by the package xacro."""
    import xacro
    from xacro import substitution_args

    def find(name: str) -> str:
        if name not in files.packages:
            raise LacksError(f"package {name}")
        return str(files.packages[name])

    substitution_args._eval_find = substitution_args._eval_dict["find"] = find
    with redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
        try:
            return str(xacro.process_file(str(file), mappings=dict(arguments)).toxml())
        except (Exception, SystemExit) as error:  # of anything that a macro may do
            raise LacksError(f"xacro: {error}") from error


def urdf_text(path: Path, kind: str, files: Files) -> tuple[str, Path]:
    """The URDF of a description, by others' means, and its file."""
    if kind == "URDF":
        text = path.read_text("utf-8", "replace")
        return (expanded(path, files, {}) if XACRO.strip("{}") in text else text), path
    if kind == "xacro":
        return expanded(path, files, {}), path

    file = _urdf_of(path, files)
    return (expanded(file, files, _arguments(path)) if file.suffix == ".xacro" else file.read_text("utf-8")), file


def _assistant(folder: Path) -> Mapping[str, Any]:
    file = folder / ".setup_assistant"
    top = yaml.safe_load(file.read_text("utf-8")) if file.is_file() else {}
    named: Mapping[str, Any] = {key.lower(): value for key, value in next(iter(top.values()), {}).items()}
    return named.get("urdf") or {}


def _arguments(folder: Path) -> dict[str, str]:
    written = _assistant(folder).get("xacro_args") or ""
    words = shlex.split(written if isinstance(written, str) else " ".join(written))
    return {name: value for name, given, value in (word.partition(":=") for word in words) if given}


def _urdf_of(folder: Path, files: Files) -> Path:
    """The URDF of a MoveIt folder: that of the package which the assistant names, or the one in the folder."""
    srdfs = [*folder.glob("config/*.srdf"), *folder.glob("config/*.srdf.xacro"), *folder.glob("*.srdf")]
    if not srdfs:
        raise LacksError("SRDF")
    for srdf in srdfs:
        _parsed(srdf.read_text("utf-8", "replace"))

    named = _assistant(folder)
    package = files.packages.get(str(named.get("package", "")))
    if package is not None and (package / str(named.get("relative_path"))).is_file():
        return package / str(named.get("relative_path"))

    launch = folder / "launch" / "planning_context.launch"
    for line in launch.read_text("utf-8").splitlines() if launch.is_file() else ():
        found = re.search(r"""\$\(find ([\w-]+)\)/([^\s'"]+\.(urdf|xacro))""", line.replace("$(find xacro)/xacro", ""))
        if found and "semantic" not in line and "srdf" not in line and found[1] in files.packages:
            return files.packages[found[1]] / found[2]

    inside = [*folder.glob("config/*.urdf"), *folder.glob("config/*.urdf.xacro")]
    inside = [file for file in inside if not file.name.startswith("gazebo_")] or inside
    if len(inside) == 1:
        return inside[0]
    raise LacksError(f"URDF of package {named.get('package')}")


def _parsed(text: str) -> ElementTree.Element:
    try:
        return ElementTree.fromstring(text.strip())
    except ElementTree.ParseError as error:
        raise LacksError(f"XML: {error}") from error


def check_whole(text: str, kind: str, file: Path, files: Files) -> None:
    """Raise an error unless a description has all that it needs."""
    root = _parsed(text)
    if kind == "MJCF":
        if root.tag != "mujoco" or root.find(".//joint") is None:
            raise LacksError("joint that moves")
        return

    moving = [joint for joint in root.findall("joint") if joint.get("type") in MOVES]
    if root.tag != "robot" or not moving:
        raise LacksError("joint that moves")
    links = {link.get("name") for link in root.findall("link")}
    children = [child.get("link") for child in root.findall("joint/child")]
    ends = {end.get("link") for tag in ("parent", "child") for end in root.findall(f"joint/{tag}")}
    if len(set(children)) != len(children) or not ends <= links or len(links) != len(children) + 1:
        raise LacksError("tree of links and joints")
    for mesh in root.findall("link/collision/geometry/mesh"):
        uri = mesh.get("filename", "")
        name = PACKAGE.sub("", uri).removeprefix("file://").replace(")", "").lstrip("./")
        rest = name.partition("/")[2] if PACKAGE.match(uri) else name
        found = any(path.endswith("/" + rest.lstrip("./")) for path in files.by_name.get(Path(name).name, ()))
        if not found and not (file.parent / name).is_file():
            raise LacksError(f"mesh {Path(name).name}")


def outcome(folder: str, name: str, kind: str) -> Outcome:
    """Judge whether a description is whole, load it, and compare it."""
    home = Path(folder)
    path = home / name
    found = Outcome()
    text = None
    try:
        files = files_below(home)
        text, file = (path.read_text("utf-8", "replace"), path) if kind == "MJCF" else urdf_text(path, kind, files)
        check_whole(text, kind, file, files)
    except (LacksError, OSError, UnicodeDecodeError, yaml.YAMLError) as lack:
        found.whole = False
        found.lacks = " ".join(str(lack).split())

    begin = time.process_time()
    robot = None
    try:
        with warnings.catch_warnings(), _within(SECONDS):
            warnings.simplefilter("ignore")
            robot = rrtik.load_robot(str(path))
    except RrtikError as error:
        found.said = str(error)
    except Exception as error:  # which no description may cause
        found.said = f"{type(error).__name__}: {error}"
    found.seconds = time.process_time() - begin

    if robot is not None:
        found.loaded = True
        found.robot = f"{len(robot.joint_names)} joints ({', '.join(robot.joint_names)}), tip {robot.tip}"
        if text is not None and kind != "MJCF":
            found.off = _off(robot, text)
    return found


@contextmanager
def _within(seconds: float) -> Iterator[None]:
    """Raise an error after some time."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"takes more than {seconds:g} s")

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _off(robot: Robot, text: str) -> float | None:
    """Compare the tip in random postures with Pinocchio's reading of a URDF; None if that cannot read it."""
    root = ElementTree.fromstring(text.strip())
    for item in (*root.findall("link/visual"), *root.findall("link/collision")):
        item.clear()
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for item in link.findall(tag):
                link.remove(item)
    with redirect_stderr(io.StringIO()):
        try:
            model = pin.buildModelFromXML(ElementTree.tostring(root, "unicode"))
        except (ValueError, RuntimeError):
            return None
    if not model.existFrame(robot.tip, pin.FrameType.BODY):
        return float("inf")

    joints = {joint.get("name", ""): joint for joint in root.findall("joint") if joint.get("type") in MOVES}
    data = model.createData()
    frame = model.getFrameId(robot.tip, pin.FrameType.BODY)
    rng = np.random.default_rng(0)
    worst = 0.0
    for row in rng.uniform(*robot.finite_range(), (POSTURES, robot.dof)):
        values = dict(zip(robot.joint_names, row.tolist(), strict=True))
        q = pin.neutral(model)
        for name in joints:
            number = model.joints[model.getJointId(name)]
            value = _value(name, joints, values)
            q[number.idx_q : number.idx_q + number.nq] = value if number.nq == 1 else (np.cos(value), np.sin(value))
        pin.framesForwardKinematics(model, data, q)
        difference = data.oMf[frame].homogeneous - robot.fk(row).homogeneous
        worst = max(worst, float(np.abs(difference).max()))
    return worst


def _value(name: str, joints: Mapping[str, ElementTree.Element], values: Mapping[str, float]) -> float:
    """The value of a joint: given, that of the joint it follows, or zero, moved into its limits."""
    if name in values:
        return values[name]
    joint = joints[name]
    tie = joint.find("mimic")
    if tie is not None and tie.get("joint") in joints:
        leader = _value(str(tie.get("joint")), joints, values)
        return float(tie.get("multiplier", "1")) * leader + float(tie.get("offset", "0"))
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return 0.0
    return float(np.clip(0.0, float(limit.get("lower", "0")), float(limit.get("upper", "0"))))


def main(
    run: Run,
    parts: Parts,
    folders: Annotated[list[Path], Argument(help="Unpacked wheels, copies of repositories.", exists=True)],
    *,
    kinds: Annotated[list[str] | None, Option("--kind", help="MoveIt, URDF, xacro, MJCF; may be repeated.")] = None,
    robots: Annotated[bool, Option(help="List joints and tips of all that are not held out.")] = False,
) -> Report:
    """Load all descriptions below the folders."""
    cases = [
        (str(folder.resolve()), name, kind)
        for folder in folders
        for kind, name in descriptions(folder.resolve())
        if kind in (kinds or KINDS)
    ]
    report = run.report("Descriptions of robots by others: what loads at the first call")
    write(report, cases, parts(outcome, cases), robots=robots)
    return report


def write(
    report: Report, cases: Sequence[tuple[str, str, str]], found: Sequence[Outcome], *, robots: bool = False
) -> None:
    """The page of what was found."""
    report.intro = " ".join((__doc__ or "").partition("\n\n")[2].split())
    rows = list(zip(cases, found, strict=True))
    shown = [(case, each) for case, each in rows if not held_out(case[1])]
    apart = [(case, each) for case, each in rows if held_out(case[1])]

    of_shown, of_apart = (_rate([each for _, each in group if each.whole]) for group in (shown, apart))
    report.bar("loaded at the first call, of the whole ones", "98 %", f"{of_shown:.1f} %", of_shown >= 98.0)
    report.bar("those held out", "within 2 points", f"{of_apart:.1f} %", of_apart >= of_shown - 2.0)
    wrong = [(case, each) for case, each in rows if each.off is not None and each.off > AGREE]
    compared = sum(each.off is not None for _, each in rows)
    report.bar(f"tip elsewhere than Pinocchio says, of {compared}", "0", str(len(wrong)), not wrong)

    heads = ("kind", "all", "whole", "loaded of these", "held out: whole", "loaded of these", "slowest [s]")
    table = []
    for kind in KINDS:
        ours, theirs = ([each for case, each in group if case[2] == kind] for group in (shown, apart))
        whole, their_whole = ([each for each in group if each.whole] for group in (ours, theirs))
        slowest = max((each.seconds for each in (*ours, *theirs)), default=0.0)
        counts = (len(ours) + len(theirs), len(whole), _share(whole), len(their_whole), _share(their_whole))
        table.append((kind, *map(str, counts), f"{slowest:.1f}"))
    report.table("By kind", heads, table)

    by_folder = Counter(Path(case[0]).name for case, each in rows if each.whole)
    loaded = Counter(Path(case[0]).name for case, each in rows if each.whole and each.loaded)
    report.table(
        "By folder", ("folder", "whole", "loaded"), [(k, str(n), str(loaded[k])) for k, n in sorted(by_folder.items())]
    )

    said = [(_named(case), _short(each.said, case)) for case, each in shown if each.whole and not each.loaded]
    report.table("Whole, not held out, and refused", ("description", "what was said"), said)
    off = [(_named(case), f"{each.off:.3g}", each.robot) for case, each in wrong if not held_out(case[1])]
    report.table("Not where Pinocchio says", ("description", "off [m]", "robot"), off)
    lacking = Counter(each.lacks.partition(" ")[0] for _, each in rows if not each.whole)
    report.table("Not whole, by what is lacking", ("lacks", "count"), [(k, str(n)) for k, n in lacking.most_common()])
    if robots:
        all_robots = [(_named(case), each.robot) for case, each in shown if each.loaded]
        report.table("Robots", ("description", "robot"), all_robots)


def _named(case: tuple[str, str, str]) -> str:
    return f"{Path(case[0]).name}/{case[1]}"


def _short(said: str, case: tuple[str, str, str]) -> str:
    return said.replace(case[0] + "/", "").replace("|", "/")[:300]


def _rate(found: Sequence[Outcome]) -> float:
    return 100.0 * sum(each.loaded for each in found) / max(1, len(found))


def _share(found: Sequence[Outcome]) -> str:
    return f"{sum(each.loaded for each in found)} ({_rate(found):.0f} %)"
