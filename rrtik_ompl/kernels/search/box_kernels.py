"""The box of configurations in which trees grow: where starts and goals may lie."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.simd.compiled import kernel

# [unit of the configurations] by which a start or goal may lie outside the box, as robots and spaces tolerate a little
BOX_TOLERANCE = 1e-6


@kernel
def copy_inside(dof: int, source: Configuration, lower: Doubles, upper: Doubles, sink: Configuration) -> bool:
    """Copy a configuration; False, at the first coordinate beyond its bounds, if that is outside the box."""
    for k in range(dof):
        value = source[k]
        if not (value >= lower[k] - BOX_TOLERANCE and value <= upper[k] + BOX_TOLERANCE):
            return False
        sink[k] = value
    return True
