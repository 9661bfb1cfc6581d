"""Speed rows about searches: the Panda's set against the peers, the way through OMPL."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import ArrayLike

from bench.peers.description import task_of
from bench.peers.libraries import roboplan, vamp
from bench.peers.task import PER_RADIAN, Search, Task
from bench.shared.clocks import spent
from bench.speed.cases import Options, exact_problem, family, panda_files, shipped_problems, sphere_problem
from bench.speed.ours import ompl_overhead, our_search, warm_up
from rrtik_bench.report.page import Report
from rrtik_ompl import JointPath
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.world.problem import Problem

REPEATS = 5
HAS_ROBOPLAN, HAS_VAMP = (find_spec(name) is not None for name in ("roboplan", "vamp"))
NO_FOLDER = "Not run: give the folder of the MotionBenchMaker sets."
NO_ROBOPLAN = "roboplan is not installed (`pip install rrtik-ompl[peers]`): its figures are missing."
STORED = "VAMP 0.6.4, stored, inner time, indicative"
VAMP_STORED = (43.5, 108.9, 519.0)  # [us], on the Xeon of the project's first measurements
SPHERE_PATHS = (
    "{found} found; by coal, {checked} of them are free at VAMP's own 32 configurations per radian, and {certified} in "
    "steps of 5 mm too, which are up to five times as fine: as VAMP's would, the others cut a corner in between."
)

Times = dict[str, list[float]]


def spheres(options: Options, report: Report) -> None:
    """59 spheres, VAMP's [13] obstacle shapes, checks as dense as VAMP's; the best of a few calls."""
    title = "2. Searches: Panda of 59 spheres"
    files = panda_files(options, options.problems)
    if not files:
        return report.note(title, NO_FOLDER)
    times = _times("ours", "roboplan", "VAMP, call", "VAMP, inner")
    count = found = as_checked = as_certified = 0
    for number, file in enumerate(files):
        problem = sphere_problem(file)
        if problem is None:
            continue
        count += 1
        ours = our_search(problem, seconds=options.limit, per_radian=PER_RADIAN)
        if number == 0:
            warm_up(problem)
        runs = [spent(partial(ours, options.seed)) for _ in range(REPEATS)]
        times["ours"].append(min(seconds for seconds, _ in runs))
        rows = runs[0][1]
        found += rows is not None
        as_checked += _verified_between(problem, rows, PER_RADIAN)
        as_certified += _verified(problem, rows)
        if HAS_ROBOPLAN:
            peer = _peer(problem, options.limit, roboplan.search)
            calls = [spent(partial(peer, options.seed))[0] for _ in range(REPEATS)]
            times["roboplan"].append(min(calls))
        if HAS_VAMP:
            theirs = vamp.search(problem)
            inner_calls = [spent(theirs) for _ in range(REPEATS)]
            times["VAMP, call"].append(min(seconds for seconds, _ in inner_calls))
            times["VAMP, inner"].append(min(inner for _, (_, inner) in inner_calls))
    table = _rows(times, "ours")
    if not HAS_VAMP:
        table.append([STORED, "", *(f"{value:.1f}" for value in VAMP_STORED), ""])
    report.table(title, ["", "problems", "median [us]", "mean [us]", "95 % [us]", "median ratio to ours"], table)
    report.note("Paths of the spheres", SPHERE_PATHS.format(found=found, checked=as_checked, certified=as_certified))
    ours_us = 1e6 * np.array(times["ours"])
    measured = _three(ours_us)
    three = (float(np.median(ours_us)), float(ours_us.mean()), float(np.quantile(ours_us, 0.95)))
    report.bar(
        f"{count} Panda problems of 59 spheres, Python call, median / mean / 95 %; {as_checked} solved and verified",
        "35 / 90 / 450 us (aim 22 / 55 / 260)",
        measured,
        as_checked == count and all(a <= b for a, b in zip(three, (35.0, 90.0, 450.0), strict=True)),
    )


def exact(options: Options, report: Report) -> None:
    """Exact solids, ours under both rules for steps, roboplan in turn with it."""
    title = "3. Searches: Panda with exact solids"
    files = panda_files(options, options.problems)
    if not files:
        return report.note(title, NO_FOLDER)
    names = ("ours, 32 checks per radian", "ours, own rule", "roboplan")
    times = _times(*names)
    verified = dict.fromkeys(names, 0)
    by_family: dict[str, Times] = {}
    for number, file in enumerate(files):
        problem = exact_problem(file)
        if number == 0:
            warm_up(problem)
        for name, search in _exact_searches(problem, options).items():
            seconds, rows = spent(partial(search, options.seed))
            times[name].append(seconds)
            by_family.setdefault(family(file), _times(*names))[name].append(seconds)
            verified[name] += _verified(problem, rows)
    head = ["", "problems", "median [us]", "mean [us]", "95 % [us]", "median ratio to the first", "solved and verified"]
    table = [[*row, str(verified[row[0]])] for row in _rows(times, names[0])]
    report.table(title, head, table)
    cells = [[key, *(f"{1e3 * np.median(v[n]):.3g}" if v[n] else "" for n in names)] for key, v in by_family.items()]
    report.table("Medians by family [ms]", ["", *names], cells)
    own, same = 1e3 * np.array(times["ours, own rule"]), np.array(times[names[0]])
    found = verified["ours, own rule"]
    report.bar(
        f"{len(files)} exact Panda problems, the bare search: paths that the second check accepts; median",
        "2 ms (aim 0.5 ms)",
        f"{found}; {np.median(own):.3g} ms",
        bool(np.median(own) <= 2.0),
    )
    if HAS_ROBOPLAN:
        ratios = [float(f(times["roboplan"]) / f(same)) for f in (np.median, lambda v: np.quantile(v, 0.95))]
        wanted, text = "10 x (aim 30 x)", f"{ratios[0]:.3g} x, {ratios[1]:.3g} x"
        report.bar(
            "the same against roboplan, the same density of checks, median and 95 %", wanted, text, min(ratios) >= 10
        )
    else:
        report.note("roboplan", NO_ROBOPLAN)


def _exact_searches(problem: Problem, options: Options) -> dict[str, Callable[[int], Matrix | None]]:
    searches = {
        "ours, 32 checks per radian": our_search(problem, seconds=options.limit, per_radian=PER_RADIAN),
        "ours, own rule": our_search(problem, seconds=options.limit),
    }
    if HAS_ROBOPLAN:
        searches["roboplan"] = _peer(problem, options.limit, roboplan.search)
    return searches


def _peer(problem: Problem, seconds: float, search: Callable[[Task], Search]) -> Search:
    """A peer's search, its files read."""
    with TemporaryDirectory() as folder:
        return search(task_of(problem, Path(folder), seconds))


