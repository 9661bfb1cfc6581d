"""The speed row of trust: certificates of default paths, an independent judge of them, the same paths in threads."""

from __future__ import annotations

from collections.abc import Callable
from itertools import cycle, islice

import numpy as np

from bench.shared.judge import Contacts
from bench.shared.motion_bench_maker import problem_of, scene_files
from bench.speed.cases import Options
from bench.speed.lengths import STORED, processor_clocks
from bench.speed.whole import samples
from rrtik_bench.report.page import Report
from rrtik_ompl import Problem, load_problem, plan, plan_many
from rrtik_ompl.model.proof import certificate_by
from rrtik_ompl.world.certificate_check import certificate_fault

CERTIFICATES = 1000
JUDGED = 2000  # paths
THREADS = 4


def trusted(options: Options, report: Report) -> None:
    """Verify the certificates of default paths, let Pinocchio and coal judge them, and plan them in threads."""
    problems = _problems(options)
    certificates, judged = (10, 10) if options.quick else (CERTIFICATES, JUDGED)
    verified = touching = looked = unproven = 0
    judges = [Contacts(problem.world) for problem in problems]
    for number, problem in enumerate(islice(cycle(problems), judged)):
        with processor_clocks():
            found = plan(problem, seed=options.seed + number)
        path = found.path
        unproven += found.proven is not True
        if path is None:
            continue
        if number < certificates and path.proof is not None:
            certificate = certificate_by(path.proof, path.waypoints)
            fault = certificate_fault(certificate, problem.world, path.waypoints, clearance=path.proof.clearance)
            verified += not fault
        rows = samples(path.waypoints)
        touching += sum(any(True for _ in judges[number % len(problems)].depths(q)) for q in rows)
        looked += len(rows)

    with processor_clocks():
        alone = plan_many(problems, seed=options.seed, threads=1)
        together = plan_many(problems, seed=options.seed, threads=THREADS)
    same = sum(
        one.path is not None and other.path is not None and np.array_equal(one.path.waypoints, other.path.waypoints)
        for one, other in zip(alone, together, strict=True)
    )
    rows_of_bars = (
        (f"certificates of {certificates} default paths verify", certificates, verified),
        (f"configurations of {judged} default paths that touch, by Pinocchio and coal, of {looked}", 0, touching),
        (f"default plans without a proven path, of {judged}", 0, unproven),
        (f"paths that are the same in one thread and in {THREADS}", len(problems), same),
    )
    for what, wanted, measured in rows_of_bars:
        report.bar(what, str(wanted), str(measured), measured == wanted)


def _problems(options: Options) -> list[Problem]:
    """The Panda's and the UR5's problems where their sets are there, and shipped ones."""
    shipped = [load_problem(name) for name in STORED]
    if options.folder is None:
        return shipped
    files = [file for arm in ("panda", "ur5") for file in scene_files(options.folder, arm, options.problems)]
    found = (problem_of(file, balls=False) for file in files)
    return [*shipped, *(problem for problem in found if problem is not None)]


ROWS: dict[str, Callable[[Options, Report], None]] = {"trust": trusted}
