"""Random numbers inside kernels, all from one whole number: uniform shares, and points that cover a box evenly."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.compiled import inlined, kernel
from rrtik_ompl.fast.lanes import double_at, field, set_double, set_field

# Constants of splitmix64 as signed whole numbers.
GOLDEN = np.int64(0x9E3779B97F4A7C15 - 2**64)
FIRST_FACTOR = np.int64(0xBF58476D1CE4E5B9 - 2**64)
SECOND_FACTOR = np.int64(0x94D049BB133111EB - 2**64)
SHARE_OF_BIT = 2.0**-53
LEAST_REST = 1e-12


@inlined
def shifted(number: Any, places: int) -> Any:
    """Bits moved down by ``places``, zeros moved in (a signed number would move in its sign)."""
    return (number >> places) & ((np.int64(1) << (np.int64(64) - places)) - 1)


@kernel
def next_share(table: int, place: int) -> float:
    """The next number in [0, 1); the state is a field of a table. Source: splitmix64 (Steele, Lea, Flood 2014)."""
    state = field(table, place) + GOLDEN
    set_field(table, place, state)
    mixed = (state ^ shifted(state, 30)) * FIRST_FACTOR
    mixed = (mixed ^ shifted(mixed, 27)) * SECOND_FACTOR
    return float(shifted(mixed ^ shifted(mixed, 31), 11)) * SHARE_OF_BIT


@kernel
def next_in_base(x: float, inverse: float) -> float:
    """The successor of x in the van der Corput sequence of base 1 / inverse: 1 is added to its first digit.

    The carry runs towards the later digits. From a random first point it is a randomised Halton sequence (Struckmeier
    1995; Wang and Hickernell 2000).
    """
    rest = max(1.0 - x - LEAST_REST, LEAST_REST)  # less, as x is rounded
    if inverse < rest:
        return x + inverse
    digit = inverse
    previous = digit
    while digit >= rest:
        previous = digit
        digit *= inverse
    return max(x + previous + digit - 1.0, 0.0)


@kernel
def start_points(table: int, place: int, points: int, count: int) -> int:
    """Set the first point of a sequence in ``count`` dimensions."""
    for k in range(count):
        set_double(points, k, next_share(table, place))
    return count


@kernel
def next_point(table: int, place: int, points: int, inverses: int, count: int) -> int:
    """Replace a point by the next one: of the Halton sequence, or uniformly random where the inverse base is 0."""
    for k in range(count):
        inverse = double_at(inverses, k)
        if inverse > 0.0:
            set_double(points, k, next_in_base(double_at(points, k), inverse))
        else:
            set_double(points, k, next_share(table, place))
    return count
