"""The speed rows of lengths: how short the paths of `plan(problem)` are, beside what was stored or is known to exist.

Lengths are in the units of the space [rad or m].
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np

from bench.planning.best_known import best_lengths, the_70, title
from bench.shared.motion_bench_maker import problem_of, scene_files
from bench.speed.cases import Options
from bench.speed.planning import NO_FOLDER
from rrtik_bench.report.page import Report
from rrtik_ompl import PoseGoal, Problem, ProblemError, load_problem, plan
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.ik.goal_configurations import GoalSearch
from rrtik_ompl.model.robot import poses

# Medians of 50 seeds of OMPL's RRTConnect with `shorten()`, commit e2bcbff of this repository.
STORED = {
    "ur5_table": 2.52,
    "panda_shelf": 3.19,
    "xarm7_cage": 7.10,
    "so101_bin": 0.86,
    "ur10_bin": 1.44,
    "kinova_table": 2.29,
}
LONGEST = 1.005  # times the stored median
SEEDS = 50
NEAR = 0.05  # over the best known length counts as near
SEEDS_OF_THE_70 = 4
OVER_TIME = {0.0: "the default call", 0.03: "30 ms of `improve`", 0.1: "100 ms of `improve`"}
BRANCHES = 12
POSES = 4  # of each family
SEEDS_OF_POSES = 3
BRANCH_BARS = (1.03, 1.08, 1.2)  # mean, 90 %, worst: over the best branch


def shipped_lengths(options: Options, report: Report) -> None:
    """The default path on shipped problems beside the stored medians."""
    seeds = 3 if options.quick else SEEDS
    rows = []
    for name, stored in STORED.items():
        problem = load_problem(name)
        lengths = np.array([_length(problem, seed) for seed in range(seeds)])
        middle = float(np.median(lengths))
        spread = [float(np.quantile(lengths, share)) for share in (0.1, 0.9, 1.0)]
        rows.append([name, *(f"{value:.3f}" for value in (stored, middle, *spread)), f"{middle / stored:.3f}"])
        report.bar(
            f"{name}: median length of the default path over the stored one",
            f"{LONGEST:g}",
            f"{middle / stored:.3f}",
            middle <= LONGEST * stored,
        )
    heads = ["problem", "stored", "median", "10 %", "90 %", "worst", "over the stored one"]
    text = f"{seeds} seeds. Stored: medians of OMPL's RRTConnect with `shorten()` before the default call was short."
    report.table("7. Lengths: shipped problems", heads, rows, text=text)


def best_known(options: Options, report: Report) -> None:
    """The default path, and what `improve=` makes of it, beside the shortest known paths of 70 Panda problems."""
    if options.folder is None:
        return report.note("8. Lengths: the best known ones", NO_FOLDER)
    known = best_lengths()
    files = the_70(options.folder, "panda")
    seeds = 1 if options.quick else SEEDS_OF_THE_70
    over: dict[float, list[float]] = {seconds: [] for seconds in OVER_TIME}
    for file in files:
        problem = problem_of(file, balls=False)
        assert problem is not None
        _length(problem, 99)  # loads what is used
        for seed in range(seeds):
            for seconds, runs in over.items():
                runs.append(_length(problem, seed, improve=seconds) / known[title(file)] - 1.0)

    each = {seconds: np.array(runs) for seconds, runs in over.items()}
    for seconds, wanted in ((0.0, 0.85), (0.03, 0.97)):
        share = _share_near(each[seconds])
        what = f"within {NEAR:.0%} of the best known length after {OVER_TIME[seconds]}"
        report.bar(what, f"{wanted:.0%}", f"{share:.1%}", share >= wanted)
    worst = float(each[0.1].max())
    report.bar(f"worst after {OVER_TIME[0.1]}, over the best known length", "5 %", f"{worst:.1%}", worst <= NEAR)
    heads = ["after", f"within {NEAR:.0%}", "median", "mean", "95 %", "worst"]
    rows = [
        [OVER_TIME[seconds], f"{_share_near(runs):.1%}", *(f"{value:.2%}" for value in _four(runs))]
        for seconds, runs in each.items()
    ]
    text = f"{len(files)} problems of MotionBenchMaker's Panda, {seeds} seeds; times are of the processor."
    report.table("8. Lengths: over the best known ones", heads, rows, text=text)
    return None


def branches(options: Options, report: Report) -> None:
    """One plan to a pose beside the best of the plans to its branches, one by one."""
    if options.folder is None:
        return report.note("9. Lengths: goals of the tip", NO_FOLDER)
    files = spread(options.folder, POSES)[:: 10 if options.quick else 1]
    over = []
    for file in files:
        problem, goal = of_pose(file)
        best = min(_lengths_of_branches(problem, goal), default=np.nan)
        over += [_length(Problem(problem.world, problem.start, goal), seed) / best for seed in range(SEEDS_OF_POSES)]
    found = np.array(over)
    measured = float(found.mean()), float(np.quantile(found, 0.9)), float(found.max())
    report.bar(
        f"goal of the tip over the best of {BRANCHES} branches: mean / 90 % / worst",
        " / ".join(f"{value:g}" for value in BRANCH_BARS),
        " / ".join(f"{value:.3f}" for value in measured),
        all(value <= bar for value, bar in zip(measured, BRANCH_BARS, strict=True)),
    )
    heads = ["poses", "seeds", "mean", "median", "90 %", "worst"]
    numbers = (measured[0], float(np.median(found)), *measured[1:])
    row = [str(len(files)), str(SEEDS_OF_POSES), *(f"{value:.3f}" for value in numbers)]
    text = f"Length of one plan to a pose over that of the best of up to {BRANCHES} plans to its branches alone."
    report.table("9. Lengths: goals of the tip", heads, [row], text=text)
    return None


def spread(folder: Path, count: int) -> list[str]:
    """So many problems of each family of the Panda, spread over its first 50."""
    files = scene_files(folder, "panda", 50)
    families = sorted({Path(file).parent for file in files})
    own = ([file for file in files if Path(file).parent == family] for family in families)
    return [each[round(k)] for each in own for k in np.linspace(0, len(each) - 1, count)]


def of_pose(file: str) -> tuple[Problem, PoseGoal]:
    """A problem of the Panda's set, and the pose that its goal has."""
    problem = problem_of(file, balls=False)
    assert problem is not None
    assert problem.goal.q is not None
    return problem, PoseGoal(poses(problem.robot, problem.goal.q[None])[0])


