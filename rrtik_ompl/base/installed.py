"""Which packages are installed, by the folders that they leave beside their code.

importlib.metadata says the same and takes 20 ms to be loaded, as long as all of this library that a plan begins with.
It is asked where packages lie in archives, or are found in another way than on ``sys.path``.
"""

from __future__ import annotations

import os
import re
import sys
from functools import cache
from importlib import import_module
from typing import NamedTuple

ENDINGS = (".dist-info", ".egg-info")  # of these folders
FINDERS = ("_frozen_importlib_external", "importlib")  # modules of the finder that looks on sys.path


class Installed(NamedTuple):
    """An installed package: its version, "" if its folder's name has none, and that folder."""

    version: str
    folder: str


def version_of(package: str) -> str:
    """Return the version in which a package is installed; "" if it has come in another way.

    Example:
        >>> version_of("no-such-package")
        ''
    """
    return version_on_path(package) or _by_importlib(package)


def version_on_path(package: str) -> str:
    """Return the version of a package that lies in a folder on ``sys.path``; "" if it lies elsewhere or nowhere.

    Example:
        >>> version_on_path("no-such-package")
        ''
    """
    found = installed_packages().get(_key(package)) if on_path_alone() else None
    return found.version if found else ""


@cache
def installed_packages() -> dict[str, Installed]:
    """Return the packages in folders on ``sys.path`` by name; of several versions of one the first counts."""
    found: dict[str, Installed] = {}
    for place in dict.fromkeys(path or os.curdir for path in sys.path):
        try:
            names = os.listdir(place)
        except OSError:
            continue
        for name in names:
            stem, ending = os.path.splitext(name)
            if ending in ENDINGS:
                project, _, rest = stem.partition("-")
                found.setdefault(_key(project), Installed(rest.partition("-")[0], os.path.join(place, name)))
    return found


def on_path_alone() -> bool:
    """Check whether all packages are found in folders on ``sys.path``."""
    others = [
        finder
        for finder in sys.meta_path
        if hasattr(finder, "find_distributions") and getattr(finder, "__module__", "").split(".")[0] not in FINDERS
    ]
    return not others and not any(path.endswith(".egg") or os.path.isfile(path) for path in sys.path)


def _key(package: str) -> str:
    """Return the name under which a package is known, however it is written."""
    return re.sub(r"[-_.]+", "_", package).lower()


@cache
def _by_importlib(package: str) -> str:
    metadata = import_module("importlib.metadata")
    try:
        return str(metadata.version(package))
    except metadata.PackageNotFoundError:
        return ""
