"""The bases of the Halton sequence [49] that searches in kernels draw their samples from."""

from __future__ import annotations

PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37)  # a Halton sequence of more dimensions covers a box badly


def inverse_bases(dimensions: int) -> list[float]:
    """Inverse bases of the sequence for a box of that many dimensions; zeros where it would cover it badly."""
    if dimensions > len(PRIMES):
        return [0.0] * dimensions
    return [1.0 / prime for prime in PRIMES[:dimensions]]
