"""IKURT: every acceptance row for the published algorithm and the improved one, and both beside IK and RRT-Connect.

Usage: ``python bench/ikurt_report.py [--mbm mbm_panda] [--literal N] [--problems N] [--panda N] [--quick]``; minutes.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ikurt_cases as cases
import numpy as np
from acceptance import Report
from ompl import geometric as og

import rrtik_ompl as rrtik
from rrtik_ompl.ik.ikurt.metric import TipMetric
from rrtik_ompl.ik.ikurt.published import PublishedSearch, Steps
from rrtik_ompl.ik.ikurt.search import BatchedSearch, Judge, Options
from rrtik_planners import IKURT, FastRRTConnect, IKURTPublished

SECONDS = 10.0  # of an acceptance run
SOON = 5.0  # [s] for the hundred seeds
POSE_SECONDS, PANDA_SECONDS, BLOCKED_SECONDS = 2.0, 1.0, 1.0
STRETCH = [1.0]  # limits of wall time are so many times those of processor time
VARIANTS = {"literal": IKURTPublished, "improved": IKURT}


@dataclass
class Run:
    """One plan: its processor time, how far its end is from the goal in the published metric, whether it is sound."""

    plan: Any
    limit: float
    seconds: float
    away: float = np.inf
    sound: bool = True

    @property
    def solved(self) -> bool:
        """Whether there is a path, within the limit of processor time."""
        return bool(self.plan.found) and self.seconds <= self.limit

    @property
    def metres(self) -> float:
        """From the goal to the tip at the end of the path."""
        return float(self.plan.statistics.get("position_error", np.inf))

    def count(self, name: str) -> float:
        """A count of the planner's, or its seconds."""
        return self.seconds if name == "seconds" else float(self.plan.statistics.get(name, 0))


def run(problem: Any, planner: Any, seed: int, limit: float, **parameters: Any) -> Run:
    begin = time.process_time()
    plan = rrtik.plan(problem, planner, seconds=limit * STRETCH[0], seed=seed, parameters=parameters)
    seconds = time.process_time() - begin
    if plan.path is None:
        return Run(plan, limit, seconds)
    sound = not plan.path.violations(problem.world) and bool((plan.path.start == problem.start).all())
    away = float(cases.metric_of(problem).distance(plan.path.end[None])[0])
    return Run(plan, limit, seconds, away, sound)


def solved(runs: list[Run]) -> float:
    return 100.0 * float(np.mean([each.solved for each in runs]))


def middle(runs: list[Run], name: str) -> float:
    """Median of a count over all runs; of one that failed what it had used up by then."""
    return float(np.median([each.count(name) for each in runs]))


def worst(runs: list[Run]) -> float:
    return max((each.away for each in runs if each.solved), default=np.inf)


def acceptance(report: Report, literal: int, improved: int) -> None:
    done: dict[str, dict[str, list[Run]]] = {}
    for name, problem in cases.examples().items():
        run(problem, IKURT, 0, SECONDS)  # whatever is loaded at the first question is no part of planning
        loose = cases.as_published(problem)
        done[name] = {
            "literal": [run(loose, IKURTPublished, seed, SECONDS) for seed in range(literal)],
            "improved": [run(problem, IKURT, seed, SECONDS) for seed in range(improved)],
            "no Jacobian": [run(loose, IKURT, seed, SECONDS, jacobian=False) for seed in range(literal)],
        }
    for which in VARIANTS:
        rows(report, which, {name: each[which] for name, each in done.items()})
    beat(report, done)
    table(report, done)


def rows(report: Report, which: str, done: dict[str, list[Run]]) -> None:
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
        wanted = 1e-6 if which == "improved" else cases.METRIC
        bar, bound = f"{what}{name}, planning limits", f">= 95 %, metric <= {wanted:g}"
        report.bar(bar, bound, f"{share:.0f} %, {away:.1e}", share >= 95 and away <= wanted)
    sound = all(each.sound for runs in done.values() for each in runs)
    shown = "all" if sound else "not all"
    report.bar(what + "paths valid at half the resolution, first vertex the start", "all", shown, sound)
    problem = cases.blocked()
    ends = [run(problem, VARIANTS[which], seed, BLOCKED_SECONDS) for seed in range(5)]
    longest, false = max(each.plan.seconds for each in ends), sum(each.plan.found for each in ends)
    allowed = BLOCKED_SECONDS * STRETCH[0]
    shown = f"{false} false; ends after {longest:.2f} s of {allowed:g}"
    report.bar(
        what + "goal blocked by a ball", "no false success, ends in time", shown, not false and longest < allowed + 0.5
    )
    falls, adds = (literal_falls if which == "literal" else improved_falls)()
    report.bar(what + "CONNECT adds vertices of falling metric", "strictly", f"{adds} vertices", falls and adds > 0)


