"""Proofs of motions between rows of joint values: by kernels, or by numpy where there are none."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.kernels.proof import in_numpy
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.kernels.simd.library import library

PROOF_KERNELS = "proof.proof_kernels"
DOUBLE, INT = 8, 4  # bytes of a number
ProofOfRows: TypeAlias = Callable[[int, int], int]  # of the first row, and how many; returns how many are not proven


def proof_of_rows(
    packed: ProofPairs, starts: Matrix, ends: Matrix, pairs: NDArray[np.int32], places: Vector
) -> ProofOfRows:
    """Return what proves some of the motions starts[k] -> ends[k] and writes the answers.

    Args:
        packed: The table.
        starts: Rows of joint values in C order, shape (m or more, joints).
        ends: Likewise, shape (m, joints).
        pairs: Gets for each motion -1, or the number of a pair that is not proven apart, shape (m,).
        places: Gets where on the motion that is, from 0 to 1, shape (m,).
    """
    kernels = library(PROOF_KERNELS)
    if kernels is None:

        def prove_in_numpy(first: int, number: int) -> int:
            rows = slice(first, first + number)
            return in_numpy.prove(packed, starts[rows], ends[rows], pairs[rows], places[rows])

        return prove_in_numpy

    address = packed.table.address
    row = DOUBLE * ends.shape[1]
    read = starts.ctypes.data, ends.ctypes.data
    written = pairs.ctypes.data, places.ctypes.data

    def prove(first: int, number: int) -> int:
        skipped = row * first
        sinks = written[0] + INT * first, written[1] + DOUBLE * first
        return int(kernels.prove(address, read[0] + skipped, read[1] + skipped, number, *sinks))

    return prove
