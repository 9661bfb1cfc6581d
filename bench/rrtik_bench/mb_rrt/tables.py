"""Tables 6 to 11 of [3] and its worked example."""

from __future__ import annotations

from functools import partial

import numpy as np

from rrtik_bench.mb_rrt.runs import (
    GOALS,
    NAMES,
    PRECISION,
    PUBLISHED,
    TOLERANCE,
    Measured,
    all_variants,
    laws,
    precise,
)
from rrtik_bench.report.rows import Row, Verdict, verdict, within
from rrtik_bench.tables import Table
from rrtik_ompl.ik.mb_rrt.links import Links

SOURCE = "[3]"
SIGMAS = 3.0  # of a share counted on so many goals
MOST = 20.0  # [%]; a larger difference is one, however few the goals
FACTOR = 1.5  # between two means of passes
THINNED = {3: 5, 10: 10}  # every so manieth goal, if quick
# What readings of the rules give over several clouds of goals: share solved [%], and mean passes where it is known
EXPECTED = {
    3: {
        "c-space": ((30, 75), None), "uniform-a": ((3, 35), None), "uniform-b": ((35, 72), None),
        "uniform-a-star": ((5, 35), None), "uniform-b-star": ((100, 100), (55, 130)),
        "surface-a": ((10, 50), None), "surface-b": ((100, 100), (4, 8)),
    },
    10: {
        "c-space": ((10, 60), None), "uniform-a": ((40, 60), None), "uniform-b": ((40, 68), None),
        "uniform-a-star": ((25, 45), None), "uniform-b-star": ((100, 100), (230, 400)),
        "surface-a": ((45, 75), None), "surface-b": ((100, 100), (6, 12)),
    },
}  # fmt: skip
PASS = "an iteration is one pass over the joints; the mean is over goals solved"
CLOUD = "goals spread evenly over the area (those of [3] are not known); shares vary from cloud to cloud"
READINGS = {
    (3, "c-space"): "nearer to the print at 0.2 cm, the tolerance of the 2-joint demonstration; " + CLOUD,
    (10, "c-space"): "step 3 degrees, root at zero, not stated in [3]; " + CLOUD,
    (3, "uniform-a-star"): 'printed "57142", read as 5.7142 %, as the trap of rule A predicts',
    (10, "uniform-a-star"): "in the trap success comes early or never: no reading gives a mean of 1672",
    (3, "uniform-b-star"): "a ring about the goal predicts 95 passes; 100 % as printed",
    (10, "uniform-b-star"): "a ring about the goal predicts 100 % and 318 passes; no reading gives 71 %",
    (3, "surface-a"): "other clouds of goals gave 17 to 43 %",
}
RHO = (
    "nodes of index 1 to n-1, out by more than 1 % of the reach; neither that nor the goals are stated, which shift it"
)


def variants(count: int, quick: bool) -> list[Row]:
    """Tables 6 and 8 (3 joints) or 7 and 9 (10 joints): every variant."""
    thinned = THINNED[count] if quick else 1
    goals = len(range(0, GOALS[count], thinned))
    rows = []
    for name, found in all_variants(count, thinned=thinned).items():
        rows += _variant(count, name, found[TOLERANCE[count]], goals)
    return rows


