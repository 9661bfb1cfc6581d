"""Gray code beside natural binary, which [2] found to converge more slowly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.genetic.published import INCH, POINTS, TOLERANCE, curve
from rrtik_bench.genetic.runs import TRAJECTORIES, arm
from rrtik_bench.report.rows import Bar, Row, judged
from rrtik_bench.tables import Table
from rrtik_ompl.ik.genetic.options import STANDARD
from rrtik_ompl.ik.genetic.search import GeneticRun, follow_targets

GENERATIONS, STANDING = 1_000, 200
PRINT = "binary converges more slowly"
STUCK = "where two neighbours differ in many bits, one-bit mutations do not lead on"


def coded_run(trajectory: int, gray: bool, seed: int, *, restarts: bool = True) -> GeneticRun:
    """The standard preset with three joints along a trajectory, `GENERATIONS` at most."""
    options = replace(STANDARD, gain=1.0, gray=gray, generations=GENERATIONS)
    if not restarts:
        options = replace(options, stall=None, start_over=None)
    goals = [rrtik.PositionGoal(point, TOLERANCE * INCH) for point in curve(trajectory) * INCH]
    return follow_targets(arm(3), goals, options, np.random.default_rng(seed))


def codings(quick: bool) -> list[Row]:
    """Points gained by both codes in the same number of generations, and how near the first point they stand still."""
    count, rows = 2 if quick else 20, []
    for number in TRAJECTORIES:
        points = {gray: np.array([len(coded_run(number, gray, seed).q) for seed in range(count)])
                  for gray in (True, False)}  # fmt: skip
        ratio = float(points[False].mean() / max(points[True].mean(), 1e-9))
        text = f"{ratio:.3f}: {points[False].mean():.1f} of {POINTS} points beside {points[True].mean():.1f}"
        rows.append(judged(f"trajectory {number}: points, binary over Gray", PRINT, text, ratio,
                           Bar((0.0, 1e6), held=(0.0, 0.9)), f"{GENERATIONS} generations, {count} runs"))  # fmt: skip
    misses = [coded_run(1, False, seed, restarts=False) for seed in range(count)]
    stuck = float(np.mean([len(run.q) < POINTS and run.cost_of_point.sum() <= STANDING for run in misses]))
    nearest = float(np.median([run.distances[-1] for run in misses])) / INCH
    rows.append(judged("binary, no restarts: runs without a further point after generation 200", "bits disrupt",
                       f"{stuck:.0%}, {nearest:.2g} in from their point (median)", stuck,
                       Bar((0.0, 1.0), held=(0.5, 1.0)), STUCK))  # fmt: skip
    return rows


TABLES = (
    Table(
        "ga-reb-coding",
        "Gray code beside natural binary",
        "[2], choice of the code",
        codings,
        15,
        3,
        bars="the direction from the source; 0.9 and the half ours",
    ),
)
