"""Files of macros of public repositories, expanded by the package xacro itself and by us; prints both counts.

Each file named ``.xacro`` is expanded without arguments: in this process by the package alone, which can run anything
(so only for folders that you trust), and by `robot_text`.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterator
from contextlib import redirect_stderr
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import xacro
from typer import Argument
from xacro import substitution_args

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.package_path import Packages
from rrtik_ompl.description.xacro_text import robot_text

REFUSALS = ("is not on the list", "not one of the functions", "outside the folders", "two underscores", "more than")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a file: ``equal``, ``other text``, ``refused by us``, ``only by us`` or ``by neither``."""

    file: Path
    kind: str
    said: str = ""


def outcomes(folder: Path) -> Iterator[Outcome]:
    """Both expansions of each file of a folder."""
    packages = sorted({file.parent.parent for file in folder.rglob("package.xml")})
    for file in sorted(folder.rglob("*.xacro")):
        theirs = _by_xacro(file, packages)
        try:
            ours = robot_text(file, packages)
        except InputError as error:
            refused = theirs is not None or any(word in str(error) for word in REFUSALS)
            yield Outcome(file, "refused by us" if refused else "by neither", str(error))
            continue
        if theirs is None:
            yield Outcome(file, "only by us")
        else:
            yield Outcome(file, "equal" if ours == theirs else "other text")


def _by_xacro(file: Path, packages: list[Path]) -> str | None:
    """What the package makes of a file; None if it fails."""

    def find(name: str) -> str:
        found = Packages(packages, file.parent).find(name)
        if found is None:
            raise LookupError(name)
        return str(found)

    substitution_args._eval_find = substitution_args._eval_dict["find"] = find
    with redirect_stderr(io.StringIO()):
        try:
            return str(xacro.process_file(str(file), mappings={}).toxml())
        except (Exception, SystemExit):  # of anything that a macro may do
            return None


def main(folders: Annotated[list[Path], Argument(help="Copies of repositories.", exists=True)]) -> int:
    """Count, and print what differs."""
    total: Counter[str] = Counter()
    for folder in folders:
        counts: Counter[str] = Counter()
        for outcome in outcomes(folder.resolve()):
            counts[outcome.kind] += 1
            if outcome.kind not in ("equal", "by neither"):
                print(f"{outcome.file}: {outcome.kind}: {outcome.said}")
        print(f"{folder.name}: {dict(counts)}")
        total += counts
    print(f"all: {dict(total)}")
    return 1 if total["refused by us"] or total["other text"] else 0
