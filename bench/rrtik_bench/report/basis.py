"""Whether a source prints what a figure is compared with, or the bar is ours."""

from __future__ import annotations

STATEMENTS = frozenset({
    "a rotation", "about a tenth of the generations", "all", "closed form", "constant", "formula", "never moved",
    "no significant difference", "none", "sin(theta5)", "stated", "the same", "varies", "yes",
})  # fmt: skip
"""What is printed without a number, and is right or wrong without one of ours."""

WORDS = frozenset({
    "B is better in every scenario", "a cost", "a plot", "about the same time", "at every step shown", "at least one",
    "better", "binary converges more slowly", "bits disrupt", "by the eighth frame", "covered, in words",
    "end CONNECT", "far from optimal", "faster", "fewer, in words", "future work", "implied", "in the sixth frame",
    "joints may slide; none measured", "kinds are named, not counted", "named", "near the shortest",
    "no evidence that it helps", "no help, if none is blocked", "no more", "none, by implication", "not in the print",
    "not measured", "not optimal", "not treated", "one is shown", "shorter", "smooth", "solved; no time",
    "stalls, unless along the axes", "usable",
    "visible",
})  # fmt: skip
"""What leaves the number that judges to us, or is not printed at all."""


def is_printed(published: str) -> bool:
    """Whether a printed number or statement judges; what has a digit is a printed number.

    Raises:
        ValueError: If nobody has said of these words which of the two they are.
    """
    if any(sign.isdigit() for sign in published) or published in STATEMENTS:
        return True
    if published in WORDS:
        return False
    raise ValueError(f"neither a number nor among STATEMENTS and WORDS of {__name__}: {published!r}")
