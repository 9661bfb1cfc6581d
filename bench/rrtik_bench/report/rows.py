"""One line of a comparison: what was printed, what was measured, how the text was read, and what to make of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

HELD, DIFFERS, MISSED = "held", "differs", "missed"


@dataclass(frozen=True, slots=True)
class Row:
    """One figure.

    Attributes:
        name: What it is.
        published: As printed.
        measured: As it comes out here.
        verdict: ``held``: as printed, within what chance or the statement allows; ``differs``: not as printed, and the
            reading says why; ``missed``: outside what is expected too.
        reading: How the text was read, or why the figure differs.
    """

    name: str
    published: str
    measured: str
    verdict: str
    reading: str = ""


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
    run: Callable[[bool], list[Row]]
    seconds: float
    quick_seconds: float


def verdict(close: bool, expected: bool = False) -> str:
    """``held`` if a figure is as printed, ``differs`` if it is as the reading lets expect, else ``missed``."""
    return HELD if close else DIFFERS if expected else MISSED


def within(factor: float, measured: float, published: float) -> bool:
    """Whether a figure is at most so many times larger or smaller than the other; never for NaN."""
    return published / factor <= measured <= published * factor
