"""Find packages of ROS, and the mesh files that a URDF names: by ``package://``, ``file://``, absolute or relative."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from urllib.parse import unquote

from rrtik_ompl.base.errors import InputError, MissingFileError

MESH_SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".glb", ".gltf")
ASSISTANT = ".setup_assistant"  # file in which MoveIt's setup assistant states the URDF of a folder
MANIFEST = "package.xml"  # file that makes a folder a package, and states the package's name
DEPTH = 5  # levels below a folder that are searched for packages
LEVELS = 2  # levels above a package that may be a workspace, so that other packages in them are its neighbours
MOST_FOLDERS = 20_000  # most folders that are looked into below one folder
IGNORED = ("COLCON_IGNORE", "CATKIN_IGNORE")  # files that tell ROS's tools to leave a folder alone
SKIPPED = frozenset({"build", "install", "log", "node_modules", "__pycache__"})
_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)/*(.*)")
_NAME = re.compile(r"<name>\s*([\w.-]+)\s*</name>")


class Packages:
    """Finds packages by name, for one file of a robot.

    A package is a folder called by its name, or one whose ``package.xml`` states the name. It is sought, in this order,
    in the folders that are given (and in all folders below them), in the folders above the file, among the neighbours
    of the file's own package, and where ROS has it: ``ROS_PACKAGE_PATH``, ``AMENT_PREFIX_PATH``; then among the
    repositories that the package robot_descriptions has downloaded.

    Attributes:
        given: Folders that contain packages, or are packages.
        folder: Folder of the file; None if it is not in a file.
        renamed: Packages that are not found, and the folder from which their files are taken instead.
    """

    def __init__(self, given: Iterable[Path] = (), folder: Path | None = None) -> None:
        self.given = tuple(given)
        self.folder = None if folder is None else folder.resolve()
        self.renamed: dict[str, Path] = {}
        self._below: dict[Path, dict[str, Path]] = {}
        self._last: dict[str, Path] = {}  # folder in which a package was last looked into

    def find(self, name: str) -> Path | None:
        """Return the folder of a package, one with a ``package.xml`` if there is any; None if it is not found."""
        found = None
        for candidate in self._candidates(name):
            if _has_manifest(candidate):
                return candidate
            found = found or candidate
        return found

    def neighbours(self) -> list[Path]:
        """Return the packages beside that of the file, and those in the folders that are given."""
        found = (self._packages_below(root).values() for root in (*self.given, *self._workspaces))
        return list(dict.fromkeys(package for packages in found for package in packages))

    def files(self, name: str, rest: str) -> Iterator[Path]:
        """Yield where a file of a package may be, the likeliest place first; the file need not exist there.

        Args:
            name: Name of the package.
            rest: Path of the file in it.
        """
        if name in self._last:
            yield self._last[name] / rest
        for folder in self._candidates(name):
            self._last[name] = folder
            yield folder / rest

        # The folder of a package may have been copied without its name: the file is sought around the URDF.
        if self.folder is not None and name not in self._last:
            for folder in (self.folder, *list(self.folder.parents)[:LEVELS]):
                if rest and os.path.isfile(folder / rest):
                    self.renamed[name] = folder
                    yield folder / rest

    def _candidates(self, name: str) -> Iterator[Path]:
        if not name or name in (".", ".."):
            return
        above = () if self.folder is None else (self.folder, *self.folder.parents)
        for folders, searched in (
            (self.given, self.given),
            (above, self._workspaces),
            (self._environment, self._environment),
        ):
            for folder in folders:
                yield from (each for each in (folder / name, folder) if _is_called(each, name))
            for folder in searched:
                if name in (packages := self._packages_below(folder)):
                    yield packages[name]

    @cached_property
    def _workspaces(self) -> tuple[Path, ...]:
        """The folders above the file's package in which its neighbours may be.

        Folders that are no robot's are left out: those that contain the user's home or the system's temporary files.
        """
        if self.folder is None:
            return ()
        wide = [Path.home(), Path(os.environ.get("TMPDIR", "/tmp"))]
        for own in (self.folder, *self.folder.parents):
            # A folder of MoveIt that is no package stands beside those that it needs.
            levels = LEVELS if _has_manifest(own) else int(os.path.isfile(own / ASSISTANT))
            if levels:
                above = list(own.parents)[:levels]
                return tuple(each for each in above if not any(path.is_relative_to(each) for path in wide))
        return ()

    @cached_property
    def _environment(self) -> tuple[Path, ...]:
        """The folders in which ROS and robot_descriptions have packages."""
        prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        places = [Path(prefix) / "share" for prefix in prefixes if prefix]
        places += [Path(place) for place in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if place]
        cache = os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")
        return (*places, Path(cache).expanduser())

    def _packages_below(self, folder: Path) -> dict[str, Path]:
        """Return the packages in a folder by their names; of two with one name, the one with the shortest path."""
        if folder not in self._below:
            self._below[folder] = dict(reversed([*_packages_in(folder)]))
        return self._below[folder]


def _packages_in(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield names and folders of the packages in a folder, level by level; packages are not searched for others."""
    level = [os.fspath(folder)]
    visited = 0
    for _ in range(DEPTH + 1):
        below: list[str] = []
        for place in level:
            visited += 1
            if visited > MOST_FOLDERS:
                return
            try:
                with os.scandir(place) as listing:
                    entries = sorted(listing, key=lambda entry: entry.name)
                names = {entry.name for entry in entries}
                if MANIFEST in names and (stated := _stated_name(Path(place))):
                    yield stated, Path(place)
                is_whole = MANIFEST in names and place != os.fspath(folder)
                if is_whole or not names.isdisjoint(IGNORED):
                    continue
                below += [e.path for e in entries if e.name[0] != "." and e.name not in SKIPPED and e.is_dir()]
            except OSError:
                continue
        level = below


