"""Names of arms that people type: another name of a shipped one, or where the description of an arm is to be had.

The package robot_descriptions (https://github.com/robot-descriptions/robot_descriptions.py) knows where some two
hundred descriptions are, and keeps those that it has fetched in a folder. `fetched` reads from its modules which file
that is, without running them: running one downloads.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rrtik_ompl.base.errors import InputError, UnknownNameError

PACKAGE = "robot_descriptions"
CACHE = "ROBOT_DESCRIPTIONS_CACHE"  # variable that names its folder
DEFAULT_CACHE = "~/.cache/robot_descriptions"
FILES = ("URDF_PATH", "XACRO_PATH", "MJCF_PATH")

# Other names of the very same arm.
SAME = {
    "franka": "panda",
    "frankapanda": "panda",
    "frankaemikapanda": "panda",
    "fer": "panda",
    "soarm100": "so100",
    "soarm101": "so101",
    "unitreez1": "z1",
    "ufactoryxarm7": "xarm7",
    "j2s6s200": "kinova",
    "puma": "puma560",
}
# Arms that are not shipped, by the modules of robot_descriptions that have them, and by who makes them.
MODULES = {
    "Franka": "fr3 fr3_v2",
    "Universal Robots": "ur3e ur5e ur7e ur8long ur10e ur12e ur15 ur16e ur18 ur20 ur30",
    "KUKA": "iiwa7 iiwa14",
    "Kinova": "gen2 gen3 gen3_lite j2n4s300 j2n6s200 j2n6s300 j2n7s300 j2s6s300 j2s7s300 mico",
    "UFACTORY": "xarm6",
    "Flexiv": "rizon4 rizon10",
    "FANUC": "fanuc_m710ic",
    "AgileX": "piper",
    "Enactic": "openarm_v1 openarm_v2",
    "ROBOTIS": "omx_f omx_l omy_3m omy_f3m omy_l100 open_manipulator_x",
    "The Robot Studio": "so_arm102",
    "I2RT": "yam",
    "COMAU": "edo",
    "Rethink": "sawyer_mj",
    "Trossen": "viper_mj widow_mj aloha_mj",
    "ARX": "arx_l5_mj",
    "ABB": "yumi",
    "Fetch": "fetch",
    "Willow Garage": "pr2",
    "PAL": "tiago",
    "Hello Robot": "stretch",
}
OTHER_WORDS = {"iiwa": "iiwa14", "lbriiwa14": "iiwa14", "lbriiwa7": "iiwa7", "kukaiiwa": "iiwa14", "frankafr3": "fr3",
               "research3": "fr3", "kinovagen3": "gen3", "sawyer": "sawyer_mj", "vx300s": "viper_mj",
               "viperx": "viper_mj", "wx250s": "widow_mj", "widowx": "widow_mj", "aloha": "aloha_mj",
               "jaco": "j2s6s300", "jaco2": "j2s6s300"}  # fmt: skip
# Arms in no package that is known here: what their vendors publish.
ELSEWHERE = {
    "lite6": 'load_robot(".../xarm_description/urdf/xarm_device.urdf.xacro", xacro_args={"robot_type": "lite", '
    '"dof": 6}) of github.com/xArm-Developer/xarm_ros2',
    "xarm5": 'load_robot(".../xarm_description/urdf/xarm_device.urdf.xacro", xacro_args={"robot_type": "xarm", '
    '"dof": 5}) of github.com/xArm-Developer/xarm_ros2',
}
LETTERS_ALIKE = 0.75  # least likeness of two names without their digits, of which one may be meant by the other


@dataclass(frozen=True, slots=True)
class Fetched:
    """A description in the folder of robot_descriptions: its file, and options of `rrtik_ompl.load_robot`."""

    file: Path
    options: dict[str, Any] = field(default_factory=dict)


def plain_name(name: str) -> str:
    """Return a name as it is compared: in lower case, letters and digits alone."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def shipped_name(name: str, shipped: Iterable[str]) -> str | None:
    """Return the name of the shipped robot that somebody means who writes it in another way; None if there is none."""
    known = {plain_name(each): each for each in shipped}
    wanted = plain_name(name)
    return known.get(wanted) or known.get(plain_name(SAME.get(wanted, "")))


def unknown_robot(name: str, shipped: Iterable[str]) -> InputError:
    """Return the error for a name of no shipped robot: where its description is to be had, or a similar name.

    A name is only similar if the letters before the digits are: ``fr3`` is no misspelt ``ur3``.
    """
    known = tuple(shipped)
    wanted = plain_name(name)
    module = _module_of(wanted)
    if module is not None:
        return InputError(
            f"robot '{name}' is not shipped; pip install {PACKAGE}, python -m {PACKAGE} pull {module}, then "
            f'load_robot("{module}")'
        )
    if wanted in ELSEWHERE:
        return InputError(f"robot '{name}' is not shipped; its vendor's description: {ELSEWHERE[wanted]}")

    similar = [each for each in known if _alike(wanted, plain_name(each))]
    return UnknownNameError("robot", name, known, similar=similar)


