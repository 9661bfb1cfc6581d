"""The standing comparison: planners that pip installs on generated families and on MotionBenchMaker's problems.

Each path, ours and theirs, is judged by its ends and by `rrtik.prove`: proven free for its whole length, touching at a
place that is named, or undecided. Where one touches, Pinocchio and coal are asked whether these two do so there. Of
ours a second program verifies the certificates. A peer that cannot live with our versions of numpy and Pinocchio is
given an interpreter of its own, for instance ``--python mplib=venv_mplib/bin/python``; one that is absent is a row that
says why. What is done is kept beside the page: the same command goes on from there.
"""

from __future__ import annotations

import atexit
import sys
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from typer import Option

import rrtik_ompl as rrtik
from bench.peers.description import NoTask, task_of
from bench.peers.host import Answer, Host
from bench.peers.libraries.pinocchio_model import model_and_geometry
from bench.peers.task import Task
from bench.shared.clocks import spent
from bench.shared.motion_bench_maker import problem_of, scene_files
from bench.shared.parts import Parts
from bench.shared.problems import goal_joints
from bench.shared.run import Pythons, Run, SetsOrNone
from bench.speed.machine import machine
from rrtik_bench.report.page import Report
from rrtik_ompl import JointPath, Problem
from rrtik_ompl.base.arrays import TAU, Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.judgement import Finding
from rrtik_ompl.planning.generated_problems import FAMILIES, generated_problem

PLANNER = "fastrrtconnect"
STATUSES = ("proven", "touching", "invalid", "undecided")
TIMES_OVER = 11  # column of the time over ours
OURS = "plan(problem)"
NAMED = f'plan(problem, "{PLANNER}")'
PEERS = {
    "OMPL, Pinocchio + coal": "ompl_callback",
    "the same with a broadphase": "ompl_callback --broadphase",
    "roboplan": "roboplan",
    "roboplan, shortened": "roboplan shortcut",
    "MPlib": "mplib",
    "Tesseract, casts": "tesseract",
    "Tesseract, steps": "tesseract steps",
    "OMPL, Drake": "drake",
    "Genesis World": "genesis",
    "pyroboplan": "pyroboplan",
}
EVERY = {"Genesis World": 16, "pyroboplan": 4}  # of how many problems these take one, for they take long
GENERATED, SETS = ("titan4", "ur5", "panda"), ("panda", "ur5")


@dataclass(frozen=True)
class Outcome:
    """What one planner made of one problem with one seed.

    Attributes:
        group: Arm and family.
        run: Number of the problem, and the seed.
        planner: Who.
        seconds: Of its process.
        found: Whether it gave a path.
        ends: Whether that leads from the start to the goal.
        status: What the proof says: "proven", "touching", "invalid" (outside the limits) or "undecided"; "" without a
            path.
        confirmed: Whether Pinocchio and coal find that the two bodies touch where the path is said to touch, or the
            certificate of a path of ours is verified.
        said: What the proof says of the worst place, where there is one.
        length: [rad]; NaN without a path.
        failed: Why it broke, or "".
    """

    group: str
    run: tuple[int, int]
    planner: str
    seconds: float
    found: bool
    ends: bool
    status: str
    confirmed: bool
    said: str
    length: float
    failed: str


def joins(problem: Problem, rows: Matrix) -> bool:
    """Whether a path leads from the start to the goal, whole turns of a joint aside."""
    off = np.abs(rows[[0, -1]] - np.array([problem.start, goal_joints(problem)]))
    turns = np.where(problem.robot.prismatic, 0.0, TAU * np.round(off / TAU))
    return bool(np.allclose(off, turns, atol=1e-6))


def interpreters(words: Iterable[str]) -> dict[str, str]:
    """The interpreters of peers that have one of their own, from words such as ``mplib=venv/bin/python``.

    Raises:
        InputError: If a word is no such pair, or names no peer.
    """
    known = sorted({module.split()[0] for module in PEERS.values()})
    found = {}
    for word in words:
        name, equals, path = word.partition("=")
        if not equals or name not in known:
            raise InputError(f"--python {word}: expected NAME=INTERPRETER, NAME being {', '.join(known)}")
        found[name] = path
    return found


def judged(group: str, run: tuple[int, int], planner: str, problem: Problem, task: Task, answer: Answer) -> Outcome:
    """A path and what the judges say of it."""
    rows = answer.rows
    if rows is None:
        return Outcome(group, run, planner, answer.cpu, False, False, "", False, "", float("nan"), answer.failed)

    path = JointPath.of(problem.robot, rows)
    verdict = rrtik.prove(problem.world, path, clearance=0.0)
    worst = verdict.worst
    confirmed = True
    if verdict.status == "touching" and worst is not None:
        confirmed = touches(task, worst)
    elif verdict.proven and planner in (OURS, NAMED):
        certificate = problem.world.certificate(path)
        confirmed = certificate is not None and not problem.world.verify(certificate, path)

    said = "" if worst is None else str(worst)
    ends = joins(problem, rows)
    return Outcome(
        group, run, planner, answer.cpu, True, ends, verdict.status, confirmed, said, path.length, answer.failed
    )


