"""Sources of the problems of a suite: small plain descriptions from which any process can build the problem."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.benchmark.scaling import crowded_arm, planar_chain
from rrtik_ompl.description.catalog import find_problem, load_robot
from rrtik_ompl.planning.generated_problems import generated_problem
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem

CACHED_PROBLEMS = 4  # problems cached in a process; runs of one problem are consecutive


@dataclass(frozen=True, slots=True)
class Source:
    """Description of a problem that is not built yet.

    Attributes:
        kind: One of KINDS.
        name: Name of the problem.
        group: Group of problems that are reported together.
        arguments: Arguments of the function in KINDS, plain values.
        axis: Quantity that grows in a scaling family; "" otherwise.
        value: Its value.
    """

    kind: str
    name: str
    group: str
    arguments: tuple[Any, ...]
    axis: str = ""
    value: float = 0.0

    def plain(self) -> dict[str, Any]:
        """Return the source as plain values for JSON."""
        return asdict(self)


def from_plain(data: Mapping[str, Any]) -> Source:
    """Return the source that :meth:`Source.plain` has written."""
    return Source(**{**data, "arguments": tuple(data["arguments"])})


@lru_cache(maxsize=CACHED_PROBLEMS)
def build(source: Source) -> Problem:
    """Build the problem of a source.

    Raises:
        RrtikError: If it cannot be built, with the message of the builder.
    """
    return KINDS[source.kind](*source.arguments)


def file_source(name: str, folder: Path) -> Source:
    """Return the source of a shipped problem by its name, or of a file relative to ``folder``.

    Raises:
        UnknownNameError: If there is no shipped problem of that name.
        InputError: If there is no such file.
    """
    path = Path(name)
    if not path.suffix and len(path.parts) == 1:
        find_problem(name)
        return Source("file", name, name, (name, None))  # by name, because other machines keep it in other folders

    file = (folder / path).resolve()
    if not os.path.isfile(file):
        raise InputError(f"no such problem file '{name}' as seen from {folder}; check the path")
    return Source("file", file.stem, file.stem, (str(file), None))


def folder_sources(folder: Path, robot: str | None) -> list[Source]:
    """Return the sources of all problems in a folder and its subfolders: problem files and MotionBenchMaker's pairs.

    Args:
        folder: Where to search; problems of one folder are reported together.
        robot: Used instead of the one that the files name; None to keep it.

    Raises:
        InputError: If there is none, or no such folder.
    """
    if not os.path.isdir(folder):
        raise InputError(f"--problems {folder}: no such folder; check the path")

    found = sorted(file for ending in ("yaml", "yml") for file in folder.rglob(f"*.{ending}"))
    found = [file for file in found if not file.name.startswith("request")]
    pairs = {file.parent for file in found if file.name.startswith("scene")}
    found = [file for file in found if file.parent not in pairs or file.name.startswith("scene")]

    if not found:
        raise InputError(f"{folder}: holds no problem files (.yaml) and no pairs sceneN.yaml, requestN.yaml")

    sources = []
    whole = folder.resolve()
    for file in map(Path.resolve, found):
        group = (Path(whole.name) / file.parent.relative_to(whole)).as_posix()
        sources.append(Source("file", f"{group}/{file.stem}", group, (str(file), robot)))

    return sources


def generated_sources(robot: str, family: str, first: int, count: int) -> list[Source]:
    """Return sources of ``rrtik_ompl.planning.generated_problems`` with the seeds first, first + 1, ..."""
    group = f"{robot}/{family}"
    seeds = range(first, first + count)
    return [Source("generated", f"{group}/{seed}", group, (robot, family, seed)) for seed in seeds]


def scaling_sources(axis: str, values: list[Any], *arguments: Any, group: str) -> list[Source]:
    """Return one source for each value of the quantity that grows: ``joints``, ``obstacles`` or ``resolution``."""
    return [Source(axis, f"{group}/{value:g}", group, (*arguments, value), axis, float(value)) for value in values]


def _from_file(file: str, robot: str | None) -> Problem:
    return load_problem(file, robot=robot)


def _generated(robot: str, family: str, seed: int) -> Problem:
    return generated_problem(load_robot(robot), family, seed)


def _resolved(name: str, resolution: float) -> Problem:
    problem = load_problem(name)
    return Problem(problem.world.with_resolution(resolution), problem.start, problem.goal, name=problem.name)


def _crowded(robot: str, seed: int, count: int) -> Problem:
    return crowded_arm(load_robot(robot), int(count), seed)


def _chain(seed: int, joints: int) -> Problem:
    return planar_chain(int(joints), seed)


KINDS: Mapping[str, Callable[..., Problem]] = MappingProxyType(
    {
        "file": _from_file,
        "generated": _generated,
        "joints": _chain,
        "obstacles": _crowded,
        "resolution": _resolved,
    }
)
