"""Straight lines of the tip beside roboplan's Cartesian planner, on the same lines in one run."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.peers.description import task_of
from bench.peers.host import Host
from bench.shared.parts import Parts
from bench.shared.run import Roboplan, Run
from bench.tip_motion.judge import Judge
from bench.tip_motion.lines import ROUNDS, SPREAD
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix

ARMS = ("titan4", "ur5", "panda")
THEIRS = {
    "roboplan_cartesian": "roboplan, its own 5 mm, 0.57 degrees",
    "roboplan_cartesian fine": "roboplan, 0.1 mm, 0.1 degrees",
}
STRAYS = ("off", "turned", "jump")
OURS = "ours, 0.1 mm, 0.1 degrees, with proofs"
SECONDS = 5.0  # [s] by the clock
SAMPLED = 4  # places of every motion that are judged, for some of theirs have a thousand


@dataclass(frozen=True)
class Followed:
    """What somebody made of a line: whether all of it, processor time [s], largest strays [m, rad] and step [rad]."""

    whole: bool
    seconds: float
    off: float
    turned: float
    jump: float


def line_of(python: str, arm: str, number: int) -> dict[str, Followed]:
    """A line from a random configuration to the pose of another one, without obstacles, as each of them follows it."""
    robot, rng = rrtik.load_robot(arm), np.random.default_rng([7, number])
    world = rrtik.World(robot)
    while True:
        q = rng.uniform(*robot.finite_range())
        other = robot.clamp(q + rng.normal(0.0, SPREAD, robot.dof))
        if world.certify(np.stack([q, other])).all():
            break
    judge, spent = Judge(world), []
    begin, end = robot.fk(q), robot.fk(other)

    def seen(rows: Matrix | None, whole: bool, seconds: float) -> Followed:
        if rows is None or not whole:
            return Followed(False, seconds, 0.0, 0.0, 0.0)
        off, turned = judge.strays(rows, begin, end, SAMPLED)
        return Followed(True, seconds, off, turned, float(np.abs(np.diff(rows, axis=0)).max()))

    for _ in range(ROUNDS):
        since = time.process_time()
        made = rrtik.straight(world, q, end)
        spent.append(time.process_time() - since)
    found = {OURS: seen(None if made.path is None else made.path.waypoints, made.fraction == 1.0, min(spent))}
    with TemporaryDirectory() as folder:
        asked = task_of(rrtik.Problem(world, q, other), Path(folder), SECONDS)
        for module in THEIRS:
            answers = [_host(module, python).ask(asked, 0) for _ in range(ROUNDS)]
            rows, least = answers[-1].rows, min(answer.cpu for answer in answers)
            found[module] = seen(rows, rows is not None, least)
    return found


@cache
def _host(module: str, python: str) -> Host:
    return Host(module, python)


def main(
    run: Run,
    parts: Parts,
    *,
    count: Annotated[int, Option("--lines", help="Of each arm.")] = 12,
    python: Roboplan = sys.executable,
) -> Report:
    """Measure."""
    report = run.report("Straight lines beside roboplan's")
    report.intro = (
        "From a random configuration the tip moves straight to the pose of another one, each joint of which is some "
        "0.35 rad away; no obstacles, for roboplan's Cartesian planner looks at none. Its paths are timed motions at "
        "1 m/s and 3 rad/s at most. Not every line can be followed to its end. The judge is pinocchio alone, at "
        f"{SAMPLED} places of every motion. Times: processor time, the smallest of {ROUNDS} calls; ours includes "
        "proofs against contact of the arm with itself."
    )
    table = []
    for arm in ARMS:
        lines = parts(line_of, [(python, arm, k) for k in range(count)])
        for who, name in {OURS: OURS, **THEIRS}.items():
            whole = [line[who] for line in lines if line[who].whole]
            ms = 1e3 * np.array([each.seconds for each in whole])
            spread = f"{np.median(ms):.2f} / {np.quantile(ms, 0.95):.2f}" if whole else "-"
            most = [max((getattr(each, what) for each in whole), default=0.0) for what in STRAYS]
            amounts = [f"{1e3 * most[0]:.3f}", f"{np.degrees(most[1]):.3f}", f"{most[2]:.2f}"]
            table.append([arm, name, f"{len(whole)} of {len(lines)}", spread, *amounts])
    heads = ["arm", "who", "whole", "ms (median / 95 %)", "off, mm", "turned, degrees", "largest step, rad"]
    report.table("Lines", heads, table)
    report.note("Versions", _host(next(iter(THEIRS)), python).versions)
    return report
