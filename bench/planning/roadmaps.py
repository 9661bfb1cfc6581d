"""Roadmaps of the Panda's MotionBenchMaker scenes: making one, a thousand queries, an obstacle that moves.

The first problem of each family.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

from bench.shared.run import PandaSet, Run
from rrtik_bench.report.page import Report
from rrtik_ompl import Problem, Roadmap, World, plan, pose
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker

WANTED = 3e-4  # [s] median of a query
VERTICES = 2000
PLANNED = 100  # of the queries, also by plan()
SHIFT = 0.05  # [m] by which the first obstacle moves


@dataclass(frozen=True)
class Measured:
    """One scene: seconds of processor time; ``solved`` counts queries, ``plans`` are those of `plan()`."""

    family: str
    making: float
    queries: Matrix
    solved: int
    moving: float
    after: Matrix
    plans: Matrix
    others: Matrix
    proven: int


def asked(roadmap: Roadmap, ends: Matrix) -> tuple[Matrix, int]:
    """Seconds of each query between a pair of configurations, shape (m, 2, n), and how many have a path."""
    seconds, solved = [], 0
    for start, goal in ends:
        begin = process_time()
        rows = roadmap.route(start[None], goal[None], bool)
        seconds.append(process_time() - begin)
        solved += rows is not None
    return np.array(seconds), solved


def free_pairs(world: World, count: int) -> Matrix:
    """Pairs of free configurations, shape (count, 2, n), from a fixed seed."""
    rng, rows = np.random.default_rng(0), np.empty((0, world.robot.dof))
    while len(rows) < 2 * count:
        drawn = rng.uniform(world.robot.lower, world.robot.upper, (10 * count, world.robot.dof))
        rows = np.vstack([rows, drawn[world.valid_batch(drawn)]])
    return rows[: 2 * count].reshape(count, 2, -1)


def moved(world: World) -> World:
    """The world after its first obstacle has moved."""
    first, *others = world.scene.obstacles
    there = pose([SHIFT, 0.0, 0.0]) * first.pose
    return world.with_scene(replace(world.scene, obstacles=(replace(first, pose=there), *others)))


def planned(world: World, ends: Matrix, planner: str, parameters: dict[str, object]) -> tuple[Matrix, int]:
    """Seconds of `plan()` between pairs of configurations, and how many paths are proven."""
    seconds, proven = [], 0
    for start, goal in ends:
        problem = Problem(world, start, goal)
        begin = process_time()
        found = plan(problem, planner, seed=1, parameters=parameters, shorten=False)
        seconds.append(process_time() - begin)
        proven += bool(found.proven)
    return np.array(seconds), proven


def measured(file: Path, urdf: Path, queries: int) -> Measured:
    """All of one scene."""
    world = load_motion_bench_maker(file, robot=urdf).world
    ends = free_pairs(world, queries)
    begin = process_time()
    roadmap = Roadmap(world, vertices=VERTICES)
    making = process_time() - begin
    seconds, solved = asked(roadmap, ends)
    there = moved(world)
    still = there.valid_batch(ends.reshape(-1, ends.shape[2])).reshape(-1, 2).all(axis=1)
    begin = process_time()
    elsewhere = roadmap.moved_to(there)
    moving = process_time() - begin
    after, _ = asked(elsewhere, ends[still])
    plans, proven = planned(world, ends[:PLANNED], "roadmap", {"roadmap": roadmap})
    others, _ = planned(world, ends[:PLANNED], "auto", {})
    return Measured(file.parent.name, making, seconds, solved, moving, after, plans, others, proven)


def fill(report: Report, results: list[Measured]) -> None:
    """What came out."""
    slowest = max(float(np.median(r.queries)) for r in results)
    count = len(results[0].queries)
    what = f"{count} queries in one world: median, slowest of {len(results)} worlds"
    report.bar(what, f"<= {1e3 * WANTED:g} ms", f"{1e3 * slowest:.3f} ms", slowest <= WANTED)
    rows = [
        [
            r.family,
            f"{r.making:.2f}",
            *(f"{1e3 * np.percentile(r.queries, share):.3f}" for share in (50, 90, 99)),
            f"{r.solved}",
            f"{1e3 * r.moving:.0f}",
            f"{1e3 * np.median(r.after):.3f}",
            f"{1e3 * np.median(r.plans):.2f}",
            f"{1e3 * np.median(r.others):.2f}",
            f"{r.proven}",
        ]
        for r in results
    ]
    heads = ["scene", "made [s]", "median [ms]", "90 %", "99 %", f"of {count} joined", "moved [ms]", "median then [ms]"]
    heads += ['plan(problem, "roadmap") [ms]', "plan(problem) [ms]", f"of {PLANNED} proven"]
    report.table(f"{VERTICES} vertices; processor time", heads, rows)
    report.note(
        "What was done",
        "Each query goes from one random free configuration to another one. `Roadmap.route()` is measured for all of "
        f"them, then again after the first obstacle was moved by {SHIFT:g} m (`Roadmap.moved_to()`), where motions are "
        f"checked as queries come to them. `plan()` on the roadmap, with proofs, is for the first {PLANNED}; beside "
        "it the default call. Most pairs see each other; a roadmap serves where they do not.",
    )


def main(run: Run, folder: PandaSet, *, queries: int = 1000) -> Report:
    """Measure."""
    families = sorted(path for path in (folder / "problems").glob("*") if path.is_dir())
    files = [next(iter(sorted(family.glob("*.yaml")))) for family in families]
    report = run.report("Roadmaps: many queries in one world")
    fill(report, [measured(file, folder / "panda.urdf", queries) for file in files])
    return report
