"""Descriptions of robots that others wrote: which of them load at the first call, and whether as the right robot.

Give it folders: unpacked wheels, copies of repositories. Every URDF, xacro, MJCF and MoveIt folder below them is loaded
with default options. Whether a description is whole (its files are there, its XML is valid, a joint moves) is judged
without rrtik_ompl: an MJCF by MuJoCo's compiler; others by ElementTree, by the package xacro, which can run anything,
and by looking for the files (those of packages in a folder of this name, or whose `package.xml` has it, anywhere below
the folder). The tip is compared with Pinocchio's or MuJoCo's own reading at 50 postures. Whether a tip or a joint is a
finger is judged by its name, but for hands alone: all joints are fingers', or the file is called hand, gripper or
finger and fewer than three are not. A description whose joints are all in loops is rightly refused by default and
listed apart.

A sample, those robots whose paths have the least SHA-256, is planned for: the default planner in a scene of four boxes
around the arm, up to three pairs of random postures, and the page of the path is written.

A description whose path below its folder has a SHA-256 that is divisible by three is held out: it is counted apart, and
neither its name nor why it was refused is shown, so that nobody mends the library for it.

The version of a folder is read from its `.dist-info`, or from a file beside it: NAME.commit.
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
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
import yaml
from typer import Argument, Option

import rrtik_ompl as rrtik
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import NotFoundError, RrtikError
from rrtik_ompl.model.robot import Robot

KINDS = ("MoveIt", "URDF", "xacro", "MJCF")
Case = tuple[str, str, str]  # folder, path below it, kind
MOVES = ("revolute", "continuous", "prismatic")
POSTURES = 50
AGREE = 1e-6  # [m], and of the entries of a rotation
SECONDS = 90.0
XACRO = ("{http://www.ros.org/wiki/xacro}", "{http://ros.org/wiki/xacro}")
FINGER = re.compile(r"finger|thumb|(^|_)(index|ring|pinky)(_|$)|knuckle|jaw|claw|phalan")
HAND = re.compile(r"hand|gripper|finger")  # name of the file of a hand alone
FEW = 3  # such a file has fewer other joints
PAIRS = 3  # of random postures that are tried
SAMPLES = 400  # postures from which reach and free postures are taken
PACKAGE = re.compile(r"^(?:package|model)://|^file://\$\(find ")


@dataclass
class Outcome:
    """What became of a description.

    Attributes:
        whole: Whether it can be loaded at all, as far as others can tell; else ``lacks`` says why not.
        loaded: Whether it was.
        said: The message of the refusal.
        armless: Whether that is that there is no arm in it, only joints in loops, as of most grippers of bars.
        off: Largest difference of the tip from Pinocchio's [m, or of an entry of the rotation]; None if not compared.
        seconds: Processor time.
        robot: Joints and tip.
        finger: Whether the tip is a finger by its name.
        fingers: How many actuated joints are those of fingers by their names.
    """

    whole: bool = True
    lacks: str = ""
    loaded: bool = False
    said: str = ""
    armless: bool = False
    off: float | None = None
    seconds: float = 0.0
    robot: str = ""
    finger: bool = False
    fingers: int = 0


@dataclass
class Planned:
    """What became of a plan in a scene of four boxes.

    Attributes:
        said: Why there is none; "" if there is one.
        proven: Whether the whole path is proven.
        world: Processor time of the first world [s].
        plan: Processor time of the plan [s].
        page: Processor time of the page [s].
        size: Bytes of the page.
    """

    said: str = ""
    proven: bool = False
    world: float = 0.0
    plan: float = 0.0
    page: float = 0.0
    size: int = 0


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
        tag for tag in own if tag.rpartition("}")[2] not in ("include", "macro", "property", "arg", "insert_block")
    ]
    return robot.tag == "robot" and bool(robot.get("name")) and bool(calls)


@dataclass(frozen=True)
class Files:
    """The files below a folder: their names, by their last part, and the folders of packages by name."""

    by_name: Mapping[str, Sequence[str]]
    packages: Mapping[str, Sequence[Path]]


@lru_cache(maxsize=1)
def files_below(folder: Path) -> Files:
    """Look through a folder."""
    by_name: dict[str, list[str]] = {}
    packages: dict[str, list[Path]] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            by_name.setdefault(path.name, []).append(path.as_posix())
        elif path.is_dir():
            packages.setdefault(path.name, []).append(path)
    for file in by_name.get("package.xml", ()):
        named = re.search(r"<name>\s*(\S+)\s*</name>", Path(file).read_text("utf-8", "replace"))
        if named:
            packages.setdefault(named[1], []).insert(0, Path(file).parent)
    return Files(by_name, packages)


def expanded(file: Path, files: Files, arguments: Mapping[str, str]) -> str:
    """The text of a URDF by the package xacro."""
    import xacro
    from xacro import substitution_args

    def find(name: str) -> str:
        if name not in files.packages:
            raise LacksError(f"package {name}")
        return str(files.packages[name][0])

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
        return (expanded(path, files, {}) if any(space.strip("{}") in text for space in XACRO) else text), path
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
    for package in files.packages.get(str(named.get("package", "")), ()):
        if (package / str(named.get("relative_path"))).is_file():
            return package / str(named.get("relative_path"))

    launch = folder / "launch" / "planning_context.launch"
    for line in launch.read_text("utf-8").splitlines() if launch.is_file() else ():
        found = re.search(r"""\$\(find ([\w-]+)\)/([^\s'"]+\.(urdf|xacro))""", line.replace("$(find xacro)/xacro", ""))
        if found and "semantic" not in line and "srdf" not in line and found[1] in files.packages:
            return files.packages[found[1]][0] / found[2]

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


def check_whole(text: str, file: Path, files: Files) -> None:
    """Raise an error unless a URDF has all that it needs."""
    root = _parsed(text)
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
        name = PACKAGE.sub("", uri).removeprefix("file://").replace(")", "")
        package, _, rest = name.partition("/")
        places = [each / rest for each in files.packages.get(package, ())] if PACKAGE.match(uri) else []
        if not any(place.is_file() for place in (*places, file.parent / name)):
            raise LacksError(f"mesh {Path(name).name}")


def compiled(file: Path) -> Any:
    """An MJCF by MuJoCo's own compiler."""
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        raise LacksError(f"MuJoCo: {error}") from error
    if not np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)).any():
        raise LacksError("joint that moves")
    return model


