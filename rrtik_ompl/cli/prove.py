"""The command `rrtik prove`: judge the motions of any program in the world of a problem, or of a robot and a scene."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, get_args

import typer

from rrtik_ompl.base.choices import Between, one_of
from rrtik_ompl.base.errors import InputError, ProblemError
from rrtik_ompl.cli import FOUND, NOT_FOUND, UNDECIDED
from rrtik_ompl.cli.drawing import ROBOT_FILES
from rrtik_ompl.cli.table import Table
from rrtik_ompl.cli.terminal import plural, progress, say
from rrtik_ompl.files.tables import FORMATS as PATH_FORMATS
from rrtik_ompl.files.text import check_target

if TYPE_CHECKING:
    from rrtik_ompl.model.judgement import Finding, MotionVerdict
    from rrtik_ompl.motion.received.points import Motion
    from rrtik_ompl.world.world import World

MOST_LINES = 8  # largest number of findings that are printed of a motion
CODES = {"proven": FOUND, "touching": NOT_FOUND, "invalid": NOT_FOUND, "undecided": UNDECIDED}


class Judged(NamedTuple):
    """A motion of a file and its verdict."""

    name: str
    motion: Motion
    verdict: MotionVerdict


def prove(
    problem: Annotated[str, typer.Argument(help="A problem, or a robot (name, URDF, MJCF) with --scene.")],
    motions: Annotated[
        list[Path],
        typer.Argument(
            metavar="MOTION...",
            help="ROS's and MoveIt's messages: .json, .yaml, bags; arrays: .npz, .npy; tables: .csv; our own files.",
        ),
    ],
    scene: Annotated[
        Path | None, typer.Option(help="What is around a robot: a scene, a cloud, an octree, a mesh.")
    ] = None,
    clearance: Annotated[
        float | None, typer.Option(help="Distance to keep from obstacles [m]; if left out what the world requires.")
    ] = None,
    between: Annotated[
        str | None,
        typer.Option(
            metavar="lines|cubics|quintics",
            help="How the arm goes between points; if left out as ROS's joint_trajectory_controller goes.",
        ),
    ] = None,
    degrees: Annotated[bool, typer.Option("--degrees", help="The angles in the files are degrees.")] = False,
    rate: Annotated[float | None, typer.Option(help="Points a second in a file without times [1/s].")] = None,
    certificate: Annotated[Path | None, typer.Option(help="Write the certificate of one motion: .json.")] = None,
    mend: Annotated[Path | None, typer.Option(help="Write a proven path near one motion: .json, .csv or .txt.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> int:
    """Prove the motions of any program free, or say where they touch.

    Every configuration counts, not only the points: a motion that clips something between two of them is found. Exit
    code 0: all motions are proven free; 1: one touches something or keeps less than it has to; 3: one could not be
    decided.
    """
    check_target(certificate, (".json",))
    check_target(mend, PATH_FORMATS)
    way = None if between is None else one_of(get_args(Between), between, "way between points")

    world = _world(problem, scene)
    judged = _judged(world, motions, clearance, way, degrees=degrees, rate=rate)
    for option, target in (("--certificate", certificate), ("--mend", mend)):
        if target is not None and len(judged) > 1:
            raise InputError(f"{option} is for one motion, and there are {len(judged)}; give one file with one motion")

    if as_json:
        print(json.dumps({"problem": problem, "motions": [_document(each) for each in judged]}))
    else:
        say(_table(judged))
        for each in judged:
            say(*_lines(world, each))

    written = []
    if certificate is not None and judged[0].verdict.proven:
        _certify(world, judged[0], certificate, way)
        written.append(f"wrote {certificate}")
    if mend is not None:
        written.append(_mend(world, judged[0], mend, way))
    if not as_json:
        say(*written)
    return max((CODES[each.verdict.status] for each in judged), key=[FOUND, UNDECIDED, NOT_FOUND].index)


def _world(name: str, scene: Path | None) -> World:
    """Return the world of a problem, or of a robot and a scene."""
    from rrtik_ompl import Scene, World, list_problems, list_robots, load_problem, load_robot, load_scene
    from rrtik_ompl.problem_files.problem_values import load_unchecked

    is_robot = Path(name).suffix.lower() in ROBOT_FILES or (name in list_robots() and name not in list_problems())
    if is_robot or scene is not None:
        if not is_robot and name in list_problems():
            raise InputError(f"--scene is for a robot, and '{name}' is a problem, which has a scene of its own")
        robot = load_robot(name)
        return World(robot, Scene() if scene is None else load_scene(scene))
    try:
        return load_problem(name).world
    except ProblemError:  # its start or goal is not free, which does not matter here
        settings, _, _ = load_unchecked(name)
        return World.of(settings)


def _judged(
    world: World,
    files: Sequence[Path],
    clearance: float | None,
    between: Between | None,
    *,
    degrees: bool,
    rate: float | None,
) -> list[Judged]:
    """Return all motions of files with their verdicts."""
    from rrtik_ompl import load_motions
    from rrtik_ompl import prove as verdict_of

    read = [(file, load_motions(file, world.robot, degrees=degrees, rate=rate)) for file in files]
    with progress("proving"):
        return [
            Judged(
                getattr(motion, "name", file.name),
                motion,
                verdict_of(world, motion, between=between, clearance=clearance),
            )
            for file, motions in read
            for motion in motions
        ]


def _table(judged: Sequence[Judged]) -> Table:
    """Return a table with a row for each motion."""
    table = Table("motion", "pieces", "proven", "touching", "invalid", "undecided", "verdict", right=range(1, 6))
    for name, _, verdict in judged:
        counts = [len(each) for each in (verdict.touching, verdict.invalid, verdict.undecided)]
        cells = [verdict.pieces, verdict.pieces - sum(counts), *counts]
        table.add_row(name, *map(str, cells), verdict.status)
    return table


def _lines(world: World, judged: Judged) -> list[str]:
    """Return what is to be said of a motion."""
    from rrtik_ompl.world.route_check import as_it_stands

    name, _, verdict = judged
    still = as_it_stands(world.scene)
    if verdict.proven:
        return [f"{name}: {verdict}{still}"]
    lines = [f"{name}: {each}" for each in verdict.findings[:MOST_LINES]]
    more = len(verdict.findings) - MOST_LINES
    return [
        *lines,
        *([f"{name}: and {plural(more, 'more place')}"] if more > 0 else []),
        *([still[2:]] if still else []),
    ]


def _document(judged: Judged) -> dict[str, Any]:
    """Return a motion and its verdict as plain values."""
    name, _, verdict = judged
    return {
        "motion": name,
        "status": verdict.status,
        "clearance": verdict.clearance,
        "between": verdict.curve,
        "pieces": verdict.pieces,
        "touching": verdict.touching,
        "invalid": verdict.invalid,
        "undecided": verdict.undecided,
        "findings": [_finding(each) for each in verdict.findings],
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "status": finding.status,
        "begin": finding.begin,
        "end": finding.end,
        "place": finding.place,
        "time": finding.time,
        "q": finding.q.tolist(),
        "pair": [name for name in finding.pair if name],
        "distance": finding.distance if math.isfinite(finding.distance) else None,
        "reason": finding.reason,
    }


def _certify(world: World, judged: Judged, file: Path, between: Between | None) -> None:
    """Write the certificate of a motion that is proven: of a path, or of a timed motion if it has curves.

    Raises:
        InputError: If planes do not prove it.
    """
    from rrtik_ompl.motion.received.points import curve_of

    curve = curve_of(judged.motion, world.robot, between)
    found = world.certificate(curve.positions if curve.straight else curve, judged.verdict.clearance)
    if found is None:
        raise InputError(f"--certificate: {judged.name} is proven by distances that coal measures, and not by planes")
    found.save(file)


def _mend(world: World, judged: Judged, file: Path, between: Between | None) -> str:
    """Write a proven path near a motion, and return how far it departs from it."""
    from rrtik_ompl.planning.mending import mended

    with progress("mending"):
        found = mended(world, judged.motion, between=between, clearance=judged.verdict.clearance)
    found.path.save(file)
    return f"wrote {file}: {found}"
