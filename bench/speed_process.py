"""Speed rows about whole processes: cold and warm start of `rrtik plan`, import, memory over many plans."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from acceptance import Report
from speed_cases import Options
from speed_ours import PLANNER

PROBLEM = "titan4_sdu"
WARM_RUNS = 5
LOOKS = 10
MEGABYTE = 1e6
FLAT = 2.0  # [MB] of growth over the second half that still counts as none
MODULES = ("rrtik_ompl", "rrtik_ompl.planning")
CACHES = {"XDG_CACHE_HOME": "cache", "NUMBA_CACHE_DIR": "numba", "RRTIK_CACHE": "rrtik"}
PLAN = "from rrtik_ompl.command import main; main()"
IMPORT = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"


def starts(options: Options, report: Report) -> None:
    """Row 10: from nothing to a printed plan in a new process, with empty and with filled caches; wall time."""
    rows = []
    with TemporaryDirectory() as folder:
        places = {name: str(Path(folder) / place) for name, place in CACHES.items()}
        times = [
            _seconds([PLAN, "plan", PROBLEM, "--planner", PLANNER, "--seed", "1"], places) for _ in range(WARM_RUNS + 1)
        ]
        cold, warm = times[0], min(times[1:])
        rows += [[f"`rrtik plan {PROBLEM}`, empty caches", f"{cold:.2f}"], ["the same again", f"{warm:.2f}"]]
        imports = {
            name: min(float(_output([IMPORT.format(name)], places)) for _ in range(WARM_RUNS)) for name in MODULES
        }
    rows += [[f"`import {name}`", f"{seconds:.3f}"] for name, seconds in imports.items()]
    report.table("10. Start of a process", ["", "wall time [s]"], rows)
    report.bar("cold start of `rrtik plan`", "20 s (aim 2 s)", f"{cold:.2f} s", cold <= 20.0)
    report.bar("warm start of `rrtik plan`", "1.0 s (aim 0.5 s)", f"{warm:.2f} s", warm <= 1.0)
    report.bar("`import rrtik_ompl`", "0.5 s", f"{imports['rrtik_ompl']:.3f} s", imports["rrtik_ompl"] <= 0.5)


def memory(options: Options, report: Report) -> None:
    """Row 11: resident memory of a process of its own over many plans."""
    plans = 50 if options.quick else options.plans
    lines = _output([str(Path(__file__)), str(plans), str(options.seed)], {}, script=True).split()
    sizes = [float(value) for value in lines]
    numbers = [str(plans * (k + 1) // LOOKS) for k in range(LOOKS)]
    report.table(
        f"11. Memory over {plans} plans of `{PROBLEM}`",
        ["plans", *numbers],
        [["resident [MB]", *(f"{size:.1f}" for size in sizes)]],
    )
    growth = sizes[-1] - sizes[LOOKS // 2 - 1]
    text = f"{sizes[-1]:.0f} MB, {growth:+.1f} MB over the second half"
    report.bar(f"memory after {plans} plans", "flat over 100,000 (aim below 300 MB)", text, growth <= FLAT)


def _seconds(arguments: list[str], places: dict[str, str]) -> float:
    begin = time.perf_counter()
    _output(arguments, places)
    return time.perf_counter() - begin


def _output(arguments: list[str], places: dict[str, str], *, script: bool = False) -> str:
    """What a new interpreter prints; its caches are at ``places``."""
    command = [sys.executable, *([] if script else ["-c"]), *arguments]
    done = subprocess.run(command, env={**os.environ, **places}, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout


def _resident() -> float:
    """Resident memory of this process [MB]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return float(line.split()[1]) * 1024.0 / MEGABYTE
    raise RuntimeError("this system does not tell the memory of a process")


def _plan_and_look(plans: int, seed: int) -> None:
    """Plan so many times; print the resident memory after every tenth of them."""
    from rrtik_ompl import load_problem, plan

    problem = load_problem(PROBLEM)
    looks = {plans * (k + 1) // LOOKS for k in range(LOOKS)}
    for number in range(1, plans + 1):
        plan(problem, PLANNER, seed=seed + number)
        if number in looks:
            print(f"{_resident():.3f}")


if __name__ == "__main__":
    _plan_and_look(int(sys.argv[1]), int(sys.argv[2]))
