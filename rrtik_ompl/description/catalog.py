"""Look up by name the robots, planners and problems that installed packages offer, and load robots from files.

Packages offer them through entry points in these groups: ``rrtik_ompl.robots`` (name -> a function that takes keyword
options and returns a `Robot`), ``rrtik_ompl.planners`` (name -> a class), ``rrtik_ompl.problems`` (any name -> the
``Path`` of a folder of problem files), ``rrtik_ompl.suites`` (likewise, suites for ``rrtik bench``),
``rrtik_ompl.tables`` (any name -> published tables for ``rrtik reproduce``, see `rrtik_bench.tables.Collection`) and
``rrtik_ompl.workspaces`` (name of a robot -> a function that returns slices of its effective workspace, see
`rrtik_ompl.ik.reach.Slice`).
"""

from __future__ import annotations

import inspect
import json
import os
import threading
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.errors import InputError, RrtikError, UnknownNameError, listed, name_of, require
from rrtik_ompl.description.known_arms import fetched, is_description, shipped_name, unknown_robot
from rrtik_ompl.description.offers import offers_of
from rrtik_ompl.description.robot_source import BasePose, plain, source_entry
from rrtik_ompl.description.robot_source import base_pose as checked_base
from rrtik_ompl.description.urdf import URDF_OPTIONS, robot_from_urdf
from rrtik_ompl.description.variants import narrowed, padded, scaled, weighted
from rrtik_ompl.description.xacro_text import expanding
from rrtik_ompl.files.kinds import FilePath, refusing_others
from rrtik_ompl.files.text import file_name, is_utf8
from rrtik_ompl.model.robot import Robot

AUTO = "auto"  # a portfolio of planners, which `plan()` runs if none is named
SOLVED_KINDS = ("any goal", "goal of the tip", "path constraints")  # what planners of "auto" say that they solve
FILE_OPTIONS = ("urdf", "srdf", "joint_limits", "dh", "moveit", "mjcf")
FILE_KINDS = (".urdf", ".xml", ".mjcf", ".xacro", ".yaml", ".yml")
PARAMETRIC = ("planar", "point2d")  # robots that a problem file describes by their own group of keys
CALLER_OPTIONS = ("trust_xacro", "xacro_limits")  # options that no file may give
# Options of any robot, each with the function that applies it.
COMMON_OPTIONS: Mapping[str, Callable[..., Robot]] = {
    "scale": scaled,
    "padding": padded,
    "joint_ranges": narrowed,
    "joint_weights": weighted,
}
VALUES_BY = {"locked": "joint", "gripper": "state, open and closed", "xacro_args": "argument"}
CACHED_ROBOTS = 16  # with all that was derived from them
MOUNTING = ("base_pose", "tip", *COMMON_OPTIONS)  # keys beside the group of a parametric robot


def list_robots() -> tuple[str, ...]:
    """Return the names that `load_robot` knows.

    Example:
        >>> "panda" in rrtik.list_robots()
        True
    """
    return tuple(sorted(offers_of("robots")))


def list_planners() -> tuple[str, ...]:
    """Return the names of the planners that packages offer (without OMPL's own)."""
    return tuple(sorted(offers_of("planners")))


def find_planner(name: str) -> type[Any]:
    """Return the planner class of a name.

    Raises:
        UnknownNameError: If no package offers it.
    """
    found: type[Any] = _load("planner", "planners", name)
    return found


def is_auto(name: str) -> bool:
    """Check whether the name of a planner stands for the portfolio, which has no class.

    Raises:
        InputError: If it is no name.
    """
    require(name, str, "name of a planner", "see list_planners()")
    return name.lower() == AUTO


@cache
def portfolio() -> Mapping[str, str]:
    """Return the planners that "auto" uses, in the order of their turns, each with the kind of goal that it solves.

    A package that offers planners lists them in ``PORTFOLIO`` of its top-level module, by name: "any goal", "goal of
    the tip" (the planner finds the configurations itself) or "path constraints". No planner is imported for this.
    """
    offered = offers_of("planners")
    packages = sorted({entry.module.partition(".")[0] for entry in offered.values()})
    found: dict[str, str] = {}

    for package in packages:
        try:
            listed: Mapping[str, str] = getattr(import_module(package), "PORTFOLIO", {})
        except Exception as error:
            # The default planner does without the planners of a package that is broken.
            warnings.warn(f"planners of '{package}' are left out of \"auto\": {error}; reinstall it", stacklevel=2)
            continue
        for name, solves in listed.items():
            kind = one_of(SOLVED_KINDS, solves, f"kind of goals of '{name}' in PORTFOLIO of '{package}'")
            if name in offered:
                found.setdefault(name, kind)
    return MappingProxyType(found)