def outcome(folder: str, name: str, kind: str) -> Outcome:
    """Judge whether a description is whole, load it, and compare it."""
    home = Path(folder)
    path = home / name
    found = Outcome()
    text, model = None, None
    try:
        if kind == "MJCF":
            model = compiled(path)
        else:
            files = files_below(home)
            text, file = urdf_text(path, kind, files)
            check_whole(text, file, files)
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
        found.armless = "no arm in it" in found.said
    except Exception as error:  # which no description may cause
        found.said = f"{type(error).__name__}: {error}"
    found.seconds = time.process_time() - begin

    if robot is not None:
        found.loaded = True
        found.robot = f"{len(robot.joint_names)} joints ({', '.join(robot.joint_names)}), tip {robot.tip}"
        is_finger = [_is_finger(joint) for joint in robot.movable]
        alone = all(is_finger) or (bool(HAND.search(path.stem.lower())) and len(is_finger) - sum(is_finger) < FEW)
        found.finger = not alone and _is_finger(robot.tip)
        found.fingers = 0 if alone else sum(_is_finger(joint) for joint in robot.joint_names)
        if model is not None:
            found.off = _off_mujoco(robot, model)
        elif text is not None:
            found.off = _off(robot, text)
    return found


def _is_finger(name: str) -> bool:
    """Whether a link or joint has the name of a finger; a jaw that is fixed is a part of a palm."""
    return bool(FINGER.search(name.lower())) and "fixed" not in name.lower()


def planned(folder: str, name: str, kind: str) -> Planned:
    """Plan in a scene of four boxes, and write the page."""
    found = Planned()
    try:
        with warnings.catch_warnings(), _within(SECONDS), TemporaryDirectory() as scratch:
            warnings.simplefilter("ignore")
            robot = rrtik.load_robot(str(Path(folder) / name))
            begin = time.process_time()
            world = rrtik.World(robot, four_boxes(robot))
            found.world = time.process_time() - begin

            begin = time.process_time()
            problem, path, found.proven = _path(world)
            found.plan = time.process_time() - begin

            begin = time.process_time()
            page = Path(scratch) / "page.html"
            rrtik.view(problem, path, html=page)
            found.page = time.process_time() - begin
            found.size = page.stat().st_size
    except Exception as error:  # which are counted
        found.said = " ".join(f"{type(error).__name__}: {error}".split())
    return found


def four_boxes(robot: Robot) -> rrtik.Scene:
    """Posts on the diagonals around the base, at two thirds of where the tip gets."""
    rng = np.random.default_rng(0)
    base = np.array(robot.fk(robot.finite_range()[0], robot.model.frames[1].name).translation)
    tips = np.array([robot.fk(q).translation for q in rng.uniform(*robot.finite_range(), (SAMPLES, robot.dof))])
    reach = float(np.quantile(np.linalg.norm((tips - base)[:, :2], axis=1), 0.9)) or 1.0
    height = float(np.median(tips[:, 2]))
    corners = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    return rrtik.Scene(
        [
            rrtik.Obstacle(
                f"post {number}",
                rrtik.Box([0.1 * reach, 0.1 * reach, 0.6 * reach]),
                [base[0] + 0.5 * reach * x, base[1] + 0.5 * reach * y, height],
            )
            for number, (x, y) in enumerate(corners)
        ]
    )


