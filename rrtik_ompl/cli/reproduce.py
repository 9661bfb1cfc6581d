"""The command `rrtik reproduce`: published tables measured again, printed beside what was published."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer

from rrtik_ompl.cli.terminal import note, progress, say
from rrtik_ompl.errors import InputError, UnknownNameError
from rrtik_ompl.files.text import check_target

KEYS = ("name", "published", "measured", "verdict", "reading")
HEADS = ("figure", *KEYS[1:])
WIDTH = 60  # of a reading in a table for a person


class Verdict(Protocol):
    """What to make of a figure: the word that is shown, and whether the comparison is a success."""

    value: str
    passes: bool


class Row(Protocol):
    """One figure, as printed and as measured, and how the text was read."""

    name: str
    published: str
    measured: str
    verdict: Verdict
    reading: str


class Table(Protocol):
    """A published table as a package offers it; see `rrtik_bench.tables.Table`."""

    name: str
    title: str
    source: str
    seconds: float
    quick_seconds: float

    def run(self, quick: bool, /) -> Sequence[Row]:
        """Measure it again."""


def reproduce(
    tables: Annotated[
        list[str] | None, typer.Argument(metavar="[TABLE]...", help="Names, or beginnings of them.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="All tables.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer runs, the same rules: minutes for all.")] = False,
    listed: Annotated[bool, typer.Option("--list", help="List the tables and how long they take.")] = False,
    markdown: Annotated[Path | None, typer.Option(help="Write the comparison to this file: .md.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")] = False,
) -> int:
    """Measure published tables again.

    Exit code 1 if a figure is missed.
    """
    from rrtik_ompl.catalog import find_tables

    check_target(markdown, (".md",))
    offers = find_tables()
    known: dict[str, Table] = {table.name: table for offer in offers for table in offer.tables}
    if not known:
        raise InputError("no installed package offers published tables")
    if listed:
        say(_list(known.values()), *(line for offer in offers for line in offer.not_here))
        return 0
    if everything == bool(tables):
        raise InputError("which tables? give their names, or --all; `rrtik reproduce --list` shows them")
    wanted = list(known.values()) if everything else chosen(known, tables or ())
    note(f"{_count(len(wanted), 'table')}, about {_time(sum(_seconds(each, quick) for each in wanted))} on two cores")
    done = []
    for table in wanted:
        begin = time.perf_counter()
        with progress(f"{table.name}: {table.title}, about {_time(_seconds(table, quick))}"):
            rows = table.run(quick)
        done.append((table, rows))
        if not as_json:
            say(f"{table.name}: {table.title} ({table.source}), {time.perf_counter() - begin:.1f} s", _table(rows))
    if markdown is not None:
        _write(markdown, done, quick)
    verdicts = [row.verdict for _, rows in done for row in rows]
    if as_json:
        print(json.dumps({table.name: [_plain(row) for row in rows] for table, rows in done}))
    else:
        counts = Counter(verdict.value for verdict in verdicts)
        say(", ".join(f"{number} {word}" for word, number in counts.items()))
        say(*([] if markdown is None else [f"wrote {markdown}"]))
    return 0 if all(verdict.passes for verdict in verdicts) else 1


def chosen(known: Mapping[str, Table], names: Iterable[str]) -> list[Table]:
    """The tables of these names, in the order of ``known``; ``mb-rrt`` stands for all whose name begins so.

    Raises:
        UnknownNameError: If a name fits none.
    """
    wanted: set[str] = set()
    for name in names:
        fits = [each for each in known if each == name or each.startswith(f"{name}-")]
        if not fits:
            raise UnknownNameError("table", name, known)
        wanted.update(fits)
    return [table for name, table in known.items() if name in wanted]


def _cells(row: Row) -> tuple[str, ...]:
    return row.name, row.published, row.measured, row.verdict.value, row.reading


def _plain(row: Row) -> dict[str, str]:
    return dict(zip(KEYS, _cells(row), strict=True))


def _seconds(table: Table, quick: bool) -> float:
    return float(table.quick_seconds if quick else table.seconds)


def _list(tables: Iterable[Table]) -> Any:
    from rich import box
    from rich.table import Table

    shown = Table("name", "what", "published in", "full", "quick", box=box.SIMPLE_HEAD, pad_edge=False)
    for each in tables:
        shown.add_row(each.name, each.title, each.source, _time(each.seconds), _time(each.quick_seconds))
    return shown


def _table(rows: Sequence[Row]) -> Any:
    from rich import box
    from rich.table import Table

    shown = Table(*HEADS, box=box.SIMPLE_HEAD, pad_edge=False)
    shown.columns[-1].max_width = WIDTH
    for row in rows:
        shown.add_row(*_cells(row))
    return shown


def _write(file: Path, done: Sequence[tuple[Table, Sequence[Row]]], quick: bool) -> None:
    import platform

    from rrtik_ompl import __version__
    from rrtik_ompl.benchmark.tables import markdown_table
    from rrtik_ompl.files.text import write_text

    command = f"rrtik reproduce {'--all' if len(done) > 1 else done[0][0].name}{' --quick' if quick else ''}"
    lines = ["# Published and measured", "", f"Written by `{command}`, rrtik-ompl {__version__}, {platform.machine()}."]
    lines += [
        "",
        "Held: as printed, within chance. Differs: not as printed, and the reading says why. Missed: neither.",
    ]
    for table, rows in done:
        lines += ["", f"## {table.title}", "", f"`{table.name}`, {table.source}", ""]
        lines += markdown_table(HEADS, map(_cells, rows))
    write_text(file, "\n".join([*lines, ""]))


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
