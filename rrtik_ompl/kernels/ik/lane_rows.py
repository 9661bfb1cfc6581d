"""Forward kinematics of wide lanes by rows: a row is that of a frame's three axes and its origin, one number a lane."""

from __future__ import annotations

from typing import Any, TypeAlias

from rrtik_ompl.kernels.ik.ik_accessors import pose_column, pose_origin, pose_row
from rrtik_ompl.kernels.ik.ik_layout import Pose
from rrtik_ompl.kernels.simd.compiled import inlined
from rrtik_ompl.kernels.simd.lanes import spread_wide
from rrtik_ompl.kernels.simd.vectors import along

Row: TypeAlias = Any  # four wide lanes


@inlined
def first_row(pose: Pose, row: int) -> Row:
    """A row of a frame, the same in every lane."""
    x, y, z = pose_row(pose, row)
    return spread_wide(x), spread_wide(y), spread_wide(z), spread_wide(pose_origin(pose, row))


@inlined
def row_after(fixed: Pose, cosine: Any, sine: Any, row: Row) -> Row:
    """A row of the next frame, a fixed frame away after a turn about z."""
    x, y, z, o = row
    a = cosine * x + sine * y
    b = cosine * y - sine * x
    o = o + (a * pose_origin(fixed, 0) + b * pose_origin(fixed, 1) + z * pose_origin(fixed, 2))
    return (
        along(pose_column(fixed, 0), a, b, z),
        along(pose_column(fixed, 1), a, b, z),
        along(pose_column(fixed, 2), a, b, z),
        o,
    )


@inlined
def slid(slide: Any, row: Row) -> Row:
    """A row of a frame that has slid along its z."""
    return row[0], row[1], row[2], row[3] + slide * row[2]
