"""One figure beside what was printed or wanted, and the verdict on it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verdict(str, Enum):
    """What to make of a figure.

    ``held``: as printed or wanted, within what chance or the statement allows; ``differs``: not so, and the reading
    says why; ``missed``: outside what is expected too.
    """

    HELD = "held"
    DIFFERS = "differs"
    MISSED = "missed"

    @property
    def passes(self) -> bool:
        """Whether a report with this verdict is a success."""
        return self is not Verdict.MISSED


@dataclass(frozen=True, slots=True)
class Row:
    """One figure.

    Attributes:
        name: What it is.
        published: As printed, or what is wanted.
        measured: As it comes out here.
        verdict: What to make of it.
        reading: How the text was read, or why the figure differs.
    """

    name: str
    published: str
    measured: str
    verdict: Verdict
    reading: str = ""


def verdict(close: bool, expected: bool = False) -> Verdict:
    """``held`` if a figure is as printed or wanted, ``differs`` if as the reading lets expect, else ``missed``."""
    return Verdict.HELD if close else Verdict.DIFFERS if expected else Verdict.MISSED


def within(factor: float, measured: float, published: float) -> bool:
    """Whether a figure is at most so many times larger or smaller than the other; never for NaN."""
    return published / factor <= measured <= published * factor