def find_workspace(robot: str) -> Callable[[], Any]:
    """Return the function that computes a robot's effective workspace; it takes no arguments and returns slices.

    Raises:
        UnknownNameError: If no package offers one for this robot.
    """
    found: Callable[[], Any] = _load("effective workspace of robot", "workspaces", robot)
    return found


def list_problems() -> tuple[str, ...]:
    """Return the names of the problems that packages ship.

    Example:
        >>> "panda_shelf" in rrtik.list_problems()
        True
    """
    return tuple(sorted(_problem_files()))


def find_problem(name: str) -> Path:
    """Return the file of a shipped problem.

    Raises:
        UnknownNameError: If no package ships it.
    """
    files = _problem_files()
    if name not in files:
        raise UnknownNameError("problem", name, files)
    return files[name]


def list_suites() -> tuple[str, ...]:
    """Return the names of the benchmark suites that packages ship."""
    return tuple(sorted(_shipped("suite", "suites")))


def find_suite(name: str) -> Path:
    """Return the file of a shipped suite.

    Raises:
        UnknownNameError: If no package ships it.
    """
    files = _shipped("suite", "suites")
    if name not in files:
        raise UnknownNameError("suite", name, files)
    return files[name]


def find_tables() -> tuple[Any, ...]:
    """Return the collections of published tables that packages offer, one per package.

    Raises:
        InputError: If one of them cannot be loaded.
    """
    return tuple(_load("published tables", "tables", name) for name in sorted(offers_of("tables")))


def problem_folders() -> tuple[Path, ...]:
    """Return the folders of the problems that packages ship."""
    return _folders("problem", "problems")


def task_files() -> dict[str, Path]:
    """Return the files of the tasks that packages ship, by name; they are in a subfolder of the problems' folder."""
    return _shipped("problem", "problems", "tasks/")


def load_robot(
    name: FilePath,
    *,
    tip: str | None = None,
    group: str | None = None,
    joints: Iterable[str] | None = None,
    locked: Mapping[str, float] | None = None,
    gripper: Mapping[str, Mapping[str, float]] | None = None,
    base_pose: BasePose = None,
    padding: float | Mapping[str, float] | None = None,
    scale: Mapping[str, float] | None = None,
    joint_ranges: Mapping[str, Sequence[float]] | None = None,
    joint_weights: Mapping[str, float] | None = None,
    srdf: FilePath | None = None,
    urdf: FilePath | None = None,
    joint_limits: FilePath | None = None,
    packages: FilePath | Iterable[FilePath] | None = None,
    strict: bool = False,
    xacro_args: Mapping[str, object] | None = None,
    xacro_limits: Mapping[str, float] | None = None,
    trust_xacro: bool = False,
    parameters: Mapping[str, object] | None = None,
) -> Robot:
    """Load a robot by name or from a file; the same call returns the same object, unless one of its files has changed.

    A DH table takes ``tip`` and ``base_pose``, and the options of every robot: ``padding``, ``scale``,
    ``joint_ranges``, ``joint_weights``. An MJCF also takes ``joints``, ``locked``, ``gripper``,
    ``joint_limits`` and ``strict``.

    Args:
        name: A name from `list_robots`; or the path of a URDF (``.urdf``, ``.xml``; ``.xacro`` needs the package
            xacro), of an MJCF (``.xml``, ``.mjcf``), of a DH table (``.yaml``), or of a MoveIt configuration folder.
        tip: Link that goals refer to; that of the group, or of the first arm, if None.
        group: Group of the SRDF whose joints are actuated.
        joints: Actuated joints, in the order wanted; those of the group, or those that move a tip, if None.
        locked: Values of joints that are held fixed [rad or m]; by default 0, moved into the limits.
        gripper: Joint values at which it is open and closed [rad or m]: ``{"open": {joint: 0.04}, "closed": {..}}``;
            by default those of the SRDF, or else what follows from the shape of the fingers.
        base_pose: T_world_base: a ``pinocchio.SE3``, or ``{"xyz": [..], "quat_xyzw": [..]}``.
        padding: How much thicker links are than their geometry [m]: one number for all, or by name of link.
        scale: Factors by which the solids of links are larger about their own middles, by name of link.
        joint_ranges: Narrower limits of joints, by name [rad or m].
        joint_weights: How much joints count in the length of a path, by name; 1 if not named.
        srdf: SRDF beside a URDF, or in place of that of a folder; one named ``.xacro`` is expanded.
        urdf: URDF in place of that of a MoveIt folder.
        joint_limits: File in the format of MoveIt's ``joint_limits.yaml``.
        packages: Folders in which ``package://`` names are sought first.
        strict: Whether a URDF, folder or MJCF is refused if it would otherwise give a `DescriptionWarning`: because a
            name in it does not exist, a posture is outside the limits, or something in it is not read.
        xacro_args: Arguments of macros, by name.
        xacro_limits: Limits for the expansion of macros: ``{"seconds": 10, "gigabytes": 1}``, or one of these.
        trust_xacro: Whether macros are evaluated by xacro's own evaluator, which can run any code, and may read files
            anywhere. Otherwise expressions that are not on a list of allowed ones are refused.
        parameters: What a shipped robot has of its own, such as ``{"limits": "envelope"}`` of titan4 and
            ``{"radius": 0.05}`` of planar3.

    Raises:
        UnknownNameError: If there is no robot of that name.
        InputError: If the robot does not take an option, or a file or value cannot be used.

    Example:
        >>> rrtik.load_robot("panda", tip="panda_hand", padding=0.01).dof
        7
        >>> rrtik.load_robot("planar", parameters={"lengths": [1.0, 0.5], "radius": 0.02}).dof
        2
    """
    require(strict, bool, "strict")
    require(parameters, Mapping | None, "parameters of a robot", "give values by name")
    options = {
        "tip": tip,
        "group": group,
        "joints": joints,
        "locked": locked,
        "gripper": gripper,
        "base_pose": base_pose,
        "padding": padding,
        "scale": scale,
        "joint_ranges": joint_ranges,
        "joint_weights": joint_weights,
        "srdf": srdf,
        "urdf": urdf,
        "joint_limits": joint_limits,
        "packages": packages,
        "strict": strict or None,
        "xacro_args": xacro_args,
    }
    own = dict(parameters or {})
    for key in own:
        if key in options:
            raise InputError(f"robot '{name}': parameters has '{key}', which is an option: {key}=...")

    with refusing_others(name, "Robot"):
        return _loaded(name, own | options, trust_xacro, xacro_limits)


