"""Planners by name: this library's, those of other packages, OMPL's, and ``file.py:Class`` for classes in files.

A file is executed, as by ``import``.
"""

from __future__ import annotations

import importlib.util
import inspect
import os
import sys
from collections.abc import Iterable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.base.floors import NO_OMPL
from rrtik_ompl.description import catalog
from rrtik_ompl.description.catalog import AUTO, is_auto
from rrtik_ompl.files.digest import sha256
from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.planner_options import planner_options
from rrtik_ompl.ompl_bridge.planner_traits import BOUND, PlannerFactory, ompl_planners, unbound_planners

MARK = ".py:"  # in the name of a class in a file

_OMPL_PREFIX, _MOVEIT_SUFFIX = "geometric::", "kConfigDefault"  # as in ompl_planning.yaml


def list_planners() -> tuple[str, ...]:
    """Return the names of all planners: "auto", those of packages in lower case, and OMPL's as OMPL writes them.

    Example:
        >>> rrtik.list_planners()[:3]
        ('auto', 'bicrdt', 'cbirrt')
    """
    return (AUTO, *catalog.list_planners(), *sorted(ompl_planners()))


def refuse_options(given: Iterable[str]) -> None:
    """Raise an InputError if options are given for the portfolio, which takes none.

    Raises:
        InputError: If there are any.
    """
    if named := ", ".join(given):
        raise InputError(f"planner '{AUTO}' takes no options, got {named}; name the planner that they are for")


def options_of(name: str) -> tuple[str, ...]:
    """Return the names of the options of a planner; the portfolio has none.

    Raises:
        UnknownNameError: If there is no such planner; the error carries all names.
    """
    return () if is_auto(name) else tuple(planner_options(find_planner(name)))


def find_planner(name: str) -> PlannerFactory:
    """Return the planner class of a name, in upper or lower case; MoveIt's spelling of OMPL's names is accepted too.

    ``file.py:Class`` is a class in a file, which is executed.

    Raises:
        InputError: If there is no such file, or it cannot be executed.
        UnknownNameError: If there is no class of that name, as for "auto"; the error carries all names.
    """
    if is_planner_file(name):
        return planner_of_file(name)

    bare = name.removeprefix(_OMPL_PREFIX).removesuffix(_MOVEIT_SUFFIX).lower()
    if bare in _wheel():
        return _wheel()[bare]
    if bare in catalog.list_planners():
        return catalog.find_planner(bare)
    if not _wheel() and bare in {*BOUND.lower().split(), *map(str.lower, unbound_planners())}:
        raise InputError(f"planner '{name}': {NO_OMPL}")
    raise UnknownNameError("planner", name, list_planners())


@cache
def _wheel() -> Mapping[str, PlannerFactory]:
    """Return OMPL's planners by their names in lower case."""
    return {name.lower(): planner for name, planner in ompl_planners().items()}


def is_planner_file(name: str) -> bool:
    """Check whether a name is that of a class in a Python file."""
    return MARK in name


def label_of(name: str) -> str:
    """Return ``Class`` for ``file.py:Class``; any other name as it is."""
    return name.rpartition(":")[2] if is_planner_file(name) else name


def planner_in_folder(name: str, folder: Path) -> str:
    """Return the name with an absolute path; a relative one is relative to ``folder``."""
    file, _, wanted = name.rpartition(":")
    return f"{(folder / file).resolve()}:{wanted}"


def planner_of_file(name: str) -> PlannerFactory:
    """Return the planner class in a file, ``file.py:Class``; the file is executed once per process.

    Raises:
        InputError: If the file cannot be read or executed, or the name is not that of a planner class.
        UnknownNameError: If it has no such class; the error carries the names of its planners.
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
    """Runs a Python file and returns its module, once per process and path.

    A failed module is not kept in sys.modules.
    """
    # Several files may have the same name, so the name of the module depends on the whole path.
    name = f"planner_file_{path.stem}_{sha256(str(path).encode()).hexdigest()[:8]}"
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
