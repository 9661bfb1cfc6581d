"""Whether the wheel can be installed beside the toolkits that people have: resolved for each version of Python by uv.

The table goes to docs/install.md. Packages without wheels, such as those that LeRobot needs, are built for their
metadata, so that a run takes some ten minutes the first time. ``--real FOLDER`` also makes an environment of some GB,
with LeRobot and ManiSkill, and plans in it. There, or by ``--lerobot PYTHON`` in an environment that has it, LeRobot
reads demonstrations that were written for it; ``--no-resolve`` leaves the rest out.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from datetime import date
from importlib.util import find_spec
from itertools import repeat
from pathlib import Path
from typing import Annotated

from typer import Option

from bench.install.resolve import ROOT, Answer, built_wheel, resolved
from bench.shared.run import Run
from rrtik_bench.report.machine import package_version
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.demos import record

PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
PLATFORM = "x86_64-manylinux_2_39"
PATIENCE = 400.0  # [s], as other programs may run beside it
AT_ONCE = 4  # resolvers, which wait for the network most of the time
TOOLKITS = (
    "lerobot",
    "lerobot[kinematics]",
    "mani_skill",
    "robosuite",
    "genesis-world",
    "mujoco",
    "pin-pink",
    "roboplan",
    "drake",
    "tesseract-robotics-nanobind",
    "jax",
)
# Of these uv names our bound, which is not the one to blame.
FOREIGN_BOUNDS = {"robosuite": "mink 0.0.5, which it asks for, wants numpy below 2, and no Pinocchio installs there"}
PAGE = ROOT / "docs" / "install.md"
BEGIN, END = "<!-- python -m bench environments -->\n", "<!-- end -->\n"

# OpenCV comes under two names with the same files, of which an environment must hold the same version.
REAL = ("lerobot", "mani_skill", "opencv-python<4.14", "opencv-python-headless<4.14")
REAL_PYTHON = "3.12"

DEMOS = ("panda_pick_place", "so101_pick_place")
COUNT = 10  # demonstrations of each
EQUAL = 1e-5  # share of a column's range to which statistics are equal, in single precision
BINS = 2 / 5000  # the same of quantiles: two of the bins in which LeRobot counts


def beside(toolkit: str, python: str, wheel: Path) -> tuple[str, Answer | None]:
    """The newest version of a toolkit that there is for a Python, and what uv says of it beside the wheel.

    The version is empty, and the answer None, if the toolkit cannot be had for that Python even alone.
    """
    name = re.sub(r"\[.*", "", toolkit).replace("_", "-")
    version = resolved([toolkit], PLATFORM, python, wheels_alone=False, patience=PATIENCE).versions.get(name, "")
    if not version:
        return "", None
    asked = [f"{toolkit}=={version}", f"rrtik-ompl @ {wheel.as_uri()}"]
    return version, resolved(asked, PLATFORM, python, wheels_alone=False, patience=PATIENCE)


def fill(page: Report, wheel: Path) -> None:
    """What uv says, here and in docs/install.md."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        pairs = [(toolkit, python) for toolkit in TOOLKITS for python in PYTHONS]
        answers = dict(zip(pairs, pool.map(beside, *zip(*pairs, strict=True), repeat(wheel)), strict=True))

    cells: dict[tuple[str, str], str] = {}
    reasons: dict[str, list[str]] = {}
    for (toolkit, python), (version, answer) in answers.items():
        cells[toolkit, python] = version if answer and answer.versions else f"{version}: no" if version else "-"
        if answer and not answer.versions:
            reason = FOREIGN_BOUNDS.get(toolkit, answer.reason)
            reasons.setdefault(f"{toolkit} {version}: {reason}", []).append(python)

    rows = [[f"`{toolkit}`", *(cells[toolkit, python] for python in PYTHONS)] for toolkit in TOOLKITS]
    ours = [answer for (toolkit, _), (_, answer) in answers.items() if answer and toolkit not in FOREIGN_BOUNDS]
    asked, good = len(ours), sum(bool(answer.versions) for answer in ours)
    why_not = [f"- {reason} (Python {', '.join(pythons)})" for reason, pythons in reasons.items()]
    page.bar(
        f"beside toolkits that can be had, but {', '.join(FOREIGN_BOUNDS)}",
        "all resolve",
        f"{good} of {asked}",
        good == asked,
    )
    text = "The newest version of each that resolves alone; -: there is none, or no answer, for that Python."
    page.table("Python", ("", *PYTHONS), rows, text=text)
    if why_not:
        page.note("Why not", "\n".join(why_not))

    lines = [f"Resolved on {date.today()} by {package_version('uv')} for Linux on x86-64; installed: see below.", ""]
    lines += [f"| {' | '.join(row)} |" for row in (["beside, Python", *PYTHONS], ["---"] * (1 + len(PYTHONS)), *rows)]
    said = PAGE.read_text()
    before, _, rest = said.partition(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n" + "\n".join([*lines, "", *why_not]) + f"\n\n{END}" + rest.partition(END)[2])


def plan_beside(wheel: Path, folder: Path) -> str:
    """Install the wheel with LeRobot and ManiSkill in a folder, import all of them, and plan; what was printed."""
    uv = [sys.executable, "-m", "uv"]
    python = str(folder / "bin" / "python")
    subprocess.run([*uv, "venv", "--quiet", "--allow-existing", "--python", REAL_PYTHON, str(folder)], check=True)
    subprocess.run([*uv, "pip", "install", "--quiet", "--python", python, *REAL, str(wheel)], check=True)
    subprocess.run([python, "-c", "import lerobot, mani_skill, rrtik_ompl; rrtik_ompl.sensing.Camera"], check=True)
    plan = [str(folder / "bin" / "rrtik"), "plan", "panda_shelf", "--seed", "1"]
    return subprocess.run(plan, cwd=folder, check=True, capture_output=True, text=True).stdout


def read_by_lerobot(page: Report, python: str, folder: Path) -> None:
    """Write demonstrations of both tasks as datasets, and have LeRobot read them and compute their statistics anew."""
    rows = []
    equal = True
    for task in DEMOS:
        made = record(task, COUNT, folder / task, format="lerobot", jobs=1)
        script = [python, str(Path(__file__).with_name("read_lerobot.py")), str(made.dataset)]
        answer = subprocess.run(script, cwd=folder, check=True, capture_output=True, text=True).stdout
        said = json.loads(answer.splitlines()[-1])
        quantiles = max(share for word, share in said["differences"].items() if word.startswith("q"))
        others = max(share for word, share in said["differences"].items() if not word.startswith("q"))
        equal &= said["episodes"] == COUNT and others <= EQUAL and quantiles <= BINS
        shapes = ", ".join(f"{name} {shape}" for name, shape in said["batch"].items())
        rows.append([f"`{task}`", said["version"], str(said["episodes"]), str(said["frames"]), shapes,
                     f"{others:.1e}", f"{quantiles:.1e}"])  # fmt: skip
    page.bar("datasets read by LeRobot's loader, statistics as its writer computes them", "equal", str(equal), equal)
    header = ("task", "LeRobot", "episodes", "frames", "a batch", "statistics", "quantiles")
    text = "The last two: largest difference, as a share of a column's range. LeRobot counts quantiles in 5,000 bins."
    page.table("Read by LeRobot", header, rows, text=text)


def main(
    run: Run,
    *,
    wheel: Annotated[Path | None, Option(help="One that was built already.")] = None,
    real: Annotated[Path | None, Option(help="Make an environment here, and plan in it.")] = None,
    lerobot: Annotated[str | None, Option(help="Python that has LeRobot, which reads demonstrations.")] = None,
    resolve: Annotated[bool, Option(help="Ask uv for all toolkits.")] = True,
) -> Report:
    """Ask, and with ``--real`` install."""
    if find_spec("uv") is None:
        raise InputError("environments: uv is not installed here; pip install uv")
    report = run.report("The wheel beside other toolkits", "resolved")
    with tempfile.TemporaryDirectory() as folder:
        made = (wheel or built_wheel(Path(folder))).resolve() if resolve or real is not None else Path()
        if real is not None:
            said = plan_beside(made, real.resolve())
            report.note("LeRobot and ManiSkill installed", f"`rrtik plan panda_shelf --seed 1`:\n\n```\n{said}```")
            lerobot = lerobot or str(real.resolve() / "bin" / "python")
        if lerobot is not None:
            read_by_lerobot(report, lerobot, Path(folder))
        if resolve:
            fill(report, made)
    return report
