"""Searches and whole `plan()` calls on the MotionBenchMaker problems, this version beside an earlier one.

Each version runs in a process of its own, and they take turns, problem by problem: machines are shared, so only the
factors between them say much. Processor time.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import Option

from bench.shared.run import Run, Sets
from bench.speed.machine import machine
from rrtik_bench.report.page import Report
from rrtik_ompl import list_problems, load_problem
from rrtik_ompl.base.choices import one_of

TABLES = ("searches", "plans", "queries")
ROOT = Path(__file__).resolve().parent.parent.parent
WANTED_FACTORS = {"panda": 0.68, "ur5": 0.65, "ur5, cage": 0.40}
WANTED_PLANS = {"panda": (0.8, 6.0), "ur5": (2.0, 15.0)}  # [ms] median, 95 %
WANTED_SHIPPED, WANTED_AROUND, WANTED_RATE = 0.7, 150.0, 2000.0  # [ms], [us], plans a second
Answers = list[list[dict[str, Any]]]  # of each version: answer by answer


class Version:
    """A version of this package in a process of its own."""

    def __init__(self, checkout: Path) -> None:
        places = [checkout, *(checkout / name for name in ("planners", "robots", "bench"))]
        script = [sys.executable, "-W", "ignore", str(Path(__file__).with_name("search_calls.py"))]
        surroundings = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, places))}
        self._process = subprocess.Popen(
            script, cwd=checkout, env=surroundings, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self._answer()

    def ask(self, row: str, subject: str) -> dict[str, Any]:
        """Have something measured."""
        assert self._process.stdin is not None
        print(json.dumps([row, subject]), file=self._process.stdin, flush=True)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("a version has ended without an answer; its errors stand above")
        found: dict[str, Any] = json.loads(line)
        return found


def in_turn(versions: Sequence[Version], row: str, subjects: Sequence[str]) -> Answers:
    """The answers of all versions, who take turns; subjects that one of them leaves out are left out."""
    answers = [[version.ask(row, subject) for version in versions] for subject in subjects]
    return [list(each) for each in zip(*(a for a in answers if all(a)), strict=True)]


def numbers(answers: list[dict[str, Any]], key: str) -> np.ndarray[Any, Any]:
    """All numbers of one kind."""
    return np.concatenate([np.asarray(a[key], dtype=float) for a in answers])


def three(values: np.ndarray[Any, Any], digits: str = ".3g") -> list[str]:
    """Median, mean and 95 %."""
    return [f"{v:{digits}}" for v in (np.median(values), values.mean(), np.quantile(values, 0.95))]


def factor(answers: Answers, key: str) -> float | None:
    """Geometric mean of this version's numbers over those of the earlier one."""
    if len(answers) < 2:
        return None
    return float(np.exp(np.log(numbers(answers[0], key) / numbers(answers[1], key)).mean()))


def shown(value: float | None) -> str:
    """A factor, if there is one."""
    return "" if value is None else f"{value:.2f}"


def scene_files(folder: Path, arm: str, problems: int) -> list[str]:
    """The first problems of each family of an arm's set."""
    families = sorted(path for path in (folder / f"mbm_{arm}" / "problems").glob("*") if path.is_dir())
    return [str(file) for family in families for file in sorted(family.glob("scene*.yaml"))[:problems]]


def searches(report: Report, versions: Sequence[Version], folder: Path, problems: int) -> None:
    """Bare searches on balls, as VAMP checks."""
    rows = []
    for arm in ("panda", "ur5"):
        files = scene_files(folder, arm, problems)
        parts = {arm: files, f"{arm}, cage": [f for f in files if Path(f).parent.name.startswith("cage")]}
        answered = dict(zip(files, zip(*in_turn(versions, "search_on_balls", files), strict=True), strict=False))
        for part, names in parts.items():
            answers = [list(each) for each in zip(*(answered[n] for n in names if n in answered), strict=True)]
            ratio, certified = factor(answers, "us"), sum(a["certified"] for a in answers[0])
            rows.append([part, str(len(numbers(answers[0], "us"))), str(certified), *three(numbers(answers[0], "us"))])
            rows[-1] += [shown(ratio), shown(factor(answers, "motions"))]
            if ratio is not None and part in WANTED_FACTORS:
                wanted = WANTED_FACTORS[part]
                report.bar(
                    f"search on balls, {part}: time over the earlier version's",
                    f"{wanted}",
                    shown(ratio),
                    ratio <= wanted,
                )
    head = ["", "runs", "certified by coal", "median [us]", "mean [us]", "95 % [us]", "factor", "factor of motions"]
    report.table("Bare searches on balls, 32 checks per radian", head, rows)


