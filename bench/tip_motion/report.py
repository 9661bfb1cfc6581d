"""Straight lines of the tip, and tasks.

An interrupted run goes on where it was.
"""

from __future__ import annotations

from collections import Counter
from typing import Annotated

import numpy as np
from typer import Option

from bench.shared.parts import Parts
from bench.shared.run import Run
from bench.tip_motion.lines import Line, line_of
from bench.tip_motion.tasks import CASES, Done, carried
from rrtik_bench.report.machine import processes, processor
from rrtik_bench.report.page import Report

ARMS = ("titan4", "ur5", "panda", "puma560")
RIGHT = 0.01  # share of the line
DEVIATION, TURN = 1e-4, np.radians(0.1)
JUMP = 0.25  # [rad]

LINES = """From a random free configuration among four balls the tip moves straight to the pose of another one, each
joint of which is some 0.35 rad away. The judge is pinocchio and coal alone: it samples every motion at 1/50, and
follows lines itself in 1,500 steps of Newton's method; for a redundant arm it does so in 25 ways to use the freedom and
takes the farthest. Where that is less than the fraction, the judge has seen that the path is on the line and touches
nothing. Times: processor time, the smallest of three calls."""
TASKS = """Three grasps, two places, a wall between them and three posts. Where no plan was found, each grasp with each
place alone was tried with ten seeds and two seconds each. Times: processor time of the whole plan, the smaller of
two calls; proofs and second checks included."""


def lines(report: Report, measure: Parts, count: int, brute: int) -> None:
    """Straight lines of each arm."""
    rows = []
    for arm in ARMS:
        own: list[Line] = measure(line_of, [(arm, k, k < brute) for k in range(count)])
        off, turned = max(each.off for each in own), max(each.turned for each in own)
        times = 1e3 * np.array([each.seconds for each in own])
        asked = [each for each in own if each.fraction == 1.0 or np.isfinite(each.brute)]
        wrong = [each for each in asked if each.fraction < 1.0 and each.brute > each.fraction + RIGHT]
        right = 1.0 - len(wrong) / max(len(asked), 1)
        jumps = sum(each.jump > JUMP + 1e-9 for each in own)
        cuts = sum(each.cut > 0.0 or not each.proven for each in own)
        held = off <= DEVIATION and turned <= TURN + 1e-6
        worst = f"{1e3 * off:.4f} mm, {np.degrees(turned):.4f} degrees"
        report.bar(f"{arm}: deviation at 1/50 of every motion", "<= 0.1 mm, 0.1 degrees", worst, held)
        report.bar(f"{arm}: joint jumps above {JUMP} rad", "0", f"{jumps}", jumps == 0)
        report.bar(f"{arm}: lines that touch something or are not proven", "0", f"{cuts}", cuts == 0)
        report.bar(f"{arm}: fraction right", ">= 99 %", f"{100 * right:.1f} % of {len(asked)}", right >= 0.99)
        report.bar(f"{arm}: time, median [ms]", "<= 3", f"{np.median(times):.2f}", np.median(times) <= 3.0)
        stops = Counter(_kind(each.reason) for each in own if each.reason)
        spread = f"{np.median(times):.2f} / {np.quantile(times, 0.95):.2f} / {times.max():.1f}"
        whole = sum(each.fraction == 1.0 for each in own)
        waypoints = f"{np.median([each.waypoints for each in own]):.0f}"
        rows.append([arm, f"{whole} of {count}", spread, waypoints, *(f"{stops[kind]}" for kind in KINDS)])
    heads = ["arm", "whole", "ms, median / 95 % / worst", "waypoints", *KINDS]
    report.table("Straight lines", heads, rows, text=LINES)


KINDS = ("limit", "singular", "contact", "too near")


def _kind(reason: str) -> str:
    return next((kind for kind in KINDS if kind in reason), reason)


def tasks(report: Report, measure: Parts, scenes: int) -> None:
    """Pick and place of each arm."""
    rows = []
    for arm in CASES:
        own: list[Done] = measure(carried, [(arm, k) for k in range(scenes)])
        found, possible = sum(each.found for each in own), sum(each.brute for each in own)
        times = 1e3 * np.array([each.seconds for each in own if each.found])
        faults, motions = sum(each.faults for each in own), sum(each.motions for each in own)
        report.bar(f"{arm}: pick and place found", "all that can be", f"{found} of {possible}", found == possible)
        report.bar(f"{arm}: whole plan, median [ms]", "<= 100", f"{np.median(times):.0f}", np.median(times) <= 100.0)
        report.bar(f"{arm}: motions with a fault, by the judge", "0", f"{faults} of {motions}", faults == 0)
        spread = f"{np.median(times):.0f} / {np.quantile(times, 0.95):.0f} / {times.max():.0f}"
        rows.append([arm, f"{found} of {scenes}", spread, f"{sum(each.proven for each in own)} of {motions}"])
    report.table("Pick and place", ["arm", "found", "ms, median / 95 % / worst", "motions proven"], rows, text=TASKS)


def main(
    run: Run,
    parts: Parts,
    *,
    followed: Annotated[int, Option("--lines", help="Of each arm.")] = 1000,
    brute: Annotated[int, Option(help="Of these, that the judge follows too.")] = 200,
    scenes: Annotated[int, Option(help="Of each arm.")] = 50,
) -> Report:
    """Measure."""
    report = run.report("Straight lines of the tip, and tasks", f"{processes(run.jobs)}, {processor()}")
    lines(report, parts, followed, brute)
    tasks(report, parts, scenes)
    return report
