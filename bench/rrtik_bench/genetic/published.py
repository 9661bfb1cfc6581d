"""What [2] gives: its trajectories, its tables, its expanded kinematics. Lengths in inches, as there."""

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

REFERENCE = {  # joints [deg]: wrist or tip [in]
    (0.0, 0.0, 0.0): (17.8, 4.9, -17.0),
    (30.0, -40.0, 20.0): (14.5144, 14.0380, -4.7738),
    (30.0, -40.0, 20.0, 50.0, 60.0): (13.1139, 14.9146, -6.2263),
}


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


def expanded_tip(q: np.ndarray, d7: float = 2.2) -> np.ndarray:
    """The tip of the five-joint arm [in] as published, term by term; q: shape (m, 5) [rad]."""
    a2, a3, d3, d4 = 17.0, 0.8, 4.9, 17.0
    (c1, c2, c3, c4, c5), (s1, s2, s3, s4, s5) = np.cos(q).T, np.sin(q).T
    x = a2 * c1 * c2 + a3 * c1 * c2 * c3 - d3 * s1 - d4 * c1 * c3 * s2 - d7 * c1 * c3 * c5 * s2 - d4 * c1 * c2 * s3
    x += -d7 * c1 * c2 * c5 * s3 - a3 * c1 * s2 * s3 - d7 * c1 * c2 * c3 * c4 * s5 + d7 * c1 * c4 * s2 * s3 * s5
    x += -d7 * s1 * s4 * s5
    y = d3 * c1 + a2 * c2 * s1 + a3 * c2 * c3 * s1 - d4 * c3 * s1 * s2 - d7 * c3 * c5 * s1 * s2 - d4 * c2 * s1 * s3
    y += -d7 * c2 * c5 * s1 * s3 - a3 * s1 * s2 * s3 - d7 * c2 * c3 * c4 * s1 * s5 + d7 * c4 * s1 * s2 * s3 * s5
    y += d7 * c1 * s4 * s5
    z = -d4 * c2 * c3 - d7 * c2 * c3 * c5 - a2 * s2 - a3 * c3 * s2 - a3 * c2 * s3 + d4 * s2 * s3 + d7 * c5 * s2 * s3
    z += d7 * c3 * c4 * s2 * s5 + d7 * c2 * c4 * s3 * s5
    return np.stack([x, y, z], axis=1)
