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
from rrtik_bench.report.rows import SIGMAS, Bar, Row, Span, about, all_of, judged, judged_runs, small, within
from rrtik_bench.tables import Table
from rrtik_ompl.ik.mb_rrt.links import Links

SOURCE = "[3]"
MOST = 20.0  # [%]; a larger difference is one, however few the goals
FACTOR = 1.5  # between two means of passes
LIMIT = 10_000.0  # passes
THINNED = {3: 5, 10: 10}  # every so manieth goal, if quick
# What readings of the rules give over several clouds of goals: share solved [%], and mean passes where it is known
EXPECTED: dict[int, dict[str, tuple[Span, Span | None]]] = {
    3: {
        "c-space": ((30, 75), None), "uniform-a": ((3, 35), None), "uniform-b": ((35, 72), None),
        "uniform-a-star": ((5, 35), (1, 150)), "uniform-b-star": ((100, 100), (55, 130)),
        "surface-a": ((10, 50), (1, 15)), "surface-b": ((100, 100), (4, 8)),
    },
    10: {
        "c-space": ((10, 60), None), "uniform-a": ((40, 60), None), "uniform-b": ((40, 68), None),
        "uniform-a-star": ((25, 45), (20, 500)), "uniform-b-star": ((100, 100), (230, 400)),
        "surface-a": ((45, 75), (3, 15)), "surface-b": ((100, 100), (6, 12)),
    },
}  # fmt: skip
# Most of the nodes outside their region that the rules let expect; uniform samples lie outside more often than not
MOST_OUTSIDE = {"surface-a": 0.35, "surface-b": 0.22}
UNIFORM_OUTSIDE = (0.5, 0.9)
PASS = "an iteration is one pass over the joints; the mean is over goals solved"
CLOUD = "goals spread evenly over the area (those of [3] are not known); shares vary from cloud to cloud"
MISPRINT = 'printed "57142", read as 5.7142 %, as the trap of rule A predicts'
RHO = (
    "nodes of index 1 to n-1, out by more than 1 % of the reach; neither that nor the goals are stated, which shift it"
)


def variants(count: int, quick: bool) -> list[Row]:
    """Tables 6 and 8 (3 joints) or 7 and 9 (10 joints): every variant."""
    thinned = THINNED[count] if quick else 1
    goals = len(range(0, GOALS[count], thinned))
    rows = []
    for name, found in all_variants(count, thinned=thinned).items():
        rows += variant_rows(count, name, found, goals)
    return rows


def variant_rows(count: int, name: str, by_tolerance: dict[float, Measured], goals: int) -> list[Row]:
    """What was measured of one variant with so many goals, by tolerance [cm], beside its print."""
    rate, mean, *outside = PUBLISHED[count][name]
    found, label = by_tolerance[TOLERANCE[count]], NAMES[name]
    reading = _reading(count, name, by_tolerance)
    rows = [
        judged(f"{label}: goals solved", f"{rate:.4g} %", f"{found.converged:.4g} % of {goals}", found.converged,
               _share_bar(count, name, found.converged, goals), reading),
        _passes(count, name, found, goals, f"{label}: mean passes", f"{mean:.1f}"),
    ]  # fmt: skip
    for words, printed, ours in zip(("rho", "rho after 10,000"), outside, (found.rho, found.rho_all), strict=True):
        measured = f"{ours[0]:.3f} (strictly {ours[1]:.3f})"
        rows.append(judged(f"{label}: {words}", f"{printed:.3f}", measured, ours[0], _rho_bar(name, printed), RHO))
    return rows


def _share_bar(count: int, name: str, converged: float, goals: int) -> Bar:
    """Of the goals solved [%]: within chance of the print, or of what the rules let expect."""
    rate, (low, high) = PUBLISHED[count][name][0], EXPECTED[count][name][0]
    pooled = (rate * GOALS[count] + converged * goals) / (GOALS[count] + goals) / 100.0
    chance = min(100.0 * SIGMAS * np.sqrt(pooled * (1.0 - pooled) * (1.0 / GOALS[count] + 1.0 / goals)), MOST)
    room = min(SIGMAS * np.sqrt(max(low * (100 - low), high * (100 - high)) / goals), MOST)
    expected = low - room, min(high + room, 100.0)
    return Bar((0.0, 100.0), held=about(rate, chance + 1e-9), differs=expected)


def _passes(count: int, name: str, found: Measured, goals: int, label: str, printed: str) -> Row:
    """The mean over goals solved: nothing to judge where none was."""
    mean, (_, expected) = PUBLISHED[count][name][1], EXPECTED[count][name]
    successes = round(0.01 * found.converged * goals)
    if not successes and EXPECTED[count][name][0][0] < 100:
        return Row(label, printed, "none solved", None, f"of {goals} goals; there is no mean")
    if expected is None:  # successes come at any time: their mean lies as near to its own as chance has it
        middle, room = 0.45 * LIMIT, SIGMAS * LIMIT / np.sqrt(12.0 * successes)
        expected = max(middle - room, 0.02 * LIMIT), min(middle + room, 0.95 * LIMIT)
        reading = f"{successes} successes anywhere in up to 10,000 passes: {expected[0]:.0f} to {expected[1]:.0f}"
    else:
        expected = expected[0] / FACTOR, expected[1] * FACTOR
        reading = f"rules predict {expected[0]:.0f} to {expected[1]:.0f} over clouds of goals{_ring(count, name)}"
    bar = Bar((1.0, LIMIT), held=within(FACTOR, mean), differs=expected)
    return judged_runs(label, printed, f"{found.mean:.1f}", found.hits, bar, f"{PASS}; {reading}")


