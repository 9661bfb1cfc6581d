"""The speed row of whole calls: `plan(problem)` as a person types it, the named planner, VAMP's search and simplifying.

Three arms, on their exact meshes and on VAMP's spheres. Who takes part takes turns, problem by problem, in processor
time. The paths of the default call on exact meshes are judged by Pinocchio and coal alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from bench.peers.libraries import vamp
from bench.shared.clocks import least, spent
from bench.shared.judge import Contacts
from bench.shared.motion_bench_maker import GROUPS, problem_of, scene_files
from bench.speed.cases import Options
from bench.speed.ours import PLANNER
from bench.speed.planning import NO_FOLDER
from rrtik_bench.report.page import Report
from rrtik_ompl import Plan, Problem, ProblemError, load_robot, plan
from rrtik_ompl.base.arrays import Matrix

ROUNDS = 2  # of each call; the least counts
SAMPLES = 50  # configurations of a path that the judge looks at
BARS = {"panda": (0.8, 4.0), "ur5": (2.5, 9.0), "fetch": (4.0, 40.0)}  # [ms] median and 95 % of the default, exact
OVER_VAMP = 2.0  # times VAMP's calls, the default call on the same spheres
YARDSTICK = 100  # configurations
HAS_VAMP = find_spec("vamp") is not None
DEFAULT = "`plan(problem)`"
NAMED = f'`plan(problem, "{PLANNER}")`'
THEIRS = "VAMP, search and simplifying"


class Run(NamedTuple):
    """One call at one problem.

    Attributes:
        seconds: Processor time [s].
        path: Its waypoints, or None.
        proven: Whether the path is proven.
    """

    seconds: float
    path: Matrix | None
    proven: bool = False

    @property
    def length(self) -> float:
        """Length of the path [rad or m]; nan if there is none."""
        return np.nan if self.path is None else float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())


Runs = dict[tuple[str, str], list[Run]]  # by solids and call
Call = Callable[[], Any]
Read = Callable[[Any], Run]
NOTHING = Run(np.nan, None)  # of a problem whose ends collide by spheres: the runs of all calls keep in step


def whole_plans(options: Options, report: Report) -> None:
    """Measure all arms whose sets are there."""
    if options.folder is None:
        return report.note("1. Whole calls", NO_FOLDER)
    rows: list[list[str]] = []
    left_out: list[str] = []
    for arm in GROUPS:
        if not (options.folder / f"mbm_{arm}").is_dir():
            left_out.append(f"The set of {arm} is not there.")
            continue
        runs, touching, looked, refused = _of_arm(arm, options)
        if refused:
            left_out.append(f"Left out, as start or goal collides by exact solids: {refused} of {arm}.")
        rows += _rows(arm, runs)
        _bars(arm, runs, report)
        report.bar(
            f"{arm}: configurations of default paths that touch, by Pinocchio and coal",
            "0",
            f"{touching} of {looked}",
            touching == 0,
        )
    head = ["", "solids", "call", "runs", "found", "proven", "median [ms]", "mean [ms]", "95 % [ms]", "length"]
    report.table("1. Whole calls", [*head, "time over VAMP", "length over VAMP"], rows)
    report.note(
        "What they are",
        f"The least of {ROUNDS} calls. VAMP's times are of the problems that it solves. Lengths and ratios are "
        f"geometric means, ratios of the problems that both solve. {YARDSTICK} calls of `pinocchio.computeCollisions` "
        + " ".join([f"of the Panda at random configurations: {1e3 * _yardstick():.2f} ms.", *left_out]),
    )
    return None


def _of_arm(arm: str, options: Options) -> tuple[Runs, int, int, int]:
    """Its runs; how many configurations of the default's exact paths touch, of how many; problems that are refused."""
    assert options.folder is not None
    runs: Runs = {}
    touching = looked = refused = 0
    for number, file in enumerate(scene_files(options.folder, arm, options.problems)):
        try:
            exact = problem_of(file, balls=False)
        except ProblemError:
            refused += 1
            continue
        assert exact is not None
        calls = dict(_calls(arm, exact, problem_of(file, balls=True), options))
        for key, (call, read) in calls.items():
            if number == 0:
                call()  # loads kernels
            seconds, found = least(call, ROUNDS)
            runs.setdefault(key, []).append(NOTHING if found is None else read(found)._replace(seconds=seconds))
        path = runs["exact", DEFAULT][-1].path
        if path is not None:
            judge = Contacts(exact.world)
            rows = samples(path)
            touching += sum(any(True for _ in judge.depths(q)) for q in rows)
            looked += len(rows)
    return runs, touching, looked, refused


