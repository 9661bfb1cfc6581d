"""Tables of results: for the terminal, as Markdown, as CSV."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from typing import Any

from rrtik_ompl.benchmark.run import NOT_FOUND, SOLVED
from rrtik_ompl.benchmark.statistics import QUANTITIES, Result, Spread

OVERVIEW = (
    *("problem", "planner", "solved / valid / total", "planning, median / 95 % [s]", "shortening [s]"),
    *("total, median / 95 % [s]", "iterations", "length, found / shortened", "transitions, found / shortened"),
)
OF_A_SPREAD = ("mean", "std", "min", "25 %", "median", "75 %", "95 %", "max")


def overview(results: Iterable[Result]) -> list[tuple[str, ...]]:
    """Return one row for each planner on each label; single values are medians."""
    return [
        (
            result.label,
            result.planner,
            f"{result.solved} / {result.valid} / {result.total}",
            _two(result.spread("plan_seconds")),
            _median(result.spread("shorten_seconds")),
            _two(result.spread("total_seconds")),
            _median(result.spread("iterations")),
            f"{_median(result.spread('initial_length'))} / {_median(result.spread('length'))}",
            f"{_median(result.spread('initial_transitions'))} / {_median(result.spread('transitions'))}",
        )
        for result in results
    ]


def markdown(results: Sequence[Result], head: Mapping[str, Any]) -> str:
    """Return a page with conditions, overview, failures, and one table for each quantity."""
    suite = head["suite"]
    lines = [f"# {suite['title']}", "", conditions(results, head), "", *markdown_table(OVERVIEW, overview(results))]
    lines += ["", remark(results, head)]

    broken = failures(results)
    if broken:
        lines += ["", "## Runs that broke", "", *markdown_table(("problem", "planner", "runs", "why"), broken)]

    for quantity, (name, unit) in QUANTITIES.items():
        rows = [(r.label, r.planner, *map(figure, s)) for r in results if (s := r.spread(quantity)) is not None]
        if rows:
            title = f"## {name}{f' [{unit}]' if unit else ''}"
            lines += ["", title, "", *markdown_table(("problem", "planner", *OF_A_SPREAD), rows)]

    return "\n".join([*lines, ""])


def conditions(results: Iterable[Result], head: Mapping[str, Any]) -> str:
    """Return the conditions of the campaign in one paragraph: command, limits, machine, versions."""
    suite = head["suite"]
    machine = head["machine"]
    runs = 1 + max(run["run"] for result in results for run in result.runs)
    spread = "--scheduler ADDRESS" if machine["at a time"] == "a cluster" else f"--jobs {machine['at a time']}"

    command = f"rrtik bench {suite['name']} --runs {runs} {spread}"
    versions = ", ".join(f"{name} {machine[name]}" for name in ("rrtik-ompl", "ompl", "pin", "coal", "numpy", "python"))

    return (
        f"Written by `{command}`: {runs} runs of each planner on each problem, "
        f"{suite['seconds']:g} s each, {suite['memory_mb']:g} MB, seed {suite['seed']}. {machine['processor']}, "
        f"{machine['cores']} cores, {machine['at a time']} at a time, {machine['system']}; {versions}; "
        f"begun {machine['begun']}."
    )


def remark(results: Iterable[Result], head: Mapping[str, Any]) -> str:
    """Return a remark on what the values mean, and on paths that came after the time limit."""
    limit = head["suite"]["seconds"]
    late = sum(seconds > limit for result in results for seconds in result.values("plan_seconds"))

    text = "Figures are over the runs with a valid path; single figures are medians."
    if late:
        text += f" {late} path(s) came after the limit of {limit:g} s: the last check of a path is not cut short."
    return text


def failures(results: Iterable[Result]) -> list[tuple[str, str, str, str]]:
    """Return the failures other than running out of time, as rows of problem, planner, number of runs, and reason."""
    rows = []
    for result in results:
        broken = [run for run in result.runs if run["status"] not in (SOLVED, NOT_FOUND)]
        counts = Counter(f"{run['status']}: {run.get('reason', '')}" for run in broken)
        rows += [(result.label, result.planner, str(number), why) for why, number in counts.most_common()]
    return rows


def csv_text(results: Iterable[Result]) -> str:
    """Return one row for each planner, label and quantity; SI units, full precision."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("problem", "planner", "solved", "valid", "total", "quantity", "unit", *Spread._fields))

    for result in results:
        counts = (result.label, result.planner, result.solved, result.valid, result.total)
        for quantity, (_, unit) in QUANTITIES.items():
            spread = result.spread(quantity)
            if spread is not None:
                writer.writerow((*counts, quantity, unit, *spread))

    return text.getvalue()


def figure(value: float) -> str:
    """Format a number with three significant digits."""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _median(spread: Spread | None) -> str:
    return "-" if spread is None else figure(spread.median)


def _two(spread: Spread | None) -> str:
    return "-" if spread is None else f"{figure(spread.median)} / {figure(spread.p95)}"


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    cells = (" | ".join(text.replace("|", "\\|") for text in row) for row in rows)
    return ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads), *(f"| {row} |" for row in cells)]
