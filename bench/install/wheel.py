"""What the built wheel holds, how long its installation takes, and what importing it costs. For Linux.

Without a wheel it makes one with all kernels, some minutes. The installation goes to a fresh environment, from pip's
own cache: run it twice, and the second run is what the page should tell of.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated
from zipfile import ZipFile

from typer import Option

from bench.shared.clocks import of_children
from bench.shared.run import Run
from rrtik_bench.report.machine import versions
from rrtik_bench.report.page import Report

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 5
COMPILED = {".so", ".o", ".a", ".dylib", ".pyd", ".nbc", ".nbi"}
STRAY = {"tests", "__pycache__", ".pytest_cache", ".mypy_cache", ".ruff_cache", ".hypothesis"}
IMPORTS = {
    "`rrtik_ompl`": "import rrtik_ompl",
    "what `plan()` needs": "import rrtik_ompl as r; (r.plan, r.Problem, r.World, r.load_robot)",
    "and problem files": "import rrtik_ompl as r; (r.plan, r.Problem, r.World, r.load_robot, r.load_problem)",
    "and a plan, whose kernels are there": "import rrtik_ompl as r; r.plan(r.load_problem('ur5_table'), seed=1)",
    "pinocchio, coal and OMPL alone": "import pinocchio, coal, ompl.base",
}
# the peak of the process alone: ru_maxrss would be that of the process it came from, if that was larger
MEASURE = (
    "; import resource as _r; _u = _r.getrusage(_r.RUSAGE_SELF)"
    "; _m = [line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')]"
    "; print(_u.ru_utime + _u.ru_stime, int(_m[0]) / 1024)"
)
FIRST_COMMAND = (
    "plan",
    "titan4_sdu",
    "--seed",
    "1",
    "--out",
    "titan4_sdu.json",
    "--html",
    "titan4_sdu.html",
)  # of README


def main(
    run: Run, *, built_wheel: Annotated[Path | None, Option("--wheel", help="One that was built already.")] = None
) -> Report:
    """Measure."""
    report = run.report("The wheel")
    report.intro = (
        f"{versions('numpy', 'llvmlite')}. Times are processor times of all processes together; imports the least of "
        f"{ROUNDS}, memory the most that the process held."
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel = built_wheel or built(folder)
        contents(report, wheel)
        python = installed(report, wheel, folder / "fresh")
        imports(report, python)
        first_command(report, python, folder)
    return report


def built(folder: Path) -> Path:
    """Make the wheel of this checkout with its kernels."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-deps"]
    run([*command, "--wheel-dir", str(folder), str(ROOT)], RRTIK_KERNELS="1")
    (wheel,) = folder.glob("rrtik_ompl-*.whl")
    return wheel


def contents(report: Report, wheel: Path) -> None:
    """What is in it, by kind."""
    with ZipFile(wheel) as archive:
        members = [item for item in archive.infolist() if not item.is_dir()]
    sizes: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    for item in members:
        kind = Path(item.filename).suffix or "none"
        sizes[kind] += item.compress_size
        counts[kind] += 1
    rows = [[kind, str(counts[kind]), f"{size / 1e6:.2f}"] for kind, size in sizes.most_common(12)]
    universal = wheel.name.endswith("py3-none-any.whl")
    report.bar("one wheel for all machines", "py3-none-any", wheel.name, universal)
    compiled = sum(counts[kind] for kind in COMPILED)
    report.bar("machine code in it", "none", f"{compiled} files", compiled == 0)
    stray = [item.filename for item in members if STRAY & set(Path(item.filename).parts)]
    report.bar("tests and caches in it", "none", f"{len(stray)} files", not stray)
    megabytes = wheel.stat().st_size / 1e6
    report.bar("size of the wheel", "<= 10 MB", f"{megabytes:.1f} MB", megabytes <= 10.0)
    text = f"`{wheel.name}`, {megabytes:.1f} MB."
    report.table("Contents", ("ending", "files", "compressed [MB]"), rows, text=text)