def beat(report: Report, done: dict[str, dict[str, list[Run]]]) -> None:
    for name in (n for n in done if n not in ("planar3_boxes", "planar6_c")):
        before, after = (middle(done[name][which], "metric_evaluations") for which in VARIANTS)
        shown = f"{after:.0f} of {before:.0f}: 1/{before / max(after, 1):.0f}"
        report.bar(f"Beat: evaluations, {name}", "<= 1/3 of the literal", shown, after <= before / 3)
    accuracy = max(worst(done[name]["improved"]) for name in done)
    report.bar("Beat: accuracy of the improved one, all examples", "1e-6", f"{accuracy:.1e}", accuracy <= 1e-6)
    slowest = max(middle(done[name]["improved"], "seconds") for name in cases.TITAN)
    report.bar("Beat: TITAN-4 online, largest median", "< 0.1 s", f"{slowest:.4f} s", slowest < 0.1)


def table(report: Report, done: dict[str, dict[str, list[Run]]]) -> None:
    lines = []
    for name, each in done.items():
        for which, runs in each.items():
            counts = (f"{middle(runs, count):.0f}" for count in COUNTS)
            found = f"{sum(r.solved for r in runs)} of {len(runs)}"
            lines.append([name, which, found, f"{middle(runs, 'seconds'):.4f}", *counts, f"{worst(runs):.1e}"])
    head = ["example", "variant", "solved", "median s", *COUNTS.values(), "worst metric"]
    report.table("The examples: medians of all runs, those that failed included", head, lines)


def hundred(report: Report, seeds: int) -> None:
    lines, everything = [], True
    for name, problem in cases.examples().items():
        runs = [run(problem, IKURT, seed, SOON) for seed in range(seeds)]
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


def literal_falls() -> tuple[bool, int]:
    """Whether every vertex that CONNECT has added is nearer than the one before it, and how many these are."""
    problem = cases.as_published(rrtik.load_problem("planar6_c_pose"))
    metric, until = cases.metric_of(problem), time.monotonic() + 2.0
    bounds, rng = problem.robot.finite_range(), np.random.default_rng(0)
    steps = Steps(0.15, 0.5, metric.radius)
    search = PublishedSearch(
        metric, steps, *bounds, problem.world.motion_valid, lambda: time.monotonic() > until, rng, problem.start
    )
    return falls(search)


def improved_falls() -> tuple[bool, int]:
    """The same of the improved one, without descents, which would need no CONNECT."""
    problem = rrtik.load_problem("planar6_c_pose")
    metric, until = TipMetric(problem.robot, [problem.goal]), time.monotonic() + 2.0
    bounds, rng = problem.robot.finite_range(), np.random.default_rng(0)
    judge = Judge(problem.world.valid_batch, problem.world.motion_valid_batch, lambda: time.monotonic() > until)
    options = Options(0.15, 0.6, jacobian=False, most_vertices=10_000)
    return falls(BatchedSearch(metric, options, *bounds, judge, rng, problem.start[None]))


def falls(search: Any) -> tuple[bool, int]:
    held, added, connect = [], [0], search._connect

    def watched(vertex: int) -> Any:
        before = search.tree.size
        outcome = connect(vertex)
        new = search.tree.distance[before:]
        held.append(bool((np.diff(np.append(search.tree.distance[vertex], new)) < 0.0).all()))
        added[0] += len(new)
        return outcome

    search._connect = watched
    search.run()
    return all(held), added[0]


def two_steps(problem: Any, seconds: float, seed: int) -> bool:
    """The nearest free solution of inverse kinematics, then RRT-Connect to that one alone."""
    ik = rrtik.solve_ik(
        problem.robot, problem.goal, near=problem.start, world=problem.world, seconds=seconds, seed=seed
    )
    if not ik.found:
        return False
    joints = rrtik.Problem(problem.world, problem.start, ik.solutions[0])
    return rrtik.plan(joints, og.RRTConnect, seconds=seconds, seed=seed).found


