"""The speed page: our figures beside the peers', all measured in one run on this machine.

Rows that need MotionBenchMaker's problems say so where their folder is not given. It holds ``mbm_panda``, ``mbm_ur5``
and ``mbm_fetch``: the folders ``panda``, ``ur5`` and ``fetch`` of the resources of KavrakiLab/vamp, with their problems
unpacked. An arm whose set is not there is left out. Peers that are not installed are left out, and the rows say so
(``pip install rrtik-ompl[peers]``).

Times are CPU time of this process unless a table says otherwise, for machines are shared; the candidates take turns,
problem by problem.
"""

from __future__ import annotations

import sys
from typing import Annotated

from ompl import util as ou
from typer import Option

from bench.shared.run import Run, SetsOrNone
from bench.speed import goals, lengths, trust
from bench.speed.cases import Options
from bench.speed.checks import free_motions, near_obstacles
from bench.speed.machine import machine
from bench.speed.planning import exact, ompl_layer, spheres
from bench.speed.whole import whole_plans
from rrtik_bench.report.page import Report
from rrtik_ompl.base.choices import one_of

ROWS = {
    "whole": whole_plans,
    "spheres": spheres,
    "exact": exact,
    "free-motions": free_motions,
    "near-obstacles": near_obstacles,
    "ompl-layer": ompl_layer,
    **lengths.ROWS,
    **goals.ROWS,
    **trust.ROWS,
}


def main(
    run: Run,
    folder: SetsOrNone = None,
    *,
    quick: Annotated[bool, Option(help="A fraction of the work.")] = False,
    only: Annotated[list[str] | None, Option(help="This row; may be repeated.")] = None,
    problems: Annotated[int, Option(help="Problems of each family.")] = 50,
    peer_problems: Annotated[int, Option(help="Of each family, to see what OMPL costs.")] = 3,
    seed: int = 1,
) -> Report:
    """Measure the rows asked for."""
    wanted = [one_of(ROWS, name, "row") for name in only or ROWS]
    most = 1 if quick else problems
    slow = min(most, peer_problems)
    options = Options(folder, most, slow, seed, quick)
    ou.setLogLevel(ou.LogLevel.LOG_ERROR)

    report = run.report("Speed")
    report.note("Machine", machine())
    work = f"At most {most} problems of each family, {slow} to see what OMPL costs; seed {seed}."
    report.note("Work", work + (" Quick: a fraction of the configurations." if quick else ""))
    for name in wanted:
        print(f"{name} ...", file=sys.stderr, flush=True)
        ROWS[name](options, report)
        report.save(run.out)  # after every row: a run that is cut short leaves what it has measured
    return report
