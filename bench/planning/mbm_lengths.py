"""Joint-space length of the Panda's MotionBenchMaker problems after `auto`, and their paths as single-joint moves.

Usage: ``python bench/planning/mbm_lengths.py FOLDER [--problems 20] [--seconds 0.2]``: problems of each family, evenly
over its hundred, and the time that `auto` is given for each. FOLDER is the unpacked set (see bench/README.md).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from bench.shared.pages import add_out
from rrtik_bench.crdt.runs import sound
from rrtik_bench.report.page import Report
from rrtik_ompl import one_joint_moves, plan, shorten
from rrtik_ompl.base.choices import ShorteningMethod
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.problem_files.motion_bench_maker import load_motion_bench_maker
from rrtik_ompl.world.path import JointPath
from rrtik_ompl.world.problem import Problem

PUBLISHED = 4.90  # [rad], median after simplification; of VAMP, whose path before it has 7.76
LIMIT = 10.0  # [s] of a plan
METHODS: tuple[ShorteningMethod, ...] = ("corners", "ompl")  # beside auto, without a limit of time
CONVERTED = 5  # problems of each family whose paths are turned into single-joint moves


@dataclass(frozen=True)
class Measured:
    """One problem: lengths [rad] and seconds by method, and what became of its conversion."""

    family: str
    lengths: dict[str, float]
    seconds: dict[str, float]
    faults: int
    moves: int | None = None
    moves_after: int | None = None
    whole: bool = True
    refused: str = ""


def measured(files: list[Path], urdf: Path, seconds: float) -> Iterator[Measured]:
    """Plan each problem, shorten its path by every method, and convert the first few."""
    for number, file in enumerate(files):
        problem = load_motion_bench_maker(file, robot=urdf)
        found = plan(problem, "fastrrtconnect", seconds=LIMIT, seed=0)
        if found.path is None:
            raise SystemExit(f"{file}: {found.reason}")
        raw = found.path
        paths, times = {"raw": raw}, {"raw": found.seconds}
        names: tuple[ShorteningMethod, ...] = ("auto", *METHODS)
        for method in names:
            begin = perf_counter()
            paths[method] = shorten(raw, problem, method=method, seconds=seconds if method == "auto" else None)
            times[method] = perf_counter() - begin
        faults = sum(bool(p.violations(problem.world)) or p.length > raw.length for p in paths.values())
        result = Measured(file.parent.name, {name: p.length for name, p in paths.items()}, times, faults)
        yield result if number >= CONVERTED else _with_moves(result, paths["auto"], problem)


def _with_moves(result: Measured, path: JointPath, problem: Problem) -> Measured:
    """The same with the conversion of its path to single-joint moves."""
    begin = perf_counter()
    try:
        moves = one_joint_moves(path, problem)
    except InputError as error:
        return replace(result, refused=str(error))
    times = {**result.seconds, "moves": perf_counter() - begin}
    fewer = shorten(moves, problem, method="axis")
    whole = sound(problem, moves.waypoints) and sound(problem, fewer.waypoints)
    return replace(result, seconds=times, moves=moves.transitions, moves_after=fewer.transitions, whole=whole)


def table(report: Report, results: list[Measured]) -> None:
    """Medians of each family and of all."""
    names = ("raw", "auto", *METHODS)
    rows = []
    for family in [*dict.fromkeys(r.family for r in results), "all"]:
        own = [r for r in results if family in (r.family, "all")]
        cells = [
            f"{np.median([r.lengths[n] for r in own]):.2f}, {np.median([r.seconds[n] for r in own]):.3f}" for n in names
        ]
        rows.append([family, str(len(own)), *cells])
    report.table("Median length [rad] and time [s]", ["family", "problems", *names], rows)


def page(results: list[Measured], seconds: float) -> Report:
    """The report."""
    report = Report("Lengths of the Panda's MotionBenchMaker problems", "python bench/planning/mbm_lengths.py FOLDER")
    median = float(np.median([r.lengths["auto"] for r in results]))
    what = f"median length after auto, {seconds:g} s, {len(results)} problems"
    report.bar(what, f"<= {PUBLISHED:.2f} rad", f"{median:.3f} rad", median <= PUBLISHED)
    faults = sum(r.faults for r in results)
    report.bar("shortened paths pass the dense check and are not longer", "all", f"{faults} faults", faults == 0)
    done, refused = [r for r in results if r.moves is not None], [r for r in results if r.refused]
    whole = all(r.whole for r in done)
    text = f"{len(done)} of {len(done) + len(refused)} ({'all' if whole else 'NOT all'} sound)"
    report.bar("paths turned into single-joint moves", "all", text, whole and not refused)
    table(report, results)
    counts = [(r.seconds["moves"], r.moves, r.moves_after) for r in done]
    spent, before, after = np.median(np.array(counts, dtype=float), axis=0)
    text = (
        f"Medians of the {len(done)} converted paths: {before:g} moves in {spent:.2f} s; {after:g} after the axis cut."
    )
    report.note("Single-joint moves", " ".join([text, *(f"{r.family}: {r.refused}." for r in refused)]))
    text = "RRT-Connect (`fastrrtconnect`, seed 0) on the exact meshes, then each method; wall clock, checks included."
    report.note("What was done", text)
    return report


def main() -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--problems", type=int, default=20, help="of each family")
    parser.add_argument("--seconds", type=float, default=0.2, help="for auto")
    add_out(parser, "mbm_lengths.md")
    options = parser.parse_args()
    results: list[Measured] = []
    for family in sorted(path for path in (options.folder / "problems").glob("*") if path.is_dir()):
        scenes = sorted(family.glob("scene*.yaml"))
        chosen = [scenes[k * len(scenes) // options.problems] for k in range(min(options.problems, len(scenes)))]
        results += measured(chosen, options.folder / "panda.urdf", options.seconds)
    report = page(results, options.seconds)
    return report.finish(options.out)


if __name__ == "__main__":
    raise SystemExit(main())