def _path(world: rrtik.World) -> tuple[rrtik.Problem, rrtik.JointPath, bool]:
    """A problem between random free postures, its path, and whether that is proven."""
    robot = world.robot
    rng = np.random.default_rng(1)
    rows = rng.uniform(*robot.finite_range(), (SAMPLES, robot.dof))
    free = rows[world.valid_batch(rows)]
    if len(free) < 2:
        raise NotFoundError(f"{len(free)} of {SAMPLES} random postures are free")

    reason = ""
    for start, goal in list(zip(free[::2], free[1::2], strict=False))[:PAIRS]:
        problem = rrtik.Problem(world, start, goal)
        plan = rrtik.plan(problem)
        if plan.path is not None:
            return problem, plan.path, bool(plan.proven)
        reason = plan.reason
    raise NotFoundError(reason)


@contextmanager
def _within(seconds: float) -> Iterator[None]:
    """Raise an error after some processor time."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"takes more than {seconds:g} s")

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


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


def _off_mujoco(robot: Robot, model: Any) -> float | None:
    """Compare the tip in random postures with MuJoCo's; None if a joint that the robot holds still moves it there."""
    import mujoco

    kinds = ((mujoco.mjtObj.mjOBJ_BODY, "xbody"), (mujoco.mjtObj.mjOBJ_SITE, "site"))
    named = [(kind, mujoco.mj_name2id(model, kind, robot.tip), what) for kind, what in kinds]
    tip = next(((number, what) for _, number, what in named if number >= 0), None)
    if tip is None:
        return None

    body = model.site_bodyid[tip[0]] if tip[1] == "site" else tip[0]
    before: set[str] = set()
    while body > 0:
        for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
                before.add(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint) or "")
        body = model.body_parentid[body]
    if not before <= set(robot.joint_names):
        return None

    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    worst = 0.0
    for row in rng.uniform(*robot.finite_range(), (POSTURES, robot.dof)):
        for name, value in zip(robot.joint_names, row, strict=True):
            joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
            if joint >= 0:
                data.qpos[model.jnt_qposadr[joint]] = value
        mujoco.mj_kinematics(model, data)
        place = (data.site_xpos, data.site_xmat) if tip[1] == "site" else (data.xpos, data.xmat)
        pose = robot.fk(row).homogeneous
        worst = max(
            worst,
            float(np.abs(pose[:3, 3] - place[0][tip[0]]).max()),
            float(np.abs(pose[:3, :3] - place[1][tip[0]].reshape(3, 3)).max()),
        )
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
    plans: Annotated[int, Option(help="Robots that are planned for.")] = 60,
) -> Report:
    """Load all descriptions below the folders."""
    cases = [
        (str(folder.resolve()), name, kind)
        for folder in folders
        for kind, name in descriptions(folder.resolve())
        if kind in (kinds or KINDS)
    ]
    report = run.report("Descriptions of robots by others: what loads at the first call")
    found = parts(outcome, cases)
    chosen = sample(cases, found, plans)
    write(report, cases, found, robots=robots)
    write_plans(report, chosen, parts(planned, chosen))
    report.table("Versions", ("folder", "version"), [(folder.name, version(folder.resolve())) for folder in folders])
    return report


def sample(cases: Sequence[Case], found: Sequence[Outcome], count: int) -> list[Case]:
    """Descriptions to plan for: one of each robot that was loaded, those with the least digests."""
    by_digest = sorted(zip(cases, found, strict=True), key=lambda row: sha256(row[0][1].encode()).hexdigest())
    first: dict[str, Case] = {}
    for case, each in by_digest:
        if each.whole and each.loaded:
            first.setdefault(each.robot, case)
    return list(first.values())[:count]


def version(folder: Path) -> str:
    """Version of an unpacked wheel, or commit of a copy of a repository."""
    commit = folder.with_name(f"{folder.name}.commit")
    if commit.is_file():
        return commit.read_text("utf-8").strip()[:12]
    return ", ".join(sorted(each.name.removesuffix(".dist-info") for each in folder.glob("*.dist-info"))) or "unknown"


