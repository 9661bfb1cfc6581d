"""The tables and lists of [1, ch. 6.3]."""

from __future__ import annotations

from collections import Counter
from dataclasses import astuple

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench.crdt.baseline import TreeRun, crdt_run, rrt_run
from rrtik_bench.crdt.published import CRDT_TABLE, PRISM_LIST, RRT_TABLE, SDU_LIST
from rrtik_bench.crdt.runs import RouteRun, joints_of, route_run
from rrtik_bench.report.rows import Row, verdict, within
from rrtik_bench.tables import Table
from rrtik_ompl.transitions import lower_bound, route_length, routes, transitions

SOURCE = "[1, ch. 6.3]"
COLUMNS = ("iterations", "vertices", "collision checks", "time [s]")
LOST = "the drawing is lost: environment E is a reconstruction; a check is a point test every 0.2 along an edge"
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
        rows.append(Row(f"{name}: success", "100 %", f"{found} of {count}", verdict(found == count), ""))
        for k, column in enumerate(COLUMNS):
            ours, theirs = means[name][k], printed[name][k]
            close = ours < theirs if column == "time [s]" else within(1.5, ours, theirs)
            rows.append(Row(f"{name}: mean {column}", f"{theirs:g}", f"{ours:.4g}", verdict(close, True), LOST))
    for k, (low, high) in ((0, (0.25, 0.60)), (2, (0.7, 1.4))):
        share, theirs = means["C-RDT"][k] / means["RRT"][k], printed["C-RDT"][k] / printed["RRT"][k]
        row = f"mean {COLUMNS[k]}, C-RDT over RRT"
        rows.append(Row(row, f"{theirs:.3f}", f"{share:.3f}", verdict(low <= share <= high), f"bar {low} to {high}"))
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
        close = falling and within(1.35, moves[TWICE], 5.0)
        rows.append(Row(f"case {case.upper()}: transitions, raw, pass 1, pass 2", "10 -> 6 -> 5 (one run)",
                        f"{_arrows(moves)} (mean)", verdict(close, falling), reading))  # fmt: skip
    return rows


def subsea(quick: bool) -> list[Row]:
    """TITAN-4 and the subsea distribution unit."""
    runs = _runs("titan4_sdu", 20 if quick else 200)
    (moves, lengths), printed = _stages(runs), np.deg2rad(SDU_LIST)
    best = min(run.moves[TWICE] for run in runs)
    sixth = sum(6 in joints_of(run.routes[TWICE]) for run in runs if run.moves[TWICE] == best)
    c, length = lower_bound(printed[0], printed[-1]), route_length(printed)
    return [
        Row("transitions, raw, pass 1, pass 2", "12 -> 9 -> 7 (one run)", f"{_arrows(moves)} (mean), best {best}",
            verdict(moves[TWICE] <= 7.5, moves[TWICE] <= 9.0), SUBSEA),
        Row("length [rad], raw, pass 1, pass 2", "16.06 -> 7.53 -> 3.16", f"{_arrows(lengths)} (mean)",
            verdict(within(1.35, lengths[TWICE], 3.16), lengths[RAW] > lengths[ONCE] > lengths[TWICE]),
            SUBSEA + "; the printed run is a good one: its structure is not known"),
        Row("theta6 in the best routes", "never moved", f"moved in {sixth} of them", verdict(sixth == 0)),
        Row("printed list: transitions, c", "7, 5", f"{transitions(printed)}, {c}",
            verdict((transitions(printed), c) == (7, 5))),
        Row("printed list: length", "3.16 rad", f"{length:.3f} rad", verdict(abs(length - 3.16) < 0.005)),
    ]  # fmt: skip


def prisms(quick: bool) -> list[Row]:
    """TITAN-4 and two prisms."""
    runs, printed = _runs("titan4_prisms", 20 if quick else 200), np.deg2rad(PRISM_LIST)
    optimal = [route for run in runs for route in run.routes[TWICE:] if transitions(route) == 3]
    families = Counter(joints_of(route) for route in optimal)
    share = 100.0 * families[3, 1, 3] / max(len(optimal), 1)
    c = lower_bound(printed[0], printed[-1])
    twice = 100.0 * float(np.mean([run.moves[TWICE] == 3 for run in runs]))
    return [
        Row("printed list: transitions, c", "3, 1", f"{transitions(printed)}, {c}",
            verdict((transitions(printed), c) == (3, 1))),
        Row("runs that end at the optimum", "not given", f"{twice:.0f} % after the double pass", verdict(twice >= 10.0),
            "prisms are proposals; the printed 100 runs were chosen among those that ended optimal"),
        Row("theta3-theta1-theta3 among optimal routes", "95 %", f"{share:.0f} % of {len(optimal)}",
            verdict(share >= 85.0, share > 30.0), "depends on the height of the prisms, which is not known"),
    ]  # fmt: skip


def counts(quick: bool) -> list[Row]:
    """How many single-joint routes there are."""
    del quick
    found = routes(3, 1), routes(3, 2)
    reading = "one edge (m = 1); for more the printed factor m! would count the orders of edges, which are fixed"
    return [Row("Routes(3, 1), Routes(3, 2)", "6, 90", f"{found[0]}, {found[1]}", verdict(found == (6, 90)), reading)]


TABLES = (
    Table("crdt-routes", "Number of single-joint routes", f"{SOURCE}, count of routes", counts, 1, 1),
    Table("crdt-e", "Environment E: RRT and C-RDT", f"{SOURCE}, two tables of test E", environment_e, 65, 8),
    Table("crdt-planar", "Planar arm, two squares", f"{SOURCE}, planar test", planar, 7, 1),
    Table("crdt-sdu", "TITAN-4 at the subsea unit", f"{SOURCE}, SDU test", subsea, 11, 3),
    Table("crdt-prisms", "TITAN-4 and two prisms", f"{SOURCE}, prism test", prisms, 6, 2),
)
