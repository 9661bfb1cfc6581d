"""A Markdown page of acceptance rows (what was wanted, what was measured, held or missed) and tables."""

from __future__ import annotations

import platform
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version


def processes(count: int) -> str:
    """How many there were, as a page says it."""
    return "one process" if count == 1 else f"{count} processes"


def package_version(name: str) -> str:
    """The version of an installed package, or that it is missing."""
    try:
        return f"{name} {version(name)}"
    except PackageNotFoundError:
        return f"{name} not installed"


@dataclass
class Report:
    """Collects sections and bars."""

    title: str
    command: str
    where: str = processes(1)
    lines: list[str] = field(default_factory=list)
    bars: list[tuple[str, str, str, bool]] = field(default_factory=list)

    def table(self, title: str, head: list[str], rows: list[list[str]]) -> None:
        """Add a section with one table."""
        self.lines += [f"## {title}", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
        self.lines += ["| " + " | ".join(row) + " |" for row in rows] + [""]

    def note(self, title: str, text: str) -> None:
        """Add a section of text."""
        self.lines += [f"## {title}", "", text, ""]

    def bar(self, what: str, wanted: str, measured: str, held: bool) -> None:
        """Add an acceptance row."""
        self.bars.append((what, wanted, measured, bool(held)))

    def markdown(self) -> str:
        """The whole page."""
        held = sum(bar[3] for bar in self.bars)
        rows = [f"| {a} | {b} | {c} | {'held' if ok else '**missed**'} |" for a, b, c, ok in self.bars]
        head = [f"# {self.title}", "", f"Written by `{self.command}`, {platform.machine()}, {self.where}.", ""]
        bars = [f"## Acceptance: {held} of {len(self.bars)} held", ""]
        bars += ["| bar | wanted | measured | |", "|---|---|---|---|", *rows, ""]
        return "\n".join([*head, *(bars if rows else []), *self.lines])