def write(report: Report, cases: Sequence[Case], found: Sequence[Outcome], *, robots: bool = False) -> None:
    """The page of what was found."""
    report.intro = " ".join((__doc__ or "").partition("\n\n")[2].split())
    rows = list(zip(cases, found, strict=True))
    shown = [(case, each) for case, each in rows if not held_out(case[1])]
    apart = [(case, each) for case, each in rows if held_out(case[1])]

    of_shown, of_apart = (
        _rate([each for _, each in group if each.whole and not each.armless]) for group in (shown, apart)
    )
    alone = [(_named(case), _short(each.said, case)) for case, each in shown if each.whole and each.armless]
    report.bar("loaded at the first call, of the whole ones", "98 %", f"{of_shown:.1f} %", of_shown >= 98.0)
    report.bar("those held out", "within 2 points", f"{of_apart:.1f} %", of_apart >= of_shown - 2.0)
    wrong = [(case, each) for case, each in rows if each.off is not None and each.off > AGREE]
    compared = sum(each.off is not None for _, each in rows)
    report.bar(f"tip elsewhere than Pinocchio or MuJoCo say, of {compared}", "0", str(len(wrong)), not wrong)

    for group, whose in ((shown, ""), (apart, ", held out")):
        arms = [each for _, each in group if each.whole and each.loaded]
        tips, joints = sum(each.finger for each in arms), sum(each.fingers > 0 for each in arms)
        wanted = "0" if group is shown else "only counted"
        report.bar(
            f"tip is a finger; a finger's joint is planned, of {len(arms)}{whose}",
            wanted,
            f"{tips}; {joints}",
            not (tips + joints) or group is apart,
        )

    heads = ("kind", "all", "whole", "loaded of these", "held out: whole", "loaded of these", "slowest [s]")
    table = []
    for kind in KINDS:
        ours, theirs = ([each for case, each in group if case[2] == kind] for group in (shown, apart))
        whole, their_whole = ([each for each in group if each.whole and not each.armless] for group in (ours, theirs))
        slowest = max((each.seconds for each in (*ours, *theirs)), default=0.0)
        counts = (len(ours) + len(theirs), len(whole), _share(whole), len(their_whole), _share(their_whole))
        table.append((kind, *map(str, counts), f"{slowest:.1f}"))
    report.table("By kind", heads, table)

    by_folder = Counter(Path(case[0]).name for case, each in rows if each.whole and not each.armless)
    loaded = Counter(Path(case[0]).name for case, each in rows if each.whole and each.loaded)
    report.table(
        "By folder", ("folder", "whole", "loaded"), [(k, str(n), str(loaded[k])) for k, n in sorted(by_folder.items())]
    )

    said = [
        (_named(case), _short(each.said, case))
        for case, each in shown
        if each.whole and not each.loaded and not each.armless
    ]
    report.table("Whole, not held out, and refused", ("description", "what was said"), said)
    report.table("No arm, which is said and not counted above", ("description", "what was said"), alone)
    off = [(_named(case), f"{each.off:.3g}", each.robot) for case, each in wrong if not held_out(case[1])]
    report.table("Not where Pinocchio or MuJoCo say", ("description", "off [m]", "robot"), off)
    fingered = [(_named(case), each.robot) for case, each in shown if each.whole and (each.finger or each.fingers)]
    report.table("Fingers as tips or planned", ("description", "robot"), fingered)
    lacking = Counter(each.lacks.partition(" ")[0] for _, each in rows if not each.whole)
    report.table("Not whole, by what is lacking", ("lacks", "count"), [(k, str(n)) for k, n in lacking.most_common()])
    if robots:
        all_robots = [(_named(case), each.robot) for case, each in shown if each.loaded]
        report.table("Robots", ("description", "robot"), all_robots)


def write_plans(report: Report, cases: Sequence[Case], found: Sequence[Planned]) -> None:
    """What became of the plans."""
    done = [each for each in found if not each.said]
    proven = sum(each.proven for each in done)
    report.bar(
        f"path in a scene of four boxes and its page, of {len(found)}", "", f"{len(done)}; {proven} proven", held=True
    )
    columns = (("first world", "world"), ("plan", "plan"), ("page", "page"))
    rows = [
        (what, *(f"{np.quantile([getattr(each, key) for each in done], share):.2f}" for share in (0.5, 0.95, 1.0)))
        for what, key in columns
        if done
    ]
    text = f"Processor time. Largest page: {max((each.size for each in done), default=0) / 1e6:.1f} MB."
    report.table("Plans", ("seconds", "median", "95 %", "most"), rows, text=text)
    shown = [
        (_named(case), _short(each.said, case))
        for case, each in zip(cases, found, strict=True)
        if each.said and not held_out(case[1])
    ]
    report.table("Not held out, and without a path", ("description", "what was said"), shown)


def _named(case: tuple[str, str, str]) -> str:
    return f"{Path(case[0]).name}/{case[1]}"


def _short(said: str, case: tuple[str, str, str]) -> str:
    return said.replace(case[0] + "/", "").replace("|", "/")[:300]


def _rate(found: Sequence[Outcome]) -> float:
    return 100.0 * sum(each.loaded for each in found) / max(1, len(found))


def _share(found: Sequence[Outcome]) -> str:
    return f"{sum(each.loaded for each in found)} ({_rate(found):.0f} %)"
