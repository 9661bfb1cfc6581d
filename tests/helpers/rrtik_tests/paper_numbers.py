"""Numbers of the paper beside the data that they come from."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

NUMBER = re.compile(r"(?<![\w.])\d[\d,]*(?:\.\d+)?(?:e-\d+)?(?!\w|\.\d)")
NO_NUMBERS = (
    r"`[^`]*`",  # names and commands
    r"\]\([^)]*\)",  # addresses
    r"\[\d[^\]]*\]",  # citations
    r"^#+ [\d.]*",  # headings' own
    r"tables \d[\d., ]*(?:and \d[\d.]*)?",  # places of a text
    r"(?:[Ff]igure|section|table|algorithm|joint|axis|link) \d+(?:\.\d+)?",
    r"\(\d\.\d\)",
    r"theta\d",
)


@dataclass(frozen=True)
class Told:
    """A number of a page: its line, the heading above it, and as it stands there."""

    line: int
    heading: str
    text: str

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text.replace(",", ""))


def numbers(text: str) -> list[str]:
    """Numbers of a line that are no names, addresses, citations or places of a text."""
    for pattern in NO_NUMBERS:
        text = re.sub(pattern, " ", text)
    return [each.rstrip(",") for each in NUMBER.findall(text)]


def told(page: str) -> Iterator[Told]:
    """Numbers of a Markdown page, but for its blocks of code."""
    heading, code = "", False
    for line, text in enumerate(page.splitlines(), start=1):
        code ^= text.startswith("```")
        heading = text.lstrip("# ") if text.startswith("#") else heading
        if not code:
            yield from (Told(line, heading, number) for number in numbers(text))


def found(number: Told, data: Iterable[str]) -> bool:
    """Whether the data have a number, or one that rounds to it as it is written."""
    decimals = len(number.text.partition(".")[2]) if "e" not in number.text else None
    for text in data:
        value = float(text.replace(",", ""))
        if value == number.value or (decimals and round(value, decimals) == number.value):
            return True
    return False


def without_data(page: str, sources: Path, root: Path, computed: str = "") -> list[Told]:
    """Numbers of a page that are not in the reports of their section, nor said to be no measurement.

    Args:
        page: Markdown.
        sources: YAML: for each heading the reports that have its numbers, and its numbers that are not measured here.
        root: Folder that the reports are named from.
        computed: Further data.
    """
    sections = yaml.safe_load(sources.read_text(encoding="utf-8"))
    rest = []
    for number in told(page):
        section = sections.get(number.heading)
        if section is None:
            continue
        data = numbers_of([root / name for name in section.get("reports", [])], computed)
        if number.text not in section.get("given", []) and not found(number, data):
            rest.append(number)
    return rest


def numbers_of(reports: list[Path], computed: str) -> set[str]:
    """Every number in some reports; percentages and units may stick to them."""
    texts = [report.read_text(encoding="utf-8") for report in reports]
    return {
        each.rstrip(",") for text in [*texts, computed] for each in re.findall(r"\d[\d,]*(?:\.\d+)?(?:e-\d+)?", text)
    }
