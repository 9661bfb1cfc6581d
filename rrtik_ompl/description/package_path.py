"""Find the mesh files that a URDF names: by ``package://``, ``file://``, absolute, or relative to the URDF."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import unquote

from rrtik_ompl.base.errors import InputError, MissingFileError

MESH_SUFFIXES = (".stl", ".obj", ".dae")
_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)/*(.*)")


def resolve_mesh(uri: str, folder: Path | None, packages: Iterable[Path], where: str) -> Path:
    """Return the absolute path of an existing mesh file.

    ``package://NAME/REST`` is sought as DIR/NAME/REST in ``packages``, in the URDF's folder and in every folder above
    it, and as DIR/REST if DIR itself is called NAME; ``file://$(find NAME)/REST`` of xacro likewise.

    Args:
        uri: The name of the mesh in the URDF.
        folder: Folder of the URDF, if it came from a file.
        packages: Further folders to search, first.
        where: File and element, put in front of error messages.

    Raises:
        MissingFileError: If there is no such file.
        InputError: If its format is unknown.
    """
    scheme, _, rest = uri.rpartition("://")
    if scheme not in ("", "file", "package", "model"):
        raise InputError(f"{where}: mesh '{uri}' is not a file; use package://, file:// or a path")

    if find_expression := _FIND.match(rest):
        scheme = "package"
        rest = f"{find_expression[1]}/{find_expression[2]}"

    roots = [Path(p) for p in packages]
    roots += [] if folder is None else [folder, *folder.parents]
    name = unquote(rest) if scheme else rest
    name = name.lstrip("/") if scheme in ("package", "model") else name  # package:///NAME is a common mistake.

    candidates = _in_packages(name, roots) if scheme in ("package", "model") else _beside(name, folder)
    file = next((path for path in candidates if os.path.isfile(path)), None)
    if file is None:
        package = name.partition("/")[0]
        remedy = f"give packages=[the folder that holds '{package}']" if scheme in ("package", "model") else "check it"
        raise MissingFileError(f"{where}: mesh file '{uri}' does not exist; {remedy}")

    if file.suffix.lower() not in MESH_SUFFIXES:
        raise InputError(f"{where}: mesh '{uri}' is of no kind that can be read; export it as STL, OBJ or DAE")
    return file.resolve()


def _in_packages(name: str, roots: Iterable[Path]) -> Iterator[Path]:
    package, _, rest = name.partition("/")
    for root in roots:
        yield root / name
        if root.name == package:
            yield root / rest


def _beside(name: str, folder: Path | None) -> Iterator[Path]:
    path = Path(name)
    if path.is_absolute() or folder is None:
        yield path
    else:
        yield folder / path


def package_folder(name: str, folder: Path, packages: Iterable[Path]) -> Path | None:
    """Return the folder of a package, from ``packages`` or from ``folder`` and all folders above; None if missing."""
    roots = [*packages, folder, *folder.parents]
    candidates = (root if root.name == name else root / name for root in roots)
    return next((candidate for candidate in candidates if name and os.path.isdir(candidate)), None)
