"""What a round of tables has done so far: it stands beside the page until that is written."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rrtik_ompl.base.version import __version__
from rrtik_ompl.cli.published.page import KEYS, Row, Table, plain
from rrtik_ompl.files.text import read_text, write_text


@dataclass(frozen=True, slots=True)
class KeptVerdict:
    """A verdict as it was kept."""

    value: str

    @property
    def passes(self) -> bool:
        """Whether it is a success."""
        return self.value != "missed"


@dataclass(frozen=True, slots=True)
class KeptRow:
    """A row as it was kept."""

    name: str
    published: str
    measured: str
    verdict: KeptVerdict | None
    reading: str


class Kept:
    """The tables that a round has measured, in a file beside its page; without a page nothing is kept.

    Args:
        markdown: The page.
        quick: Whether the round is the quick one; the rows of another round, or of another version, are not taken.
    """

    def __init__(self, markdown: Path | None, quick: bool) -> None:
        self.file = None if markdown is None else markdown.with_suffix(".parts.jsonl")
        self._round = f"{__version__} {'quick' if quick else 'full'}"
        self._lines: dict[str, str] = {}

        if self.file is not None and self.file.is_file():
            for line in read_text(self.file).splitlines():
                self._lines[json.loads(line)["table"]] = line

    def known(self, table: Table) -> Sequence[Row] | None:
        """The rows of a table that this round has measured before it was interrupted."""
        line = self._lines.get(table.name)
        if line is None or json.loads(line)["round"] != self._round:
            return None
        return [_row(each) for each in json.loads(line)["rows"]]

    def add(self, table: Table, rows: Sequence[Row]) -> None:
        """Keep the rows of a table.

        Raises:
            InputError: If there is no room for them; what was kept before is still there.
        """
        if self.file is None:
            return
        line = {"table": table.name, "round": self._round, "rows": [plain(row) for row in rows]}
        self._lines[table.name] = json.dumps(line)
        write_text(self.file, "".join(f"{each}\n" for each in self._lines.values()))

    def forget(self) -> None:
        """The round has come to its end."""
        if self.file is not None:
            self.file.unlink(missing_ok=True)


def _row(kept: dict[str, str]) -> Row:
    name, published, measured, verdict, reading = (kept[key] for key in KEYS)
    return KeptRow(name, published, measured, KeptVerdict(verdict) if verdict else None, reading)
