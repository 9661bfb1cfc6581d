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
import os
import platform
import sys
from pathlib import Path

from ompl import util as ou

from bench.speed.cases import Options
from bench.speed.checks import free_motions, near_obstacles
from bench.speed.ours import PLANNER
from bench.speed.planning import callbacks, exact, ompl_layer, spheres, titan
from bench.speed.process import memory, starts
from rrtik_bench.report.page import Report, package_version
from rrtik_ompl.fast.library import library
from rrtik_ompl.fast.processor import WIDTH

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
PACKAGES = ("rrtik-ompl", "numba", "llvmlite", "numpy", "ompl", "pin", "coal", "roboplan", "vamp-planner")


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
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "reports" / "speed.md")
    given = parser.parse_args()
    most = 1 if given.quick else given.problems
    slow = min(most, given.peer_problems)
    options = Options(given.folder, most, slow, given.seed, given.quick, given.plans)
    ou.setLogLevel(ou.LogLevel.LOG_ERROR)
    report = Report("Speed", "python bench/speed/report.py FOLDER")
    report.note("Machine", machine())
    work = f"At most {most} problems of each family, {slow} for the slow peers; {given.plans} plans; seed {given.seed}."
    report.note("Work", work + (" Quick: a fraction of the configurations and plans." if given.quick else ""))
    given.out.parent.mkdir(parents=True, exist_ok=True)
    for name in given.only or ROWS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        ROWS[name](options, report)
        given.out.write_text(report.markdown())  # after every row: a run that is cut short leaves what it has measured
    print(report.markdown())
    return 0 if all(bar[3] for bar in report.bars) else 1


def machine() -> str:
    """Processor, width of the kernels, versions, the planner that was measured."""
    packages = ", ".join(package_version(name) for name in PACKAGES)
    about = f"{processor()}, {os.cpu_count()} cores; Python {platform.python_version()}; {packages}."
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())  # what else ran shows in wall times
    about += f" Load at the start (1, 5, 15 minutes): {load}."
    return f"{about}\n\nOur planner: `{PLANNER}`. Kernels: {lanes()}. CPU time of the process unless said otherwise."


def processor() -> str:
    """The processor's name as the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def lanes() -> str:
    """Width of the kernels on this machine."""
    return "none, plain numpy" if library("kernels") is None else f"{WIDTH} lanes"


if __name__ == "__main__":
    raise SystemExit(main())
