"""A Markdown page: acceptance rows (what was wanted, what was measured, held or missed), tables and text."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rrtik_bench.report.machine import processes
from rrtik_bench.report.rows import Row, Verdict, verdict
from rrtik_ompl.benchmark.tables import markdown_table
from rrtik_ompl.files.text import write_text


@dataclass
class Report:
    """Collects sections and acceptance rows.

    Attributes:
        title: Of the page.
        command: Which writes it.
        where: How many processes worked.
        intro: A paragraph that stands before everything else.
        lines: Of the sections.
        bars: Acceptance rows; they stand before the sections.
    """

    title: str
    command: str
    where: str = processes(1)
    intro: str = ""
    lines: list[str] = field(default_factory=list)
    bars: list[Row] = field(default_factory=list)

    def table(
        self, title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], *, text: str = "", level: int = 2
    ) -> None:
        """Add a section with one table, below a text if there is one."""
        self.note(title, text, level=level)
        self.lines += [*markdown_table(heads, rows), ""]

    def note(self, title: str, text: str, *, level: int = 2) -> None:
        """Add a section of text; without a title the text goes on where the last section ended."""
        self.lines += [f"{'#' * level} {title}", ""] if title else []
        self.lines += [text, ""] if text else []

    def bar(self, what: str, wanted: str, measured: str, held: bool | np.bool) -> None:
        """Add an acceptance row."""
        self.bars.append(Row(what, wanted, measured, verdict(bool(held))))

    def add(self, part: Report) -> None:
        """Add the sections and the acceptance rows of another report."""
        self.lines += part.lines
        self.bars += part.bars

    @property
    def passes(self) -> bool:
        """Whether no acceptance row is missed."""
        return all(row.verdict is None or row.verdict.passes for row in self.bars)

    def markdown(self) -> str:
        """The whole page."""
        held = sum(row.verdict is Verdict.HELD for row in self.bars)
        head = [f"# {self.title}", "", f"Written by `{self.command}`, {platform.machine()}, {self.where}.", ""]
        head += [self.intro, ""] if self.intro else []
        if self.bars:
            rows = [(row.name, row.published, row.measured, _shown(row.verdict)) for row in self.bars]
            head += [f"## Acceptance: {held} of {len(self.bars)} held", ""]
            head += [*markdown_table(("bar", "wanted", "measured", ""), rows), ""]
        return "\n".join([*head, *self.lines])

    def save(self, file: Path) -> None:
        """Write the page; its folder is made if need be."""
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, self.markdown())

    def finish(self, file: Path) -> int:
        """Write the page and print it.

        Returns:
            Exit code: 1 if an acceptance row is missed, else 0.
        """
        self.save(file)
        print(self.markdown())
        return int(not self.passes)


def _shown(found: Verdict | None) -> str:
    if found is None:
        return ""
    return found.value if found.passes else f"**{found.value}**"
