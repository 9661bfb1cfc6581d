"""Kernels of one ball against a cloud as a primitive: as those of :mod:`rrtik_ompl.kernels.checks.obstacle_kernels`."""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.clouds.accessors import cloud_at
from rrtik_ompl.kernels.clouds.kernels import meets_points, to_points
from rrtik_ompl.kernels.layout import PrimitiveHead, PrimitiveShape, PrimitiveTable
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.vectors import along
from rrtik_ompl.kernels.tables.accessors import (
    centre_of,
    cloud_radius_of,
    first_axis_of,
    first_plane_of,
    second_axis_of,
    third_axis_of,
)
from rrtik_ompl.kernels.tables.cloud_layout import CloudTable

ZERO = np.float32(0.0)


@inlined
def table_of(primitives: PrimitiveTable, head: PrimitiveHead) -> CloudTable:
    """The table of the cloud that a primitive is."""
    cloud: CloudTable = cloud_at(primitives, first_plane_of(head))
    return cloud


@inlined
def in_cloud(shape: PrimitiveShape, x: Any, y: Any, z: Any) -> Any:
    """Points of the world in a cloud's frame."""
    centre = centre_of(shape)
    x = x - centre[0]
    y = y - centre[1]
    z = z - centre[2]
    a = along(first_axis_of(shape), x, y, z)
    b = along(second_axis_of(shape), x, y, z)

    return a, b, along(third_axis_of(shape), x, y, z)


@kernel
def meets_cloud(
    primitives: PrimitiveTable,
    head: PrimitiveHead,
    shape: PrimitiveShape,
    x: Any,
    y: Any,
    z: Any,
    radius: float,
    bound: bool,
    wanted: int,
) -> int:
    """Lanes among ``wanted`` in which a ball meets a point; ``bound``: the ball only stands for balls inside it."""
    reach = radius + cloud_radius_of(shape)
    if reach <= ZERO:  # cubes that are taken as smaller than they are, and a ball that is smaller still
        return 0
    a, b, c = in_cloud(shape, x, y, z)
    met: int = meets_points(table_of(primitives, head), a, b, c, reach, bound, wanted)
    return met


@kernel
def cloud_gap(primitives: PrimitiveTable, head: PrimitiveHead, shape: PrimitiveShape, x: Any, y: Any, z: Any) -> Any:
    """Distance of a point from the nearest of the cloud's points or cubes, less the radius around these."""
    a, b, c = in_cloud(shape, x, y, z)
    return to_points(table_of(primitives, head), a, b, c) - cloud_radius_of(shape)
