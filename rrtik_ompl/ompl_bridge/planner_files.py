"""Planners in anybody's Python files, named ``file.py:Class``: the file is run, as ``import`` would."""

from __future__ import annotations

import importlib.util
import inspect
import os
import sys
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from ompl import base as ob

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.files.digest import sha256
from rrtik_ompl.ompl_bridge.planner_traits import PlannerFactory

MARK = ".py:"


def is_planner_file(name: str) -> bool:
    """Whether a name is that of a class in a Python file."""
    return MARK in name


def label_of(name: str) -> str:
    """``Class`` of ``file.py:Class``; any other name as it is."""
    return name.rpartition(":")[2] if is_planner_file(name) else name


def planner_in_folder(name: str, folder: Path) -> str:
    """The name with a path that does not depend on the current folder; a relative one begins at ``folder``."""
    file, _, wanted = name.rpartition(":")
    return f"{(folder / file).resolve()}:{wanted}"


def planner_of_file(name: str) -> PlannerFactory:
    """The planner class in a file, ``file.py:Class``; the file is run once a process.

    Raises:
        InputError: If the file cannot be read or run, or what it calls so is no planner.
        UnknownNameError: If it has no such class; carries the names of its planners.
    """
    file, _, wanted = name.rpartition(":")
    path = Path(file)
    if not os.path.isfile(path):
        raise InputError(f"planner '{name}': there is no file {file}")

    module = _module(path.resolve())
    found: Any = getattr(module, wanted, None)
    if found is None:
        planners = {key: value for key, value in vars(module).items() if _is_planner(value)}
        planners_of_module = [key for key, value in planners.items() if inspect.getmodule(value) is module]
        raise UnknownNameError(f"planner in {file}", wanted, planners_of_module)
    if not _is_planner(found):
        raise InputError(f"planner '{name}': {wanted} is not a class derived from ompl.base.Planner")
    return found  # type: ignore[no-any-return]


def _is_planner(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, ob.Planner)


@lru_cache(maxsize=32)
def _module(path: Path) -> ModuleType:
    name = f"planner_file_{path.stem}_{sha256(str(path).encode()).hexdigest()[:8]}"  # files of one name are several
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"planner in {path}: not a Python file")

    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module

    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise InputError(f"planner in {path}: the file cannot be run: {type(error).__name__}: {error}") from error

    return module