def _calls(
    arm: str, exact: Problem, spheres: Problem | None, options: Options
) -> Iterator[tuple[tuple[str, str], tuple[Call, Read]]]:
    """Each call by its name, and what makes a run of its result; a problem whose ends collide is passed over."""
    for solids, problem in (("exact", exact), ("spheres", spheres)):
        for name, planner in ((DEFAULT, None), (NAMED, PLANNER)):
            yield (solids, name), (partial(_ours, problem, planner, options.seed), _run_of_plan)
    if HAS_VAMP:
        theirs = None if spheres is None else vamp.simplified(spheres, arm)
        yield ("spheres", THEIRS), (_pass if theirs is None else theirs, _run_of_vamp)


def _ours(problem: Problem | None, planner: str | None, seed: int) -> Plan | None:
    if problem is None:
        return None
    return plan(problem, seed=seed) if planner is None else plan(problem, planner, seed=seed, shorten=False)


def _pass() -> None:
    """Stand for VAMP's call where there is none."""


def _run_of_plan(found: Plan) -> Run:
    return NOTHING if found.path is None else Run(0.0, found.path.waypoints, found.proven is True)


def _run_of_vamp(path: Any) -> Run:
    return Run(0.0, vamp.waypoints(path))


def samples(path: Matrix) -> Matrix:
    """Configurations spread evenly over a path, shape (SAMPLES, dof)."""
    ends = np.concatenate([[0.0], np.cumsum([np.linalg.norm(b - a) for a, b in pairwise(path)])])
    places = np.linspace(0.0, ends[-1], SAMPLES)
    return np.column_stack([np.interp(places, ends, column) for column in path.T])


def _rows(arm: str, runs: Runs) -> Iterator[list[str]]:
    """Rows of the table, the default call first."""
    theirs = runs.get(("spheres", THEIRS))
    for (solids, name), each in runs.items():
        times = _times(each)
        lengths = np.array([run.length for run in each])
        counts: list[int | str] = [
            len(times),
            sum(run.path is not None for run in each),
            sum(run.proven for run in each),
        ]
        if name == THEIRS:
            counts[2] = ""
        numbers = [np.median(times), np.mean(times), np.quantile(times, 0.95), _geometric(lengths)]
        ratios = ["", ""]
        if theirs is not None and name != THEIRS:
            ratios = [f"{value:.3g}" for value in _over(each, theirs)]
        yield [arm, solids, name, *map(str, counts), *(f"{value:.3g}" for value in numbers), *ratios]


def _bars(arm: str, runs: Runs, report: Report) -> None:
    each = runs["exact", DEFAULT]
    times = _times(each)
    measured = float(np.median(times)), float(np.quantile(times, 0.95))
    wanted = BARS[arm]
    report.bar(
        f"{arm}, exact: {DEFAULT}, median / 95 %",
        "{:g} / {:g} ms".format(*wanted),
        "{:.3g} / {:.3g} ms".format(*measured),
        measured[0] <= wanted[0] and measured[1] <= wanted[1],
    )
    proven = sum(run.proven for run in each)
    report.bar(f"{arm}, exact: found and proven", f"all {len(each)}", str(proven), proven == len(each))
    theirs = runs.get(("spheres", THEIRS))
    if theirs is not None:
        ratio, _ = _over(runs["spheres", DEFAULT], theirs)
        report.bar(
            f"{arm}, spheres: {DEFAULT} over VAMP's two calls", f"{OVER_VAMP:g}", f"{ratio:.3g}", ratio <= OVER_VAMP
        )


def _times(runs: list[Run]) -> Matrix:
    """Times of the runs that took place [ms]."""
    return 1e3 * np.array([run.seconds for run in runs if not np.isnan(run.seconds)])


def _over(ours: list[Run], theirs: list[Run]) -> tuple[float, float]:
    """Time and length over another's, geometric means of the problems that both solve."""
    both = [(a, b) for a, b in zip(ours, theirs, strict=True) if a.path is not None and b.path is not None]
    times = np.array([a.seconds / b.seconds for a, b in both])
    return _geometric(times), _geometric(np.array([a.length / b.length for a, b in both]))


def _geometric(values: Matrix) -> float:
    kept = values[np.isfinite(values) & (values > 0.0)]
    return float(np.exp(np.log(kept).mean())) if len(kept) else np.nan


def _yardstick() -> float:
    """Processor time of `YARDSTICK` calls of ``pinocchio.computeCollisions`` of the Panda [s]."""
    robot = load_robot("panda")
    model = robot.model
    geometry = robot.collision
    data, places = model.createData(), geometry.createData()
    rows = robot.pinocchio_configuration(
        np.random.default_rng(0).uniform(*robot.finite_range(), (YARDSTICK, robot.dof))
    )

    def call() -> None:
        for q in rows:
            pin.computeCollisions(model, data, geometry, places, q, False)

    return min(spent(call)[0] for _ in range(ROUNDS))
