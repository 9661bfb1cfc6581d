"""Measure the acceptance rows of DRRT-Con and the issue's targets for arms, and write them as Markdown.

Usage: ``nice python bench/drrt_con_report.py [--repeats 30] [--seconds 240] [--out bench/reports/drrt_con.md]``

``--seconds`` is the time for runs of six-joint arms among moving obstacles: as many as fit, of both arms in turn. All
in all it takes twice that.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path

import drrt_con_runs as runs
import drrt_con_scenes as scenes
import numpy as np
from acceptance import Report
from ompl import util as ou
from plane_worlds import Plane

import rrtik_ompl as rrtik
from rrtik_ompl.moving_world import MovingWorld
from rrtik_ompl.replanning import Run, replan
from rrtik_ompl.replanning.connecting import PlainConnect
from rrtik_ompl.replanning.drrt_con import DrrtCon
from rrtik_ompl.replanning.judge import judge

PLANNERS = ("drrt-con", "rrt-connect", "drrt")
HEAD = ["arrived", "length", "repairs", "waits", "evasions", "repair median / p95 [ms]", "tick p95 [ms]"]


def plane_run(problem: rrtik.Problem, seed: int, **changes: object) -> Run:
    return replan(problem, limits=scenes.limits(), seed=seed, **{"seconds": 40.0, **scenes.OPTIONS, **changes})


def figures(found: list[Run]) -> list[str]:
    """Cells of a table, see HEAD."""
    repairs = np.concatenate([r.seconds("repair", "repair") for r in found])
    ticks = np.concatenate([r.seconds("all") for r in found])
    times = "none" if len(repairs) == 0 else " / ".join(f"{1e3 * np.percentile(repairs, p):.2f}" for p in (50, 95))
    counts = [f"{np.mean([r.count(event) for r in found]):.1f}" for event in ("repair", "wait", "evade")]
    length = np.mean([r.length for r in found])
    arrived = f"{sum(r.arrived for r in found)} of {len(found)}"
    return [arrived, f"{length:.2f}", *counts, times, f"{1e3 * np.percentile(ticks, 95):.1f}"]


def static_rows(report: Report, count: int) -> None:
    """Scene 2: what was walked, against one pass of RRT-Connect with the sequential cut, and the class optimum."""
    rows, shares, ratios = [], [], []
    for name, problem, shapes in (
        ("two walls", scenes.walls(), scenes.WALLS),
        ("pockets, frozen", scenes.pockets(moving=False), [scenes.POCKET, scenes.UPPER]),
    ):
        size = (scenes.SIZE, scenes.SIZE)
        plane = Plane(name, [np.array(s, dtype=float) for s in shapes], size, problem.start, problem.goal.q)
        walked, once = [], []
        for seed in range(count):
            run = plane_run(problem, seed)
            best = plane.class_optimum(run.configurations)
            walked.append(run.length / best)
            planner = DrrtCon(PlainConnect(np.zeros(2), np.full(2, scenes.SIZE), scenes.EPS, seed), scenes.EPS)
            planner.begin(problem.start, problem.goal.q[None], MovingWorld(problem.world))
            route = planner.path
            once.append(float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum()) / plane.class_optimum(route))
            shares.append(walked[-1] * best <= once[-1] * plane.class_optimum(route) + 1e-9)
        ratios.append(float(np.mean(walked)))
        rows.append([name, f"{np.mean(walked):.4f}, {max(walked):.4f}", f"{np.mean(once):.4f}, {max(once):.4f}"])
    head = ["scene", "walked by DRRT-Con: mean, max", "RRT-Connect and the sequential cut, one pass: mean, max"]
    report.table(f"Static scenes: length over the shortest of the same class, {count} runs each", head, rows)
    text = ", ".join(f"{ratio:.4f}" for ratio in ratios)
    report.bar("static: mean walked / class optimum (two walls, pockets)", "<= 1.03", text, max(ratios) <= 1.03)
    share = float(np.mean(shares))
    report.bar("static: walked <= one pass of RRT-Connect + cut", ">= 90 % of pairs", f"{share:.0%}", share >= 0.9)


def triangle_rows(report: Report, count: int) -> None:
    """Scene 3 at several speeds, all planners, and with prediction."""
    rows, arrived, p95 = [], {}, []
    sound, bounded, plain, predictive = [], [], [], []
    for ratio in (0.2, 0.5, 1.0):
        problems = [scenes.triangles(ratio, seed) for seed in range(count)]
        for planner in PLANNERS:
            some = problems[: 5 if planner == "drrt" else count]
            found = [plane_run(p, seed, planner=planner) for seed, p in enumerate(some)]
            rows.append([f"{ratio:g}", planner, *figures(found)])
            if planner == "drrt-con":
                arrived[ratio] = np.mean([r.arrived for r in found])
                p95.append(np.percentile(np.concatenate([r.seconds("all") for r in found]), 95))
                sound += [runs.executed_valid(p, r) for p, r in zip(problems[::3], found[::3], strict=True)]
                bounded += [calls_bounded(p, r) for p, r in zip(problems, found, strict=True)]
                plain = found
        if ratio == 1.0:
            predictive = [plane_run(p, seed, predict=4) for seed, p in enumerate(problems)]
            rows.append([f"{ratio:g}", "drrt-con, 4 ticks ahead", *figures(predictive)])
    report.table(f"Six triangles, {count} runs each, 5 of drrt", ["speed ratio", "planner", *HEAD], rows)
    least = min(arrived[0.2], arrived[0.5])
    report.bar("six triangles, ratio 0.2 and 0.5: arrival in 400 ticks", ">= 95 %", f"{least:.0%}", least >= 0.95)
    share = float(np.mean(sound))
    report.bar(
        "the executed edge is free in the exact world of its tick",
        "100 %",
        f"{share:.0%} of {len(sound)} runs",
        share == 1.0,
    )
    report.bar(
        "configurations looked at, nothing hit",
        "<= path / resolution + points",
        f"{np.mean(bounded):.0%} of runs",
        all(bounded),
    )
    report.bar("tick time (planar), p95", "<= 50 ms", f"{1e3 * max(p95):.1f} ms", max(p95) <= 0.05)
    report.bar("Beat: ratio 1.0, arrival", ">= 95 %", f"{arrived[1.0]:.0%}", arrived[1.0] >= 0.95)
    predictive_bar(report, plain, predictive)


def predictive_bar(report: Report, plain: list[Run], predictive: list[Run]) -> None:
    """The predictive variant against the plain one, ratio 1.0."""
    held = [[sum(r.count(e) for r in found) for e in ("wait", "evade", "repair")] for found in (plain, predictive)]
    stops = [waits + evasions for waits, evasions, _ in held]
    text = ", ".join(f"{what} {a} -> {b}" for what, a, b in zip(("waits", "evasions", "replans"), *held, strict=True))
    fewer = held[1][0] <= 0.7 * held[0][0] or held[1][2] <= 0.7 * held[0][2]
    report.bar("Beat: predictive: waits or replans", "at least 30 % fewer", text, fewer and stops[1] <= stops[0])


def calls_bounded(problem: rrtik.Problem, run: Run) -> bool:
    """Whether each look at a free path asked for no more than its length over the resolution, and its points."""
    weights, resolution = problem.world.weights, problem.world.motion_resolution
    for before, tick in zip(run.ticks[:-1], run.ticks[1:], strict=True):
        if tick.event == "walk" and before.path is not None and "look" in tick.seconds:
            ways = np.abs(np.diff(before.path, axis=0))
            points = 2.0 * np.ceil(np.linalg.norm(ways, axis=1) / (0.5 * scenes.EPS)).sum() + 2
            if tick.checked > (ways @ weights).sum() / resolution + points:
                return False
    return True


def goal_rows(report: Report, count: int) -> None:
    """The goal that is covered for a while, and the goal that moves."""
    waited, arrived, clean = [], [], []
    for seed in range(count):
        problem = scenes.covered(seed)
        run = plane_run(problem, seed)
        waited.append(run.count("wait") > 0)
        arrived.append(run.arrived and run.ticks[-1].time * scenes.RATE <= 83 + 60)
        verdict = judge(problem.robot, run, problem.world.scene)
        clean.append(not verdict.contacts)
    shares = [float(np.mean(values)) for values in (waited, arrived, clean)]
    text = ", ".join(f"{share:.0%}" for share in shares)
    report.bar(
        "covered goal: waits, arrives within 60 ticks of release, no contact", "100 % each", text, min(shares) == 1
    )
    caught = []
    for seed in range(count):
        problem, goal = scenes.moving_goal(seed)
        caught.append(plane_run(problem, seed, goal_feed=goal).arrived)
    report.bar(
        "moving goal, 0.6 of the robot's speed: captured", ">= 95 %", f"{np.mean(caught):.0%}", np.mean(caught) >= 0.95
    )


def arm_order(report: Report, count: int) -> None:
    """Scene 4: the order of events."""
    kept = []
    for seed in range(count):
        run = replan(
            scenes.planar_arm(), step=0.08, rate=20, eps=0.3, margin=0.01, limits=slow(3), seconds=30, seed=seed
        )
        going = ["go" if t.event in ("plan", "walk", "repair") else t.event for t in run.ticks]
        kept.append([event for event, _ in groupby(going)] == ["go", "wait", "go", "arrive"])
    text = f"{np.mean(kept):.0%} of {count} runs"
    report.bar("planar arm: follow, stop, hold, resume, arrive", "this order", text, all(kept))


def slow(count: int) -> rrtik.RateLimits:
    return rrtik.RateLimits(np.full(count, 2.0), np.full(count, 10.0))


def arm_rows(report: Report, seconds: float) -> None:
    """Six joints, 20 obstacles: contact, arrival, repairs; as many runs as fit."""
    rows = []
    for name, arm in runs.ARMS.items():
        found, begin = [], time.perf_counter()
        while time.perf_counter() - begin < 0.5 * seconds:
            found.append(runs.arm_run(name, len(found)))
        for planner, most, slot in (("rrt-connect", max(int(seconds / 25), 2), 0.5), ("drrt", 2, 1.0 / runs.RATE)):
            others = [runs.arm_run(name, seed, planner=planner, slot=slot, seconds=6.0) for seed in range(most)]
            rows.append([name, planner, *figures([r for r, _ in others]), contacts(others)])
        rows.append([name, "drrt-con", *figures([r for r, _ in found]), contacts(found)])
        arm_bars(report, name, arm["count"], found)
    report.table("Six-joint arms among 20 obstacles that wander", ["arm", "planner", *HEAD, "runs with contact"], rows)


def contacts(found: list) -> str:
    """How many runs had contact, and in what ticks it began."""
    events = [v.contacts[0][1] for _, v in found if v.contacts]
    return f"{len(events)}" + (f" ({', '.join(sorted(set(events)))})" if events else "")


def arm_bars(report: Report, name: str, count: int, found: list) -> None:
    touched = sum(bool(v.contacts) for _, v in found)
    reached = np.mean([r.arrived and not v.contacts for r, v in found])
    repairs = np.concatenate([r.seconds("repair", "repair") for r, _ in found])
    ticks = np.concatenate([r.seconds("all") for r, _ in found])
    nearest = min(v.nearest for _, v in found)
    text = f"{touched} of {len(found)} runs; nearest {1e3 * nearest:.1f} mm"
    what = f"{name}, {count} obstacles slower than the bound: runs with contact"
    enough = len(found) >= 1000
    report.bar(what, "0 of 1,000", text + ("" if enough else " (too few runs)"), touched == 0 and enough)
    text = f"{reached:.1%} of {len(found)}"
    report.bar(f"{name}: arrived without contact within {runs.LONGEST:g} s", ">= 95 %", text, reached >= 0.95)
    p95 = 1e3 * np.percentile(repairs, 95) if len(repairs) else 0.0
    report.bar(f"{name}: repair, p95 of {len(repairs)}", "< 20 ms", f"{p95:.1f} ms", p95 < 20.0)
    p95 = 1e3 * np.percentile(ticks, 95)
    report.bar(
        f"{name}: whole tick (obstacles packed, look, repair, step), p95", "< 20 ms", f"{p95:.1f} ms", p95 < 20.0
    )


def repair_rows(report: Report, count: int) -> None:
    """The same repair by other ways, at the same moments."""
    rows = []
    for name in runs.ARMS:
        quick, slower = runs.paired(name, range(count))
        for moments in (m for m in (quick, slower) if m.ours):
            ways = {runs.OURS: moments.ours, **moments.others}
            rows += [[name, what, *repair_cells(way), f"{moments.ratio(what):.1f}"] for what, way in ways.items()]
        for what, moments in (
            (runs.SCRATCH, quick),
            *((w, slower) for w in slower.others if "World" in w),
        ):
            ratio = moments.ratio(what)
            report.bar(f"{name}: median repair against {what}", ">= 5 times faster", f"{ratio:.1f} times", ratio >= 5.0)
    head = [
        "arm",
        "way to a new path",
        "repairs",
        "median [ms]",
        "p95 [ms]",
        "length: new / blocked",
        "seconds: median of ratios to DRRT-Con",
    ]
    report.table("Repairs, each also done by the others at the same moment", head, rows)


def repair_cells(way: list[tuple[float, float]]) -> list[str]:
    """Number of repairs, median and p95 of their milliseconds, and the mean length of what they found."""
    seconds, lengths = np.array(way).T
    times = [f"{1e3 * np.percentile(seconds, p):.3f}" for p in (50, 95)]
    return [str(len(way)), *times, f"{lengths.mean():.3f}"]


def plane_part(report: Report, count: int) -> None:
    """Everything in the plane."""
    static_rows(report, count)
    triangle_rows(report, count)
    goal_rows(report, count)
    arm_order(report, count)


def _part(section: Callable[[Report, float], None], amount: float) -> Report:
    """A part of the report, in a process of its own."""
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    report = Report("", "")
    section(report, amount)
    return report


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=30)
    parser.add_argument("--seconds", type=float, default=240.0)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "reports" / "drrt_con.md")
    given = parser.parse_args()
    report = Report("DRRT-Con", "python bench/drrt_con_report.py")
    work = [(plane_part, given.repeats), (repair_rows, max(given.repeats // 5, 2)), (arm_rows, given.seconds)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for part in pool.map(_part, *zip(*work, strict=True)):
            report.bars += part.bars
            report.lines += part.lines
    report.note("How it is read", READING)
    given.out.write_text(report.markdown())


READING = (
    "The scenes' numbers are proposals: the paper's figures give none. A contact is judged by coal alone, five times a "
    "tick (ten in the plane), with every obstacle where it really is at that moment; the planner's world is not asked. "
    "'From scratch, same kernels' is RRT-Connect and shortcuts in the same kernels and the same packed scene as "
    "DRRT-Con's own repair, so it shows what keeping the path is worth; a new World and plan() is what planning from "
    "scratch cost before there was replanning. A repair is one that found a path, with what is new of it shortened; a "
    "whole tick also packs the moved obstacles, checks the path and steps. Times are of a shared machine under load: "
    "compare ratios. Of the baselines fewer runs were made, of 6 s at most; drrt has one tick for a repair."
)

if __name__ == "__main__":
    main()
