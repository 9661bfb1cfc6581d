"""The shortest known paths of the MotionBenchMaker problems, `bench/data/mbm_best.csv`: searched anew and shortened.

A path is planned from another seed and shortened, again and again, for so many seconds of processor time a problem; a
length that is less than the one in the file takes its place. "The 70" of an arm are every fifth of the first 50 pairs
of each family. The file is written after each problem.
"""

from __future__ import annotations

import csv
import sys
import time
import warnings
from itertools import count
from pathlib import Path
from typing import Annotated

from typer import Option

from bench.shared.motion_bench_maker import problem_of, scene_files
from bench.shared.run import Sets
from rrtik_ompl import Problem, plan, shorten

BEST = Path(__file__).resolve().parent.parent / "data" / "mbm_best.csv"
CHECKS = 4000  # of the motions of one path: it is then as good as taut


def the_70(folder: Path, arm: str) -> list[str]:
    """Every fifth of the first 50 problems of each family of an arm's set."""
    return scene_files(folder, arm, 50)[::5]


def title(file: str) -> str:
    """What a problem is called in the file of lengths."""
    return f"{Path(file).parent.name}/{Path(file).stem}"


def best_lengths() -> dict[str, float]:
    """The stored lengths [rad] by title; none if there is no file."""
    if not BEST.exists():
        return {}
    with BEST.open(newline="") as lines:
        return {row["problem"]: float(row["length"]) for row in csv.DictReader(lines)}


def shortest(problem: Problem, seconds: float) -> float:
    """The least length [rad] that is found within a time [s, of the processor]; infinite if there is none."""
    end, best = time.process_time() + seconds, float("inf")
    for seed in count():
        if time.process_time() >= end:
            return best
        found = plan(problem, "fastrrtconnect", seed=seed, seconds=seconds, shorten=False)
        if found.path is not None and len(found.path.waypoints) > 2:
            best = min(best, shorten(found.path, problem, seed=seed, one_joint=False, checks=CHECKS).length)
        elif found.path is not None:
            return found.path.length
    return best


def main(folder: Sets, seconds: Annotated[float, Option(help="Of processor time, each problem.")] = 20.0) -> None:
    """Search for shorter paths."""
    warnings.simplefilter("ignore")
    known = best_lengths()
    files = [file for arm in ("panda", "ur5") for file in the_70(folder, arm)]
    for number, file in enumerate(files, 1):
        problem = problem_of(file, balls=False)
        assert problem is not None
        known[title(file)] = min(known.get(title(file), float("inf")), shortest(problem, seconds))
        with BEST.open("w", newline="") as lines:
            rows = csv.writer(lines, lineterminator="\n")
            rows.writerows([("problem", "length"), *((name, f"{known[name]:.6f}") for name in sorted(known))])
        print(f"{number} of {len(files)}: {title(file)} {known[title(file)]:.4f} rad", file=sys.stderr)
