"""Random drags in pages that plan, by the mouse in a headless Chromium: each ends in a proven path, or in a word.

Beside another checkout (``--beside``) the same drags are made in its pages of the same problems: from the same state,
in the same view, by the same way in space. Where a drag leads to another state there, each page is given that of the
other. Needs Chromium.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "helpers"))
page_drags: Any = import_module("rrtik_tests.page_drags")

PROBLEMS = (
    "planar3_boxes", "cut_two_ls", "titan4_sdu", "titan4_bar", "two_titan4", "panda_shelf", "ur5_table", "ur10_bin",
    "so101_bin", "xarm7_cage", "kinova_table",
)  # fmt: skip
SAME = 1e-6  # [rad or m]: so near, two states are the same
# A page of a problem, by the library of a checkout.
MAKE = """
import sys
import rrtik_ompl as rrtik
from rrtik_ompl.viewer.page import page
problem = rrtik.load_problem(sys.argv[1])
path = rrtik.plan(problem, seed=1).path
open(sys.argv[2], "w", encoding="utf-8").write(page(problem, path))
"""


@dataclass
class Beside:
    """Of the drags that the page of another checkout can make too, here and there.

    Attributes:
        made: Drags.
        paths: That ended in a proven path.
        tips: That moved a tip.
        followed: Of these, the tip went where the pointer had it.
        asked: Where it did, or an obstacle was moved, and a path was proven.
        states: Different states in which the drags ended, in either page.
        solved: Of these, the page finds a path that is proven.
    """

    made: list[int] = field(default_factory=lambda: [0, 0])
    paths: list[int] = field(default_factory=lambda: [0, 0])
    tips: list[int] = field(default_factory=lambda: [0, 0])
    followed: list[int] = field(default_factory=lambda: [0, 0])
    asked: list[int] = field(default_factory=lambda: [0, 0])
    states: int = 0
    solved: list[int] = field(default_factory=lambda: [0, 0])


@dataclass
class Dragged:
    """Of the drags in a page.

    Attributes:
        counts: Drags by what was dragged, whether by a handle, and outcome.
        wrong: What is neither a proven path nor a word.
        beside: Of another checkout's page, too.
    """

    counts: dict[str, int]
    wrong: list[str]
    beside: Beside | None = None

    def of(self, *words: str) -> int:
        """How many have all these words."""
        return sum(number for key, number in self.counts.items() if set(words) <= set(key.split()))


def drags_in(name: str, drags: int, beside: Path | None) -> Dragged:
    """Random drags in the page of a problem, and the same ones in that of another checkout."""
    problem = rrtik.load_problem(name)
    with TemporaryDirectory() as folder, ExitStack() as opened:
        page = opened.enter_context(page_drags.drag_page(page_of(name, ROOT, Path(folder, "here.html"))))
        made = list(page.some(problem, drags, PROBLEMS.index(name)))
        counts = Counter(f"{each.kind} {'handle' if each.wanted.by_handle else 'itself'} {word(each)}" for each in made)
        wrong = [f"{each.wanted}: {each.outcome}" for each in made if word(each) == "wrong"]
        if beside is None:
            return Dragged(counts, wrong)

        old = opened.enter_context(page_drags.drag_page(page_of(name, beside, Path(folder, "there.html")), page))
        found = Beside()
        for here in made:
            if not here.wanted.by_handle:
                there = old.make(here.wanted, problem)
                if there.said is not None:
                    count_pair(found, problem, [page, old], [here, there])
        return Dragged(counts, wrong, found)


def count_pair(found: Beside, problem: rrtik.Problem, pages: list[Any], drags: list[Any]) -> None:
    """Count a drag that was made in two pages."""
    solved = [each.outcome == "proven" for each in drags]
    for k, each in enumerate(drags):
        found.made[k] += 1
        found.paths[k] += solved[k]
        found.tips[k] += each.followed is not None
        found.followed[k] += each.followed is True
        found.asked[k] += solved[k] and each.followed is not False

    if same_state(*(each.said for each in drags)):
        found.states += 1
        for k in (0, 1):
            found.solved[k] += solved[k]
        return

    for k in (0, 1):
        other = pages[1 - k].says_in(drags[k].said)
        found.states += 1
        found.solved[k] += solved[k]
        found.solved[1 - k] += page_drags.outcome(problem, other, titled=False) == "proven"


def same_state(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Whether two pages are in the same state: ends and obstacles."""

    def numbers(said: dict[str, Any]) -> np.ndarray:
        ends = [said["state"][end] for end in page_drags.ENDS]
        return np.concatenate([*ends, *(each["pose"] for each in said["obstacles"])])

    return bool(np.abs(numbers(one) - numbers(other)).max() < SAME)


