"""DRRT-Con [1, ch. 5.2] in the plane and on arms, beside planning from scratch.

Times are of the processor, so that runs beside each other are fair. An interrupted run goes on where it was.
"""

from __future__ import annotations

from itertools import groupby
from typing import Annotated

import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.replanning import runs, scenes
from bench.replanning.arms import HEAD, arm_rows, contacts, figures, repair_rows
from bench.replanning.runs import outcome, plane_run
from bench.shared.parts import Parts
from bench.shared.problems import goal_joints
from bench.shared.run import Run
from rrtik_bench.contact_check import check_contacts
from rrtik_bench.report.page import Report
from rrtik_bench.shortening.plane_worlds import Plane
from rrtik_ompl.replanning.connecting import PythonConnect, TreeOptions
from rrtik_ompl.replanning.drrt_con import DrrtCon
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.world.moving_world import MovingWorld

PLANNERS = ("drrt-con", "rrt-connect", "drrt")


def static_rows(report: Report, count: int) -> None:
    """Scene 2: what was walked, against one pass of RRT-Connect with the sequential cut, and the class optimum."""
    rows, shares, ratios = [], [], []
    for name, problem, shapes in (
        ("two walls", scenes.walls(), scenes.WALLS),
        ("pockets, frozen", scenes.pockets(moving=False), [scenes.POCKET, scenes.UPPER]),
    ):
        size = (scenes.SIZE, scenes.SIZE)
        plane = Plane(name, [np.array(s, dtype=float) for s in shapes], size, problem.start, goal_joints(problem))
        walked, once = [], []
        for seed in range(count):
            run = plane_run(problem, seed)
            best = plane.class_optimum(run.configurations)
            walked.append(run.length / best)
            options = TreeOptions(np.zeros(2), np.full(2, scenes.SIZE), scenes.EPS, seed)
            planner = DrrtCon(PythonConnect(options), scenes.EPS)
            planner.begin(problem.start, goal_joints(problem)[None], MovingWorld(problem.world))
            route = planner.path
            assert route is not None
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
            rows.append([f"{ratio:g}", planner, *cells(some, found)])
            if planner == "drrt-con":
                arrived[ratio] = np.mean([r.found for r in found])
                p95.append(np.percentile(np.concatenate([r.tick_seconds("all") for r in found]), 95))
                sound += [runs.executed_valid(p, r) for p, r in zip(problems[::3], found[::3], strict=True)]
                bounded += [calls_bounded(p, r) for p, r in zip(problems, found, strict=True)]
                plain = found
        bound = ratio * scenes.STEP * scenes.RATE
        keeping = [plane_run(p, seed, speed_bound=bound) for seed, p in enumerate(problems)]
        rows.append([f"{ratio:g}", "drrt-con, speed bound stated", *cells(problems, keeping)])
        if ratio == 1.0:
            predictive = [plane_run(p, seed, lookahead_ticks=4) for seed, p in enumerate(problems)]
            rows.append([f"{ratio:g}", "drrt-con, 4 ticks ahead", *cells(problems, predictive)])
    head = ["speed ratio", "planner", *HEAD, "runs with contact"]
    report.table(f"Six triangles, {count} runs each, 5 of drrt", head, rows)
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
    report.bar("six triangles, ratio 1.0: arrival in 400 ticks", ">= 95 %", f"{arrived[1.0]:.0%}", arrived[1.0] >= 0.95)
    predictive_bar(report, plain, predictive)


def cells(problems: list[rrtik.Problem], found: list[ReplanRun]) -> list[str]:
    """Runs in a table: figures, and how many had contact."""
    judged = [outcome(r, check_contacts(p.robot, r, p.world.scene)) for p, r in zip(problems, found, strict=True)]
    return [*figures(judged), contacts(judged)]


