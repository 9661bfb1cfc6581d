"""The speed page: our figures beside the peers', all measured in one run on this machine.

    python bench/speed/report.py [FOLDER] [--quick] [--only ROW ...] [--problems N] [--seed S] [--out FILE]

FOLDER is the unpacked MotionBenchMaker set of the Panda (``panda.urdf``, ``panda_spherized.urdf``, ``panda.srdf``,
``problems/``); rows that need it say so where it is not given. Peers that are not installed are left out, and the rows
say so (``pip install rrtik-ompl[peers]``).

Times are CPU time of this process unless a table says otherwise, for machines are shared; the candidates take turns,
problem by problem. Exit code 0 if every bar is held, else 1.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ompl import util as ou

from bench.shared.pages import add_out
from bench.speed.cases import Options
from bench.speed.checks import free_motions, near_obstacles
from bench.speed.machine import machine
from bench.speed.planning import callbacks, exact, ompl_layer, spheres, titan
from bench.speed.process import memory, starts
from rrtik_bench.report.page import Report

ROWS = {
    "spheres": spheres,
    "exact": exact,
    "callbacks": callbacks,
    "free-motions": free_motions,
    "near-obstacles": near_obstacles,
    "ompl-layer": ompl_layer,
    "titan4": titan,
    "starts": starts,
    "memory": memory,
}


def main() -> int:
    """Measure the rows asked for, print the page and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="the unpacked Panda set, for instance mbm_panda")
    parser.add_argument("--quick", action="store_true", help="a fraction of the work")
    parser.add_argument("--only", choices=ROWS, action="append", help="this row; may be repeated")
    parser.add_argument("--problems", type=int, default=100, help="problems of each family")
    parser.add_argument("--peer-problems", type=int, default=3, help="of each family for the slow peers")
    parser.add_argument("--plans", type=int, default=2000, help="over which the memory is watched")
    parser.add_argument("--seed", type=int, default=1)
    add_out(parser, "speed.md")
    given = parser.parse_args()
    most = 1 if given.quick else given.problems
    slow = min(most, given.peer_problems)
    options = Options(given.folder, most, slow, given.seed, given.quick, given.plans)
    ou.setLogLevel(ou.LogLevel.LOG_ERROR)
    report = Report("Speed", "python bench/speed/report.py FOLDER")
    report.note("Machine", machine())
    work = f"At most {most} problems of each family, {slow} for the slow peers; {given.plans} plans; seed {given.seed}."
    report.note("Work", work + (" Quick: a fraction of the configurations and plans." if given.quick else ""))
    for name in given.only or ROWS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        ROWS[name](options, report)
        report.save(given.out)  # after every row: a run that is cut short leaves what it has measured
    return report.finish(given.out)


if __name__ == "__main__":
    raise SystemExit(main())