def _rho_bar(name: str, printed: float) -> Bar:
    held = within(1.25, printed)
    if name not in MOST_OUTSIDE:
        return Bar((0.0, 1.0), held=held, differs=UNIFORM_OUTSIDE)
    return Bar((0.0, 1.0), held=held, differs=(0.0, max(MOST_OUTSIDE[name], held[1])))


def _reading(count: int, name: str, found: dict[float, Measured]) -> str:
    loose = found.get(0.2)
    at = f"at 0.2 cm, the tolerance of the 2-joint demonstration, {loose.converged:.4g} %; " if loose else ""
    misprint = f"{MISPRINT}; " if (count, name) == (3, "uniform-a-star") else ""
    return misprint + at + CLOUD


def _ring(count: int, name: str) -> str:
    """By the share of the square that the ring about the goal takes: with the goal as last sample, and rule B."""
    if name != "uniform-b-star":
        return ""
    reach, link = 10.0 * count, 10.0
    return f"; a ring about the goal takes {reach**2 / (np.pi * link * TOLERANCE[count]):.0f} passes and misses none"


def precision(count: int, quick: bool) -> list[Row]:
    """Table 10 (3 joints) or 11 (10 joints): MB-RRT at three tolerances."""
    rng, rows, repeats = np.random.default_rng(0), list[Row](), 1 if quick else 5
    for tolerance, (rate, mean, rho, _) in PRECISION[count].items():
        hits, ours = precise(count, tolerance, repeats, rng)
        share, found = 100.0 * float((hits > 0).mean()), float(hits.mean())
        reading = f"mean over {repeats} random state{'' if repeats == 1 else 's'}; {CLOUD.split(' (')[0]}"
        rows += [
            judged(f"{tolerance:g} cm: goals solved", f"{rate} %", f"{share:g} %", 0.01 * share, all_of()),
            judged_runs(f"{tolerance:g} cm: mean passes", f"{mean:.2f}", f"{found:.2f}", hits.ravel().tolist(),
                        Bar((1.0, LIMIT), held=within(FACTOR, mean)), reading),
            judged(f"{tolerance:g} cm: rho", f"{rho:.3f}", f"{ours:.3f}", ours,
                   Bar((0.0, 1.0), held=within(1.25, rho), differs=(rho, 0.35)), RHO),
        ]  # fmt: skip
    return rows


def example(quick: bool) -> list[Row]:
    """The worked example of surface sampling: 4 links of 10 cm, goal (20, 30)."""
    del quick
    links, goal = Links([10.0] * 4), np.array([20.0, 30.0])
    far, near = float(np.linalg.norm(goal)), float(links.max_span[1])
    tangent = float(np.degrees(np.arcsin(near / far)))
    edge = float(np.degrees(np.arccos((far**2 + 10.0**2 - near**2) / (2.0 * far * 10.0))))
    ks, outside = laws(np.random.default_rng(0))
    return [
        judged("tangent angle", "56.31 deg", f"{tangent:.2f} deg", tangent, Bar((0.0, 90.0), about(56.31, 0.005))),
        judged("angle beyond which a node is outside", "46.10 deg", f"{edge:.2f} deg", edge,
               Bar((0.0, 90.0), held=about(46.10, 0.005))),
        judged("share of index-1 nodes outside", "1/3", f"{outside:.4f}", outside, Bar((0.0, 1.0), about(1 / 3, 0.01))),
        judged("direction of these nodes: distance from the arcsine law", "0", f"{ks:.4f}", ks, small(0.01, 1.0),
               "Kolmogorov-Smirnov, 100,000 samples"),
    ]  # fmt: skip


TABLES = (
    Table("mb-rrt-example", "Surface sampling, worked example", f"{SOURCE}, worked example", example, 1, 1),
    Table("mb-rrt-8", "All variants, 3 joints (tables 6, 8)", "[3, tables 6 and 8]", partial(variants, 3), 25, 5),
    Table("mb-rrt-9", "All variants, 10 joints (tables 7, 9)", "[3, tables 7 and 9]", partial(variants, 10), 100, 20),
    Table("mb-rrt-10", "MB-RRT's precision, 3 joints", "[3, table 10]", partial(precision, 3), 1, 1),
    Table("mb-rrt-11", "MB-RRT's precision, 10 joints", "[3, table 11]", partial(precision, 10), 2, 1),
)
