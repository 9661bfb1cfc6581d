"""One figure beside what was printed or wanted, the bar that judges it, and the verdict."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum
from typing import TypeAlias

import numpy as np

Span: TypeAlias = tuple[float, float]  # both ends belong to it
INFINITE = float("inf")


class Verdict(str, Enum):
    """What to make of a figure.

    ``held``: as printed or wanted, within what chance or the statement allows; ``better``: beyond that, on the side
    that is wanted; ``differs``: not so, but as the reading lets expect; ``refuted``: a computation shows that the print
    is wrong; ``missed``: none of these.
    """

    HELD = "held"
    BETTER = "better"
    DIFFERS = "differs"
    REFUTED = "refuted"
    MISSED = "missed"

    @property
    def passes(self) -> bool:
        """Whether a report with this verdict is a success."""
        return self is not Verdict.MISSED


@dataclass(frozen=True, slots=True)
class Bar:
    """What a measured number has to be: the first interval that it lies in gives the verdict; else it is missed.

    Attributes:
        possible: What a measurement can be at all.
        held: As printed.
        better: Beyond the print, on the side that is wanted.
        refuted: Where the number shows that the print is wrong.
        differs: What the reading lets expect.

    Raises:
        ValueError: If no possible number would be missed or refute the print: such a bar judges nothing.
    """

    possible: Span
    held: Span
    better: Span | None = None
    refuted: Span | None = None
    differs: Span | None = None

    def __post_init__(self) -> None:
        if not self.wrong():
            raise ValueError(f"nothing can be missed: {self}")

    def __call__(self, value: float) -> Verdict:
        """The verdict on a number; NaN, for a measurement that failed, is missed."""
        for verdict in Verdict:
            span = None if verdict is Verdict.MISSED else getattr(self, verdict.value)
            if span is not None and span[0] <= value <= span[1]:
                return verdict
        return Verdict.MISSED

    def wrong(self) -> list[float]:
        """Possible numbers that are missed or refute the print: ends of what is possible, and beside each end."""
        spans = [span for field in fields(self) if (span := getattr(self, field.name)) is not None]
        ends = np.array(sorted({float(np.clip(end, -1e12, 1e12)) for span in spans for end in span}))
        beside = np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1]), ends * 1.001 + 1e-15, ends * 0.999 - 1e-15])
        low, high = self.possible
        bad = (Verdict.MISSED, Verdict.REFUTED)
        return [float(value) for value in beside if low <= value <= high and self(value) in bad]


@dataclass(frozen=True, slots=True)
class Row:
    """One figure.

    Attributes:
        name: What it is.
        published: As printed, or what is wanted.
        measured: As it comes out here.
        verdict: What to make of it; None where there is nothing to judge, as for seconds on another machine.
        reading: How the text was read, or why the figure differs.
        value: The number that was judged.
        bar: By which.
    """

    name: str
    published: str
    measured: str
    verdict: Verdict | None
    reading: str = ""
    value: float = float("nan")
    bar: Bar | None = None


def judged(name: str, published: str, measured: str, value: float, bar: Bar, reading: str = "") -> Row:
    """A row whose verdict follows from a number by a bar.

    Example:
        >>> judged("rank", "4", "5", 5, Bar((0, 6), held=(4, 4), refuted=(5, 5))).verdict.value
        'refuted'
    """
    return Row(name, published, measured, bar(float(value)), reading, float(value), bar)


def verdict(held: bool) -> Verdict:
    """``held`` or ``missed``, of what is wanted and not printed."""
    return Verdict.HELD if held else Verdict.MISSED


def within(factor: float, published: float) -> Span:
    """From so many times smaller to so many times larger than a positive number."""
    return published / factor, published * factor


def about(published: float, tolerance: float) -> Span:
    """As far on both sides of a number."""
    return published - tolerance, published + tolerance


def exactly(published: float, most: float) -> Bar:
    """The bar of a whole number that is none if it is not exactly as printed; ``most`` can be counted."""
    return Bar((0.0, most), held=(published, published))


def small(tolerance: float, most: float = 10.0) -> Bar:
    """The bar of a deviation that has to be at most a tolerance."""
    return Bar((0.0, most), held=(0.0, tolerance))


def all_of(refutes: bool = False) -> Bar:
    """The bar of a share, from 0 to 1, that has to be 1; where it ``refutes``, less shows that the print is wrong."""
    return Bar((0.0, 1.0), held=(1.0, 1.0), refuted=(0.0, 1.0) if refutes else None)
