"""Tables 4 and 5 of [2], its first points and its other statements."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from rrtik_bench.genetic.published import FIRST_POINT, TABLE_4, TABLE_5
from rrtik_bench.genetic.runs import TRAJECTORIES, TrajectoryRun, arm, mean, median, runs
from rrtik_bench.report.rows import Row, verdict, within
from rrtik_bench.tables import Table
from rrtik_ompl.ik.genetic.options import HISTORICAL, STANDARD, GeneticOptions

SOURCE = "[2]"
SLOW = replace(HISTORICAL, gene_mutation=0.005, stall=None)  # the fit for five joints
RUNS, FEW = 5, 1  # in full, quickly
FACTOR = 2.0  # between single runs of one setting
GENERATION = "a generation is one evaluation of the population; the historical preset is a fit made after the fact"


@cache
def _three(options: GeneticOptions, count: int) -> dict[int, list[TrajectoryRun]]:
    return runs(arm(3), options, count)


@cache
def _five(options: GeneticOptions, count: int) -> dict[int, list[TrajectoryRun]]:
    return runs(arm(5), options, count)


def _count(quick: bool) -> int:
    return FEW if quick else RUNS


def three_joints(quick: bool) -> list[Row]:
    """Table 4: with and without range reduction."""
    count, rows = _count(quick), []
    with_it, bare = _three(replace(HISTORICAL, gain=0.0), count), _three(replace(HISTORICAL, window=None), count)
    ours = _three(replace(STANDARD, gain=1.0), count)
    for number in TRAJECTORIES:
        (share, per_point), (generations, per_point_with) = TABLE_4[number]
        done, cost = mean(bare[number], "completed"), mean(with_it[number], "generations")
        points = float(np.mean([len(each.result.q) for each in bare[number]]))
        rows += [
            Row(
                f"trajectory {number} without reduction: points at 10,000 generations",
                f"{share} %, {per_point} a point",
                f"{done:.1f} %, {10_000 / max(points, 1.0):.0f} a point",
                verdict(within(1.5, done, share), done <= 60.0),
                GENERATION,
            ),
            Row(
                f"trajectory {number} with reduction: generations",
                f"{generations}, {per_point_with} a point",
                f"{cost:.0f}, {cost / 251:.0f} a point (standard preset: {mean(ours[number], 'generations'):.0f})",
                verdict(within(FACTOR, cost, generations), cost < 10_000),
                GENERATION + "; the extrapolation's gain is 0 for it, 1 for the standard preset",
            ),
        ]
    return rows


def five_joints(quick: bool) -> list[Row]:
    """Table 5: with range reduction, d7 = 2.2 in."""
    count = _count(quick)
    slow, ours = _five(replace(SLOW, gain=0.0), count), _five(replace(STANDARD, gain=0.0), count)
    rows = []
    for number in TRAJECTORIES:
        generations, per_point = TABLE_5[number]
        cost, done = mean(slow[number], "generations"), mean(slow[number], "completed")
        reading = "mutation 0.005 per gene and gain 0: with the printed gain of 1 a redundant arm runs away"
        rows.append(
            Row(
                f"trajectory {number}: generations",
                f"{generations}, {per_point} a point, 100 %",
                f"{cost:.0f}, {done:.0f} % (standard preset: median {median(ours[number], 'generations'):.0f})",
                verdict(within(FACTOR, cost, generations), cost <= 20_000),
                reading + ('; printed "#3" again' if number == 4 else ""),
            )
        )
    return rows


def first_points(quick: bool) -> list[Row]:
    """Generations to the first point."""
    count = _count(quick)
    found = {3: _three(replace(HISTORICAL, gain=0.0), count), 5: _five(replace(SLOW, gain=0.0), count)}
    return [
        Row(
            f"{joints} joints, trajectory {number}",
            f"{FIRST_POINT[joints][number - 1]}",
            f"{mean(found[joints][number], 'first'):.0f}",
            verdict(within(FACTOR, mean(found[joints][number], "first"), FIRST_POINT[joints][number - 1]), True),
            "a single run was printed, and these counts vary by half; 1 and 2 begin at the same point",
        )
        for joints in (3, 5)
        for number in TRAJECTORIES
    ]


def statements(quick: bool) -> list[Row]:
    """What is said beside the tables."""
    count = _count(quick)
    ours = _three(replace(STANDARD, gain=1.0), count)
    bare, old = _three(replace(STANDARD, window=None), count), _three(replace(HISTORICAL, gain=0.0), count)
    every = [one for row in ours.values() for one in row]
    saved = [mean(bare[n], "generations") / mean(ours[n], "generations") for n in TRAJECTORIES]
    single = float(np.mean([mean(old[n], "single") for n in TRAJECTORIES]))
    error = [max(one.errors.max() for one in every), min(one.errors.min() for one in every)]
    jumps, off = sum(one.jumps for one in every), max(one.off_branch for one in every)
    seconds = float(np.median([one.seconds for one in every]))
    return [
        Row("errors of the points", "from 0.002 to about 1e-4 in", f"{error[0]:.4f} to {error[1]:.0e} in",
            verdict(error[0] < 0.002)),
        Row("3-joint trajectories coincide with the closed form", "yes", f"within {off:.4f} deg", verdict(off <= 0.03)),
        Row("points in a single generation, 3 joints", "about 25 %", f"{single:.0f} % (historical preset)",
            verdict(within(1.6, single, 25.0), True), "the mean hides trajectories of 7 and of 70 %"),
        Row("range reduction needs", "about a tenth of the generations",
            f"1/{min(saved):.1f} to 1/{max(saved):.1f} (standard preset)", verdict(min(saved) >= 4.0)),
        Row("jumps between solutions", "none", str(jumps), verdict(jumps == 0)),
        Row("time of a 3-joint run", "under a minute at 300 MHz", f"{seconds:.2f} s", verdict(seconds < 60.0)),
    ]  # fmt: skip


TABLES = (
    Table("ga-reb-4", "Three joints, with and without range reduction", "[2, table 4]", three_joints, 60, 15),
    Table("ga-reb-5", "Five joints", "[2, table 5]", five_joints, 50, 12),
    Table("ga-reb-first", "Generations to the first point", SOURCE, first_points, 60, 12),
    Table("ga-reb-statements", "Errors, jumps, single generations", SOURCE, statements, 15, 4),
)
