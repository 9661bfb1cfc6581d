"""Configurations of searches in kernels: drawn from a box, read from memory, made ready for checks and neighbours."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.kernels.search.motions.motion_kernels import set_joint_values
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.search.two_trees_layout import SampledTable
from rrtik_ompl.kernels.simd.compiled import kernel
from rrtik_ompl.kernels.simd.random_kernels import next_point, next_share, start_points
from rrtik_ompl.kernels.simd.records import same_place

# [unit of the configurations] by which a start or goal may lie outside the box, as robots and spaces tolerate a little
BOX_TOLERANCE = 1e-6


@kernel
def start_samples(search: SampledTable, seed: int) -> None:
    """Choose the first sample by a seed."""
    search.random = seed
    next_share(search)
    start_points(search, search.point, search.motions.dof)


@kernel
def draw(search: SampledTable, sink: Configuration) -> None:
    """Set a configuration to the next sample of the box."""
    dof = search.motions.dof
    next_point(search, search.point, search.inverse_bases, dof)
    for k in range(dof):
        low = search.lower[k]
        high = search.upper[k]
        sink[k] = low + (high - low) * search.point[k]


@kernel
def load_row(search: SampledTable, source: Configuration) -> bool:
    """Set the row to a configuration; False, at the first coordinate beyond its bounds, if that is outside the box."""
    for k in range(search.motions.dof):
        value = source[k]
        if not (value >= search.lower[k] - BOX_TOLERANCE and value <= search.upper[k] + BOX_TOLERANCE):
            return False
        search.row[k] = value
    set_row_values(search)
    return True


@kernel
def set_row_values(search: SampledTable) -> None:
    """Joint values of the row, unless they are the configuration itself."""
    if not same_place(search.row, search.row_values):
        set_joint_values(search.motions, search.row, search.row_values)


@kernel
def set_query(search: SampledTable, row: Configuration) -> None:
    """Look for what is nearest to a configuration."""
    for k in range(search.motions.dof):
        search.query[k] = np.float32(row[k])
