"""Speed rows about whole processes: cold and warm start of `rrtik plan`, import, memory over many plans."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import rrtik_ompl
from bench.speed.cases import Options
from bench.speed.ours import PLANNER
from rrtik_bench.report.page import Report
from rrtik_ompl.cli.app import FOUND, NOT_FOUND

PROBLEM = "titan4_sdu"
WARM_RUNS = 5
LOOKS = 10
MEGABYTE = 1e6
FLAT = 2.0  # [MB] of growth over the second half that still counts as none
MODULES = ("rrtik_ompl", "rrtik_ompl.planning.plan")
CACHES = {"XDG_CACHE_HOME": "cache", "NUMBA_CACHE_DIR": "numba", "RRTIK_CACHE": "rrtik"}
PLAN = "from rrtik_ompl.cli.entry import main; main()"
SOURCE = "import pathlib, rrtik_ompl; print(pathlib.Path(rrtik_ompl.__file__).resolve())"
IMPORT = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"


def starts(options: Options, report: Report) -> None:
    """From nothing to a printed plan in a new process, with empty and with filled caches; wall time."""
    with TemporaryDirectory() as folder:
        places = {name: str(Path(folder) / place) for name, place in CACHES.items()}
        same_source(places)
        command = [PLAN, "plan", PROBLEM, "--planner", PLANNER, "--seed", "1"]
        cold, cold_cpu, found = _plan_seconds(command, places)
        made = sum(1 for _ in (Path(folder) / CACHES["RRTIK_CACHE"] / "kernels").glob("*.code"))
        runs = [_plan_seconds(command, places) for _ in range(WARM_RUNS)]
        imports = {name: _import_seconds(name, places) for name in MODULES}
    warm, warm_cpu = (min(run[k] for run in runs) for k in (0, 1))
    all_found = all(run[2] for run in runs)
    rows = [
        [
            f"`rrtik plan {PROBLEM}`, empty caches ({made} libraries of kernels made)",
            f"{cold:.2f}",
            f"{cold_cpu:.2f}",
            _word(found),
        ]
    ]
    rows += [["the same again, best of a few", f"{warm:.2f}", f"{warm_cpu:.2f}", _word(all_found)]]
    rows += [[f"`import {name}`", f"{seconds:.3f}", "", ""] for name, seconds in imports.items()]
    report.table("10. Start of a process", ["", "wall time [s]", "CPU time [s]", "path found"], rows)
    held = cold <= 20.0 and found and made > 0  # one that made nothing was not a cold start of the kernels
    report.bar("cold start of `rrtik plan`", "20 s (aim 2 s)", f"{cold:.2f} s, path found: {_word(found)}", held)
    report.bar("warm start of `rrtik plan`", "1.0 s (aim 0.5 s)", f"{warm:.2f} s", warm <= 1.0 and all_found)
    report.bar("`import rrtik_ompl`", "0.5 s", f"{imports['rrtik_ompl']:.3f} s", imports["rrtik_ompl"] <= 0.5)


def same_source(places: dict[str, str]) -> None:
    """Make sure that new interpreters run the package that this one runs.

    Raises:
        RuntimeError: If they find another copy of it.
    """
    here, there = str(Path(rrtik_ompl.__file__).resolve()), _output(["-c", SOURCE], places).strip()
    if here != there:
        raise RuntimeError(f"a new process imports {there}, not {here}; make PYTHONPATH absolute, or install one copy")


def memory(options: Options, report: Report) -> None:
    """Resident memory of a process of its own over many plans."""
    plans = 50 if options.quick else options.plans
    same_source({})
    lines = _output([str(Path(__file__).resolve()), str(plans), str(options.seed)], {}).split()
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


def _import_seconds(module: str, places: dict[str, str]) -> float:
    return min(float(_output(["-c", IMPORT.format(module)], places)) for _ in range(WARM_RUNS))


def _plan_seconds(arguments: list[str], places: dict[str, str]) -> tuple[float, float, bool]:
    """Wall time and CPU time of a process that plans, and whether it found a path."""
    begin, used = time.perf_counter(), _children_seconds()
    done = _run(["-c", *arguments], places)
    seconds, used = time.perf_counter() - begin, _children_seconds() - used
    if done.returncode not in (FOUND, NOT_FOUND):
        raise RuntimeError(f"`rrtik plan` ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return seconds, used, done.returncode == FOUND


def _children_seconds() -> float:
    """CPU time of all processes that this one has started and seen end [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _word(good: bool) -> str:
    return "yes" if good else "**no**"


def _output(arguments: list[str], places: dict[str, str]) -> str:
    """What a new interpreter prints."""
    done = _run(arguments, places)
    if done.returncode:
        raise RuntimeError(f"{' '.join(arguments)} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout


def _run(arguments: list[str], places: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run a new interpreter to its end; its caches are at ``places``.

    It starts in an empty folder, for ``python -c`` looks for packages in the working directory before anywhere else.
    """
    command, environment = [sys.executable, *arguments], {**os.environ, **places}
    with TemporaryDirectory() as folder:
        return subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=False)


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