def _variant(count: int, name: str, found: Measured, goals: int) -> list[Row]:
    rate, mean, rho, rho_all = PUBLISHED[count][name]
    (low, high), passes = EXPECTED[count][name]
    pooled = (rate * GOALS[count] + found.converged * goals) / (GOALS[count] + goals) / 100.0
    chance = min(100.0 * SIGMAS * np.sqrt(pooled * (1.0 - pooled) * (1.0 / GOALS[count] + 1.0 / goals)), MOST)
    room = 100.0 * SIGMAS * np.sqrt(max(low * (100 - low), high * (100 - high)) / goals) / 100.0
    reading = READINGS.get((count, name), CLOUD)
    expected = bool(low - room <= found.converged <= high + room)
    solved = verdict(abs(found.converged - rate) <= chance + 1e-9, expected)
    known = passes is not None and found.converged > 0.0
    plausible = passes[0] / FACTOR <= found.mean <= passes[1] * FACTOR if passes and known else expected
    cost = verdict(within(FACTOR, found.mean, mean), plausible)
    outside = verdict(within(1.25, found.rho_all[0], rho_all), found.rho_all[0] <= max(2.2 * rho_all, rho_all + 0.15))
    label, successes = NAMES[name], round(0.01 * found.converged * goals)
    few = READINGS.get((count, name), f"a mean of {successes} successes anywhere in up to 10,000 passes")
    return [
        Row(f"{label}: goals solved", f"{rate:.4g} %", f"{found.converged:.4g} % of {goals}", solved, reading),
        Row(f"{label}: mean passes", f"{mean:.1f}", _number(found.mean), cost, PASS if cost is Verdict.HELD else few),
        Row(
            f"{label}: rho, rho after 10,000",
            f"{rho:.3f}, {rho_all:.3f}",
            f"{found.rho[0]:.3f}, {found.rho_all[0]:.3f}",
            outside,
            RHO,
        ),
    ]


def _number(value: float) -> str:
    return "none solved" if np.isnan(value) else f"{value:.1f}"


def precision(count: int, quick: bool) -> list[Row]:
    """Table 10 (3 joints) or 11 (10 joints): MB-RRT at three tolerances."""
    rng, rows, repeats = np.random.default_rng(0), [], 1 if quick else 5
    for tolerance, (rate, mean, rho, _) in PRECISION[count].items():
        hits, ours = precise(count, tolerance, repeats, rng)
        share, found = 100.0 * float((hits > 0).mean()), float(hits.mean())
        reading = f"mean over {repeats} random state{'' if repeats == 1 else 's'}; {CLOUD.split(' (')[0]}"
        rows += [
            Row(f"{tolerance:g} cm: goals solved", f"{rate} %", f"{share:g} %", verdict(share == rate), ""),
            Row(f"{tolerance:g} cm: mean passes", f"{mean:.2f}", f"{found:.2f}", verdict(within(FACTOR, found, mean)),
                reading),
            Row(f"{tolerance:g} cm: rho", f"{rho:.3f}", f"{ours:.3f}", verdict(within(1.25, ours, rho), ours < 0.35),
                RHO),
        ]  # fmt: skip
    return rows


def example(quick: bool) -> list[Row]:
    """The worked example of surface sampling: 4 links of 10 cm, goal (20, 30)."""
    del quick
    links, goal = Links([10.0] * 4), np.array([20.0, 30.0])
    far, near = float(np.linalg.norm(goal)), float(links.remaining[1])
    tangent = float(np.degrees(np.arcsin(near / far)))
    edge = float(np.degrees(np.arccos((far**2 + 10.0**2 - near**2) / (2.0 * far * 10.0))))
    ks, outside = laws(np.random.default_rng(0))
    return [
        Row("tangent angle", "56.31 deg", f"{tangent:.2f} deg", verdict(abs(tangent - 56.31) < 0.005)),
        Row("angle beyond which a node is outside", "46.10 deg", f"{edge:.2f} deg", verdict(abs(edge - 46.10) < 0.005)),
        Row("share of index-1 nodes outside", "1/3", f"{outside:.4f}", verdict(abs(outside - 1 / 3) < 0.01)),
        Row("direction of these nodes: distance from the arcsine law", "0", f"{ks:.4f}", verdict(ks < 0.01),
            "Kolmogorov-Smirnov, 100,000 samples"),
    ]  # fmt: skip


TABLES = (
    Table("mb-rrt-example", "Surface sampling, worked example", f"{SOURCE}, worked example", example, 1, 1),
    Table("mb-rrt-8", "All variants, 3 joints (tables 6, 8)", "[3, tables 6 and 8]", partial(variants, 3), 25, 5),
    Table("mb-rrt-9", "All variants, 10 joints (tables 7, 9)", "[3, tables 7 and 9]", partial(variants, 10), 100, 20),
    Table("mb-rrt-10", "MB-RRT's precision, 3 joints", "[3, table 10]", partial(precision, 3), 1, 1),
    Table("mb-rrt-11", "MB-RRT's precision, 10 joints", "[3, table 11]", partial(precision, 10), 2, 1),
)
