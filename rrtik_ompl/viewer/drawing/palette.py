"""Colours of the page: distinguishable for colour-blind people (hues of Okabe and Ito, 2008 [55])."""

from __future__ import annotations

ROBOT = "#5b6b7c"
ROBOT_ALTERNATE = "#8494a5"  # every second link, so that the joints can be seen
START = "#0072b2"
GOAL = "#009e73"
OBSTACLE = "#e3bd84"
# Of obstacles that state no colour, the largest kind first; away from the hues of ghosts, trails and contacts.
OBSTACLES = (OBSTACLE, "#a8b8c8", "#cc9480", "#9d92c7", "#cfc48a", "#83a6ab", "#d3a3b4", "#a08b77")
GROUND = "#c9bfa8"
ATTACHED = "#cc79a7"
INK = "#1d2733"
TRAIL = "#d55e00"
UNPROVEN = "#7b3294"  # trail of the tip on motions that are not proven free
BEFORE = "#56b4e9"
TOUCHING = "#d1242f"  # bodies in collision
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6bb1", "#7f7f7f")  # in this order
AXES = ("#d64545", "#3a9d3a", "#3a6fd8")  # x, y, z, as of the handles; away from trail and goal
BACKGROUND_TOP = "#f4f7f9"
BACKGROUND_BOTTOM = "#d8e0e8"
GRID_MIDDLE = "#a9b5c1"
GRID = "#bfc9d3"
BACKGROUND_TOP_DARK, BACKGROUND_BOTTOM_DARK = "#2b3541", "#171d24"  # used if the system prefers dark pages
GRID_MIDDLE_DARK = "#4d5965"
GRID_DARK = "#38434f"


def number(color: str) -> int:
    """Convert the colour '#rrggbb' to a number for three.js."""
    return int(color.removeprefix("#"), 16)
