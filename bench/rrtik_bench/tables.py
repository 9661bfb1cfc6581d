"""Published tables: what `rrtik reproduce` finds through the entry points ``rrtik_ompl.tables``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rrtik_bench.report.rows import Row


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
    """

    name: str
    title: str
    source: str
    run: Callable[[bool], Sequence[Row]]
    seconds: float
    quick_seconds: float


@dataclass(frozen=True, slots=True)
class Collection:
    """The tables that a package offers, in the order in which they are listed.

    Attributes:
        tables: No two of the same name.
        not_here: What was published and is not among them, a line each.
    """

    tables: tuple[Table, ...]
    not_here: tuple[str, ...] = ()
