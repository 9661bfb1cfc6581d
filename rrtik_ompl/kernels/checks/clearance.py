"""Bounds of distances, and what rounding may have taken from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector

ROUNDING = 3e-6  # relative error of a distance in float32, with room to spare; the margin covers the rest


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """Bounds of the signed distance between the arm and all that it must not touch, for m configurations.

    Attributes:
        lower: No more than the distance [m], shape (m,); not above 0 means that nothing is proven. +inf if nothing can
            collide, -inf for joint values beyond what the margin covers.
        upper: No less than the distance [m], shape (m,); below 0 means a collision, +inf that nothing is known.
        pairs: Numbers of the two bodies that the lower bound is of, -1 where there are none, shape (m, 2). Solids that
            one joint carries count as one body, the first of them.
    """

    lower: Vector
    upper: Vector
    pairs: NDArray[np.int64]


def rounded(distances: Vector, sign: float) -> Vector:
    """Distances moved up (sign 1) or down (-1) by what float32 may have lost."""
    return distances * (1.0 + sign * ROUNDING * np.sign(distances))
