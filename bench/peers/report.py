"""Libraries of others on the same problems: planning and inverse kinematics, all in one run, in turns.

A peer that cannot live with our versions of numpy and Pinocchio is given an interpreter of its own, for instance
``--python mplib=venv_mplib/bin/python``. A peer that is absent is a row that says why.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.ik.ik_comparison import ARMS, METRES, RADIANS, single
from bench.ik.ik_comparison import HEAD as IK_HEAD
from bench.peers.description import task_of
from bench.peers.host import Answer, Host, answered
from bench.peers.serve import timed
from bench.peers.task import PER_RADIAN, RANGE, Rows
from bench.shared.problems import goal_joints
from bench.shared.run import PandaSetOrNone, Pythons, Run
from bench.speed.cases import Options, exact_problem, family, panda_files
from bench.speed.machine import machine
from bench.speed.ours import our_search, warm_up
from rrtik_bench.report.machine import package_version
from rrtik_bench.report.page import Report
from rrtik_ompl import JointPath, Problem
from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.planning.generated_problems import generated_problem

OURS, OWN_RULE = "rrtik_ompl, fastrrtconnect", "the same by its own, denser rule"
PEERS = {
    "OMPL, Pinocchio + coal": "ompl_callback",
    "the same with a broadphase": "ompl_callback --broadphase",
    "roboplan": "roboplan",
    "MPlib": "mplib",
    "pyroboplan": "pyroboplan",
}
IK_PACKAGES = ("pytracik", "ikpy", "EAIK", "roboticstoolbox-python")
HEAD = ["", "runs", "found", "verified", "median [ms]", "mean [ms]", "95 % [ms]", "median ratio to ours", "length"]
HEAD += ["versions"]
NO_FOLDER = "Without MotionBenchMaker's problems: their folder was not given."
SHIPPED = ("titan4_sdu", "titan4_prisms")
GENERATED = (("titan4", "clutter"), ("ur5", "clutter"))
HOW = """RRT-Connect of everybody, motions of a tree at most {range:g} rad, {density:g} checks per radian (MPlib: OMPL's
1 % of the space's extent, it cannot be set), first path, no shortening; {seeds} seeds on each problem, at most
{seconds:g} s each. All read the same files: the arm's own solids (meshes as triangles), limits and pairs, so that the
problems are the same; reading is not measured. Each runs in a process of its own, in turns, run by run; time is
processor time of that process. A run without a path counts with the time that it took. Verified: the path leads from
the start to the goal (a joint may end whole turns away) and the world's second check finds nothing, in steps in
which no point of the arm moves more than half of `motion_resolution`, 5 mm: denser than what any of them checks."""
IK_HOW = """The same reachable poses for all, in turns, in one process, processor time. Solved: inside the limits, at
most {metres:g} m and {radians:g} rad away by Pinocchio's kinematics. A method is asked until its budget of time is used
up; the column "poses" says how often. All start from the middle of the limits; EAIK gives all branches, of which the
first inside the limits is taken; the Robotics Toolbox is asked for the accuracy of TRAC-IK, its own is 1.4 mm."""


@dataclass
class Runs:
    """What one candidate did, run by run; the runs of all candidates are in the same order."""

    group: list[str] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    length: list[float] = field(default_factory=list)
    verified: int = 0
    failed: dict[str, int] = field(default_factory=dict)

    def add(self, group: str, problem: Problem, answer: Answer) -> None:
        """Classify one run."""
        self.group.append(group)
        self.seconds.append(answer.cpu)
        if answer.failed:
            self.failed[answer.failed] = self.failed.get(answer.failed, 0) + 1
        if answer.rows is not None:
            path = JointPath.of(problem.robot, answer.rows)
            self.length.append(path.length)
            self.verified += joins(problem, answer.rows) and not path.violations(problem.world)

    def row(self, name: str, first: Runs) -> list[str]:
        """A row of the table."""
        ms = 1e3 * np.array(self.seconds)
        times = (np.median(ms), ms.mean(), np.quantile(ms, 0.95))
        ratio = np.median(ms / (1e3 * np.array(first.seconds)))
        counts = (len(ms), len(self.length), self.verified)
        length = f"{np.median(self.length):.3g}" if self.length else ""
        return [name, *map(str, counts), *(f"{value:.3g}" for value in (*times, ratio)), length]


def joins(problem: Problem, rows: Rows) -> bool:
    """Whether a path leads from the start to the goal, whole turns of a joint aside."""
    off = np.abs(rows[[0, -1]] - np.array([problem.start, goal_joints(problem)]))
    turns = np.where(problem.robot.prismatic, 0.0, TAU * np.round(off / TAU))
    return bool(np.allclose(off, turns, atol=1e-6))


def problems(folder: Path | None, count: int) -> Iterator[tuple[str, Problem]]:
    """Problems with the groups in which they are reported."""
    for name in SHIPPED:
        yield name, rrtik.load_problem(name)
    for robot, kind in GENERATED:
        for seed in range(count):
            yield f"{robot}, {kind}", generated_problem(rrtik.load_robot(robot), kind, seed)
    case = Options(folder, count, count, 1, False, 0)
    for file in panda_files(case, count):
        yield f"panda, {family(file)}", exact_problem(case, file)


def planning(
    report: Report, cases: Iterable[tuple[str, Problem]], seeds: int, seconds: float, pythons: Mapping[str, str]
) -> None:
    """Everybody on every problem, in turns."""
    with ExitStack() as stack:
        hosts = {
            name: stack.enter_context(Host(module, pythons.get(module.split()[0], sys.executable)))
            for name, module in PEERS.items()
        }
        runs = {name: Runs() for name in (OURS, OWN_RULE, *(name for name, host in hosts.items() if not host.absent))}
        for group, problem in cases:
            print(f"{problem.name} ...", file=sys.stderr, flush=True)
            warm_up(problem)
            with TemporaryDirectory() as folder:
                task = task_of(problem, Path(folder), seconds)
                ours = {
                    OURS: our_search(problem, seconds=task.seconds, per_radian=PER_RADIAN),
                    OWN_RULE: our_search(problem, seconds=task.seconds),
                }
                for seed in range(1, seeds + 1):
                    for name, done in runs.items():
                        answer = answered(timed(ours[name], seed)) if name in ours else hosts[name].ask(task, seed)
                        done.add(group, problem, answer)
    _planning_tables(report, hosts, runs)


def _planning_tables(report: Report, hosts: dict[str, Host], runs: dict[str, Runs]) -> None:
    ours = runs[OURS]
    absent = [[name, *[""] * 8, f"absent: {host.absent}"] for name, host in hosts.items() if host.absent]
    rows = [[*done.row(name, ours), hosts[name].versions if name in hosts else ""] for name, done in runs.items()]
    report.table("Planning", HEAD, rows + absent)
    groups = list(dict.fromkeys(ours.group))
    cells = []
    for group in groups:
        own = np.array(ours.group) == group
        medians = (f"{1e3 * np.median(np.array(done.seconds)[own]):.3g}" for done in runs.values())
        cells.append([group, str(own.sum()), *medians])
    report.table("Planning, medians [ms]", ["", "runs", *runs], cells)
    failed = [[name, str(count), why] for name, done in runs.items() for why, count in done.failed.items()]
    if failed:
        report.table("Runs that broke", ["", "runs", "why"], failed)


def inverse_kinematics(report: Report, count: int, budget: float) -> None:
    """Everybody on the same poses of several arms."""
    rows, missing = [], []
    for name in ARMS:
        robot = rrtik.load_robot(name)
        poses = robot.fk_batch(np.random.default_rng(2).uniform(*robot.finite_range(), (count, robot.dof)))
        runs, absent = single(robot, poses, budget, methods=("auto",))
        missing += absent
        rows += [[name, *done.row(f"rrtik_ompl, {each}" if each == "auto" else each)] for each, done in runs.items()]
    report.table("Inverse kinematics", ["arm", *IK_HEAD], rows)
    versions = ", ".join(package_version(name) for name in IK_PACKAGES)
    report.note("How that was measured", f"{IK_HOW.format(metres=METRES, radians=RADIANS)} {versions}.")
    if missing:
        report.note("Not asked", "\n".join(f"- {line}" for line in missing))


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


def main(
    run: Run,
    folder: PandaSetOrNone = None,
    *,
    count: Annotated[int, Option("--problems", help="Of each family.")] = 3,
    seeds: Annotated[int, Option(help="Runs of each candidate on each problem.")] = 3,
    seconds: Annotated[float, Option(help="For each run.")] = 10.0,
    python: Pythons = None,
    poses: int = 500,
    budget: Annotated[float, Option(help="Seconds for our method, seven times as many a peer.")] = 1.0,
) -> Report:
    """Measure."""
    pythons = interpreters(python or ())
    report = run.report("Beside the libraries of others", "a process for each planner")
    report.note("Machine", machine())
    how = HOW.format(range=RANGE, density=PER_RADIAN, seeds=seeds, seconds=seconds)
    report.note("How planning was measured", how if folder else f"{how} {NO_FOLDER}")
    planning(report, problems(folder, count), seeds, seconds, pythons)
    inverse_kinematics(report, poses, budget)
    return report