WAYS = {
    "IKURT": IKURT,
    "RRT-Connect to goals from IK (OMPL's)": og.RRTConnect,
    "FastRRTConnect (kernel) to goals from IK": FastRRTConnect,
    "two steps: IK, then RRT-Connect (OMPL's)": None,
}


def beside(problems: Iterable[Any], limit: float) -> tuple[int, list[list[str]]]:
    """How many problems, and solved share and times of each way; one problem after the other, each by all."""
    outcomes: dict[str, list[float]] = {name: [] for name in WAYS}
    for number, problem in enumerate(problems):
        for world in (problem.world, problem.world.with_accuracy("conservative")):
            world.motion_valid(problem.start, problem.start + 1e-3)  # loads covers and kernels
        for name, planner in WAYS.items():
            begin = time.process_time()
            if planner is None:
                found = two_steps(problem, limit * STRETCH[0], number)
            else:
                found = rrtik.plan(problem, planner, seconds=limit * STRETCH[0], seed=number).found
            taken = time.process_time() - begin
            outcomes[name].append(taken if found and taken <= limit else np.inf)
    rows = []
    for name, each in outcomes.items():
        taken = np.array(each)
        found = int(np.isfinite(taken).sum())
        share = f"{found} of {len(taken)} ({100 * found / len(taken):.1f} %)"
        taken = np.minimum(taken, limit)
        rows.append([name, share, f"{np.median(taken):.3f}", f"{taken.mean():.3f}"])
    return len(next(iter(outcomes.values()))), rows


def generated(report: Report, problems: int) -> None:
    for arm in cases.ARMS:
        count, rows = beside(cases.generated(arm, problems // len(cases.ARMS)), POSE_SECONDS)
        report.table(f"{count} generated poses, {arm} among {cases.OBSTACLES} balls, {POSE_SECONDS:g} s", HEAD, rows)


def panda(report: Report, folder: Path, problems: int) -> None:
    count, rows = beside(cases.panda_problems(folder, problems), PANDA_SECONDS)
    report.table(f"{count} problems of MotionBenchMaker, Panda, goals as poses, {PANDA_SECONDS:g} s", HEAD, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mbm", type=Path, help="the unpacked set of Panda problems, see README.md")
    parser.add_argument("--literal", type=int, default=20, help="runs of the published algorithm, up to 10 s each")
    parser.add_argument("--problems", type=int, default=500, help="generated pose problems, all arms together")
    parser.add_argument("--panda", type=int, default=140, help="problems of MotionBenchMaker")
    parser.add_argument("--stretch", type=float, default=1.0, help="wall time per processor time, on a busy machine")
    parser.add_argument("--quick", action="store_true", help="a look at everything")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "reports" / "ikurt.md")
    options = parser.parse_args()
    literal, improved, seeds = (2, 5, 10) if options.quick else (options.literal, 20, 100)
    problems, pandas = (12, 7) if options.quick else (options.problems, options.panda)
    STRETCH[0] = options.stretch
    report = Report("IKURT", "python bench/ikurt_report.py")
    report.note("What was run", INTRODUCTION)
    for section in (
        lambda: hundred(report, seeds),
        lambda: generated(report, problems),
        lambda: panda(report, options.mbm, pandas) if options.mbm else None,
        lambda: acceptance(report, literal, improved),
    ):
        section()
        options.out.write_text(report.markdown())
    print(report.markdown())


COUNTS = {
    "metric_evaluations": "evaluations",
    "checked_motions": "motions checked",
    "vertices": "vertices",
    "connects": "CONNECTs",
}
HEAD = ["", "solved", "median s", "mean s (a failure counts the limit)"]
INTRODUCTION = (
    "Literal: the published algorithm with the default numbers of the specification, poses to 1e-2 in its metric, as "
    "acceptance wants it. Improved: the default, to the tolerances of the shipped problems (1 mm and 0.01 rad, or as "
    "the file says), which are tighter. No Jacobian: the improved one with `jacobian=False`, on the looser goals. All "
    "through `plan()`, whose second check every path has passed. Evaluations are forward kinematics; `worst metric` is "
    "the published metric at the end of the worst path. Seconds are of processor time, and so are the limits. Where "
    "wall time runs out before that, a failure has had the seconds shown."
)


if __name__ == "__main__":
    main()