def _loaded(
    name: FilePath,
    given: Mapping[str, Any],
    trust_xacro: bool = False,
    xacro_limits: Mapping[str, float] | None = None,
) -> Robot:
    """Load a robot as :func:`load_robot` does; options and parameters are in one mapping, as in problem files."""
    options = {option: value for option, value in given.items() if value is not None}
    if isinstance(name, str) and name not in offers_of("robots") and not os.path.exists(name):
        if is_description(name):
            found = fetched(name)
            name, options = found.file, found.options | options
        else:
            name = shipped_name(name, offers_of("robots")) or name
    recipe = _recipe(file_name(name) if not isinstance(name, str) else name)
    for option in options:
        if option not in (*recipe.options, *COMMON_OPTIONS):
            takes = ", ".join(sorted((*recipe.options, *COMMON_OPTIONS)))
            raise InputError(f"robot '{os.fspath(name)}' takes no option '{option}'; it takes {takes}")

    where = f"robot '{os.fspath(name)}'"
    values = {key: _checked(key, value, where) for key, value in options.items()}
    if "base_pose" in values:
        values["base_pose"] = checked_base(values["base_pose"], f"{where}: base_pose")

    key = json.dumps([recipe.target, plain(values)], sort_keys=True, default=repr)
    loaded = _cache.get(key)
    if loaded is None:
        with expanding(trusted=trust_xacro, limits=xacro_limits):
            robot = recipe.make(**{option: value for option, value in values.items() if option not in COMMON_OPTIONS})
        for option, apply_option in COMMON_OPTIONS.items():
            if option in values:
                robot = apply_option(robot, values[option])
        files = [recipe.target, *recipe.further_files, *_option_files(values), *_option_files(robot.source)]
        loaded = _cache.put(key, replace(robot, source=recipe.source(values)), files)

    return loaded


