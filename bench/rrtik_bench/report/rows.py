"""One figure beside what was printed or wanted, the bar that judges it, and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, TypeAlias

import numpy as np

from rrtik_bench.report.basis import is_printed

Span: TypeAlias = tuple[float, float]  # both ends belong to it
INFINITE = float("inf")
LARGE = 10.0  # a change by a larger factor is told by where it leads
SIGMAS = 3.0  # standard errors that are chance


class Verdict(str, Enum):
    """What to make of a figure.

    ``held``: as printed or wanted, within what chance or the statement allows; ``better``: beyond that, on the side
    that is wanted, on the printed problem by a method of ours; ``differs``: not so, but as the reading lets expect,
    which holds for the printed method that comes out better, too; ``refuted``: a computation shows that the print is
    wrong; ``missed``: none of these.
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

    def turns(self, value: float) -> tuple[float, float]:
        """The nearest numbers below and above a value at which the verdict is another one; infinite if there is none.

        A run with stated seeds gives the same number each time: any change of the code that moves it farther than
        there is seen.

        Example:
            >>> Bar((0.0, 10.0), held=(2.0, 4.0), differs=(1.0, 2.0)).turns(3.0)
            (2.0, 4.0)
        """
        spans = [span for field in fields(self) if (span := getattr(self, field.name)) is not None]
        ends = sorted({end for span in spans for end in span})
        here = self(value)

        def turned(end: float, towards: float) -> bool:
            """Whether the verdict just beyond an end is another one, if a measurement can be there at all."""
            beyond = float(np.nextafter(end, towards))
            return self.possible[0] <= beyond <= self.possible[1] and self(beyond) is not here

        below = [end for end in ends if end <= value and turned(end, -INFINITE)]
        above = [end for end in ends if end >= value and turned(end, INFINITE)]
        return max(below, default=-INFINITE), min(above, default=INFINITE)

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
        runs: The numbers of single runs from which the value follows, where it does by one of `STATISTICS`.
        statistic: By which of them.

    Raises:
        ValueError: If a row that is judged has words for its print of which nobody said whether they judge.
    """

    name: str
    published: str
    measured: str
    verdict: Verdict | None
    reading: str = ""
    value: float = float("nan")
    bar: Bar | None = None
    runs: tuple[float, ...] = ()
    statistic: str = ""

    def __post_init__(self) -> None:
        if self.bar is not None:
            is_printed(self.published)  # said now, not after a round of twenty minutes

    @property
    def printed(self) -> bool:
        """Whether the source prints what the number is compared with; else the bar is ours."""
        return is_printed(self.published)

    @property
    def detects(self) -> str:
        """The least changes of the number with which the verdict would be another one."""
        if self.bar is None or np.isnan(self.value):
            return ""
        below, above = self.bar.turns(self.value)
        told = [_change(self.value, below, "less"), _change(self.value, above, "more")]
        return ", ".join(change for change in told if change)

    def record(self) -> dict[str, object]:
        """Plain values for JSON, from which `row_of` makes the row again; numbers that are not finite are words."""
        told: dict[str, object] = {"name": self.name, "published": self.published, "measured": self.measured}
        told |= {"verdict": None if self.verdict is None else self.verdict.value, "reading": self.reading}
        if self.bar is None:
            return told
        spans = {field.name: getattr(self.bar, field.name) for field in fields(self.bar)}
        bar = {name: [_plain(end) for end in span] for name, span in spans.items() if span is not None}
        judged_by = {"value": _plain(self.value), "bar": bar, "printed": self.printed, "detects": self.detects}
        return told | judged_by | ({"statistic": self.statistic, "runs": list(self.runs)} if self.statistic else {})


def row_of(record: Mapping[str, Any]) -> Row:
    """A row that was stored, judged again: its number follows from its runs, its verdict from number and bar.

    Raises:
        ValueError: If number or verdict that were stored do not follow.
    """
    name, published, measured, reading = (str(record[key]) for key in ("name", "published", "measured", "reading"))
    if record["verdict"] is None or "bar" not in record:
        verdict = None if record["verdict"] is None else Verdict(record["verdict"])
        return Row(name, published, measured, verdict, reading)

    bar = Bar(**{name: (float(low), float(high)) for name, (low, high) in record["bar"].items()})
    value = float(record["value"])
    runs = tuple(record.get("runs", ()))
    by = record.get("statistic", "")
    again = STATISTICS[by](runs) if runs else value
    row = Row(name, published, measured, bar(again), reading, again, bar, runs, by)

    if not np.isclose(again, value, rtol=1e-12, atol=0.0, equal_nan=True):
        raise ValueError(f"{row.name}: {value!r} is stored, its runs give {again!r}")
    if row.record()["verdict"] != record["verdict"]:
        raise ValueError(f"{row.name}: {record['verdict']!r} is stored, {value:g} is {row.record()['verdict']!r}")
    return row


def _plain(number: float) -> float | str:
    """A number for JSON, which has none for infinity and NaN."""
    return number if np.isfinite(number) else str(number)


def _change(value: float, end: float, side: str) -> str:
    """In per cent of a value, absolute where it is zero, or in a word where any change is too much."""
    if not np.isfinite(end):
        return ""
    if value == end:
        return f"any {side}"
    change = (end - value) / abs(value) if value else INFINITE
    return f"{100.0 * change:+.2g} %" if abs(change) < LARGE else f"to {end:.2g}"


STATISTICS: Mapping[str, Callable[[Sequence[float]], float]] = {
    "mean": lambda runs: float(np.mean(runs)),
    "median": lambda runs: float(np.median(runs)),
    "least": lambda runs: float(np.min(runs)),
    "most": lambda runs: float(np.max(runs)),
    "deviation": lambda runs: float(np.std(runs, ddof=1)),
}


def judged_runs(
    name: str, published: str, measured: str, runs: Sequence[float], bar: Bar, reading: str = "", *, by: str = "mean"
) -> Row:
    """A row whose number is a statistic of single runs, which it keeps: no runs are missed.

    Example:
        >>> judged_runs("length", "2", "2.5", [2.0, 3.0], Bar((0, 9), held=(2.0, 2.2), differs=(2.2, 3.0))).detects
        '-12 %, +20 %'
    """
    value = STATISTICS[by](runs) if len(runs) else float("nan")
    return Row(name, published, measured, bar(value), reading, value, bar, tuple(map(float, runs)), by)


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


def by_chance(first: tuple[float, int], second: tuple[float, int]) -> float:
    """Three standard errors of the difference of two means, each from a deviation and a number of runs."""
    return SIGMAS * float(np.sqrt(sum(deviation**2 / count for deviation, count in (first, second))))


def as_before(value: float, count: int, runs: Sequence[float], least: float = 0.0) -> Span:
    """What so many runs gave before, within chance of as many as there are now; ``least`` is their least deviation."""
    deviation = max(float(np.std(runs)) if len(runs) else 0.0, least)
    return about(value, by_chance((deviation, max(len(runs), 1)), (deviation, count)))


def both(first: Span, second: Span) -> Span | None:
    """Where two spans overlap; None if they do not."""
    low = max(first[0], second[0])
    high = min(first[1], second[1])
    return (low, high) if low <= high else None


def exactly(published: float, most: float) -> Bar:
    """The bar of a whole number that is none if it is not exactly as printed; ``most`` can be counted."""
    return Bar((0.0, most), held=(published, published))


def small(tolerance: float, most: float = 10.0) -> Bar:
    """The bar of a deviation that has to be at most a tolerance."""
    return Bar((0.0, most), held=(0.0, tolerance))


def all_of(refutes: bool = False) -> Bar:
    """The bar of a share, from 0 to 1, that has to be 1; where it ``refutes``, less shows that the print is wrong."""
    return Bar((0.0, 1.0), held=(1.0, 1.0), refuted=(0.0, 1.0) if refutes else None)
