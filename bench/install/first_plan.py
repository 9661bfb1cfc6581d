"""What the first plan of a process costs beyond the import of numpy, Pinocchio, coal and OMPL, with caches filled.

Processes are compared in pairs, one after the other: one that only imports, one that imports and plans. Times are
processor times. Another checkout (``--beside``) is measured in the same rounds.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Annotated

from typer import Option

ROOT = Path(__file__).resolve().parents[2]
BARES = {
    "numpy, Pinocchio, coal and OMPL": "import numpy, pinocchio, coal, ompl.base, ompl.geometric",
    "numpy, Pinocchio and coal": "import numpy, pinocchio, coal",
}
FROM_FILE = "; import rrtik_ompl as r; plan = r.plan(r.load_problem('{}')); assert plan.proven"
BY_HAND = """
import rrtik_ompl as r
robot = r.load_robot("panda")
post = r.Obstacle("post", r.Box(0.1, 0.1, 1.0), [0.45, 0.3, 0.5])
goal = r.PositionGoal([0.3, 0.5, 0.4], tolerance=0.005)
plan = r.plan(r.Problem(r.World(robot, r.Scene([post])), robot.posture("default"), goal))
assert plan.proven
"""
WORK = {
    "panda_shelf": FROM_FILE.format("panda_shelf"),
    "ur5_table": FROM_FILE.format("ur5_table"),
    "a Panda by hand": BY_HAND,
}
# The peak is that of the process alone: ru_maxrss would be that of the process it came from, if that was larger.
MEASURE = """
import os, resource
used = resource.getrusage(resource.RUSAGE_SELF)
held = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(1e3 * (used.ru_utime + used.ru_stime), int(held) / 1024)
"""


def main(
    beside: Annotated[list[Path] | None, Option(help="Other checkouts.")] = None,
    rounds: Annotated[int, Option(help="Pairs of each kind.")] = 15,
) -> None:
    """Print the medians."""
    found: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    for turn in range(rounds + 1):
        for row, *numbers in one_round([ROOT, *(beside or [])]):
            if turn > 0:  # the first round fills the caches
                found.setdefault(row, []).append((numbers[0], numbers[1]))

    print(f"{'checkout':24}{'plan':20}{'beyond':36}{'ms':>8}{'least':>8}{'peak MB':>9}")
    for (checkout, name, bare), pairs in found.items():
        spent = [time for time, _ in pairs]
        held = median(memory for _, memory in pairs)
        print(f"{checkout:24}{name:20}{bare:36}{median(spent):8.0f}{min(spent):8.0f}{held:9.0f}")


def one_round(checkouts: list[Path]) -> Iterator[tuple[tuple[str, str, str], float, float]]:
    """Yield checkout, plan and import; the processor time that the plan takes beyond the import [ms]; its peak [MB]."""
    for bare, line in BARES.items():
        alone, held = measured(ROOT, line)
        yield ("", "", bare), alone, held
        for checkout in checkouts:
            for name, work in WORK.items():
                spent, held = measured(checkout, line + work)
                yield (checkout.name, name, bare), spent - alone, held


def measured(checkout: Path, code: str) -> tuple[float, float]:
    """Processor time [ms] and peak of memory [MB] of a process that runs code of a checkout."""
    path = os.pathsep.join(str(checkout / folder) for folder in ("", "planners", "robots"))
    environment = {**os.environ, "PYTHONPATH": path}
    command = [sys.executable, "-W", "ignore", "-c", code + MEASURE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, cwd="/")
    time, memory = done.stdout.split()[-2:]
    return float(time), float(memory)