@dataclass(frozen=True, slots=True)
class _Recipe:
    """How to make a robot: kind of source, source (a name or an absolute path), function, and accepted options."""

    kind: str
    target: str
    make: Callable[..., Robot]
    options: tuple[str, ...]
    # Further files on which the robot depends, besides the target and the options.
    further_files: tuple[str, ...] = ()

    def source(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the entry that a problem file has for the robot, from the given options."""
        options = source_entry(values)
        if self.target not in PARAMETRIC:
            return {self.kind: self.target} | options
        mounting = {key: options.pop(key) for key in MOUNTING if key in options}
        return {self.target: options} | mounting


def _recipe(name: str | os.PathLike[str]) -> _Recipe:
    """Return the recipe for a name, a file or a folder.

    The modules that read a kind of file are imported only when it occurs, as they load slowly.
    """
    text = os.fspath(name)
    path = Path(text)
    if not is_utf8(os.path.abspath(text)):  # Pinocchio and coal take no other names.
        raise InputError(f"{text}: the name of the file, or of a folder above it, is not UTF-8; rename it")
    if isinstance(name, str) and text in offers_of("robots"):
        make = _load("robot", "robots", text)
        return _Recipe("name", text, make, tuple(sorted(inspect.signature(make).parameters)))

    suffix = path.suffix.lower()
    if suffix in (".yaml", ".yml"):  # The reader of YAML is only loaded when it is needed.
        from rrtik_ompl.description.dh_file import DH_OPTIONS, robot_from_dh_file

        return _Recipe("dh", str(path.resolve()), lambda **given: robot_from_dh_file(path, **given), DH_OPTIONS)

    if suffix in (".xml", ".mjcf"):
        from rrtik_ompl.description.mjcf import MJCF_OPTIONS, is_mjcf, robot_from_mjcf

        if is_mjcf(path):
            return _Recipe("mjcf", str(path.resolve()), lambda **given: robot_from_mjcf(path, **given), MJCF_OPTIONS)

    if suffix in (".urdf", ".xml", ".xacro"):
        return _Recipe("urdf", str(path.resolve()), lambda **given: robot_from_urdf(path, **given), URDF_OPTIONS)

    if os.path.isdir(path):
        from rrtik_ompl.description.moveit_config import CHOOSING_FILES, CONFIG_OPTIONS, robot_from_moveit

        target = path.resolve()
        choosing_files = tuple(str(target / file) for file in CHOOSING_FILES)
        return _Recipe(
            "moveit", str(target), lambda **given: robot_from_moveit(path, **given), CONFIG_OPTIONS, choosing_files
        )

    if path.parent != Path() or os.path.exists(path):  # os.path.exists() accepts names of any length.
        raise InputError(f"{text}: not a robot file; expected a URDF (.urdf, .xacro), a DH table (.yaml) or a folder")
    raise unknown_robot(text, list_robots())


_Stamp = tuple[str, int, int]  # path, modification time [ns] and size of a file


class _RobotCache:
    """The robots loaded last, each with the modification times and sizes of its files."""

    def __init__(self) -> None:
        self._robots: OrderedDict[str, tuple[Robot, tuple[_Stamp, ...]]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: str) -> Robot | None:
        """Return the robot stored under ``key``; None if there is none or one of its files has changed since."""
        with self._lock:
            found = self._robots.get(key)
            if found is None or _stamps(path for path, _, _ in found[1]) != found[1]:
                return None
            self._robots.move_to_end(key)
            return found[0]

    def put(self, key: str, robot: Robot, files: Iterable[str]) -> Robot:
        """Store a robot that was made from ``files`` and the meshes that it names, and return it."""
        meshes = (solid.meshPath for solid in robot.collision.geometryObjects)
        stamps = _stamps({*files, *meshes, *getattr(robot.looks, "files", ())})
        with self._lock:
            self._robots[key] = (robot, stamps)
            if len(self._robots) > CACHED_ROBOTS:
                self._robots.popitem(last=False)
        return robot


def _stamps(paths: Iterable[str]) -> tuple[_Stamp, ...]:
    found = []
    for path in sorted(paths):
        try:
            state = os.stat(path)
        except (OSError, ValueError):  # Not a file, or a deleted one, which the next load will report.
            continue
        found.append((path, state.st_mtime_ns, state.st_size))
    return tuple(found)


_cache = _RobotCache()


def _checked(key: str, value: object, where: str) -> object:
    """Check the type of an option that names files, joints or links; return the others as they are.

    Files are returned with their absolute path, so that the cache does not depend on the current folder.
    """
    what = f"{where}: {key}"
    if key in FILE_OPTIONS:
        return _file(value, what)
    if key == "packages":
        folders = [value] if isinstance(value, (str, os.PathLike)) else listed(value, what)
        return [_file(folder, what) for folder in folders]
    if key == "joints":
        return [name_of(joint, f"a joint of {what}") for joint in listed(value, what)]
    if key in ("tip", "group"):
        return name_of(value, f"the {key} of {where}")
    if key in VALUES_BY:
        require(value, Mapping, what, f"give values by name of {VALUES_BY[key]}")
    return value


def _file(value: object, what: str) -> Path:
    require(value, str | os.PathLike, what, "give the name of a file")
    path = file_name(value)
    if "\0" in str(path):
        raise InputError(f"{what}: no file can have the name {str(path)!r}")
    return path.absolute()


def _option_files(options: Mapping[str, Any]) -> list[str]:
    return [os.fspath(options[key]) for key in FILE_OPTIONS if isinstance(options.get(key), (str, os.PathLike))]


def robot_called(name: str, joint_names: tuple[str, ...]) -> Robot | None:
    """Return the robot with this name if it can be loaded and has these joints, otherwise None."""
    try:
        robot = load_robot(name)
    except RrtikError:
        return None
    return robot if robot.joint_names == joint_names else None


def robot_from_entry(entry: str | Mapping[str, Any], folder: str | os.PathLike[str] = ".") -> Robot:
    """Load the robot that a problem file names under ``robot``.

    Args:
        entry: A name; or ``{name: .., options}``; or ``{urdf: FILE, options}``, ``{moveit: FOLDER, options}``, likewise
            ``mjcf`` and ``dh``; or ``{planar: {..}}``, ``{point2d: {..}}``, which take ``base_pose`` beside them.
        folder: Folder of the problem file, relative to which files are named.

    Raises:
        InputError: If the entry has another form, or the robot cannot be loaded.
    """
    if isinstance(entry, str):
        return load_robot(_in_folder(entry, folder) if Path(entry).suffix.lower() in FILE_KINDS else entry)

    kinds = ("name", "moveit", "mjcf", "urdf", "dh", *PARAMETRIC)
    if not isinstance(entry, Mapping):
        raise InputError(f"robot: expected a name or one of the keys {', '.join(kinds)}")
    _refuse_caller_options(entry)

    present = [key for key in kinds if key in entry]
    if "moveit" in present and "urdf" in present:
        present.remove("urdf")  # Here it is an option: the URDF to read instead of the folder's.
    if len(present) != 1:
        listed = ", ".join(present) or "none"
        raise InputError(f"robot: needs exactly one of the keys {', '.join(kinds)}; found {listed}")
    kind = present[0]
    options: dict[str, Any] = {key: _resolved(key, value, folder) for key, value in entry.items() if key != kind}

    if kind in PARAMETRIC:
        if not isinstance(entry[kind], Mapping):
            raise InputError(f"robot: {kind}: expected a group of keys such as {{radius: 0.1}}")
        return _loaded(kind, {**entry[kind], **options})

    target = entry[kind]
    if not isinstance(target, str):
        raise InputError(f"robot: {kind}: expected text, found {target!r}")
    return _loaded(target if kind == "name" else _in_folder(target, folder), options)


def _refuse_caller_options(entry: Mapping[str, object]) -> None:
    """Raise an error if a file gives options that only the caller may give: a file must not declare itself trusted."""
    for key in CALLER_OPTIONS:
        if key in entry:
            raise InputError(f"robot: {key} is for whoever opens the file to give, not for the file; take it out")


def _resolved(key: str, value: object, folder: str | os.PathLike[str]) -> object:
    """Return the value of an option with file names resolved relative to a folder."""
    if key in FILE_OPTIONS and isinstance(value, str):
        return _in_folder(value, folder)
    if key == "packages" and isinstance(value, str):
        return [_in_folder(value, folder)]
    if key == "packages" and isinstance(value, Iterable) and not isinstance(value, Mapping):
        return [_in_folder(str(item), folder) for item in value]
    return value


def _in_folder(path: str, folder: str | os.PathLike[str]) -> Path:
    return Path(folder) / path


@cache
def _load(what: str, group: str, name: str) -> Any:  # noqa: ANN401 - what another package offers
    """Load what a package offers under a name of a group; ``what`` describes it in error messages."""
    offers = offers_of(group)
    if name not in offers:
        raise UnknownNameError(what, name, offers)
    try:
        return offers[name].load()
    except (ImportError, AttributeError) as error:
        raise InputError(f"{what} '{name}': {offers[name].value} cannot be loaded: {error}; reinstall it") from error


def _problem_files() -> dict[str, Path]:
    return _shipped("problem", "problems")


def _shipped(what: str, group: str, below: str = "") -> dict[str, Path]:
    """Return YAML files by name in the folders that packages offer."""
    return {file.stem: file for folder in _folders(what, group) for file in sorted(folder.glob(f"{below}*.yaml"))}


def _folders(what: str, group: str) -> tuple[Path, ...]:
    return tuple(Path(_load(f"{what} folder", group, name)) for name in offers_of(group))