def touches(task: Task, finding: Finding) -> bool:
    """Whether the two bodies of a finding touch there, by Pinocchio and coal, which read the files of the peers."""
    model, geometry = model_and_geometry(task)
    found = pin.GeometryData(geometry)
    pin.computeCollisions(model, model.createData(), geometry, found, finding.q, False)
    pairs = zip(geometry.collisionPairs, found.collisionResults, strict=True)
    names = [_body_of(each.name) for each in geometry.geometryObjects]
    touching = [{names[pair.first], names[pair.second]} for pair, result in pairs if result.isCollision()]
    return set(finding.pair) in touching


def _body_of(name: str) -> str:
    """Whose solid it is: Pinocchio numbers those of a link, and a capsule has caps."""
    link, _, number = name.rpartition("_")
    return link if number.isdecimal() and link else name.partition(", ")[0]


@cache
def _host(module: str, python: str) -> Host:
    host = Host(module, python)
    atexit.register(host.__exit__, None, None, None)
    return host


def _problem(group: str, number: int, file: str) -> Problem:
    if not file:
        arm, _, family = group.partition(", ")
        return generated_problem(rrtik.load_robot(arm), family, number)
    found = problem_of(file, balls=False)
    assert found is not None
    return found


def compared(
    turn: int, group: str, number: int, file: str, seeds: int, seconds: float, pythons: str, pages: str
) -> list[Outcome]:
    """Everybody on one problem, in turns; those of `EVERY` if it is theirs."""
    own = interpreters(pythons.split())
    problem = _problem(group, number, file)
    outcomes = []
    calls = {
        OURS: partial(rrtik.plan, problem, seconds=seconds),
        NAMED: partial(rrtik.plan, problem, PLANNER, seconds=seconds, shorten=False),
    }
    for call in calls.values():
        call(seed=0)  # what a world keeps is made
    paths: dict[str, JointPath] = {}
    with TemporaryDirectory() as folder:
        try:
            task = task_of(problem, Path(folder), seconds)
        except NoTask as error:
            print(error, file=sys.stderr)
            return []
        for seed in range(1, seeds + 1):
            found: dict[str, Answer] = {}
            for name, call in calls.items():
                taken, plan = spent(partial(call, seed=seed))
                found[name] = Answer(None if plan.path is None else plan.path.waypoints, taken, taken)
            for name, module in PEERS.items():
                if name in EVERY and turn % EVERY[name]:
                    continue
                host = _host(module, own.get(module.split()[0], sys.executable))
                if not host.absent:
                    found[name] = host.ask(task, seed)
            for name, answer in found.items():
                outcomes.append(judged(group, (number, seed), name, problem, task, answer))
                if answer.rows is not None and seed == 1:
                    paths[name] = JointPath.of(problem.robot, answer.rows)
    if pages and number == 0:
        _show(Path(pages), group, problem, paths)
    return outcomes


