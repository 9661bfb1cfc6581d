"""Published tables: what `rrtik reproduce` finds through the entry points ``rrtik_ompl.tables``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rrtik_bench.report.figures import Figure
from rrtik_bench.report.rows import Row, row_of


@dataclass(frozen=True, slots=True)
class Table:
    """A table or a figure with numbers.

    Attributes:
        name: What to call it on the command line.
        title: What it shows.
        source: Where it was published.
        run: Measures it, quickly (fewer runs, the same rules) or in full.
        seconds: About how long the full measurement takes on two cores, on its own; tables of a page may share runs.
        quick_seconds: The same for the quick one.
        fitted: What was chosen here so that figures come out as published, if anything was.
        bars: Who set the bars, the source or we, where the source prints no numbers to compare with.
        figures: Drawn from what is measured, see `rrtik reproduce --plot`.
    """

    name: str
    title: str
    source: str
    run: Callable[[bool], Sequence[Row]]
    seconds: float
    quick_seconds: float
    fitted: str = ""
    bars: str = ""
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True, slots=True)
class Collection:
    """The tables that a package offers, in the order in which they are listed.

    Attributes:
        tables: No two of the same name.
        not_here: What was published and is not among them, a line each.
        also: Other words for the beginnings of names.
        row_of: Makes a row of a record again, see `rrtik_bench.report.rows.row_of`.
    """

    tables: tuple[Table, ...]
    not_here: tuple[str, ...] = ()
    also: Mapping[str, str] = field(default_factory=dict)
    row_of: Callable[[Mapping[str, Any]], Row] = row_of
