"""The tables and lists of [1, ch. 6.3]."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import astuple
from math import factorial

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.crdt.baseline import TreeRun, crdt_run, rrt_run
from rrtik_bench.crdt.published import CONNECT_LIST, CRDT_TABLE, PRISM_LIST, RRT_TABLE, SDU_LIST
from rrtik_bench.crdt.runs import RouteRun, joints_of, route_run
from rrtik_bench.report.rows import INFINITE, Bar, Row, about, all_of, exactly, judged, within
from rrtik_bench.tables import Table
from rrtik_ompl.model.transitions import lower_bound, route_length, transitions

SOURCE = "[1, ch. 6.3]"
COLUMNS = ("iterations", "vertices", "collision checks", "time [s]")
CHECK = "a check is a point test every 0.2 along an edge"
FITTED = "environment E, whose drawing is lost: reconstructed so that the basic RRT meets its published means"
SQUARES = "the squares are lost; case {case} of three proposals, optimum {optimum}"
SUBSEA = "the unit is a proposal; theta5 is printed as a DH angle (90 is a straight wrist)"
RAW, ONCE, TWICE = range(3)


def environment_e(quick: bool) -> list[Row]:
    """The letter E: basic RRT and basic C-RDT."""
    problem, count = rrtik.load_problem("env_e"), 100 if quick else 1000
    runs = {"RRT": [rrt_run(problem, seed) for seed in range(count)]}
    runs["C-RDT"] = [crdt_run(problem, seed) for seed in range(count)]
    means = {name: _means(each) for name, each in runs.items()}
    printed = {"RRT": RRT_TABLE[0], "C-RDT": CRDT_TABLE[0]}
    rows = []
    for name, each in runs.items():
        found = sum(run.found for run in each)
        rows.append(judged(f"{name}: success", "100 %", f"{found} of {count}", found / count, all_of()))
        for k, column in enumerate(COLUMNS):
            ours, theirs = means[name][k], printed[name][k]
            label, texts = f"{name}: mean {column}", (f"{theirs:g}", f"{ours:.4g}")
            if column == "time [s]":
                rows.append(Row(label, *texts, None, "another machine"))
                continue
            bar = Bar((0.0, INFINITE), held=within(1.5, theirs), differs=within(3.0, theirs))
            rows.append(judged(label, *texts, ours, bar, CHECK))
    return [*rows, *_ratios(means, printed)]


def _ratios(means: dict[str, list[float]], printed: Mapping[str, tuple[float, ...]]) -> list[Row]:
    """C-RDT over RRT: both are claimed to be below 1."""
    rows = []
    for k, lowest in ((0, 0.25), (2, 0.7)):
        share, theirs = means["C-RDT"][k] / means["RRT"][k], printed["C-RDT"][k] / printed["RRT"][k]
        bar = Bar((0.0, INFINITE), held=(lowest, 1.0), better=(0.0, lowest))
        dearer = f"C-RDT needs {abs(100.0 * (share - 1.0)):.0f} % {'more' if share > 1.0 else 'fewer'} here"
        rows.append(judged(f"mean {COLUMNS[k]}, C-RDT over RRT", f"{theirs:.3f}", f"{share:.3f}", share, bar, dearer))
    return rows


def _means(runs: list[TreeRun]) -> list[float]:
    return [float(value) for value in np.array([astuple(run)[:4] for run in runs], dtype=float).mean(axis=0)]


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
        best = min(run.moves[TWICE] for run in runs)
        falling = moves[RAW] >= moves[ONCE] >= moves[TWICE]
        reading = SQUARES.format(case=case.upper(), optimum=optimum) + f"; best here {best}"
        bar = Bar((1.0, 50.0), held=within(1.35, 5.0), better=(1.0, 5.0 / 1.35), differs=(5.0 * 1.35, 10.0))
        rows.append(judged(f"case {case.upper()}: transitions, raw, pass 1, pass 2", "10 -> 6 -> 5 (one run)",
                           f"{_arrows(moves)} (mean)", moves[TWICE] if falling else np.nan, bar, reading))  # fmt: skip
    return rows


def subsea(quick: bool) -> list[Row]:
    """TITAN-4 and the subsea distribution unit."""
    runs = _runs("titan4_sdu", 20 if quick else 200)
    (moves, lengths), printed = _stages(runs), np.deg2rad(SDU_LIST)
    best = min(run.moves[TWICE] for run in runs)
    sixth = sum(6 in joints_of(run.routes[TWICE]) for run in runs if run.moves[TWICE] == best)
    shortest, length = min(run.lengths[TWICE] for run in runs), route_length(printed)
    return [
        judged("transitions, raw, pass 1, pass 2", "12 -> 9 -> 7 (one run)", f"{_arrows(moves)} (mean)", moves[TWICE],
               Bar((5.0, 50.0), held=(6.5, 7.5), better=(5.0, 6.5), differs=(7.5, 9.0)), SUBSEA),
        judged("fewest transitions of any run", "7", str(best), best,
               Bar((0.0, 50.0), held=(7.0, 7.0), better=(6.0, 6.0)), f"{SUBSEA}; fewer than 6 are proven impossible"),
        judged("length [rad], raw, pass 1, pass 2", "16.06 -> 7.53 -> 3.16", f"{_arrows(lengths)} (mean)",
               lengths[TWICE] if lengths[RAW] > lengths[ONCE] > lengths[TWICE] else np.nan,
               Bar((0.0, 100.0), held=within(1.35, 3.16), better=(0.5, 3.16 / 1.35), differs=(3.16 * 1.35, 7.53)),
               f"{SUBSEA}; one run was printed: the shortest of ours has {shortest:.2f}"),
        judged("theta6 in the best routes", "never moved", f"moved in {sixth} of them", sixth, exactly(0, len(runs))),
        *_printed(printed, 7, 5),
        judged("printed list: length", "3.16 rad", f"{length:.3f} rad", length, Bar((0.0, 100.0), about(3.16, 0.005))),
    ]  # fmt: skip


def _printed(route: np.ndarray, moves: int, distance: int) -> list[Row]:
    """Of a printed list: its moves, and the number of joints that differ between its ends."""
    found, c = transitions(route), lower_bound(route[0], route[-1])
    return [
        judged("printed list: transitions", str(moves), str(found), found, exactly(moves, 50)),
        judged("printed list: c, the joints that differ", str(distance), str(c), c, exactly(distance, 6)),
    ]


def prisms(quick: bool) -> list[Row]:
    """TITAN-4 and two prisms."""
    runs, printed = _runs("titan4_prisms", 20 if quick else 200), np.deg2rad(PRISM_LIST)
    optimal = [route for run in runs for route in run.routes[TWICE:] if transitions(route) == 3]
    families = Counter(joints_of(route) for route in optimal)
    share = 100.0 * families[3, 1, 3] / max(len(optimal), 1)
    twice = 100.0 * float(np.mean([run.moves[TWICE] == 3 for run in runs]))
    others = ", ".join(f"{'-'.join(map(str, joints))}: {number}" for joints, number in families.most_common())
    return [
        *_printed(printed, 3, 1),
        judged("fewest transitions of any run", "3", str(min(run.moves[TWICE] for run in runs)),
               min(run.moves[TWICE] for run in runs), exactly(3, 50), f"in {twice:.0f} % of the runs"),
        judged("theta3-theta1-theta3 among optimal routes", "95 %", f"{share:.0f} % of {len(optimal)}",
               share if optimal else np.nan, Bar((0.0, 100.0), held=(85.0, 100.0), differs=(30.0, 85.0)),
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
        judged("RRT-Connect: length", "3.00 rad (one run)",
               f"{np.median(ours):.2f} rad, from {min(ours):.2f} to {max(ours):.2f}", float(np.median(ours)),
               Bar((0.0, 100.0), held=within(1.5, 3.0), better=(0.52, 2.0), differs=(4.5, 9.0)),
               f"median of {len(ours)} plans after the sequential cut; prisms are proposals"),
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
