"""Proofs beside exact judges: paths in the plane, falsified certificates, free postures, singular poses.

An interrupted run goes on where it was.
"""

from __future__ import annotations

from typing import Annotated

from typer import Option

from bench.proofs.postures import Free, free_postures, singular_answers
from bench.proofs.report import ARMS, certificates, in_the_plane
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.machine import processes, processor
from rrtik_bench.report.page import Report
from rrtik_robots.titan4.singular_samples import CASES

BEFORE = {"shoulder wrist": "845 of 1000", "shoulder": "994 of 1000"}  # answered before limits cut the families
FREE = (
    "Postures drawn within the limits, those that are free, without obstacles. Kernels compare convex pieces, which "
    "stick out of meshes that are not convex; what they leave open of two links is compared by coal."
)
SINGULAR = (
    "Poses of postures of TITAN-4 inside its limits, drawn from each family of singular ones; `solve_ik` with its "
    "automatic choice. Answered: a posture inside the limits whose forward kinematics is the pose to within 1e-6."
)


def postures(report: Report, measure: Parts, count: int) -> None:
    """Free postures that are not proven."""
    found: list[Free] = measure(free_postures, [(arm, count) for arm in ARMS])
    rows = [
        [arm, f"{each.count}", f"{each.open_to_kernels}", _distances(each), f"{each.open}"]
        for arm, each in zip(ARMS, found, strict=True)
    ]
    heads = ["arm", "free postures", "left open by kernels", "their distances [mm]", "not proven"]
    report.table("Free postures", heads, rows, text=FREE)
    left, total = sum(each.open for each in found), sum(each.count for each in found)
    report.bar("free postures that are proven", ">= 99.9 %", f"{total - left} of {total}", left <= 1e-3 * total)


def _distances(free: Free) -> str:
    return f"{1e3 * free.nearest:.2f} to {1e3 * free.farthest:.2f}" if free.open_to_kernels else "-"


def singular(report: Report, measure: Parts, count: int) -> None:
    """Singular poses of TITAN-4."""
    found = measure(singular_answers, [(case, count) for case in CASES])
    rows = [
        [case, f"{answered} of {total}", BEFORE.get(case, "-")]
        for case, (total, answered) in zip(CASES, found, strict=True)
    ]
    report.table("TITAN-4: singular poses", ["family", "answered", "before"], rows, text=SINGULAR)
    missed = sum(total - answered for total, answered in found)
    text = f"{missed} missing of {sum(total for total, _ in found)}"
    report.bar("TITAN-4: singular poses of every family answered inside the limits", "all", text, missed == 0)


def main(
    run: Run,
    parts: Parts,
    *,
    plane: Annotated[int, Option(help="Arms in the plane whose paths are shortened.")] = 24,
    certified: Annotated[int, Option("--certificates", help="Paths whose certificates are falsified.")] = 200,
    drawn: Annotated[int, Option("--postures", help="Drawn of each arm.")] = 20_000,
    poses: Annotated[int, Option(help="Singular ones of each family.")] = 1000,
) -> Report:
    """Measure."""
    report = run.report("Proofs beside exact judges", f"{processes(run.jobs)}, {processor()}")
    postures(report, parts, drawn)
    singular(report, parts, poses)
    certificates(report, parts, certified)
    in_the_plane(report, parts, plane)
    return report
