"""The command `rrtik reproduce`: measure published tables again, and print both side by side."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Protocol

import typer

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.base.version import __version__
from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.stored_round import ENDINGS, load_round, save_round
from rrtik_ompl.cli.table import Table as Printed
from rrtik_ompl.cli.terminal import note, plural, progress, say
from rrtik_ompl.files.text import check_target, read_text, write_text

NONE: Mapping[str, str] = MappingProxyType({})

HEADS = ("figure", "published", "measured", "verdict", "reading")
VERDICTS = ("held", "better", "differs", "refuted", "missed")
MEANINGS = (
    "Held: as printed, within chance. Better: beyond the print on the side that is wanted. Differs: not as printed, as "
    "the reading lets expect. Refuted: a computation shows that the print is wrong. Missed: none of these. Seconds "
    "against older machines have no verdict. Seen from: the least changes of the number by which the verdict becomes "
    "another one."
)


def _folder(given: Path | None) -> Path | None:
    """Return the folder; refuse an option, which typer takes for the folder if that is left out."""
    if f"{given or ''}".startswith("-"):
        raise InputError(f"--plot: give a folder, not {given}; ./{given} if it has that name")
    return given


def reproduce(
    tables: Annotated[
        list[str] | None, typer.Argument(metavar="[TABLE]...", help="Names of tables, or beginnings of names.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="All tables.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer runs, the same rules: minutes for all.")] = False,
    listed: Annotated[bool, typer.Option("--list", help="List the tables and how long they take.")] = False,
    markdown: Annotated[
        Path | None,
        typer.Option(help="Write the comparison to this file: .md; an interrupted round goes on where it was."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw the figures of the sources from our measurements into this folder.", callback=_folder),
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option(help="Write every row with the numbers of its single runs to this file: .json, .json.gz."),
    ] = None,
    read: Annotated[
        Path | None, typer.Option(help="Judge the rows of such a file again instead of measuring them.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")] = False,
) -> int:
    """Measure published tables again.

    Exit code 1 if a figure is missed.
    """
    from rrtik_ompl.description.catalog import find_tables

    check_target(markdown, (".md",))
    check_target(store, ENDINGS)
    offers = find_tables()
    known: dict[str, Table] = {table.name: table for offer in offers for table in offer.tables}

    if not known:
        raise InputError("no installed package offers published tables")
    if listed:
        say(_list(known.values()), *(line for offer in offers for line in offer.not_here))
        return FOUND
    if everything == bool(tables):
        raise InputError("which tables? give their names, or --all; `rrtik reproduce --list` shows them")

    also = {name: stem for offer in offers for name, stem in offer.also.items()}
    wanted = list(known.values()) if everything else chosen(known, tables or (), also)

    if plot is not None:
        return _draw(wanted, quick, plot)

    readers = {table.name: offer.row_of for offer in offers for table in offer.tables}
    if read is not None:
        stored, quick = load_round(read, readers)
        missing = [table.name for table in wanted if table.name not in stored]
        if missing and not everything:
            raise InputError(f"{read}: has no rows of {', '.join(missing)}; measure them, without --read")
        done: Done = [(table, stored[table.name]) for table in wanted if table.name in stored]
        if not as_json:
            for table, rows in done:
                _show(table, rows, "stored")
        return _finish(done, quick, len(done) == len(known), markdown, store, as_json)

    note(f"{plural(len(wanted), 'table')}, about {_time(sum(_seconds(each, quick) for each in wanted))} on two cores")
    kept = Kept(markdown, quick, readers)

    try:
        done = [(table, _rows(table, quick, kept, shown=not as_json)) for table in wanted]
    except KeyboardInterrupt:
        if kept.file is not None:
            note(f"what is done is kept in {kept.file}; the same command goes on from there")
        raise

    code = _finish(done, quick, everything, markdown, store, as_json)
    kept.forget()
    return code


def _finish(done: Done, quick: bool, everything: bool, markdown: Path | None, store: Path | None, as_json: bool) -> int:
    """Write the files that are wanted, print the counts or all rows, and return the exit code."""
    if markdown is not None:
        write_text(markdown, page(done, quick, everything=everything))
    if store is not None:
        save_round(store, {table.name: rows for table, rows in done}, quick)

    if as_json:
        print(json.dumps({table.name: [row.record() for row in rows] for table, rows in done}))
    else:
        say(counted(done), *counted_apart(done))
        say(*(f"wrote {file}" for file in (markdown, store) if file is not None))

    missed = any(row.verdict is not None and not row.verdict.passes for _, rows in done for row in rows)
    return NOT_FOUND if missed else FOUND


def _rows(table: Table, quick: bool, kept: Kept, *, shown: bool) -> Sequence[Row]:
    """Return the rows of a table: measured now, or kept from an interrupted round."""
    begin = time.perf_counter()
    known = kept.known(table)
    with progress(f"{table.name}: {table.title}, about {_time(_seconds(table, quick))}"):
        rows = table.run(quick) if known is None else known
    kept.add(table, rows)

    if shown:
        took = "kept from before" if known is not None else f"{time.perf_counter() - begin:.1f} s"
        _show(table, rows, took)
    return rows


def _show(table: Table, rows: Sequence[Row], how: str) -> None:
    say(f"{table.name}: {table.title} ({table.source}), {how}", *_fitted(table), _table(rows))


def _fitted(table: Table) -> list[str]:
    fitted = [f"fitted to the published figures: {table.fitted}"] if table.fitted else []
    return [*fitted, *([f"bars: {table.bars}"] if table.bars else [])]


def _draw(tables: Iterable[Table], quick: bool, folder: Path) -> int:
    """Draw all figures of the given tables to a folder, and return the exit code."""
    from rrtik_ompl.files.text import make_folder

    drawn = [(table, figure) for table in tables for figure in table.figures]
    if not drawn:
        raise InputError("--plot: none of these tables has a figure; `rrtik reproduce --list` marks those that have")

    make_folder(folder)
    for table, figure in drawn:
        file = folder / f"{figure.name}.png"
        with progress(f"{table.name}: {figure.title}"):
            figure.save(file, quick)
        say(f"wrote {file}: {figure.title} ({figure.source})")
    return FOUND


def chosen(known: Mapping[str, Table], names: Iterable[str], also: Mapping[str, str] = NONE) -> list[Table]:
    """Return the tables with the given names, in the order of ``known``.

    A beginning of names, such as ``mb-rrt``, selects all tables whose names continue it after a hyphen.

    Args:
        known: All tables by name.
        names: Names that are wanted.
        also: Alternative words for beginnings of names.

    Raises:
        UnknownNameError: If a name fits none.
    """
    wanted: set[str] = set()
    for name in names:
        stem = also.get(name, name)
        fits = [each for each in known if each == stem or each.startswith(f"{stem}-")]
        if not fits:
            pages = {each.rsplit("-", 1)[0] for each in known}
            raise UnknownNameError("table", name, [*known, *pages, *also])
        wanted.update(fits)
    return [table for name, table in known.items() if name in wanted]


def _seconds(table: Table, quick: bool) -> float:
    return float(table.quick_seconds if quick else table.seconds)


# --- what a package offers -------------------------------------------------------------------------------------------


class Verdict(Protocol):
    """The result of comparing a figure: a word for display, and whether it counts as a success."""

    @property
    def value(self) -> str:
        """The word for display."""

    @property
    def passes(self) -> bool:
        """Whether it counts as a success."""


class Row(Protocol):
    """One figure as published and as measured, and the reading of the text; without comparison there is no verdict."""

    @property
    def name(self) -> str:
        """Name of the figure."""

    @property
    def published(self) -> str:
        """The published value."""

    @property
    def measured(self) -> str:
        """The measured value."""

    @property
    def verdict(self) -> Verdict | None:
        """The result of the comparison."""

    @property
    def reading(self) -> str:
        """How the text was read, or why the figure differs."""

    @property
    def printed(self) -> bool:
        """Whether the source prints what the number is compared with; else the bar is ours."""

    @property
    def detects(self) -> str:
        """The least changes of the number with which the verdict would be another one."""

    def record(self) -> dict[str, object]:
        """Return plain values for JSON, with the numbers of single runs where there are any."""


class Figure(Protocol):
    """A figure of a publication, drawn from our own measurement; see `rrtik_bench.figures.Figure`."""

    name: str
    title: str
    source: str

    def save(self, file: Path, quick: bool, /) -> None:
        """Measure what the figure shows, and draw it."""


class Table(Protocol):
    """A published table offered by a package; see `rrtik_bench.tables.Table`."""

    name: str
    title: str
    source: str
    seconds: float
    quick_seconds: float
    fitted: str
    bars: str
    figures: Sequence[Figure]

    def run(self, quick: bool, /) -> Sequence[Row]:
        """Measure the table again."""


Readers = Mapping[str, Callable[[Mapping[str, Any]], Row]]
Done = Sequence[tuple[Table, Sequence[Row]]]


# --- a comparison in words -------------------------------------------------------------------------------------------


def cells(row: Row) -> tuple[str, ...]:
    """Return the texts of a row of a printed table."""
    return row.name, row.published, row.measured, "-" if row.verdict is None else row.verdict.value, row.reading


def counted(done: Done) -> str:
    """Return the number of each verdict, in words."""
    counts = Counter(row.verdict.value for _, rows in done for row in rows if row.verdict is not None)
    silent = sum(row.verdict is None for _, rows in done for row in rows)
    words = [f"{counts[word]} {word}" for word in sorted(counts, key=VERDICTS.index)]
    return ", ".join([*words, *([f"{silent} without a verdict"] if silent else [])])


def counted_apart(done: Done) -> list[str]:
    """Return the numbers of verdicts by what the source prints, and by bars of ours, in words."""
    lines = []
    for words, printed in (("By what the sources print", True), ("By bars of ours", False)):
        rows = [
            (table, [row for row in rows if row.verdict is not None and row.printed == printed]) for table, rows in done
        ]
        lines += [f"{words}: {counted(rows)}."] if counted(rows) else []
    return lines


def page(done: Done, quick: bool, *, everything: bool = False) -> str:
    """Return the whole comparison as Markdown."""
    import platform

    from rrtik_ompl.benchmark.tables import markdown_table

    names = "--all" if everything else " ".join(table.name for table, _ in done)
    command = f"rrtik reproduce {names}{' --quick' if quick else ''}"
    lines = ["# Published and measured", "", f"Written by `{command}`, rrtik-ompl {__version__}, {platform.machine()}."]
    lines += ["", MEANINGS, "", f"In all: {counted(done)}.", "", *counted_apart(done), ""]

    rows = [(f"`{table.name}`", table.title, counted([(table, rows)])) for table, rows in done]
    lines += markdown_table(("table", "what", "verdicts"), rows)

    for table, each in done:
        lines += ["", f"## {table.title}", "", f"`{table.name}`, {table.source}", ""]
        lines += [f"Fitted to the published figures: {table.fitted}.", ""] if table.fitted else []
        lines += [f"Bars: {table.bars}.", ""] if table.bars else []
        lines += markdown_table((*HEADS, "seen from"), [(*cells(row), row.detects) for row in each])

    return "\n".join([*lines, ""])


def _list(tables: Iterable[Table]) -> Printed:
    shown = Printed("name", "what", "published in", "full", "quick", "plots", right=(3, 4, 5))
    for each in tables:
        times = (_time(each.seconds), _time(each.quick_seconds))
        shown.add_row(each.name, each.title, each.source, *times, str(len(each.figures) or ""))
    return shown


def _table(rows: Sequence[Row]) -> Printed:
    shown = Printed(*HEADS)
    for row in rows:
        shown.add_row(*cells(row))
    return shown


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"


# --- what a round has done so far ------------------------------------------------------------------------------------


class Kept:
    """Storage for the tables that a round has measured, in a file beside its page; without a page nothing is kept.

    Args:
        markdown: The page.
        quick: Whether the round is the quick one; rows of another round, or of another version, are not used.
        readers: For the rows of each table.
    """

    def __init__(self, markdown: Path | None, quick: bool, readers: Readers) -> None:
        self._readers = readers
        self.file = None if markdown is None else markdown.with_suffix(".parts.jsonl")
        self._round = f"{__version__} {'quick' if quick else 'full'}"
        self._lines: dict[str, str] = {}

        if self.file is not None and self.file.is_file():
            for line in read_text(self.file).splitlines():
                self._lines[json.loads(line)["table"]] = line

    def known(self, table: Table) -> Sequence[Row] | None:
        """Return the rows of a table that this round measured before it was interrupted; None if there are none."""
        line = self._lines.get(table.name)
        if line is None or json.loads(line)["round"] != self._round:
            return None
        return [self._readers[table.name](each) for each in json.loads(line)["rows"]]

    def add(self, table: Table, rows: Sequence[Row]) -> None:
        """Store the rows of a table.

        Raises:
            InputError: If the disk is full; rows stored before are still there.
        """
        if self.file is None:
            return
        line = {"table": table.name, "round": self._round, "rows": [row.record() for row in rows]}
        self._lines[table.name] = json.dumps(line)
        write_text(self.file, "".join(f"{each}\n" for each in self._lines.values()))

    def forget(self) -> None:
        """Delete the file at the end of the round."""
        if self.file is not None:
            self.file.unlink(missing_ok=True)
