"""The tables and lists of [1, ch. 6.3]."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import astuple
from math import factorial

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.crdt.baseline import TreeRun, crdt_run, rrt_run
from rrtik_bench.crdt.published import CONNECT_LIST, CRDT_TABLE, PRISM_LIST, RRT_TABLE, SDU_LIST
from rrtik_bench.crdt.runs import RouteRun, joints_of, route_run
from rrtik_bench.report.rows import (
    INFINITE,
    STATISTICS,
    Bar,
    Row,
    about,
    all_of,
    as_before,
    both,
    by_chance,
    exactly,
    judged,
    judged_runs,
    within,
)
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.goal import JointGoal
from rrtik_ompl.model.transitions import lower_bound, route_length, transitions
from rrtik_ompl.world.problem import Problem

SOURCE = "[1, ch. 6.3]"
COLUMNS = ("iterations", "vertices", "collision checks", "time [s]")
CHECK = "a check is a point test every 0.2 along an edge"
FITTED = "environment E, whose drawing is lost: reconstructed so that the basic RRT meets its published means"
SQUARES = "the squares are lost; case {case} of three proposals, optimum {optimum}"
SUBSEA = "the unit is a proposal; theta5 is printed as a DH angle (90 is a straight wrist)"
RAW, ONCE, TWICE = range(3)
RUNS_OF_E = 1000  # of each planner in environment E, as printed
TABLES_OF_E = {"RRT": RRT_TABLE, "C-RDT": CRDT_TABLE}
STATISTICS_OF_E = ("mean", "least", "most", "deviation")
NEAR_PRINT = 2.0  # what differs by a larger factor is not explained by the rebuilding of a scene
NEAR_MEAN = 1.5  # the same of means in environment E, to which it was fitted
REBUILT_E = "environment E is rebuilt: where it differs from the print, it is held to what it gave in 1000 runs before"
# What 1000 runs in the rebuilt environment gave, by column: mean, least, most, deviation
REBUILT: Mapping[str, Sequence[Sequence[float]]] = {
    "RRT": ((541.109, 228, 1552, 190.063), (359.421, 122, 1181, 147.835), (2334.855, 987, 5948, 749.139)),
    "C-RDT": ((189.629, 6, 1602, 181.583), (317.157, 15, 2742, 309.085), (3022.526, 392, 13553, 1755.163)),
}
SQUARES_MOVES = {"a": 5.04, "b": 5.13, "c": 4.61}  # mean moves of 100 runs before
UNIT_LENGTH = 5.18  # [rad], mean of 200 runs before
PRISM_ROUTES = 100.0 * 143 / 272  # [%] of optimal routes before
CONNECT_LENGTH = 5.76  # [rad], median of 100 runs before
LEAST_SPREAD = 0.5  # of a number of moves
ONE_RUN = 0.5  # the mean that rounds to a whole number printed of one run


def environment_e(quick: bool) -> list[Row]:
    """The letter E: basic RRT and basic C-RDT."""
    problem, count = rrtik.load_problem("env_e"), 100 if quick else RUNS_OF_E
    runs = {
        "RRT": [rrt_run(problem, seed) for seed in range(count)],
        "C-RDT": [crdt_run(problem, seed) for seed in range(count)],
    }
    rows = []
    for name, each in runs.items():
        found = sum(run.found for run in each)
        columns = _columns(each)
        rows.append(judged(f"{name}: success", "100 %", f"{found} of {count}", found / count, all_of()))
        for k, column in enumerate(COLUMNS):
            rows += _column(name, k, column, columns[k])
    return [*rows, *_ratios({name: _columns(each) for name, each in runs.items()})]


def _column(name: str, k: int, column: str, ours: Vector) -> list[Row]:
    """Mean, least, most and deviation of one column of tables 6.2 and 6.3 beside the print."""
    printed, rows = [row[k] for row in TABLES_OF_E[name]], []
    for which, (statistic, theirs) in enumerate(zip(STATISTICS_OF_E, printed, strict=True)):
        label, texts = f"{name}: {statistic} {column}", (f"{theirs:g}", f"{STATISTICS[statistic](ours.tolist()):.4g}")
        if column == "time [s]":
            rows.append(Row(label, *texts, None, "another machine"))
        elif statistic in ("least", "most") and len(ours) < RUNS_OF_E:
            rows.append(Row(label, *texts, None, f"judged with as many runs as printed, {RUNS_OF_E}"))
        else:
            bar = _statistic_bar(statistic, theirs, printed[3], ours, REBUILT[name][k][which])
            rows.append(judged_runs(label, *texts, ours.tolist(), bar, f"{CHECK}; {REBUILT_E}", by=statistic))
    return rows


def _statistic_bar(statistic: str, theirs: float, deviation: float, ours: Vector, before: float) -> Bar:
    """As printed within chance, by the printed deviation; else as the rebuilt environment gave it, near the print."""
    count, spread = len(ours), float(ours.std(ddof=1))
    if statistic == "mean":
        chance, again = (by_chance((spread, count), (other, RUNS_OF_E)) for other in (deviation, spread))
    elif statistic == "deviation":
        shape = float(((ours - ours.mean()) ** 4).mean() / spread**4 - 1.0)  # of a sample's variance: kurtosis less one
        errors = 0.5 * spread * np.sqrt(shape), 0.5 * deviation * np.sqrt(shape)
        chance, again = (by_chance((errors[0], count), (other, RUNS_OF_E)) for other in errors[::-1])
    else:  # the eleventh value from the end lies beyond another sample's extreme in one of a thousand pairs
        nearest = np.sort(ours)[:11] if statistic == "least" else np.sort(ours)[-11:]
        chance = again = float(np.ptp(nearest))
    near = NEAR_MEAN if statistic == "mean" else NEAR_PRINT
    differs = both(about(before, again), within(near, theirs))
    return Bar((0.0, INFINITE), held=about(theirs, chance), differs=differs)


def _ratios(columns: Mapping[str, Matrix]) -> list[Row]:
    """C-RDT over RRT: both means are claimed to be below 1."""
    rows = []
    for k, name in ((0, "iterations"), (2, "collision checks")):
        ours = [columns[planner][k] for planner in ("C-RDT", "RRT")]
        printed = [[row[k] for row in TABLES_OF_E[planner]] for planner in ("C-RDT", "RRT")]
        share, theirs = float(ours[0].mean() / ours[1].mean()), printed[0][0] / printed[1][0]
        errors = [(float(each.std(ddof=1) / each.mean()), len(each)) for each in ours]
        errors_of_theirs = [(row[3] / row[0], RUNS_OF_E) for row in printed]
        chance = np.hypot(share * by_chance(*errors), theirs * by_chance(*errors_of_theirs))
        held = both(about(theirs, float(chance)), (0.0, 1.0)) or (theirs, theirs)
        dearer = f"C-RDT needs {abs(100.0 * (share - 1.0)):.0f} % {'more' if share > 1.0 else 'fewer'} here"
        label = f"mean {name}, C-RDT over RRT"
        rows.append(judged(label, f"{theirs:.3f}", f"{share:.3f}", share, Bar((0.0, INFINITE), held=held), dearer))
    return rows


def _columns(runs: list[TreeRun]) -> Matrix:
    return np.array([astuple(run)[:4] for run in runs], dtype=float).T


def _runs(name: str, count: int) -> list[RouteRun]:
    problem = rrtik.load_problem(name)
    return [route_run(problem, seed) for seed in range(count)]


def _stages(runs: list[RouteRun]) -> tuple[list[float], list[float]]:
    """Mean transitions and lengths: raw, after pass 1, after pass 2."""
    moves = np.mean([run.moves for run in runs], axis=0)
    lengths = np.mean([run.lengths for run in runs], axis=0)
    return moves.tolist(), lengths.tolist()


def _arrows(values: list[float]) -> str:
    return " -> ".join(f"{value:.2f}" for value in values[: TWICE + 1])


def planar(quick: bool) -> list[Row]:
    """The planar arm of three joints and two squares."""
    rows = []
    for case, optimum in (("a", "4 as shipped, 3 with room"), ("b", "4"), ("c", "3")):
        runs = _runs(f"planar3_{case}", 10 if quick else 100)
        moves, _ = _stages(runs)
        last = [run.moves[TWICE] for run in runs]
        falling = moves[RAW] >= moves[ONCE] >= moves[TWICE]
        reading = SQUARES.format(case=case.upper(), optimum=optimum) + f"; best here {min(last)}"
        before = as_before(SQUARES_MOVES[case], 100, last, LEAST_SPREAD)
        bar = Bar((1.0, 50.0), held=about(5.0, ONE_RUN), differs=both(before, within(NEAR_PRINT, 5.0)))
        rows.append(judged_runs(f"case {case.upper()}: transitions, raw, pass 1, pass 2", "10 -> 6 -> 5 (one run)",
                                f"{_arrows(moves)} (mean)", last if falling else [], bar, reading))  # fmt: skip
    problem = rrtik.load_problem("planar3_a")
    return [*rows, _different("start and goal: c, the joints that differ", problem.start, _goal(problem), 1)]


def subsea(quick: bool) -> list[Row]:
    """TITAN-4 and the subsea distribution unit."""
    runs = _runs("titan4_sdu", 20 if quick else 200)
    (moves, lengths), printed = _stages(runs), np.deg2rad(SDU_LIST)
    best = min(run.moves[TWICE] for run in runs)
    sixth = sum(6 in joints_of(run.routes[TWICE]) for run in runs if run.moves[TWICE] == best)
    last = [run.lengths[TWICE] for run in runs]
    shortest, length = min(last), route_length(printed)
    return [
        judged_runs("transitions, raw, pass 1, pass 2", "12 -> 9 -> 7 (one run)", f"{_arrows(moves)} (mean)",
                    [run.moves[TWICE] for run in runs], Bar((5.0, 50.0), held=about(7.0, ONE_RUN)), SUBSEA),
        judged("fewest transitions of any run", "7", str(best), best,
               Bar((0.0, 50.0), held=(7.0, 7.0), differs=(6.0, 6.0)),
               f"{SUBSEA}; one run was printed, here are {len(runs)}; fewer than 6 are proven impossible"),
        judged_runs("length [rad], raw, pass 1, pass 2", "16.06 -> 7.53 -> 3.16", f"{_arrows(lengths)} (mean)",
                    last if lengths[RAW] > lengths[ONCE] > lengths[TWICE] else [],
                    Bar((0.0, 100.0), held=within(1.35, 3.16),
                        differs=both(as_before(UNIT_LENGTH, 200, last), within(NEAR_PRINT, 3.16))),
                    f"{SUBSEA}; one run was printed: the shortest of ours has {shortest:.2f}"),
        judged("theta6 in the best routes", "never moved", f"moved in {sixth} of them", sixth, exactly(0, len(runs))),
        *_printed(printed, 7, 5),
        judged("printed list: length", "3.16 rad", f"{length:.3f} rad", length, Bar((0.0, 100.0), about(3.16, 0.005))),
    ]  # fmt: skip


def _printed(route: np.ndarray, moves: int, distance: int) -> list[Row]:
    """Of a printed list: its moves, and the number of joints that differ between its ends."""
    found = transitions(route)
    return [
        judged("printed list: transitions", str(moves), str(found), found, exactly(moves, 50)),
        _different("printed list: c, the joints that differ", route[0], route[-1], distance),
    ]


def _different(name: str, start: Vector, goal: Vector, distance: int) -> Row:
    """The number of joints that differ, below which no list of single-joint moves is."""
    c = lower_bound(start, goal)
    return judged(name, str(distance), str(c), c, exactly(distance, 6))


def _goal(problem: Problem) -> Vector:
    assert isinstance(problem.goal, JointGoal)
    return problem.goal.q


def prisms(quick: bool) -> list[Row]:
    """TITAN-4 and two prisms."""
    runs, printed = _runs("titan4_prisms", 20 if quick else 200), np.deg2rad(PRISM_LIST)
    optimal = [route for run in runs for route in run.routes[TWICE:] if transitions(route) == 3]
    families = Counter(joints_of(route) for route in optimal)
    of_the_family = [100.0 * (joints_of(route) == (3, 1, 3)) for route in optimal]
    share = float(np.mean(of_the_family)) if optimal else np.nan
    twice = 100.0 * float(np.mean([run.moves[TWICE] == 3 for run in runs]))
    others = ", ".join(f"{'-'.join(map(str, joints))}: {number}" for joints, number in families.most_common())
    return [
        *_printed(printed, 3, 1),
        judged("fewest transitions of any run", "3", str(min(run.moves[TWICE] for run in runs)),
               min(run.moves[TWICE] for run in runs), exactly(3, 50), f"in {twice:.0f} % of the runs"),
        judged("theta3-theta1-theta3 among optimal routes", "95 %", f"{share:.0f} % of {len(optimal)}",
               share, Bar((0.0, 100.0), held=(85.0, 100.0), differs=as_before(PRISM_ROUTES, 272, of_the_family)),
               f"depends on the height of the prisms, which is not known; routes by joints {others}"),
        *_connected(5 if quick else 100),
    ]  # fmt: skip


def _connected(count: int) -> list[Row]:
    """RRT-Connect on the prisms: as printed, and as here."""
    problem, printed = rrtik.load_problem("titan4_prisms"), np.deg2rad(CONNECT_LIST)
    length, each = route_length(printed), (np.diff(printed, axis=0) != 0.0).sum(axis=1)
    plans = [rrtik.plan(problem, "RRTConnect", seconds=10.0, seed=seed, shorten=False) for seed in range(count)]
    routes = [rrtik.shorten(plan.path, problem, method="sequential").waypoints for plan in plans if plan.path]
    ours = [route_length(route) for route in routes]
    together = [int((np.diff(route, axis=0) != 0.0).sum(axis=1).max()) for route in routes]
    return [
        judged("RRT-Connect, printed route: length", "3.00 rad", f"{length:.3f} rad", length,
               Bar((0.0, 100.0), about(3.0, 0.005)), "table 6.6"),
        judged("RRT-Connect, printed route: joints that move at once", "all", f"{each.min()} to {each.max()} of 6",
               int(each.max()), exactly(6, 6), "table 6.6"),
        judged_runs("RRT-Connect: length", "3.00 rad (one run)",
                    f"{np.median(ours):.2f} rad, from {min(ours):.2f} to {max(ours):.2f}", ours,
                    Bar((0.0, 100.0), held=within(1.35, 3.0),
                        differs=both(as_before(CONNECT_LENGTH, 100, ours), within(NEAR_PRINT, 3.0))),
                    f"median of {len(ours)} plans after the sequential cut; prisms are proposals", by="median"),
        judged("RRT-Connect: joints that move at once", "all", f"up to {min(together)} to {max(together)} of 6",
               min(together), exactly(6, 6), "why a pilot cannot follow it"),
    ]  # fmt: skip


def _routes(joints: int, steps: int) -> int:
    """Ways to walk an edge one joint at a time on a grid of so many steps for each joint: ``(n l)! / (l!)^n``."""
    return int(factorial(joints * steps) // factorial(steps) ** joints)


def counts(quick: bool) -> list[Row]:
    """How many single-joint routes there are."""
    del quick
    reading = "one edge (m = 1); for more the printed factor m! would count the orders of edges, which are fixed"
    return [
        judged(
            f"Routes(3, {grid})", str(printed), str(_routes(3, grid)), _routes(3, grid), exactly(printed, 1e6), reading
        )
        for grid, printed in ((1, 6), (2, 90))
    ]


TABLES = (
    Table("crdt-routes", "Number of single-joint routes", f"{SOURCE}, count of routes", counts, 1, 1),
    Table(
        "crdt-e", "Environment E: RRT and C-RDT", f"{SOURCE}, two tables of test E", environment_e, 65, 8, fitted=FITTED
    ),
    Table("crdt-planar", "Planar arm, two squares", f"{SOURCE}, planar test", planar, 7, 1),
    Table("crdt-sdu", "TITAN-4 at the subsea unit", f"{SOURCE}, SDU test", subsea, 11, 3),
    Table("crdt-prisms", "TITAN-4 and two prisms", f"{SOURCE}, prism test", prisms, 6, 2),
)
