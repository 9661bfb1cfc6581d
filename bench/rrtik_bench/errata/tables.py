"""Errors of [1] and [2], what their printed statistics say of each other, and the GRIM test [54] of means of [3]."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

import rrtik_ompl as rrtik
from rrtik_bench import drrt_con, ikurt, titan4
from rrtik_bench.crdt.published import CRDT_TABLE, RRT_TABLE, SDU_LIST
from rrtik_bench.crdt.tables import COLUMNS
from rrtik_bench.errata.grim import consistent, off
from rrtik_bench.errata.prints import (
    by_arc_tangent,
    level_link_4,
    listed_routes,
    printed_pose,
    printed_routes,
    undefined,
)
from rrtik_bench.errata.statistics import left_out, points_of, welch
from rrtik_bench.genetic.published import POINTS, TABLE_4, TABLE_5
from rrtik_bench.genetic.runs import arm, run
from rrtik_bench.mb_rrt.runs import GOALS, NAMES, PRECISION, PUBLISHED
from rrtik_bench.report.rows import INFINITE, Bar, Row, Verdict, judged
from rrtik_bench.sensing.tables import deviations
from rrtik_bench.tables import Table
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.ik.genetic.options import STANDARD
from rrtik_ompl.model.robot import Robot

RUNS_OF_E = 1000  # of each planner in environment E, as printed
GA_LIMIT = 10_000  # generations, as printed
RIGHT_TO = 1e-9  # a formula that is right is so to this
DEVIATION = Bar((0.0, INFINITE), held=(0.0, RIGHT_TO), refuted=(1e-3, 1e6))
SHARE = Bar((0.0, 1.0), held=(1.0, 1.0), refuted=(0.0, 0.99))
COUNTED = Bar((0.0, 1e6), held=(0.0, 0.0), refuted=(1.0, 1e6))


def kinematics(quick: bool) -> list[Row]:
    """Formulas of chapter 3 and of appendices B and C."""
    robot, count = rrtik.load_robot("titan4"), 500 if quick else 20_000
    Q = np.random.default_rng(5).uniform(-np.pi, np.pi, (count, 6))
    return [
        *_chain(robot, Q),
        _arc_tangent(robot, Q),
        _gamma(Q),
        _joint_5(robot, Q),
        *_refuted(titan4.singularities(quick), "rank", "wrist singularity"),
    ]


def _chain(robot: Robot, Q: Matrix) -> list[Row]:
    """The table of appendix B beside the inverse kinematics, and the matrix that it expands to."""
    found = solutions(robot, printed_pose(Q))
    away = np.where(found.real[..., None], np.abs(wrapped(found.branches - Q[:, None])), np.inf)
    same = away[..., :5].max(axis=2).argmin(axis=1)  # the branch of the posture itself, by its first five joints
    roll = float(np.median(away[np.arange(len(Q)), same, 5]))
    right = np.abs(printed_pose(Q, roll=np.pi / 2) - robot.fk_batch(Q)).max()
    slips = printed_pose(Q, roll=np.pi / 2, slip=True)[:, :3, :3]
    turned = np.abs(np.swapaxes(slips, 1, 2) @ slips - np.eye(3)).max(axis=(1, 2))
    return [
        judged("theta6 of the printed table, through the printed inverse kinematics", "the same",
               f"{np.degrees(roll):.0f} deg off", roll if right < RIGHT_TO else np.nan, DEVIATION,
               f"with theta6 + 90 deg in row 6 they agree to {right:.0e}"),
        judged('"c6 = cos(theta5)" of appendix B.2', "a rotation", f"columns off by {np.median(turned):.2f}",
               float(np.median(turned)) if right < RIGHT_TO else np.nan, DEVIATION,
               f"with cos(theta6) all twelve terms are right to {right:.0e}"),
    ]  # fmt: skip


def _arc_tangent(robot: Robot, Q: Matrix) -> Row:
    """Appendix C takes theta2 by an arc tangent of one argument."""
    poses = robot.fk_batch(Q)
    found = solutions(robot, poses)
    rows, columns = np.nonzero(found.real)
    reached = robot.fk_batch(by_arc_tangent(found.branches[rows, columns]))
    share = float((np.abs(reached - poses[rows]).max(axis=(1, 2)) < RIGHT_TO).mean())
    worst = float(np.asarray(found.residuals)[found.real].max())
    return judged("branches that reach the pose with theta2 = atan(...)", "all", f"{share:.0%}",
                  share if worst < RIGHT_TO else np.nan, SHARE, f"with atan2 all, to {worst:.0e}")  # fmt: skip


def _gamma(Q: Matrix) -> Row:
    """(C.8), in the poses for which it is meant."""
    level = Q.copy()
    level[:, 3] = wrapped(-level[:, 1] - level[:, 2])
    reach = titan4.A1 + titan4.A2 * np.cos(Q[:, 1]) + titan4.A3 * np.cos(Q[:, 1] + Q[:, 2]) + titan4.A4
    level = level[reach > 0.0]
    share = {}
    for printed in (True, False):
        away = np.abs(wrapped(level_link_4(level, printed=printed) - level[:, None, 1:3])).max(axis=2).min(axis=1)
        share[printed] = float((away < 1e-6).mean())
    return judged("gamma of (C.8): poses whose posture is found, link 4 level", "all", f"{share[True]:.1%}",
                  share[True] if share[False] > 0.99 else np.nan, SHARE,
                  f"px c1 + py s1 - a1 - a4 in its place: {share[False]:.1%}; the print is for theta1 = 0")  # fmt: skip


def _joint_5(robot: Robot, Q: Matrix) -> Row:
    """The determinant is printed in the angle of the table, the limits and the text in the physical one."""
    upper, forearm, last = Q[:, 1], Q[:, 1] + Q[:, 2], Q[:, 1:4].sum(axis=1)
    radius = titan4.A1 + titan4.A2 * np.cos(upper) + titan4.A3 * np.cos(forearm) + titan4.A4 * np.cos(last)
    truth, rest = np.linalg.det(robot.jacobian_batch(Q)), titan4.A2 * titan4.A3 * radius * np.sin(Q[:, 2])
    straight = np.abs(np.abs(truth) - np.abs(rest * np.sin(Q[:, 4])))
    table = np.abs(np.abs(truth) - np.abs(rest * np.sin(Q[:, 4] + np.pi / 2))).max()
    return judged("determinant with theta5 as the text measures it", "sin(theta5)", f"off by {np.median(straight):.2f}",
                  float(np.median(straight)) if table < RIGHT_TO else np.nan, DEVIATION,
                  f"with theta5 + 90 deg, the angle of the table, right to {table:.0e}: two conventions are "
                  "mixed")  # fmt: skip


def _refuted(rows: Iterable[Row], *names: str) -> list[Row]:
    """Rows of other tables that show an error."""
    return [row for row in rows if row.name.startswith(names) and row.verdict is Verdict.REFUTED]


def planning(quick: bool) -> list[Row]:
    """Statements of chapters 5 and 6, and one of [2]."""
    wrong = [edges for edges in (1, 2, 3) if printed_routes(3, 1, edges) != listed_routes(3, 1, edges)]
    texts = [f"m = {m}: {printed_routes(3, 1, m)} printed, {listed_routes(3, 1, m)} listed" for m in (1, 2, 3)]
    moves = undefined(np.deg2rad(SDU_LIST))
    largest = RRT_TABLE[2][0]
    chance = 10.0 ** -(len(f"{largest:.0f}") - len(f"{largest:.0f}".rstrip("0")))
    return [
        judged("(6.1): edges for which the count of routes is wrong", "none", "; ".join(texts), len(wrong), COUNTED,
               "the edges of a route keep their order: a power in place of m!"),
        judged("(6.3): moves of the printed list, in radians, without a value", "none", f"{moves} of 7", moves, COUNTED,
               "a change of at most 1 is neither 0 nor greater than 1 nor less than -1"),
        judged("table 6.2: largest number of iterations", f"{largest:.0f}, with 100 % success",
               f"so round by chance: {chance:.1%}", chance, Bar((0.0, 1.0), held=(0.05, 1.0), differs=(1e-4, 0.05)),
               "points to a cap on the iterations, with which 100 % would not be known"),
        *_refuted(drrt_con.triangles(quick), "ticks with"),
        *_refuted(ikurt.solutions(quick), "solutions"),
        *([] if quick else [_gain()]),
    ]  # fmt: skip


def _gain() -> Row:
    """Extrapolation with a gain of 1, as printed, along a trajectory of the arm of five joints."""
    damped, printed = (run(arm(5), 1, replace(STANDARD, gain=gain), 0).completed for gain in (0.0, 1.0))
    return judged("[2]: points reached by five joints with the printed extrapolation", "100 %", f"{printed:.0f} %",
                  0.01 * printed if damped == 100.0 else np.nan, SHARE,
                  f"gain 1: nothing brakes what leaves the tip at rest; with gain 0 {damped:.0f} %")  # fmt: skip


def statistics(quick: bool) -> list[Row]:
    """What printed means, deviations and counts say of each other."""
    del quick
    return [*_differences(), *_refuted(deviations(), "test 2"), *_per_point()]


def _differences() -> list[Row]:
    """Tables 6.2 and 6.3, of which [1] says that nothing in them differs significantly."""
    rows = []
    for k, column in enumerate(COLUMNS):
        first, second = ((table[0][k], table[3][k]) for table in (RRT_TABLE, CRDT_TABLE))
        t, p = welch(first, second, RUNS_OF_E)
        together = min(len(COLUMNS) * p, 1.0)
        rows.append(
            judged(f"tables 6.2 and 6.3, {column}: means of RRT and C-RDT", "no significant difference",
                   f"{first[0]:g} and {second[0]:g}: t = {t:.1f}, p = {p:.1g}", together,
                   Bar((0.0, 1.0), held=(0.05, 1.0), refuted=(0.0, 0.05)),
                   f"Welch's test [82] of the printed means and deviations, {RUNS_OF_E} runs each; "
                   f"judged by {len(COLUMNS)} p, as there are so many columns")
        )  # fmt: skip
    return rows


def _per_point() -> list[Row]:
    """Generations a point of tables 4 and 5 of [2], which are generations over points if a trajectory is complete."""
    whole = [each[1] for each in TABLE_4.values()] + list(TABLE_5.values())
    cut_off = sum(generations // POINTS == per_point for generations, per_point in whole)
    rows = [
        judged("[2, tables 4, 5]: generations a point, trajectories that are complete", f"{len(whole)} quotients",
               f"{cut_off} of {len(whole)} are generations / {POINTS}, decimals cut off", cut_off,
               Bar((0.0, len(whole)), held=(len(whole), len(whole))))
    ]  # fmt: skip
    for number, ((share, per_point), _) in TABLE_4.items():
        (reached,) = points_of(share, POINTS)
        least, most = left_out(GA_LIMIT, reached, per_point)
        missing = least if least > 0 else min(most, 0)
        rows.append(
            judged(f"[2, table 4], trajectory {number} without reduction: generations a point", str(per_point),
                   f"{GA_LIMIT / reached:.1f} by {reached} points in {GA_LIMIT:,} generations", missing,
                   Bar((-1e4, 1e4), held=(0.0, 0.0), refuted=(-1e4, -1.0), differs=(1.0, 3.0 * per_point)),
                   f"no number of points gives {per_point}, rounded or cut off; it is right if {least} to {most} "
                   "generations for the point that was not reached are left out, which is not said")
        )  # fmt: skip
    return rows


def grim(quick: bool) -> list[Row]:
    """Whether each printed mean of whole numbers is possible for the number of goals that its share gives."""
    del quick
    rows = []
    for joints, table in ((3, 8), (10, 9)):
        for name, (share, mean, *_) in PUBLISHED[joints].items():
            rows.append(_mean(f"table {table}, {NAMES[name]}", mean, 4, share, GOALS[joints]))
    for joints, table, digits in ((3, 10, 4), (10, 11, 2)):
        for tolerance, (share, mean, *_) in PRECISION[joints].items():
            rows.append(_mean(f"table {table}, {tolerance:g} cm", mean, digits, share, GOALS[joints]))
    rows.append(_mean("table 6, Uniforme A", 2681.2731, 4, PUBLISHED[3]["uniform-a"][0], GOALS[3]))
    return rows


def _mean(name: str, mean: float, digits: int, share: float, goals: int) -> Row:
    count = round(0.01 * share * goals)
    others = consistent(mean, digits, goals)
    fits = "no number of goals" if not others else f"goals {_listed(others)}"
    return judged(f"{name}: mean {mean:.{digits}f}", f"over {count} goals ({share:g} % of {goals})",
                  f"{off(mean, digits, count):.1f} half units of the last digit from a fraction of {count}",
                  off(mean, digits, count), Bar((0.0, INFINITE), held=(0.0, 1.0), refuted=(1.0, 1e9)),
                  f"possible for {fits} up to {goals}")  # fmt: skip


def _listed(numbers: Sequence[int], most: int = 6) -> str:
    return ", ".join(map(str, numbers[:most])) + (", ..." if len(numbers) > most else "")


TABLES = (
    Table("errata-kinematics", "Errors of the sources: kinematics", "[1, ch. 3, app. B, C]", kinematics, 2, 1),
    Table("errata-planning", "Errors of the sources: planning", "[1, ch. 5, 6], [2]", planning, 12, 5),
    Table("errata-statistics", "Printed statistics beside each other", "[1, ch. 4, 6], [2]", statistics, 1, 1),
    Table("errata-grim", "GRIM test of printed means", "[3, tables 6 to 11], by [54]", grim, 1, 1),
)