def _has_manifest(folder: Path) -> bool:
    return os.path.isfile(folder / MANIFEST)


def _stated_name(folder: Path) -> str:
    """Return the name that the ``package.xml`` of a folder states; "" if there is none."""
    try:
        with open(folder / MANIFEST, encoding="utf-8", errors="replace") as file:
            found = _NAME.search(file.read(10_000))
    except OSError:
        return ""
    return found[1] if found else ""


def _is_called(folder: Path, name: str) -> bool:
    """Check whether a folder exists that is a package of that name, by its own or by its ``package.xml``."""
    return (folder.name == name and os.path.isdir(folder)) or (_has_manifest(folder) and _stated_name(folder) == name)


def resolve_mesh(uri: str, packages: Packages, where: str) -> Path:
    """Return the absolute path of an existing mesh file.

    ``package://NAME/REST`` is sought in the package, and ``file://$(find NAME)/REST`` of xacro likewise; other names
    are relative to the folder of the URDF.

    Args:
        uri: The name of the mesh in the URDF.
        packages: The packages, and the folder of the URDF.
        where: File and element, put in front of error messages.

    Raises:
        MissingFileError: If there is no such file.
        InputError: If its format is unknown.
    """
    scheme, _, rest = uri.strip().rpartition("://")
    if scheme not in ("", "file", "package", "model"):
        raise InputError(f"{where}: mesh '{uri}' is not a file; use package://, file:// or a path")

    if find_expression := _FIND.match(rest):
        scheme = "package"
        rest = f"{find_expression[1]}/{find_expression[2]}"

    in_package = scheme in ("package", "model")
    name = unquote(rest) if scheme else rest
    name = name.lstrip("/") if in_package else name  # package:///NAME is a common mistake.
    package, _, inside = name.partition("/")

    candidates = packages.files(package, inside) if in_package else _beside(name, packages.folder)
    file = next((path for path in candidates if os.path.isfile(path)), None)
    if file is None:
        remedy = f"give packages=[the folder that holds '{package}']" if in_package else "check it"
        raise MissingFileError(f"{where}: mesh file '{uri}' does not exist; {remedy}")

    if file.suffix.lower() not in MESH_SUFFIXES:
        raise InputError(f"{where}: mesh '{uri}' is of no kind that can be read; export it as STL, OBJ or DAE")
    return file.resolve()


def _beside(name: str, folder: Path | None) -> Iterator[Path]:
    for path in dict.fromkeys((Path(name), Path(name.replace("\\", "/")))):  # Windows separates folders by backslashes.
        yield path if path.is_absolute() or folder is None else folder / path
