"""Whether a resolver finds all that the wheel needs, for machines other than this one.

uv (``pip install uv``) resolves for a named platform and version of Python, wheels alone, without installing anything.
The page tells of the day on which it was made. A minute.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date
from importlib.util import find_spec
from pathlib import Path

from bench.shared.run import Run
from rrtik_bench.report.machine import package_version
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import InputError

PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
ROOT = Path(__file__).resolve().parents[2]
FLOOR = ROOT / "tests" / "constraints" / "floor.txt"
FLOOR_PYTHON = "3.10"  # that of the floor job: older versions have no wheels for the newest Python
SHOWN = ("ompl", "pin", "coal", "numba", "llvmlite", "numpy", "scipy", "opencv-python-headless")


PLATFORMS = {
    "macOS 15, Apple's ARM": "aarch64-apple-darwin",
    "Linux with glibc 2.28, AArch64": "aarch64-manylinux_2_28",
    "Linux with glibc 2.28, x86-64": "x86_64-manylinux_2_28",
    "macOS 15, Intel": "x86_64-apple-darwin",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
}
WANTED = tuple(PLATFORMS)[:3]  # the others are shown, not asked for


@dataclass(frozen=True)
class Answer:
    """What uv found.

    Attributes:
        versions: By name of the package; empty if nothing fits.
        reason: Why nothing fits, in uv's words.
    """

    versions: dict[str, str]
    reason: str = ""

    @property
    def shown(self) -> str:
        """For a cell of a table."""
        return f"yes, {len(self.versions)}" if self.versions else f"no: {self.reason}"


def resolved(
    asked: Iterable[str], platform: str, python: str, *options: str, wheels_alone: bool = True, patience: float = 600.0
) -> Answer:
    """Versions of all packages that some requirements lead to; source packages, if allowed, may be built for it."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate"]
    command += ["--python-platform", platform, "--python-version", python, *options, "-"]
    command += ["--only-binary", ":all:"] if wheels_alone else []
    environment = {**os.environ, "MACOSX_DEPLOYMENT_TARGET": "15.0"}
    lines = "\n".join(asked)
    try:
        done = subprocess.run(
            command, input=lines, env=environment, capture_output=True, text=True, check=False, timeout=patience
        )
    except subprocess.TimeoutExpired:
        return Answer({}, f"no answer within {patience:.0f} s")
    if done.returncode:
        said = " ".join(done.stderr.split())
        hints = [line.strip() for line in done.stderr.replace("\n  ", " ").splitlines() if "hint" in line]
        steps = said.split("And because ")[1:-1]  # of uv's proof; the last one only says that it was asked for
        return Answer({}, " ".join([*hints, " ".join(steps[-2:]) or said or "uv failed"][0].split()))
    pairs = (line.partition("==") for line in done.stdout.splitlines())
    return Answer({name: version for name, _, version in pairs if version})


def built_wheel(folder: Path) -> Path:
    """Make the wheel of this checkout in a folder, without kernels: they change nothing of what it needs."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-deps"]
    command += ["--wheel-dir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, env={**os.environ, "RRTIK_KERNELS": "0"})
    (wheel,) = folder.glob("rrtik_ompl-*.whl")
    return wheel


def fill(page: Report, wheel: Path) -> None:
    """What uv says."""
    page.intro = f"{date.today()}, {package_version('uv')}, wheels alone."
    itself = [f"rrtik-ompl @ {wheel.as_uri()}"]
    answers = {
        (platform, python): resolved(itself, name, python)
        for platform, name in PLATFORMS.items()
        for python in PYTHONS
        if platform in WANTED or python == PYTHONS[-1]
    }
    asked = [(platform, python) for platform in WANTED for python in PYTHONS]
    good = sum(bool(answers[key].versions) for key in asked)
    held = good == len(asked)
    what = f"the wheel's dependencies, three platforms, Python {PYTHONS[0]} to {PYTHONS[-1]}"
    page.bar(what, "all resolve", f"{good} of {len(asked)}", held)
    floors = {name: resolved(itself, PLATFORMS[name], FLOOR_PYTHON, "--constraint", str(FLOOR)) for name in WANTED}
    good = sum(bool(answer.versions) for answer in floors.values())
    page.bar("the lowest versions together, Python 3.10", "resolve on all three", f"{good} of 3", good == 3)
    rows = [
        [name, *(answers[name, python].shown if (name, python) in answers else "" for python in PYTHONS)]
        for name in PLATFORMS
    ]
    page.table("Whether all is found, and how many packages that is", ("platform", *PYTHONS), rows)
    columns = [(name, python) for name in WANTED for python in (PYTHONS[0], PYTHONS[-1])]
    versions = [[name, *(answers[key].versions.get(name, "") for key in columns)] for name in SHOWN]
    page.table("Versions", ("package", *(f"{name}, {python}" for name, python in columns)), versions)
    text = f"`{FLOOR.relative_to(ROOT)}` as constraints."
    page.table(
        f"The floor, Python {FLOOR_PYTHON}", ("platform", ""), [(k, v.shown) for k, v in floors.items()], text=text
    )


def main(run: Run) -> Report:
    """Ask."""
    if find_spec("uv") is None:
        raise InputError("resolve: uv is not installed here; pip install uv")
    report = run.report("What the wheel needs, resolved for other machines")
    with tempfile.TemporaryDirectory() as folder:
        fill(report, built_wheel(Path(folder)))
    return report