def _show(folder: Path, group: str, problem: Problem, paths: dict[str, JointPath]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, path in paths.items():
        file = folder / f"{group}, {name}.html".replace(", ", "_").replace(" ", "_").replace("()", "")
        rrtik.view(problem, path, html=file, title=f"{group}: {name}", still=True)


def comparisons(folder: Path | None, count: int, *rest: Any) -> list[tuple[Any, ...]]:
    """What `compared` is called with."""
    found: list[tuple[Any, ...]] = [
        (f"{arm}, {family}", number, "", *rest) for arm in GENERATED for family in FAMILIES for number in range(count)
    ]
    for arm in SETS if folder else ():
        assert folder is not None
        files = scene_files(folder, arm, count)
        for family, members in groupby(files, lambda file: Path(file).parent.name.rsplit("_", 1)[0]):
            found += [(f"{arm}, MotionBenchMaker {family}", k, file, *rest) for k, file in enumerate(members)]
    found.sort(key=lambda each: each[1])  # the first of each family, then the second of each
    return [(turn, *each) for turn, each in enumerate(found)]


def fill(report: Report, outcomes: Sequence[Outcome], pythons: Mapping[str, str]) -> None:
    """All of them, then group by group."""
    names = list(dict.fromkeys(each.planner for each in outcomes))
    ours = {(each.group, each.run): each.seconds for each in outcomes if each.planner == OURS}
    rows = []
    for name in names:
        mine = [each for each in outcomes if each.planner == name]
        timed = [each for each in mine if not each.failed] or mine[:1]
        ms = 1e3 * np.array([each.seconds for each in timed])
        beside = 1e3 * np.array([ours[each.group, each.run] for each in timed])
        ratio = float(np.exp(np.log(ms / beside).mean()))
        counts = [str(sum(each.found for each in mine)), str(sum(each.ends for each in mine))]
        counts += [str(sum(each.status == status for each in mine)) for status in STATUSES]
        lengths = [each.length for each in mine if each.found]
        length = f"{np.median(lengths):.3g}" if lengths else ""
        times = (np.median(ms), ms.mean(), np.quantile(ms, 0.95), ratio)
        rows.append([name, str(len(mine)), *counts, *(f"{t:.3g}" for t in times), length])
    ours_found = [each for each in outcomes if each.planner in (OURS, NAMED) and each.found]
    sound = sum(each.ends and each.status == "proven" and each.confirmed for each in ours_found)
    report.bar("our paths: ends right, proven, certificate verified", "all", f"{sound} of {len(ours_found)}",
               sound == len(ours_found))  # fmt: skip
    theirs = [each for each in outcomes if each.planner not in (OURS, NAMED) and each.found]
    unclear = sum(each.status == "undecided" for each in theirs)
    report.bar("their paths that the proof cannot decide", "0.5 %", f"{unclear} of {len(theirs)}",
               unclear <= 0.005 * len(theirs))  # fmt: skip
    touching = [each for each in theirs if each.status == "touching"]
    confirmed = sum(each.confirmed for each in touching)
    report.bar("their paths that touch: these two touch at the place named, by Pinocchio and coal", "all",
               f"{confirmed} of {len(touching)}", confirmed == len(touching))  # fmt: skip
    slower = {row[0]: float(row[TIMES_OVER]) for row in rows if row[0] not in (OURS, NAMED)}
    text = ", ".join(f"{name} {ratio:.3g}" for name, ratio in slower.items())
    report.bar("everybody else's time over ours, geometric mean", "> 1", text, min(slower.values(), default=2.0) > 1.0)
    head = ["", "runs", "found", "ends right", *STATUSES, "median [ms]", "mean [ms]", "95 % [ms]"]
    head += ["over ours (geometric mean)", "length [rad], median"]
    report.table("All", head, rows)
    cells = []
    for group in dict.fromkeys(each.group for each in outcomes):
        row = [group]
        for name in names:
            here = [each for each in outcomes if (each.group, each.planner) == (group, name)]
            sound = sum(each.ends and each.status == "proven" for each in here)
            row.append(f"{sound} / {len(here)}, {1e3 * np.median([each.seconds for each in here]):.3g}" if here else "")
        cells.append(row)
    report.table("By arm and family: right and proven of runs, median [ms]", ["", *names], cells)
    reasons = sorted({(each.planner, each.failed) for each in outcomes if each.failed})
    if reasons:
        counted = [[*pair, str(sum((e.planner, e.failed) == pair for e in outcomes))] for pair in reasons]
        report.table("Runs that broke", ["", "why", "runs"], counted)
    doubtful = [e for e in outcomes if e.status == "undecided" or (e.found and not e.confirmed)]
    if doubtful:
        cells = [[e.planner, e.group, str(e.run), e.status, e.said] for e in doubtful]
        report.table("Undecided, or not confirmed", ["", "group", "problem, seed", "", "what the proof says"], cells)
    hosts = {name: _host(module, pythons.get(module.split()[0], sys.executable)) for name, module in PEERS.items()}
    who = [(name, f"absent: {host.absent}" if host.absent else host.versions) for name, host in hosts.items()]
    report.table("Who", ["", "versions"], who)


HOW = f"""Ours are whole calls in a world that has planned before, the proofs of all motions included: the default
call, which shortens its path, and `{PLANNER}`, which does not. The others' is their search alone, 32 checks per
radian (MPlib: 1 % of the space's extent; Tesseract casts, or its own steps; Genesis 0.05 rad), first path, no
shortening but where a row says so. The same files for all: the arm's own solids, limits and pairs. {{seeds}} seeds on
each of {{problems}} problems of a family, in turns. {{rare}} Times are processor times of the process; a run ends after
{{seconds:g}} s by the clock, so that on a busy machine the slower ones find less. A run without a path counts with the
time that it took, and a time over ours is that over our default call on the same problem with the same seed.

Verdict: `rrtik.prove` with no clearance, straight motions between their points. A path that touches counts as confirmed
if Pinocchio and coal, which read the same files as the peers, find that the two bodies that are named touch at the
configuration that is named."""


def main(
    run: Run,
    parts: Parts,
    folder: SetsOrNone = None,
    *,
    problems: Annotated[int, Option(help="Of each family.")] = 3,
    seeds: Annotated[int, Option(help="Runs of each planner on each problem.")] = 2,
    seconds: Annotated[float, Option(help="For each run.")] = 5.0,
    python: Pythons = None,
    pages: Annotated[
        Path | None, Option(help="A folder for pages that can be turned, one a group and planner.")
    ] = None,
) -> Report:
    """Measure."""
    warnings.simplefilter("ignore")
    pythons = interpreters(python or ())
    asked = comparisons(folder, problems, seeds, seconds, " ".join(python or ()), str(pages or ""))
    outcomes = [each for some in parts(compared, asked) for each in some]
    report = run.report("The standing comparison", "a process for each planner")
    fill(report, outcomes, pythons)
    rare = " ".join(f"{name}, which takes long, has every {count}th problem." for name, count in EVERY.items())
    how = HOW.format(problems=problems, seeds=seeds, seconds=seconds, rare=rare)
    report.note("How it was measured", f"{how}\n\n{machine()}")
    return report