@contextmanager
def processor_clocks() -> Iterator[None]:
    """Let limits of time be of the processor, since machines are shared."""
    with ExitStack() as stack:
        for name in ("perf_counter", "monotonic"):
            stack.enter_context(patch.object(time, name, time.process_time))
        yield


def _length(problem: Problem, seed: int, *, improve: float = 0.0) -> float:
    with processor_clocks():
        found = plan(problem, seed=seed, improve=improve) if improve else plan(problem, seed=seed)
    return np.inf if found.path is None else found.path.length


def _lengths_of_branches(problem: Problem, goal: PoseGoal) -> Iterator[float]:
    """Lengths of plans to single configurations at a pose."""
    search = GoalSearch(Problem(problem.world, problem.start, goal), 1234)
    search.first()
    while len(search.rows) < BRANCHES and search.more():
        pass
    for q in search.rows[:BRANCHES]:
        try:
            yield _length(Problem(problem.world, problem.start, q), 0)
        except ProblemError:
            continue


def _share_near(over: Vector) -> float:
    return float((over <= NEAR).mean())


def _four(over: Matrix) -> tuple[float, float, float, float]:
    return float(np.median(over)), float(over.mean()), float(np.quantile(over, 0.95)), float(over.max())


ROWS: dict[str, Callable[[Options, Report], None]] = {
    "shipped-lengths": shipped_lengths,
    "best-known": best_known,
    "branches": branches,
}
