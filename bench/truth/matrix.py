"""Every kind of shape by every way to an answer, on random postures and motions, against a fresh `World`."""

from __future__ import annotations

import numpy as np

from bench.shared.parts import Parts
from bench.truth.matrix_cells import WAYS, Case, Judged, draw, judged, movable, without_row
from bench.truth.shape_kinds import kinds, without_maker
from rrtik_bench.report.page import Report
from rrtik_ompl import load_robot

ROBOTS = ("ur5", "titan4", "panda_primitives", "planar6")
ROUNDS = 10  # of each kind and robot, at full size
POSTURES, MOTIONS = 120, 24


def cells(robot: str, kind: str, held: bool, seed: int) -> list[Judged]:
    """One case of a kind of shape, by each of the ways in turn."""
    rng = np.random.default_rng([seed, list(kinds()).index(kind), held])
    case = draw(kind, held, load_robot(robot), rng, POSTURES, MOTIONS)
    return [_cell(way, case) for way in WAYS]


def _cell(way: str, case: Case) -> Judged:
    """A cell; what is no refusal, and yet raised, is wrong."""
    try:
        return judged(way, case)
    except Exception as error:
        return Judged(wrong=1, fault=f"{type(error).__name__}: {error}"[:200])


def rows() -> list[tuple[str, bool]]:
    """Kinds of shapes, and whether a link holds them."""
    return [(kind, held) for kind in kinds() for held in (False, True) if not held or movable(kind)]


def section(parts: Parts, size: float) -> Report:
    """The matrix."""
    report = Report("Shapes and ways", "")
    rounds = max(round(size * ROUNDS), 1)
    robots = ROBOTS if size >= 0.1 else ROBOTS[:1]
    work = [(robot, *row, seed) for row in rows() for robot in robots for seed in range(rounds)]
    found = dict(zip(work, parts(cells, work), strict=True))
    faults = [
        f"- {robot}, {'held ' * held}{kind}, draw {seed}, {way}: {each.fault}"
        for (robot, kind, held, seed), row in found.items()
        for way, each in zip(WAYS, row, strict=True)
        if each.wrong
    ]
    table, whole = [], Judged()
    for kind, held in rows():
        mine = [row for (_, name, by_link, _), row in found.items() if (name, by_link) == (kind, held)]
        sums = [sum((row[k] for row in mine), Judged()) for k in range(len(WAYS))]
        whole = sum(sums, whole)
        shown = [f"{each.right}" + f", {each.wrong} WRONG" * (each.wrong > 0) for each in sums]
        table.append([f"{'held ' * held}{kind}", *shown])
    count = f"{whole.right:,} right, {whole.refused:,} refused or on the safe side, {whole.wrong:,} wrong"
    report.bar(f"{len(table)} kinds of solids by {len(WAYS)} ways to an answer", "0 wrong", count, whole.wrong == 0)
    empty = [way for k, way in enumerate(WAYS) if not any(row[k].right for row in found.values())]
    report.bar("ways that give no answer", "0", ", ".join(empty) or "0", not empty)
    missing = [*without_maker(), *without_row()]
    report.bar("shapes and ways of the library that are not in it", "0", str(len(missing)), not missing)
    text = (
        "Answers that are those of a fresh world. On the safe side: refused by a way that takes only what it can prove."
    )
    report.table("Shapes and ways", ["solid", *WAYS], table, text="\n".join([text, "", *faults[:40], *missing]))
    return report