def plans(report: Report, versions: Sequence[Version], folder: Path, problems: int) -> None:
    """Whole calls of `plan()` on exact meshes and on what is shipped."""
    rows = []
    shipped = [name for name in list_problems() if name.startswith("titan4") and not load_problem(name).constraints]
    cases = [(arm, "plan_on_meshes", scene_files(folder, arm, problems)) for arm in ("panda", "ur5")]
    for name, row, subjects in [*cases, ("titan4, shipped", "plan_shipped", shipped)]:
        answers = in_turn(versions, row, subjects)
        whole, around = numbers(answers[0], "ms"), 1e3 * numbers(answers[0], "around")
        median, late, beside = float(np.median(whole)), float(np.quantile(whole, 0.95)), float(np.median(around))
        found = f"{sum(a['found'] for a in answers[0])} of {len(whole)}"
        rows.append([name, found, *three(whole), shown(factor(answers, "ms")), f"{beside:.0f}"])
        if name in WANTED_PLANS:
            wanted = WANTED_PLANS[name]
            text = f"{wanted[0]:g} / {wanted[1]:g} ms"
            held = median <= wanted[0] and late <= wanted[1]
            report.bar(f"plan() with proofs, {name}: median / 95 %", text, f"{median:.2f} / {late:.2f} ms", held)
        else:
            report.bar(
                f"plan() with proofs, {name}: median",
                f"{WANTED_SHIPPED} ms",
                f"{median:.2f} ms",
                median <= WANTED_SHIPPED,
            )
        report.bar(
            f"plan() without search and proofs, {name}: median",
            f"{WANTED_AROUND:g} us",
            f"{beside:.0f} us",
            beside <= WANTED_AROUND,
        )
    head = ["", "found", "median [ms]", "mean [ms]", "95 % [ms]", "factor", "without search and proofs [us]"]
    report.table("`plan()`", head, rows, text="Second and later plans in a world.")


def queries(report: Report, versions: Sequence[Version], folder: Path) -> None:
    """Many plans in one world."""
    file = str(folder / "mbm_panda" / "problems" / "bookshelf_small_panda" / "scene0001.yaml")
    answers = in_turn(versions, "plan_many", [file])
    rates = [1e3 / numbers(each, "ms").mean() for each in answers]
    rows = [
        [
            name,
            f"{rate:.0f}",
            *three(numbers(each, "ms")),
            str(each[0]["found"]),
            f"{np.median(numbers(each, 'problem')):.2f}",
        ]
        for name, rate, each in zip(("this version", "earlier"), rates, answers, strict=False)
    ]
    head = ["", "plans a second", "median [ms]", "mean [ms]", "95 % [ms]", "found", "`Problem()` [ms]"]
    report.table("Random queries in one world of the Panda", head, rows)
    report.bar(
        "random queries in one Panda world, plans a second",
        f"{WANTED_RATE:g}",
        f"{rates[0]:.0f}",
        rates[0] >= WANTED_RATE,
    )


def main(
    run: Run,
    folder: Sets,
    *,
    old: Annotated[Path | None, Option(help="Checkout of an earlier version.")] = None,
    problems: Annotated[int, Option(help="Of each family.")] = 50,
    only: Annotated[list[str] | None, Option(help="searches, plans or queries; may be repeated.")] = None,
) -> Report:
    """Measure."""
    wanted = [one_of(TABLES, name, "table") for name in only or TABLES]
    versions = [Version(checkout.resolve()) for checkout in (ROOT, old) if checkout is not None]
    report = run.report("Whole calls")
    report.note("Search", machine())
    if "searches" in wanted:
        searches(report, versions, folder, problems)
    if "plans" in wanted:
        plans(report, versions, folder, problems)
    if "queries" in wanted:
        queries(report, versions, folder)
    return report
