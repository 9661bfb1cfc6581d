"""A comparison as Markdown, as cells and as plain words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

KEYS = ("name", "published", "measured", "verdict", "reading")
HEADS = ("figure", *KEYS[1:])
VERDICTS = ("held", "better", "differs", "refuted", "missed")
MEANINGS = (
    "Held: as printed, within chance. Better: beyond the print on the side that is wanted. Differs: not as printed, as "
    "the reading lets expect. Refuted: a computation shows that the print is wrong. Missed: none of these. Seconds "
    "against older machines have no verdict."
)


class Verdict(Protocol):
    """What to make of a figure: the word that is shown, and whether the comparison is a success."""

    @property
    def value(self) -> str:
        """The word."""

    @property
    def passes(self) -> bool:
        """Whether it is a success."""


class Row(Protocol):
    """One figure, as printed and as measured, and how the text was read; no verdict where there is nothing to judge."""

    @property
    def name(self) -> str:
        """What it is."""

    @property
    def published(self) -> str:
        """As printed."""

    @property
    def measured(self) -> str:
        """As it comes out here."""

    @property
    def verdict(self) -> Verdict | None:
        """What to make of it."""

    @property
    def reading(self) -> str:
        """How the text was read, or why the figure differs."""


class Figure(Protocol):
    """A figure of a publication, drawn from our measurement; see `rrtik_bench.figures.Figure`."""

    name: str
    title: str
    source: str

    def save(self, file: Path, quick: bool, /) -> None:
        """Measure what it shows, and draw it."""


class Table(Protocol):
    """A published table as a package offers it; see `rrtik_bench.tables.Table`."""

    name: str
    title: str
    source: str
    seconds: float
    quick_seconds: float
    fitted: str
    bars: str
    figures: Sequence[Figure]

    def run(self, quick: bool, /) -> Sequence[Row]:
        """Measure it again."""


Done = Sequence[tuple[Table, Sequence[Row]]]


def cells(row: Row) -> tuple[str, ...]:
    """As a table shows it."""
    return row.name, row.published, row.measured, "-" if row.verdict is None else row.verdict.value, row.reading


def plain(row: Row) -> dict[str, str | None]:
    """As JSON has it: ``verdict`` is null where there is nothing to judge."""
    verdict = None if row.verdict is None else row.verdict.value
    return {**dict(zip(KEYS, cells(row), strict=True)), "verdict": verdict}


def counted(done: Done) -> str:
    """How many of each verdict."""
    counts = Counter(row.verdict.value for _, rows in done for row in rows if row.verdict is not None)
    silent = sum(row.verdict is None for _, rows in done for row in rows)
    words = [f"{counts[word]} {word}" for word in sorted(counts, key=VERDICTS.index)]
    return ", ".join([*words, *([f"{silent} without a verdict"] if silent else [])])


def page(done: Done, quick: bool) -> str:
    """The whole comparison as Markdown."""
    import platform

    from rrtik_ompl.base.version import __version__
    from rrtik_ompl.benchmark.tables import markdown_table

    command = f"rrtik reproduce {'--all' if len(done) > 1 else done[0][0].name}{' --quick' if quick else ''}"
    lines = ["# Published and measured", "", f"Written by `{command}`, rrtik-ompl {__version__}, {platform.machine()}."]
    lines += ["", MEANINGS, "", f"In all: {counted(done)}.", ""]

    rows = [(f"`{table.name}`", table.title, counted([(table, rows)])) for table, rows in done]
    lines += markdown_table(("table", "what", "verdicts"), rows)

    for table, each in done:
        lines += ["", f"## {table.title}", "", f"`{table.name}`, {table.source}", ""]
        lines += [f"Fitted to the published figures: {table.fitted}.", ""] if table.fitted else []
        lines += [f"Bars: {table.bars}.", ""] if table.bars else []
        lines += markdown_table(HEADS, map(cells, each))

    return "\n".join([*lines, ""])