def predictive_bar(report: Report, plain: list[ReplanRun], predictive: list[ReplanRun]) -> None:
    """The predictive variant against the plain one, ratio 1.0."""
    held = [[sum(r.count(e) for r in found) for e in ("wait", "evade", "repair")] for found in (plain, predictive)]
    stops = [waits + evasions for waits, evasions, _ in held]
    text = ", ".join(f"{what} {a} -> {b}" for what, a, b in zip(("waits", "evasions", "replans"), *held, strict=True))
    fewer = held[1][0] <= 0.7 * held[0][0] or held[1][2] <= 0.7 * held[0][2]
    report.bar("predictive beside plain: waits or replans", "at least 30 % fewer", text, fewer and stops[1] <= stops[0])


def calls_bounded(problem: rrtik.Problem, run: ReplanRun) -> bool:
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
        arrived.append(run.found and run.ticks[-1].time * scenes.RATE <= 83 + 60)
        verdict = check_contacts(problem.robot, run, problem.world.scene)
        clean.append(not verdict.contacts)
    shares = [float(np.mean(values)) for values in (waited, arrived, clean)]
    text = ", ".join(f"{share:.0%}" for share in shares)
    report.bar(
        "covered goal: waits, arrives within 60 ticks of release, no contact", "100 % each", text, min(shares) == 1
    )
    caught = []
    for seed in range(count):
        problem, goal = scenes.moving_goal(seed)
        caught.append(plane_run(problem, seed, goal_feed=goal).found)
    report.bar(
        "moving goal, 0.6 of the robot's speed: captured", ">= 95 %", f"{np.mean(caught):.0%}", np.mean(caught) >= 0.95
    )


def arm_order(report: Report, count: int) -> None:
    """Scene 4: the order of events."""
    kept = []
    for seed in range(count):
        run = replan(
            scenes.planar_arm(), step=0.08, rate=20, max_edge=0.3, margin=0.01, limits=slow(3), seconds=30, seed=seed
        )
        going = ["go" if t.event in ("plan", "walk", "repair") else t.event for t in run.ticks]
        kept.append([event for event, _ in groupby(going)] == ["go", "wait", "go", "arrive"])
    text = f"{np.mean(kept):.0%} of {count} runs"
    report.bar("planar arm: follow, stop, hold, resume, arrive", "this order", text, all(kept))


def slow(count: int) -> rrtik.RateLimits:
    return rrtik.RateLimits(np.full(count, 2.0), np.full(count, 10.0))


def plane_part(report: Report, count: int) -> None:
    """Everything in the plane."""
    static_rows(report, count)
    triangle_rows(report, count)
    goal_rows(report, count)
    arm_order(report, count)


def part(section: str, amount: int) -> Report:
    """A part of the report."""
    report = Report("", "")
    {"plane": plane_part, "repairs": repair_rows}[section](report, amount)
    return report


def main(
    run: Run,
    parts: Parts,
    *,
    repeats: Annotated[int, Option(help="Runs of each scene in the plane.")] = 30,
    runs: Annotated[int, Option(help="Runs of DRRT-Con of each arm.")] = 1000,
) -> Report:
    """Measure."""
    report = run.report("DRRT-Con")
    for section in parts(part, [("plane", repeats), ("repairs", max(repeats // 3, 2))]):
        report.add(section)
    report.save(run.out)
    arm_rows(report, runs, parts)
    report.note("How it is read", READING)
    return report


READING = (
    "The scenes' numbers are proposals: the figures of [1, ch. 5.2] give none. A contact is judged by coal alone, "
    "five times a tick (ten in the plane), with every obstacle where it really is at that moment; the planner's "
    "world is not asked. "
    "In the plane the margin is 0 and, but for the rows that say so, no speed is stated, so nothing rules a contact "
    "out there: a path that is free now may touch what moves during the tick. "
    "'From scratch, same kernels' is RRT-Connect and shortcuts in the same kernels and the same packed scene as "
    "DRRT-Con's own repair, so it shows what keeping the path is worth; a new World and plan() is what planning from "
    "scratch cost before there was replanning. A repair is one that found a path, with what is new of it shortened; a "
    "whole tick also packs the moved obstacles, checks the path and steps. Times are of the "
    "processor. Of the baselines fewer runs were made, of 6 s at most; drrt has one tick for a repair."
)
