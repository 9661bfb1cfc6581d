"""Xacro: macros of XML, expanded by the package xacro, which need not be installed."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterable, Mapping
from contextlib import redirect_stderr
from pathlib import Path

from rrtik_ompl.description.package_path import package_folder
from rrtik_ompl.errors import InputError
from rrtik_ompl.files.text import read_text

_lock = threading.Lock()  # the package keeps the files and macros that it is at in globals


def is_xacro(path: Path) -> bool:
    """Whether a file's name says that it holds macros."""
    return path.suffix.lower() == ".xacro"


def robot_text(path: Path, packages: Iterable[Path] = (), arguments: Mapping[str, object] | None = None) -> str:
    """Text of a URDF or SRDF file, its macros expanded if it is named ``.xacro``.

    ``$(find NAME)`` is a folder of that name in ``packages``, or in a folder above the file; else what ROS finds.

    Args:
        path: The file.
        packages: Folders that hold packages, or are packages.
        arguments: Of the macros, as behind the command xacro: ``{"ur_type": "ur5e"}``.

    Raises:
        InputError: If the file cannot be read or expanded, or the package xacro is not installed.
    """
    if not is_xacro(path):
        if arguments:
            raise InputError(f"{path}: xacro_args are for files named .xacro; leave them out")
        return read_text(path)
    read_text(path)  # which says what is wrong with the file itself
    try:
        import xacro
        from xacro import substitution_args
    except ImportError:
        expanded = f"{path.stem.removesuffix('.urdf')}.urdf"  # by this ending it is read
        raise InputError(
            f"{path}: holds macros, and the package xacro is not installed: pip install xacro, "
            f"or expand it by hand: xacro {path.name} > {expanded}"
        ) from None
    roots, folder, usual = list(packages), path.resolve().parent, substitution_args._eval_find

    def find(name: str) -> str:
        found = package_folder(name, folder, roots)
        if found is None:
            try:
                return str(usual(name))
            except ImportError:
                raise LookupError(f"package '{name}' is not found; give packages=[the folder that holds it]") from None
        return str(found)

    with _lock, redirect_stderr(io.StringIO()):
        substitution_args._eval_find = substitution_args._eval_dict["find"] = find
        try:
            words = {str(key): str(value) for key, value in (arguments or {}).items()}
            return str(xacro.process_file(str(path), mappings=words).toxml())
        except (Exception, SystemExit) as error:  # of anything that a macro may do
            said = " ".join(str(error).split()) or type(error).__name__
            raise InputError(f"{path}: xacro: {said.removeprefix(_FOREIGN)}") from None
        finally:
            substitution_args._eval_find = substitution_args._eval_dict["find"] = usual


_FOREIGN = "<class 'LookupError'>: "  # how xacro passes on an error of a search for a package
