"""Steps of damped least squares in kernels: small systems of linear equations, and how far joints go."""

from __future__ import annotations

import math

from rrtik_ompl.kernels.ik.ik_layout import StepRules
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.records import row_at

ANY_PIVOT = -1e300  # less than any pivot


@inlined
def solve_in_place(square: Doubles, size: int, vector: Doubles, least: float) -> None:
    """Replace a vector by the solution x of A x = vector, and the matrix A by its decomposition (Cholesky's).

    Args:
        square: The lower half of A, rows of ``size``; afterwards with the inverse of the diagonal.
        size: How many equations.
        vector: As many numbers.
        least: Pivots that are less count as this.
    """
    for a in range(size):
        row = row_at(square, size, a)
        for b in range(a + 1):
            other = row_at(square, size, b)
            rest = row[b]
            for k in range(b):
                rest -= row[k] * other[k]
            row[b] = 1.0 / math.sqrt(max(rest, least)) if a == b else rest * other[b]
    for a in range(size):
        row = row_at(square, size, a)
        rest = vector[a]
        for k in range(a):
            rest -= row[k] * vector[k]
        vector[a] = rest * row[a]
    for a in range(size - 1, -1, -1):
        rest = vector[a]
        for k in range(a + 1, size):
            rest -= row_at(square, size, k)[a] * vector[k]
        vector[a] = rest * row_at(square, size, a)[a]


@inlined
def move_by(rules: StepRules, change: Configuration, q: Configuration) -> None:
    """Move q by a change, shortened so that no coordinate goes too far; none goes beyond a limit."""
    largest = rules.largest_step
    most = largest
    for k in range(rules.dof):
        most = max(most, abs(change[k]))
    for k in range(rules.dof):
        value = q[k] + change[k] * (largest / most)
        q[k] = min(max(value, rules.lower[k]), rules.upper[k])
