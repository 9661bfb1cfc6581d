"""IKURT: every acceptance row for the algorithm of [1, ch. 5.1] and the improved one, both beside IK and RRT-Connect.

Half an hour of one core. An interrupted run goes on where it was.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from bench.ik import ikurt_cases as cases
from bench.ik.ikurt_runs import (
    BLOCKED_SECONDS,
    IMPROVED,
    LITERAL,
    PANDA_SECONDS,
    PLAIN,
    POSE_SECONDS,
    VARIANTS,
    IkurtRun,
    blocked_runs,
    example_runs,
    generated,
    improved_falls,
    literal_falls,
    panda,
)
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.ikurt import EXAMPLES, METRIC
from rrtik_bench.report.page import Report

SECONDS = 10.0  # of an acceptance run
SOON = 5.0  # [s] for the hundred seeds
AT_ONCE = 5  # runs of a process


def solved(runs: list[IkurtRun]) -> float:
    return 100.0 * float(np.mean([each.solved for each in runs]))


def middle(runs: list[IkurtRun], name: str) -> float:
    """Median of a count over all runs; of one that failed what it had used up by then."""
    return float(np.median([each.count(name) for each in runs]))


def worst(runs: list[IkurtRun]) -> float:
    return max((each.away for each in runs if each.solved), default=np.inf)


def acceptance(report: Report, measure: Parts, literal: int, improved: int, stretch: float) -> None:
    wanted = [(name, which, improved if which == IMPROVED else literal)
              for name in EXAMPLES for which in (LITERAL, IMPROVED, PLAIN)]  # fmt: skip
    done: dict[str, dict[str, list[IkurtRun]]] = {name: {} for name in EXAMPLES}
    for (name, which, _), runs in zip(wanted, seeds_of(measure, wanted, SECONDS, stretch), strict=True):
        done[name][which] = runs
    for which in VARIANTS:
        rows(report, which, {name: each[which] for name, each in done.items()}, stretch)
    beat(report, done)
    table(report, done)


def seeds_of(measure: Parts, wanted: list[tuple[str, str, int]], limit: float, stretch: float) -> list[list[IkurtRun]]:
    """Runs of examples by variants, so many seeds each, a few in a process."""
    pieces = [(name, which, first, min(first + AT_ONCE, count), limit, stretch)
              for name, which, count in wanted for first in range(0, count, AT_ONCE)]  # fmt: skip
    done = measure(example_runs, pieces)
    return [
        [run for piece, runs in zip(pieces, done, strict=True) if piece[:2] == (name, which) for run in runs]
        for name, which, _ in wanted
    ]


def rows(report: Report, which: str, done: dict[str, list[IkurtRun]], stretch: float) -> None:
    """The rows that runs decide, for one variant."""
    what = f"{which} ({len(done['planar6_c'])} runs each): "
    for name in ("planar6_c", "planar6_c_pose"):
        share, soon = solved(done[name]), middle(done[name], "seconds")
        bar = f"{what}example {2 if name == 'planar6_c' else 3}, {name}"
        report.bar(bar, ">= 95 %, median <= 2 s", f"{share:.0f} %, {soon:.3f} s", share >= 95 and soon <= 2)
    share = solved(done["planar3_boxes"])
    report.bar(what + "example 1, planar3_boxes", ">= 90 %", f"{share:.0f} %", share >= 90)
    share, metres = solved(done["puma_position"]), max(each.metres for each in done["puma_position"])
    report.bar(
        what + "PUMA position", "100 %, <= 1e-3 m", f"{share:.0f} %, {metres:.1e} m", share == 100 and metres <= 1e-3
    )
    share, away = solved(done["puma_pose"]), worst(done["puma_pose"])
    report.bar(what + "PUMA pose", "100 %, metric <= 1e-2", f"{share:.0f} %, {away:.1e}", share == 100 and away <= 1e-2)
    for name in cases.TITAN:
        share, away = solved(done[name]), worst(done[name])
        wanted = 1e-6 if which == "improved" else METRIC
        bar, bound = f"{what}{name}, planning limits", f">= 95 %, metric <= {wanted:g}"
        report.bar(bar, bound, f"{share:.0f} %, {away:.1e}", share >= 95 and away <= wanted)
    sound = all(each.sound for runs in done.values() for each in runs)
    shown = "all" if sound else "not all"
    report.bar(what + "paths valid at half the resolution, first vertex the start", "all", shown, sound)
    ends = blocked_runs(which, stretch)
    longest, false = max(each.elapsed for each in ends), sum(each.found for each in ends)
    allowed = BLOCKED_SECONDS * stretch
    shown = f"{false} false; ends after {longest:.2f} s of {allowed:g}"
    report.bar(
        what + "goal blocked by a ball", "no false success, ends in time", shown, not false and longest < allowed + 0.5
    )
    falls, adds = (literal_falls if which == "literal" else improved_falls)()
    report.bar(what + "CONNECT adds vertices of falling metric", "strictly", f"{adds} vertices", falls and adds > 0)


def beat(report: Report, done: dict[str, dict[str, list[IkurtRun]]]) -> None:
    for name in (n for n in done if n not in ("planar3_boxes", "planar6_c")):
        before, after = (middle(done[name][which], "metric_evaluations") for which in VARIANTS)
        shown = f"{after:.0f} of {before:.0f}: 1/{before / max(after, 1):.0f}"
        report.bar(f"metric evaluations, {name}", "<= 1/3 of the literal", shown, after <= before / 3)
    accuracy = max(worst(done[name]["improved"]) for name in done)
    report.bar("accuracy of the improved one, all examples", "1e-6", f"{accuracy:.1e}", accuracy <= 1e-6)
    slowest = max(middle(done[name]["improved"], "seconds") for name in cases.TITAN)
    report.bar("TITAN-4 online, largest median time", "< 0.1 s", f"{slowest:.4f} s", slowest < 0.1)


def table(report: Report, done: dict[str, dict[str, list[IkurtRun]]]) -> None:
    lines = []
    for name, each in done.items():
        for which, runs in each.items():
            counts = (f"{middle(runs, count):.0f}" for count in COUNTS)
            found = f"{sum(r.solved for r in runs)} of {len(runs)}"
            lines.append([name, which, found, f"{middle(runs, 'seconds'):.4f}", *counts, f"{worst(runs):.1e}"])
    head = ["example", "variant", "solved", "median s", *COUNTS.values(), "worst metric"]
    report.table("The examples: medians of all runs, those that failed included", head, lines)


def hundred(report: Report, measure: Parts, seeds: int, stretch: float) -> None:
    lines, everything = [], True
    wanted = [(name, IMPROVED, seeds) for name in EXAMPLES]
    for name, runs in zip(EXAMPLES, seeds_of(measure, wanted, SOON, stretch), strict=True):
        everything &= solved(runs) == 100.0
        seconds = [each.seconds for each in runs]
        counts = (f"{middle(runs, c):.0f}" for c in ("vertices", "checked_states", "checked_motions"))
        found = f"{sum(each.solved for each in runs)} of {seeds}"
        lines.append([name, found, f"{np.median(seconds):.4f}", f"{max(seconds):.3f}", *counts])
    head = ["example", "solved", "median s", "longest s", "vertices", "states checked", "motions checked"]
    report.table(f"The improved one, {seeds} seeds, {SOON:g} s", head, lines)
    report.bar(
        f"improved: {seeds} seeds of every example within {SOON:g} s",
        "all",
        "all" if everything else "not all",
        everything,
    )


def poses(report: Report, measure: Parts, problems: int, folder: Path | None, pandas: int, stretch: float) -> None:
    """All ways on generated poses, and on those of MotionBenchMaker if its folder is given."""
    pieces = [(arm, problems // len(cases.ARMS), stretch) for arm in cases.ARMS]
    for (arm, *_), (count, found) in zip(pieces, measure(generated, pieces), strict=True):
        report.table(f"{count} generated poses, {arm} among {cases.OBSTACLES} balls, {POSE_SECONDS:g} s", HEAD, found)
    for count, found in measure(panda, [(folder, pandas, stretch)] if folder is not None else []):
        report.table(f"{count} problems of MotionBenchMaker, Panda, goals as poses, {PANDA_SECONDS:g} s", HEAD, found)


def main(
    run: Run,
    parts: Parts,
    *,
    mbm: Annotated[Path | None, Option(help="Unpacked problems of MotionBenchMaker for the Panda.")] = None,
    literal: Annotated[int, Option(help="Runs of the published algorithm, up to 10 s each.")] = 20,
    problems: Annotated[int, Option(help="Generated pose problems, all arms together.")] = 500,
    panda: Annotated[int, Option(help="Problems of MotionBenchMaker.")] = 140,
    stretch: Annotated[float, Option(help="Wall time per processor time, on a busy machine.")] = 1.0,
    quick: Annotated[bool, Option(help="A look at everything.")] = False,
) -> Report:
    """Measure."""
    improved, seeds = 20, 100
    if quick:
        literal, improved, seeds, problems, panda = 2, 5, 10, 12, 7
    report = run.report("IKURT")
    report.note("What was run", INTRODUCTION)
    hundred(report, parts, seeds, stretch)
    poses(report, parts, problems, mbm, panda, stretch)
    acceptance(report, parts, literal, improved, stretch)
    return report


COUNTS = {
    "metric_evaluations": "evaluations",
    "checked_motions": "motions checked",
    "vertices": "vertices",
    "connects": "CONNECTs",
}
HEAD = ["", "solved", "median s", "mean s (a failure counts the limit)"]
INTRODUCTION = (
    "Literal: the published algorithm with the default numbers chosen here, poses to 1e-2 in its metric, as "
    "acceptance wants it. Improved: the default, to the tolerances of the shipped problems (1 mm and 0.01 rad, or as "
    "the file says), which are tighter. No Jacobian: the improved one with `jacobian=False`, on the looser goals. All "
    "through `plan()`, whose second check every path has passed. Evaluations are forward kinematics; `worst metric` is "
    "the published metric at the end of the worst path. Seconds are of processor time, and so are the limits. Where "
    "wall time runs out before that, a failure has had the seconds shown."
)
