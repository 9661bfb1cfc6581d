"""Colours of the page: distinguishable for colour-blind people (hues of Okabe and Ito, 2008 [55])."""

from __future__ import annotations

from collections.abc import Iterable

ROBOT = "#5b6b7c"
ROBOT_ALTERNATE = "#8494a5"  # every second link, so that the joints can be seen
START = "#0072b2"
GOAL = "#009e73"
OBSTACLE = "#e6b35a"
ATTACHED = "#cc79a7"
INK = "#1d2733"
TRAIL = "#d55e00"
UNPROVEN = "#7b3294"  # trail of the tip on motions that are not proven free
BEFORE = "#56b4e9"
TOUCHING = "#d1242f"  # bodies in collision
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6bb1", "#7f7f7f")  # in this order
AXES = ("#d55e00", "#009e73", "#0072b2")  # x, y, z
BACKGROUND_TOP = "#fbfcfd"
BACKGROUND_BOTTOM = "#e3e9ef"
GRID_MIDDLE, GRID = "#bcc6d0", "#d2d9e0"
BACKGROUND_TOP_DARK, BACKGROUND_BOTTOM_DARK = "#2b3541", "#171d24"  # used if the system prefers dark pages
GRID_MIDDLE_DARK, GRID_DARK = "#4d5965", "#38434f"


def number(color: str) -> int:
    """Convert the colour '#rrggbb' to a number for three.js."""
    return int(color.removeprefix("#"), 16)


def hexadecimal(fractions: Iterable[float]) -> str:
    """Convert red, green and blue between 0 and 1 to the colour '#rrggbb'."""
    return "#" + "".join(f"{round(255 * min(max(float(part), 0.0), 1.0)):02x}" for part in fractions)


def fractions(color: str) -> list[float]:
    """Convert the colour '#rrggbb' to red, green and blue between 0 and 1."""
    return [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