def _module_of(wanted: str) -> str | None:
    """Return the module of robot_descriptions that has an arm; None if it is not known."""
    modules = {plain_name(name.removesuffix("_mj")): name for names in MODULES.values() for name in names.split()}
    module = modules.get(wanted) or modules.get(plain_name(OTHER_WORDS.get(wanted, "").removesuffix("_mj")))
    return None if module is None else f"{module}_description"


def _alike(first: str, second: str) -> bool:
    """Check whether the letters of two names are nearly the same."""
    letters = [re.sub(r"\d", "", name) for name in (first, second)]
    return SequenceMatcher(None, letters[0], letters[1]).ratio() >= LETTERS_ALIKE


def is_description(name: str) -> bool:
    """Check whether a name may be that of a module of robot_descriptions."""
    return name.endswith("_description") and name.isidentifier()


def fetched(name: str) -> Fetched:
    """Return the file that robot_descriptions has fetched for a name, such as ``fr3_description``.

    Raises:
        InputError: If the package is not installed, has no such module, or has not fetched its files.
    """
    spec = find_spec(PACKAGE)
    if spec is None or spec.origin is None:
        raise InputError(f"robot '{name}': pip install {PACKAGE}, and python -m {PACKAGE} pull {name}")

    home = Path(spec.origin).parent
    modules = sorted(path.stem for path in home.glob("*_description.py") if not path.stem.startswith("_"))
    if name not in modules:
        raise UnknownNameError(f"description of {PACKAGE}", name, modules)

    values = _constants(home / f"{name}.py", home)
    key = next((key for key in FILES if isinstance(values.get(key), str)), None)
    if key is None:
        raise InputError(f"robot '{name}': {PACKAGE} does not say where its URDF or MJCF is; give its file")

    file = Path(values[key])
    if not file.is_file():
        raise InputError(f"robot '{name}': {file} is not there; python -m {PACKAGE} pull {name}")

    options: dict[str, Any] = {}
    if key == "XACRO_PATH":
        packages = values.get("XACRO_PACKAGE_PATHS", {})
        options = {"xacro_args": values.get("XACRO_ARGS"), "packages": list(packages.values()) or None}
    return Fetched(file, {option: value for option, value in options.items() if value})


def _constants(module: Path, home: Path) -> dict[str, Any]:
    """Return the constants of a module of robot_descriptions that are texts, paths, or dictionaries of these.

    The function that fetches a repository gives the folder that it would be in.
    """
    values: dict[str, Any] = {}

    def value(node: ast.expr) -> Any:  # noqa: ANN401 - what the module says
        match node:
            case ast.Constant():
                return node.value
            case ast.Name():
                return values[node.id]
            case ast.Dict():
                return {value(k): value(v) for k, v in zip(node.keys, node.values, strict=True) if k is not None}
            case ast.Call(func=ast.Attribute(attr="join")):
                return os.path.join(*map(value, node.args))
            case ast.Call(func=ast.Name(id="_clone_to_cache" | "clone_to_cache")):
                return _folder_of(value(node.args[0]), home)
        raise KeyError(ast.dump(node))

    for statement in ast.parse(module.read_text(encoding="utf-8")).body:
        targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
        if isinstance(statement, (ast.Assign, ast.AnnAssign)) and isinstance(targets[0], ast.Name) and statement.value:
            try:
                values[targets[0].id] = value(statement.value)
            except (KeyError, TypeError):
                continue  # a constant of another kind
    return values


def _folder_of(repository: str, home: Path) -> str:
    """Return the folder in which robot_descriptions keeps a repository."""
    tree = ast.parse((home / "_repositories.py").read_text(encoding="utf-8"))
    for entries in (node for node in ast.walk(tree) if isinstance(node, ast.Dict)):
        for key, call in zip(entries.keys, entries.values, strict=True):
            if isinstance(key, ast.Constant) and key.value == repository and isinstance(call, ast.Call):
                said = {word.arg: word.value.value for word in call.keywords if isinstance(word.value, ast.Constant)}
                folder = str(said["cache_path"])
                commit = os.environ.get("ROBOT_DESCRIPTION_COMMIT")
                cache = os.path.expanduser(os.environ.get(CACHE, DEFAULT_CACHE))
                return os.path.join(cache, folder if commit is None else f"{folder}-{commit}/{folder}")
    raise KeyError(repository)
