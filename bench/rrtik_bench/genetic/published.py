"""What [2] gives: its trajectories and its tables. Lengths in inches, as there."""

from __future__ import annotations

import numpy as np

INCH = 0.0254  # [m]
TOLERANCE = 0.002
POINTS = 251

# trajectory: (without reduction: completed %, Ger/Pt), (with it: generations, Ger/Pt); three joints, limit 10000
TABLE_4 = {
    1: ((18.7, 210), (2000, 7)),
    2: ((16.3, 240), (6678, 26)),
    3: ((19.9, 198), (4245, 16)),
    4: ((15.5, 255), (8587, 34)),
}
TABLE_5 = {1: (7309, 29), 2: (13137, 52), 3: (10100, 40), 4: (13817, 55)}  # five joints; generations, Ger/Pt
FIRST_POINT = {3: (359, 359, 335, 356), 5: (689, 689, 902, 402)}  # generations to the first point, by joints


def curve(number: int) -> np.ndarray:
    """Points of trajectory 1 to 4 [in], shape (251, 3)."""
    t = np.arange(POINTS) * (0.02 if number == 2 else 0.01)
    if number == 1:
        rows = 7 + t, 7 - t / 2, -17 + 2 * t
    elif number == 2:
        rows = 7 + np.cos(3 * t) * t / 5, 7 + np.sin(3 * t) * t / 5, -17 + 2 * t
    elif number == 3:
        rows = 7 + np.sin(np.cos(2 * t)), 7 + t * np.cos(t) / 2, -7 + 2 * t * np.cos(t) * np.sin(t)
    else:
        rows = 8 + 3 * np.cos(4 * t), np.full_like(t, 8.0), -13 + t
    return np.stack(rows, axis=1)
