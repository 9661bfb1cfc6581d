"""The command `rrtik reproduce`: published tables measured again, printed beside what was published."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

import typer

from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.cli.published.kept import Kept
from rrtik_ompl.cli.published.page import HEADS, Row, Table, cells, counted, page, plain
from rrtik_ompl.cli.terminal import note, plural, progress, say
from rrtik_ompl.files.text import check_target, write_text

if TYPE_CHECKING:
    from rich.table import Table as RichTable

NONE: Mapping[str, str] = MappingProxyType({})
WIDTH = 60  # of a reading in a table for a person


def _folder(given: Path | None) -> Path | None:
    """The folder; no other option, which typer takes for one where the folder is left out."""
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
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")] = False,
) -> int:
    """Measure published tables again.

    Exit code 1 if a figure is missed.
    """
    from rrtik_ompl.description.catalog import find_tables

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

    also = {name: stem for offer in offers for name, stem in offer.also.items()}
    wanted = list(known.values()) if everything else chosen(known, tables or (), also)

    if plot is not None:
        return _draw(wanted, quick, plot)

    note(f"{plural(len(wanted), 'table')}, about {_time(sum(_seconds(each, quick) for each in wanted))} on two cores")
    kept = Kept(markdown, quick)

    try:
        done = [(table, _rows(table, quick, kept, shown=not as_json)) for table in wanted]
    except KeyboardInterrupt:
        if kept.file is not None:
            note(f"what is done is kept in {kept.file}; the same command goes on from there")
        raise

    if markdown is not None:
        write_text(markdown, page(done, quick))
    kept.forget()

    if as_json:
        print(json.dumps({table.name: [plain(row) for row in rows] for table, rows in done}))
    else:
        say(counted(done))
        say(*([] if markdown is None else [f"wrote {markdown}"]))
    return 1 if any(row.verdict is not None and not row.verdict.passes for _, rows in done for row in rows) else 0


def _rows(table: Table, quick: bool, kept: Kept, *, shown: bool) -> Sequence[Row]:
    """Measured, or as an earlier round that was interrupted left them."""
    begin = time.perf_counter()
    known = kept.known(table)
    with progress(f"{table.name}: {table.title}, about {_time(_seconds(table, quick))}"):
        rows = table.run(quick) if known is None else known
    kept.add(table, rows)

    if shown:
        took = "kept from before" if known is not None else f"{time.perf_counter() - begin:.1f} s"
        say(f"{table.name}: {table.title} ({table.source}), {took}", *_fitted(table), _table(rows))
    return rows


def _fitted(table: Table) -> list[str]:
    fitted = [f"fitted to the published figures: {table.fitted}"] if table.fitted else []
    return [*fitted, *([f"bars: {table.bars}"] if table.bars else [])]


def _draw(tables: Iterable[Table], quick: bool, folder: Path) -> int:
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
    return 0


def chosen(known: Mapping[str, Table], names: Iterable[str], also: Mapping[str, str] = NONE) -> list[Table]:
    """The tables of these names, in the order of ``known``; ``mb-rrt`` stands for all whose name begins so.

    Args:
        known: All tables by name.
        names: Of those that are wanted.
        also: Other words for beginnings of names.

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


def _list(tables: Iterable[Table]) -> RichTable:
    from rich import box
    from rich.table import Table

    shown = Table("name", "what", "published in", "full", "quick", "--plot", box=box.SIMPLE_HEAD, pad_edge=False)
    for each in tables:
        figures = ", ".join(figure.name for figure in each.figures)
        shown.add_row(each.name, each.title, each.source, _time(each.seconds), _time(each.quick_seconds), figures)
    return shown


def _table(rows: Sequence[Row]) -> RichTable:
    from rich import box
    from rich.table import Table

    shown = Table(*HEADS, box=box.SIMPLE_HEAD, pad_edge=False)
    shown.columns[-1].max_width = WIDTH

    for row in rows:
        shown.add_row(*cells(row))
    return shown


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"
