"""Colours of what is drawn, as '#rrggbb'."""

from __future__ import annotations

import re
from collections.abc import Iterable

from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import finite_array
from rrtik_ompl.base.errors import InputError

PATTERN = "^#[0-9a-fA-F]{6}$"


def color_of(value: str | ArrayLike | None, what: str) -> str | None:
    """Return a colour as '#rrggbb'; None if there is none.

    Args:
        value: '#rrggbb', or red, green and blue from 0 to 1.
        what: What has this colour, for messages.

    Raises:
        InputError: If it is neither.

    Example:
        >>> color_of([1.0, 0.5, 0.0], "color of 'cup'")
        '#ff8000'
    """
    remedy = "use '#rrggbb', such as '#0072b2', or red, green and blue from 0 to 1"
    if value is None:
        return None

    if isinstance(value, str):
        if not re.match(PATTERN, value):
            raise InputError(f"{what}: '{value}' is not a colour; {remedy}")
        return value.lower()

    parts = finite_array(value, (3,), what)
    if parts.min() < 0.0 or parts.max() > 1.0:
        raise InputError(f"{what}: {parts.tolist()} is not a colour; {remedy}")
    return hexadecimal(parts)


def hexadecimal(fractions: Iterable[float]) -> str:
    """Convert red, green and blue between 0 and 1 to the colour '#rrggbb'."""
    return "#" + "".join(f"{round(255 * min(max(float(part), 0.0), 1.0)):02x}" for part in fractions)


def fractions(color: str) -> list[float]:
    """Convert the colour '#rrggbb' to red, green and blue between 0 and 1."""
    return [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