def installed(report: Report, wheel: Path, home: Path) -> Path:
    """Install it in a fresh environment; its Python."""
    run([sys.executable, "-m", "venv", str(home)])
    python = home / "bin" / "python"
    (place,) = home.glob("lib/python*/site-packages")
    pip = [str(python), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    before, spent = _held(place), run([*pip, str(wheel)])
    report.bar("installation, dependencies cached", "<= 20 s", f"{spent:.1f} s of processor time", spent <= 20.0)
    made = sum(file.suffix in COMPILED for file in (place / "rrtik_ompl").rglob("*"))
    report.bar("files compiled by the installation", "none", str(made), made == 0)
    after = _held(place)
    run([str(python), "-m", "pip", "--disable-pip-version-check", "uninstall", "--quiet", "--yes", "rrtik-ompl"])
    others, alone = _held(place), run([*pip, "--no-deps", str(wheel)])
    rows = [
        ["all together", f"{spent:.1f}", *_more(before, after)],
        ["the dependencies", f"{spent - alone:.1f}", *_more(before, others)],
        ["the wheel alone", f"{alone:.1f}", *_more(others, after)],
    ]
    report.table(
        "Installation by pip",
        ("", "processor time [s]", "files", "[MB]"),
        rows,
        text="Files without those of Python's own byte code, which pip writes for all modules of all packages.",
    )
    return python


def _held(place: Path) -> tuple[int, int]:
    """How many files a folder has, and how many bytes, byte code aside."""
    sizes = [file.stat().st_size for file in place.rglob("*") if file.is_file() and file.suffix != ".pyc"]
    return len(sizes), sum(sizes)


def _more(before: tuple[int, int], after: tuple[int, int]) -> tuple[str, str]:
    """Cells of a table: files, and millions of bytes, that have come."""
    return str(after[0] - before[0]), f"{(after[1] - before[1]) / 1e6:.0f}"


def imports(report: Report, python: Path) -> None:
    """Time and memory of imports, in fresh processes."""
    rows = []
    for name, line in {"Python alone": "pass", **IMPORTS}.items():
        found = [measured(python, line) for _ in range(ROUNDS)]  # the first plan makes its kernels
        rows.append((name, min(time for time, _ in found), min(memory for _, memory in found)))
    bare = rows[0][1]
    spent, memory = rows[2][1], rows[4][2]
    report.bar("import of what plan() needs", "<= 0.25 s", f"{spent - bare:.2f} s", spent - bare <= 0.25)
    report.bar("memory of a process that plans", "<= 90 MB", f"{memory:.0f} MB", memory <= 90.0)
    cells = [[name, f"{time - bare:.2f}", f"{held:.0f}"] for name, time, held in rows]
    report.table("Imports", ("", "seconds more than Python alone", "memory [MB]"), cells)


def first_command(report: Report, python: Path, folder: Path) -> None:
    """README's first command, with an empty cache; whether it compiles a kernel, and how large its page is."""
    command = [str(python.with_name("rrtik")), *FIRST_COMMAND]
    environment = own_environment(XDG_CACHE_HOME=str(folder / "cache"))
    spent, done = of_children(
        lambda: subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=True)
    )
    compiled = [line for line in done.stderr.splitlines() if "compiling" in line]
    said = "; ".join(compiled) or f"none; {spent:.1f} s of processor time"
    report.bar("kernels that README's first command compiles", "none", said, not compiled)
    size = (folder / "titan4_sdu.html").stat().st_size / 1e6
    report.bar("the page that it writes", "<= 1.25 MB", f"{size:.2f} MB", size <= 1.25)


def measured(python: Path, line: str) -> tuple[float, float]:
    """Processor time [s] and memory [MB] of a process that runs a line."""
    command = [str(python), "-c", line + MEASURE]
    done = subprocess.run(command, env=own_environment(), capture_output=True, text=True, check=True)
    time, memory = done.stdout.split()
    return float(time), float(memory)


def run(command: Sequence[str], **environment: str) -> float:
    """Run a command to its end; its processor time [s]."""
    return of_children(lambda: subprocess.run(command, check=True, env=own_environment(**environment)))[0]


def own_environment(**more: str) -> dict[str, str]:
    """The variables of this process and some more, but for the folders in which Python would find this checkout."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | more
