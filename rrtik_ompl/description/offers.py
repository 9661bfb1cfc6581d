"""What installed packages offer by entry points.

The files that packages leave beside their code are read alone, as far as they name a group of this library.
importlib.metadata is asked where :mod:`rrtik_ompl.base.installed` does not know the packages.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache, reduce
from importlib import import_module
from typing import Any

from rrtik_ompl.base.installed import installed_packages, on_path_alone

PREFIX = "rrtik_ompl."  # of all groups


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
    for group, offer in _in_folders() if on_path_alone() else _by_importlib():
        found.setdefault(group, {})[offer.name] = offer
    return found


def _by_importlib() -> list[tuple[str, Offer]]:
    points = import_module("importlib.metadata").entry_points()
    groups = sorted(group for group in points.groups if group.startswith(PREFIX))
    return [(group, Offer(each.name, each.value)) for group in groups for each in points.select(group=group)]


def _in_folders() -> list[tuple[str, Offer]]:
    """Read the offers of the packages on ``sys.path``."""
    files = [os.path.join(package.folder, "entry_points.txt") for package in installed_packages().values()]
    return [offer for file in files for offer in _read(file)]


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
