"""The command `rrtik reproduce`: published tables measured again, printed beside what was published."""

from __future__ import annotations

import json
import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from rrtik_ompl.errors import InputError
from rrtik_ompl.terminal import note, progress, say
from rrtik_ompl.text_file import check_target

HEADS = ("figure", "published", "measured", "verdict", "reading")
WIDTH = 60  # of a reading in a table for a person


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
    check_target(markdown, (".md",))
    from rrtik_bench.registry import NOT_HERE, TABLES, chosen

    if listed:
        say(_list(list(TABLES.values())), *NOT_HERE)
        return 0
    if everything == bool(tables):
        raise InputError("which tables? give their names, or --all; `rrtik reproduce --list` shows them")
    wanted = list(TABLES.values()) if everything else chosen(tables or ())
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
    counts = Counter(row.verdict for _, rows in done for row in rows)
    if as_json:
        print(json.dumps({table.name: [asdict(row) for row in rows] for table, rows in done}))
    else:
        say(", ".join(f"{number} {verdict}" for verdict, number in counts.items()))
        say(*([] if markdown is None else [f"wrote {markdown}"]))
    return 1 if counts["missed"] else 0


def _seconds(table: Any, quick: bool) -> float:
    return float(table.quick_seconds if quick else table.seconds)


def _list(tables: list[Any]) -> Any:
    from rich import box
    from rich.table import Table

    shown = Table("name", "what", "published in", "full", "quick", box=box.SIMPLE_HEAD, pad_edge=False)
    for each in tables:
        shown.add_row(each.name, each.title, each.source, _time(each.seconds), _time(each.quick_seconds))
    return shown


def _table(rows: list[Any]) -> Any:
    from rich import box
    from rich.table import Table

    shown = Table(*HEADS, box=box.SIMPLE_HEAD, pad_edge=False)
    shown.columns[-1].max_width = WIDTH
    for row in rows:
        shown.add_row(row.name, row.published, row.measured, row.verdict, row.reading)
    return shown


def _write(file: Path, done: list[tuple[Any, list[Any]]], quick: bool) -> None:
    import platform

    from rrtik_ompl import __version__
    from rrtik_ompl.text_file import write_text

    command = f"rrtik reproduce {'--all' if len(done) > 1 else done[0][0].name}{' --quick' if quick else ''}"
    lines = ["# Published and measured", "", f"Written by `{command}`, rrtik-ompl {__version__}, {platform.machine()}."]
    lines += [
        "",
        "Held: as printed, within chance. Differs: not as printed, and the reading says why. Missed: neither.",
    ]
    for table, rows in done:
        lines += ["", f"## {table.title}", "", f"`{table.name}`, {table.source}", ""]
        lines += ["| " + " | ".join(HEADS) + " |", "|" + "---|" * len(HEADS)]
        cells = ([row.name, row.published, row.measured, row.verdict, row.reading] for row in rows)
        lines += ["| " + " | ".join(text.replace("|", "\\|") for text in each) + " |" for each in cells]
    write_text(file, "\n".join([*lines, ""]))


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