def word(drag: Any) -> str:
    """The outcome in a word."""
    return drag.outcome if drag.outcome in page_drags.GOOD else "wrong"


def page_of(name: str, checkout: Path, file: Path) -> Path:
    """The page of a problem as a checkout writes it, in a file."""
    path = os.pathsep.join(str(checkout.resolve() / folder) for folder in ("", "planners", "robots"))
    command = [sys.executable, "-W", "ignore", "-c", MAKE, name, str(file)]
    subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, check=True, cwd="/")
    return file


def fill(report: Report, dragged: dict[str, Dragged]) -> None:
    """What came out."""
    every = list(dragged.values())
    total, wrong = sum(each.of() for each in every), [line for each in every for line in each.wrong]
    paths = sum(each.of("proven") for each in every)
    report.bar(
        "drags that end neither in a path that Python proves nor in a word",
        "0 of 1,000",
        f"{len(wrong)} of {total}; {paths} proven paths, {total - paths - len(wrong)} words",
        not wrong,
    )
    errors = sum("page error" in line for line in wrong)
    report.bar("page errors", "0", f"{errors}", errors == 0)

    both = [each.beside for each in every if each.beside is not None]
    if both:
        made = sum(each.made[0] for each in both)
        states = sum(each.states for each in both)
        rows = (
            ("tips that went where the pointer had them", "followed", sum(each.tips[0] for each in both)),
            ("drags with a proven path for what the pointer asked", "asked", made),
            ("states in which the drags ended, in either page, with a proven path", "solved", states),
            ("drags with any proven path", "paths", made),
        )
        for what, key, of in rows:
            here, there = (sum(getattr(each, key)[k] for each in both) for k in (0, 1))
            report.bar(f"{what}, of {of}", "not fewer than in the other checkout", f"{here}; {there}", here >= there)

    heads = ["problem", "drags", "of the start", "the goal", "obstacles", "by handles", "proven", "word", "wrong"]
    words = ((), ("start",), ("goal",), ("obstacle",), ("handle",), ("proven",), ("word",), ("wrong",))
    rows_of = [[name, *(f"{each.of(*kind)}" for kind in words)] for name, each in dragged.items()]
    report.table(
        "Drags",
        heads,
        rows_of,
        text="Each begins in the first state of the page and moves something by 2 to 40 % of the size of what is "
        "shown, or a handle by 10 to 120 pixels. All proofs are those of `opinion_on`, in the scene as it was left.",
    )
    if both:
        report.table(
            "Beside the other checkout",
            ["problem", "drags", "tips followed", "path for what was asked", "states", "path in them", "any path"],
            [[name, *cells(each.beside)] for name, each in dragged.items() if each.beside is not None],
            text="Here / there; drags by handles are left out. The last column has drags whose ghost could not follow "
            "the pointer, too: here it goes as near as the arm comes without contact, and a line says so.",
        )
    if wrong:
        report.note("Wrong", "\n".join(f"- {line}" for line in wrong))


def cells(beside: Beside) -> list[str]:
    """Numbers of the table of both checkouts."""

    def both(counts: list[int]) -> str:
        here, there = counts
        return f"{here} / {there}"

    asked = [both(beside.followed), both(beside.asked)]
    return [f"{beside.made[0]}", *asked, f"{beside.states}", both(beside.solved), both(beside.paths)]


def main(
    run: Run,
    parts: Parts,
    *,
    drags: int = 1000,
    beside: Annotated[Path | None, Option(help="Another checkout.")] = None,
) -> Report:
    """Make the drags."""
    share = -(-drags // len(PROBLEMS))
    found = parts(drags_in, [(name, share, beside) for name in PROBLEMS])
    report = run.report("Drags in pages that plan")
    fill(report, dict(zip(PROBLEMS, found, strict=True)))
    return report
