"""The results page of the documents: what campaigns of `rrtik bench` have measured, in one short table each.

The campaigns are those of the suites scenarios, titan4_families, scaling (each with ``--jobs 2``) and soak. The section
of docs/results.md between its two marks is replaced, and nothing in it is typed by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Argument, Option

from bench.shared.run import REPORTS
from rrtik_ompl.benchmark.records import NAME, read_records
from rrtik_ompl.benchmark.report import read_campaign
from rrtik_ompl.benchmark.statistics import Result, Spread
from rrtik_ompl.benchmark.tables import conditions, failures, figure, markdown_table

BEGIN, END = "<!-- results: written by python -m bench results_page -->", "<!-- end of results -->"
HEAD = (
    *("planner", "solved / valid / total", "planning, median / 95 % [ms]", "shortening [ms]", "final length"),
    "final transitions",
)
TENTH = 10


def section(folder: Path) -> list[str]:
    """Lines about one campaign.

    Raises:
        InputError: If the folder holds no campaign that can be read.
    """
    file = folder / NAME
    head, found = read_campaign(file)
    lines = [f"**{head['suite']['title']}.** {conditions(found, head)}", ""]
    plain, growing = ([r for r in found if bool(r.axis) == grows] for grows in (False, True))
    if plain:
        labels = len({result.label for result in plain})
        which = f"All {labels} groups of problems together; medians" if labels > 1 else "Medians"
        lines += [f"{which} where nothing else is said:", ""]
        lines += [*markdown_table(HEAD, (_row(each) for each in by_planner(plain))), ""]
    if growing:
        lines += ["Planning, median [ms], where one measure grows:", "", *_scaling(growing), ""]
    broken = sum(int(row[2]) for row in failures(found))
    lines += [f"Runs that crashed, hung or broke: {broken}. {memory(file)}", ""]
    return lines


def by_planner(found: Sequence[Result]) -> list[Result]:
    """All runs of each planner together."""
    merged: dict[str, Result] = {}
    for result in found:
        merged.setdefault(result.planner, Result("", result.planner, "", "", 0.0)).runs.extend(result.runs)
    return list(merged.values())


def memory(file: Path) -> str:
    """How much memory the processes of the runs held in the first and the last tenth of the campaign."""
    held = [float(record["memory_mb"]) for record in read_records(file) if "memory_mb" in record]
    part = max(1, len(held) // TENTH)
    first, last = (float(np.median(values)) for values in (held[:part], held[-part:]))
    return f"Memory of the processes, median over the first and the last tenth of the runs: {first:.0f}, {last:.0f} MB."


def _row(result: Result) -> tuple[str, ...]:
    planning = result.spread("plan_seconds")
    return (
        result.planner,
        f"{result.solved} / {result.valid} / {result.total}",
        "-" if planning is None else f"{figure(1e3 * planning.median)} / {figure(1e3 * planning.p95)}",
        _median(result.spread("shorten_seconds"), 1e3),
        _median(result.spread("length")),
        _median(result.spread("transitions")),
    )


def _scaling(growing: Sequence[Result]) -> list[str]:
    groups: dict[str, dict[str, dict[float, Result]]] = {}
    for result in growing:
        groups.setdefault(result.group, {}).setdefault(result.planner, {})[result.value] = result
    lines: list[str] = []
    for group, planners in groups.items():
        values = list(dict.fromkeys(value for each in planners.values() for value in each))
        rows = [
            (planner, *(_median(each[v].spread("plan_seconds"), 1e3) if v in each else "-" for v in values))
            for planner, each in planners.items()
        ]
        lines += [*markdown_table((group, *(f"{value:g}" for value in values)), rows), ""]
    return lines[:-1]


def _median(spread: Spread | None, factor: float = 1.0) -> str:
    return "-" if spread is None else figure(factor * spread.median)


def replaced(text: str, lines: Sequence[str]) -> str:
    """A text with other lines between the two marks.

    Raises:
        ValueError: If the marks are not there.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the marks {BEGIN} and {END} are not there")
    return "\n".join([before + BEGIN, "", *lines, END + after])


def main(
    folders: Annotated[list[Path], Argument(help="That `rrtik bench` has written, as bench-scenarios.")],
    page: Annotated[Path, Option(help="With the two marks.")] = REPORTS.parent.parent / "docs" / "results.md",
) -> None:
    """Read the campaigns and write the section."""
    lines = [line for folder in folders for line in section(folder)]
    page.write_text(replaced(page.read_text(), lines))
    print("\n".join(lines))