def ompl_layer(options: Options, report: Report) -> None:
    """What OMPL around the kernel planner costs, call by call."""
    title = "6. SimpleSetup.solve() against the bare search"
    files = panda_files(options, options.peer_problems)
    problems = [exact_problem(file) for file in files] or shipped_problems()
    bare, whole = [], []
    for problem in problems:
        solve = ompl_overhead(problem, seconds=1.0, seed=options.seed)
        warm_up(problem)
        runs = [solve() for _ in range(4 * REPEATS)]
        bare += [inner for _, inner in runs]
        whole += [outer for outer, _ in runs]
    more = 1e6 * float(np.median(np.array(whole) - np.array(bare)))
    report.table(
        title,
        ["problems", "search inside [us]", "solve() [us]", "difference [us]"],
        [[str(len(problems)), *(f"{1e6 * np.median(t):.1f}" for t in (bare, whole)), f"{more:.1f}"]],
    )
    report.bar(
        "SimpleSetup.solve() against the bare search, medians", "+ 30 us (aim + 20)", f"+ {more:.1f} us", more <= 30
    )


def _verified(problem: Problem, rows: Matrix | None) -> bool:
    """Whether there is a path from the start to the goal that the second check accepts."""
    if rows is None:
        return False
    path = JointPath.of(problem.world.robot, rows)
    ends = np.allclose(path.start, problem.start, atol=1e-6) and problem.reached(path.end)
    return bool(ends) and not path.violations(problem.world)


def _verified_between(problem: Problem, rows: Matrix | None, per_radian: float) -> bool:
    """Whether the second check accepts a path at the configurations at which a search so dense looks."""
    if rows is None:
        return False
    shares = [np.linspace(0.0, 1.0, 1 + _steps(a, b, per_radian))[:, None] for a, b in pairwise(rows)]
    dense = [(1.0 - s) * a + s * b for s, (a, b) in zip(shares, pairwise(rows), strict=True)]
    return bool(problem.reached(rows[-1]) and problem.world.certify(np.vstack(dense)).all())


def _steps(start: Vector, end: Vector, per_radian: float) -> int:
    return max(1, int(np.ceil(per_radian * float(np.linalg.norm(end - start)) - 1e-9)))


def _times(*names: str) -> Times:
    return {name: [] for name in names}


def _rows(times: Times, first: str) -> list[list[str]]:
    """A table row of each candidate that was measured."""
    base = float(np.median(times[first]))
    found = []
    for name, values in times.items():
        if values:
            cells = [f"{1e6 * v:.1f}" for v in (np.median(values), np.mean(values), np.quantile(values, 0.95))]
            found.append([name, str(len(values)), *cells, f"{np.median(values) / base:.3g}"])
    return found


def _three(values: ArrayLike) -> str:
    numbers = np.asarray(values, dtype=float)
    found = (np.median(numbers), np.mean(numbers), np.quantile(numbers, 0.95))
    return " / ".join(f"{v:.1f}" for v in found) + " us"
