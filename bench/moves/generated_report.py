"""Measure single-joint planning on generated scenes of two arms, beside RRT-Connect with shortening and conversion.

Usage: ``python bench/moves/generated_report.py [--scenes 100] [--jobs 1] [--out bench/reports/generated.md]``; scenes
of each arm, up to some ten seconds each. An interrupted run goes on where it was.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

import rrtik_ompl as rrtik
from bench.shared.parts import Parts, add_options
from bench.shared.problems import goal_joints
from rrtik_bench.crdt.runs import histogram, sound
from rrtik_bench.report.machine import processes
from rrtik_bench.report.page import Report
from rrtik_ompl.base.choices import ShorteningMethod
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.transitions import lower_bound
from rrtik_ompl.planning.generated_problems import FAMILIES, generated_problem
from rrtik_ompl.world.path import JointPath
from rrtik_ompl.world.problem import Problem

ARMS = ("titan4", "ur5")
LIMIT = 5.0  # [s] for a plan
MAKE_FEWER = 2.0  # [s] for fewest-moves as a way to shorten
BICRDT, CUT, FEWEST = "BiCRDT", "BiCRDT, double axis cut", "fewest-moves"
SAMPLED, CONVERTED = "RRT-Connect, auto", "RRT-Connect, auto, converted"
CONVERTED_CUT, CONVERTED_FEWEST = f"{CONVERTED}, double axis cut", f"{CONVERTED}, fewest-moves"
METHODS = (BICRDT, CUT, FEWEST, CONVERTED, CONVERTED_CUT, CONVERTED_FEWEST)


@dataclass(frozen=True)
class Outcome:
    """Of one method in one scene; ``seconds`` covers all stages up to this one."""

    moves: int
    travel: float  # of all joints [rad]
    seconds: float
    sound: bool


@dataclass
class Scene:
    """What every method found in one scene; a method without a path is missing."""

    family: str
    bound: int  # the joints that differ
    making: float  # [s]
    found: dict[str, Outcome] = field(default_factory=dict)
    gap: int | None = None  # of fewest-moves, as it reports it
    refused: str = ""  # why a path was not converted


def measured(arm: str, family: str, seed: int) -> Scene:
    """All methods in one scene."""
    begin = perf_counter()
    problem = generated_problem(rrtik.load_robot(arm), family, seed)
    scene = Scene(family, lower_bound(problem.start, goal_joints(problem)), perf_counter() - begin)
    raw = rrtik.plan(problem, "bicrdt", seconds=LIMIT, seed=seed)
    if raw.path is not None:
        _chain(scene, problem, raw.path, raw.seconds, {BICRDT: lambda path: path, CUT: _fewer(problem, "axis", seed)})
    fewest = rrtik.plan(problem, "fewest-moves", seconds=LIMIT, seed=seed)
    if fewest.path is not None:
        _chain(scene, problem, fewest.path, fewest.seconds, {FEWEST: lambda path: path})
        scene.gap = int(fewest.statistics["gap"])
    sampled = rrtik.plan(problem, "fastrrtconnect", seconds=LIMIT, seed=seed)
    if sampled.path is not None:
        _converted(scene, problem, sampled.path, sampled.seconds, seed)
    return scene


def _converted(scene: Scene, problem: Problem, path: JointPath, seconds: float, seed: int) -> None:
    """Shortening, conversion, and what makes fewer moves of the result."""
    stages = {SAMPLED: _fewer(problem, "auto", seed), CONVERTED: lambda path: rrtik.one_joint_moves(path, problem)}
    try:
        moves = _chain(scene, problem, path, seconds, stages)
    except InputError as error:
        scene.refused = str(error)
        return
    so_far = scene.found[CONVERTED].seconds
    _chain(scene, problem, moves, so_far, {CONVERTED_CUT: _fewer(problem, "axis", seed)})
    _chain(scene, problem, moves, so_far, {CONVERTED_FEWEST: _fewer(problem, "fewest-moves", seed, MAKE_FEWER)})


def _fewer(
    problem: Problem, method: ShorteningMethod, seed: int, seconds: float | None = None
) -> Callable[[JointPath], JointPath]:
    return lambda path: rrtik.shorten(path, problem, method=method, seconds=seconds, seed=seed)


def _chain(
    scene: Scene,
    problem: Problem,
    path: JointPath,
    seconds: float,
    stages: dict[str, Callable[[JointPath], JointPath]],
) -> JointPath:
    """Stage after stage; every one is written down, the clock runs on."""
    for name, stage in stages.items():
        begin = perf_counter()
        path = stage(path)
        seconds += perf_counter() - begin
        travel = float(np.abs(np.diff(path.waypoints, axis=0)).sum())
        whole = name == SAMPLED or sound(problem, path.waypoints)
        scene.found[name] = Outcome(path.transitions, travel, seconds, whole)
    return path


def scenes(count: int, measure: Parts) -> dict[str, list[Scene]]:
    """By arm, families in turns, spread over processes."""
    names = list(FAMILIES)
    parts = [(arm, names[k % len(names)], k // len(names)) for arm in ARMS for k in range(count)]
    results: dict[str, list[Scene]] = {arm: [] for arm in ARMS}
    for (arm, *_), scene in zip(parts, measure(measured, parts), strict=True):
        results[arm].append(scene)
    return results


def bars(report: Report, everything: list[Scene]) -> None:
    """What must hold in every scene."""
    outcomes = [outcome for scene in everything for name, outcome in scene.found.items() if name != SAMPLED]
    whole = sum(outcome.sound for outcome in outcomes)
    text = f"{whole} of {len(outcomes)} paths"
    report.bar("one joint per edge, valid at half resolution, ends exact", "all", text, whole == len(outcomes))
    for better, other in (
        (FEWEST, BICRDT),
        (FEWEST, CUT),
        (CONVERTED_FEWEST, CONVERTED),
        (CONVERTED_FEWEST, CONVERTED_CUT),
    ):
        pairs = [scene.found for scene in everything if {better, other} <= scene.found.keys()]
        fewer = sum(pair[better].moves <= pair[other].moves for pair in pairs)
        report.bar(f"{better}: no more moves than '{other}'", "always", f"{fewer} of {len(pairs)}", fewer == len(pairs))


def tables(report: Report, arm: str, found: list[Scene]) -> None:
    """One arm: all methods, families, and how good fewest-moves says that it is."""
    common = [scene for scene in found if set(METHODS) <= scene.found.keys()]
    head = ["method", "solved", "moves: mean, median, 95 %", "joint travel [rad]", "time, median / 95 % [s]"]
    rows = []
    for name in METHODS:
        own = [scene.found[name] for scene in common]
        times = [scene.found[name].seconds for scene in found if name in scene.found]
        moves, travel = np.array([o.moves for o in own]), np.mean([o.travel for o in own])
        spread = f"{moves.mean():.1f}, {np.median(moves):g}, {np.quantile(moves, 0.95):g}"
        clock = f"{np.median(times):.2f} / {np.quantile(times, 0.95):.2f}"
        rows.append([name, f"{len(times)} of {len(found)}", spread, f"{travel:.1f}", clock])
    report.table(f"{arm}: moves and travel in the {len(common)} scenes that all methods solve", head, rows)
    rows = []
    for family in FAMILIES:
        scenes = [scene for scene in found if scene.family == family]
        if not scenes:
            continue
        cells = [_of_family(scenes, name) for name in METHODS]
        making = np.mean([scene.making for scene in scenes])
        rows.append([family, f"{making:.2f}", f"{np.mean([scene.bound for scene in scenes]):.1f}", *cells])
    report.table(
        f"{arm}: families; mean moves (solved)", ["family", "making [s]", "joints that differ", *METHODS], rows
    )
    gaps = [scene.gap for scene in found if scene.gap is not None]
    refused = [scene.refused for scene in found if scene.refused]
    text = f"Gap to the bound: {histogram(gaps)}. Paths that could not be converted: {len(refused)}"
    report.note(f"{arm}: how good fewest-moves says that it is", text + "".join(f"; {line}" for line in refused) + ".")


def _of_family(own: list[Scene], name: str) -> str:
    moves = [scene.found[name].moves for scene in own if name in scene.found]
    return f"{np.mean(moves):.1f} ({len(moves)}/{len(own)})" if moves else f"- (0/{len(own)})"


def main() -> None:
    """Run everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=100, help="of each arm")
    add_options(parser, "generated.md")
    options = parser.parse_args()
    report = Report(
        "Single-joint moves in generated scenes", "python bench/moves/generated_report.py", processes(options.jobs)
    )
    with Parts(options.out, options.jobs) as measure:
        results = scenes(options.scenes, measure)
        write(report, results, options)


def write(report: Report, results: dict[str, list[Scene]], options: argparse.Namespace) -> None:
    """Fill the page."""
    bars(report, [scene for found in results.values() for scene in found])
    for arm, found in results.items():
        tables(report, arm, found)
    text = (
        f"Scenes of `rrtik_ompl.planning.generated_problems`, families in turns, seeds 0, 1, ...; every one has a "
        f"path, found by RRT-Connect or BiCRDT, but neither a free straight motion nor a free order of moving every "
        f"joint once. "
        f"Limits: {LIMIT:g} s for every planner, {MAKE_FEWER:g} s for fewest-moves as a way to shorten; times are wall "
        f"clock and include all stages; {options.jobs} at a time."
    )
    report.note("What was done", text)
    report.finish(options.out)


if __name__ == "__main__":
    main()
