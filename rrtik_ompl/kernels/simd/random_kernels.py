"""Random numbers inside kernels, all from one whole number: uniform shares, and points that cover a box evenly."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    choose,
    larger,
    set_wide_lanes,
    wide_lanes_at,
)

# Constants of splitmix64 [46], without signs: LLVM may assume that a signed number never overflows.
GOLDEN, FIRST_FACTOR, SECOND_FACTOR = (
    np.uint64(x) for x in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
SHIFT_30, SHIFT_27, SHIFT_31, SHIFT_11 = (np.uint64(x) for x in (30, 27, 31, 11))
SHARE_OF_BIT = 2.0**-53
LEAST_REST = 1e-12


@kernel
def next_share(table: Any) -> float:
    """The next number in [0, 1); the state is the field ``random`` of a table. Source: splitmix64 [46]."""
    state: Any = np.uint64(table.random) + GOLDEN
    table.random = np.int64(state)
    mixed = (state ^ (state >> SHIFT_30)) * FIRST_FACTOR
    mixed = (mixed ^ (mixed >> SHIFT_27)) * SECOND_FACTOR
    return float(np.int64((mixed ^ (mixed >> SHIFT_31)) >> SHIFT_11)) * SHARE_OF_BIT


@inlined
def next_in_bases(x: Any, inverse: Any) -> Any:
    """The successors of x in the van der Corput sequences of bases 1 / inverse, in wide lanes.

    To each, 1 is added at its first digit, and the carry runs towards the later digits. The successor is that of [47];
    from a random first point it is a randomised Halton sequence [48].
    """
    rest = larger((1.0 - x) - LEAST_REST, LEAST_REST)  # less, as x is rounded
    previous = inverse
    digit = inverse
    first = carry = digit >= rest
    while bits(carry) != 0:
        previous = choose(carry, digit, previous)
        digit = choose(carry, digit * inverse, digit)
        carry = digit >= rest
    return choose(first, larger(((x + previous) + digit) - 1.0, 0.0), x + inverse)


@kernel
def start_points(table: Any, points: Any, count: int) -> int:
    """Set the first point of a sequence in ``count`` dimensions."""
    for k in range(count):
        points[k] = next_share(table)
    return count


@kernel
def next_point(table: Any, points: Any, inverses: Any, count: int) -> int:
    """Replace a point by the next one: of the Halton sequence, or uniformly random where the inverse bases are 0.

    Both arrays have room for whole lanes.
    """
    if inverses[0] > 0.0:
        for block in range((count + WIDTH - 1) // WIDTH):
            x = next_in_bases(wide_lanes_at(points, block), wide_lanes_at(inverses, block))
            set_wide_lanes(points, block, x)
    else:
        start_points(table, points, count)
    return count
