"""What installed packages offer by entry points.

importlib.metadata takes 30 ms to be loaded and to read what all packages offer; here the files that packages leave
beside their code are read alone, as far as they name a group of this library. Where packages lie in archives, or are
found in another way than on ``sys.path``, importlib.metadata is asked.
"""

from __future__ import annotations

import os
import re
import sys
from dataclasses import dataclass
from functools import cache, reduce
from importlib import import_module
from typing import Any

PREFIX = "rrtik_ompl."  # of all groups
METADATA = (".dist-info", ".egg-info")  # endings of folders beside packages
FINDERS = ("_frozen_importlib_external", "importlib")  # modules of the finder that looks on sys.path


@dataclass(frozen=True, slots=True)
class Offer:
    """An entry point.

    Attributes:
        name: By which it is looked up.
        value: Where it stands, such as ``package.module:function``.
    """

    name: str
    value: str

    @property
    def module(self) -> str:
        """The module in which it stands."""
        return self.value.partition("[")[0].partition(":")[0].strip()

    def load(self) -> Any:  # noqa: ANN401 - what another package offers
        """Import what is offered.

        Raises:
            ImportError: If there is no such module.
            AttributeError: If it has no such name.
        """
        names = self.value.partition("[")[0].partition(":")[2].strip()
        return reduce(getattr, names.split(".") if names else [], import_module(self.module))


def offers_of(group: str) -> dict[str, Offer]:
    """Return what packages offer in a group of this library, without ``PREFIX``, by name."""
    return _offers().get(PREFIX + group, {})


@cache
def _offers() -> dict[str, dict[str, Offer]]:
    """Return all offers by group and name; cached, as installed packages have to be looked through."""
    found: dict[str, dict[str, Offer]] = {}
    for group, offer in _in_folders() if _on_path_alone() else _by_importlib():
        found.setdefault(group, {})[offer.name] = offer
    return found


def _on_path_alone() -> bool:
    """Check whether all packages are found in folders on ``sys.path``."""
    others = [
        finder
        for finder in sys.meta_path
        if hasattr(finder, "find_distributions") and getattr(finder, "__module__", "").split(".")[0] not in FINDERS
    ]
    return not others and not any(path.endswith(".egg") or os.path.isfile(path) for path in sys.path)


def _by_importlib() -> list[tuple[str, Offer]]:
    points = import_module("importlib.metadata").entry_points()
    groups = sorted(group for group in points.groups if group.startswith(PREFIX))
    return [(group, Offer(each.name, each.value)) for group in groups for each in points.select(group=group)]


def _in_folders() -> list[tuple[str, Offer]]:
    """Read the offers of packages; of several versions of a package on the path the first one counts."""
    found: list[tuple[str, Offer]] = []
    seen: set[str] = set()
    for folder in dict.fromkeys(path or os.curdir for path in sys.path):
        try:
            names = os.listdir(folder)
        except OSError:
            continue
        for name in names:
            stem, ending = os.path.splitext(name)
            project = re.sub(r"[-_.]+", "_", stem.partition("-")[0]).lower()
            if ending not in METADATA or project in seen:
                continue
            seen.add(project)
            found += _read(os.path.join(folder, name, "entry_points.txt"))
    return found


def _read(file: str) -> list[tuple[str, Offer]]:
    """Read the offers in a file of entry points; none if there is no such file."""
    try:
        with open(file, encoding="utf-8") as stream:
            text = stream.read()
    except (OSError, UnicodeDecodeError):
        return []
    if f"[{PREFIX}" not in text:
        return []

    found: list[tuple[str, Offer]] = []
    group = ""
    for line in map(str.strip, text.splitlines()):
        name, is_offer, value = (part.strip() for part in line.partition("="))
        if line.startswith("[") and line.endswith("]"):
            group = line[1:-1].strip()
        elif is_offer and group.startswith(PREFIX) and not line.startswith(("#", ";")):
            found.append((group, Offer(name, value)))
    return found
