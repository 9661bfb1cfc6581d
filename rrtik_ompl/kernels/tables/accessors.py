"""What kernels read from rows in the arrays of the checks' tables, by name: a number, three numbers, or the row itself.

The places are those of :mod:`rrtik_ompl.kernels.layout`. By the types mypy knows which row is meant, so that it refuses
one that is passed for another; to the compiler all addresses of numbers of a kind are the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.layout import DOUBLE_BYTES, FLOAT_BYTES, INT_BYTES
from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.simd.access import (
    double_reader,
    double_vector_reader,
    float_column,
    float_reader,
    int_column,
    int_reader,
    record_reader,
    vector_reader,
)
from rrtik_ompl.kernels.simd.access import int_row as _int_row
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined
from rrtik_ompl.kernels.simd.lanes import lanes_at, set_int, set_lanes
from rrtik_ompl.kernels.simd.records import row_at as _row_at

Vector: TypeAlias = Any  # three numbers

FRAME_BYTES = layout.POSE_NUMBERS * FLOAT_BYTES * WIDTH

# Arm
placement_at: Callable[[layout.Placement, int], layout.Placement] = record_reader(FLOAT_BYTES * layout.POSE_NUMBERS)
first_row_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ROTATION)
second_row_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ROTATION + 3)
third_row_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ROTATION + 6)
origin_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ORIGIN)
frame_at: Callable[[layout.Frame, int], layout.Frame] = record_reader(FRAME_BYTES)

# Balls of the arm
radius_at: Callable[[layout.Ball, int], float] = float_column(layout.BALL_FLOATS, layout.RADIUS)
ball_x: Callable[[layout.Ball, int], float] = float_column(layout.BALL_FLOATS, layout.CENTRE)
ball_y: Callable[[layout.Ball, int], float] = float_column(layout.BALL_FLOATS, layout.CENTRE + 1)
ball_z: Callable[[layout.Ball, int], float] = float_column(layout.BALL_FLOATS, layout.CENTRE + 2)
group_at: Callable[[layout.Group, int], layout.Group] = record_reader(INT_BYTES * layout.GROUP_INTS)
frame_of_group: Callable[[layout.Group], int] = int_reader(layout.GROUP_FRAME)
first_cluster_of_group: Callable[[layout.Group], int] = int_reader(layout.GROUP_FIRST)
end_cluster_of_group: Callable[[layout.Group], int] = int_reader(layout.GROUP_END)
cluster_at: Callable[[layout.Cluster, int], layout.Cluster] = record_reader(INT_BYTES * layout.CLUSTER_INTS)
body_of_cluster: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_BODY)
frame_of_cluster: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_FRAME)
first_ball_of: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_FIRST)
end_ball_of: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_END)
body_at: Callable[[layout.MovingBody, int], layout.MovingBody] = record_reader(INT_BYTES * layout.BODY_INTS)
frame_of_body: Callable[[layout.MovingBody], int] = int_reader(layout.BODY_FRAME)
first_cluster_of_body: Callable[[layout.MovingBody], int] = int_reader(layout.BODY_FIRST)
end_cluster_of_body: Callable[[layout.MovingBody], int] = int_reader(layout.BODY_END)
pair_group_at: Callable[[layout.PairGroup, int], layout.PairGroup] = record_reader(INT_BYTES * layout.PAIR_GROUP_INTS)
one_group_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_ONE)
other_group_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_OTHER)
first_pair_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_FIRST)
end_pair_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_END)
pair_at: Callable[[layout.Pair, int], layout.Pair] = record_reader(INT_BYTES * layout.PAIR_INTS)
one_body_of: Callable[[layout.Pair], int] = int_reader(layout.PAIR_ONE)
other_body_of: Callable[[layout.Pair], int] = int_reader(layout.PAIR_OTHER)
looked_up_of: Callable[[layout.Pair], int] = int_reader(layout.PAIR_LOOKED_UP)

# Neighbours
neighbours_at: Callable[[layout.Neighbours, int], layout.Neighbours] = record_reader(INT_BYTES * layout.NEIGHBOUR_INTS)
mark_of_neighbours: Callable[[layout.Neighbours], int] = int_reader(layout.NEIGHBOUR_MARK)
row_joint_of: Callable[[layout.Neighbours], int] = int_reader(layout.NEIGHBOUR_ROW)
column_joint_of: Callable[[layout.Neighbours], int] = int_reader(layout.NEIGHBOUR_COLUMN)

# Primitives: what stands still
standing_body_at: Callable[[layout.PrimitiveHead, int], int] = int_column(layout.HEAD_INTS, layout.STANDING_BODY)
head_at: Callable[[layout.PrimitiveHead, int], layout.PrimitiveHead] = record_reader(INT_BYTES * layout.HEAD_INTS)
standing_body_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.STANDING_BODY)
kind_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.KIND)
first_plane_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.FIRST_PLANE)
end_plane_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.END_PLANE)
plane_at: Callable[[layout.Plane, int], layout.Plane] = record_reader(FLOAT_BYTES * layout.PLANE_FLOATS)
normal_of: Callable[[layout.Plane], Vector] = vector_reader(layout.PLANE_NORMAL)
offset_of: Callable[[layout.Plane], float] = float_reader(layout.PLANE_OFFSET)
shape_at: Callable[[layout.PrimitiveShape, int], layout.PrimitiveShape] = record_reader(
    FLOAT_BYTES * layout.SHAPE_FLOATS
)

# Numbers of the shapes of primitives that several modules read
centre_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.SHAPE_CENTRE)
first_axis_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.BOX_AXES)
second_axis_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.BOX_AXES + 3)
third_axis_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.BOX_AXES + 6)
cloud_radius_of: Callable[[layout.PrimitiveShape], float] = float_reader(layout.CLOUD_RADIUS)

# Solids
span_at: Callable[[layout.Span, int], layout.Span] = record_reader(INT_BYTES * layout.SPAN_INTS)
frame_of_span: Callable[[layout.Span], int] = int_reader(layout.SPAN_FRAME)
first_around_of: Callable[[layout.Span], int] = int_reader(layout.AROUND_FIRST)
end_around_of: Callable[[layout.Span], int] = int_reader(layout.AROUND_END)
first_inside_of: Callable[[layout.Span], int] = int_reader(layout.INSIDE_FIRST)
end_inside_of: Callable[[layout.Span], int] = int_reader(layout.INSIDE_END)
solid_at: Callable[[layout.Solid, int], layout.Solid] = record_reader(INT_BYTES * layout.SOLID_INTS)
kind_of_solid: Callable[[layout.Solid], int] = int_reader(layout.SOLID_KIND)
first_block_of: Callable[[layout.Solid], int] = int_reader(layout.FIRST_BLOCK)
end_block_of: Callable[[layout.Solid], int] = int_reader(layout.END_BLOCK)
is_inside: Callable[[layout.Solid], int] = int_reader(layout.IS_INSIDE)
sizes_at: Callable[[layout.SolidSizes, int], layout.SolidSizes] = record_reader(DOUBLE_BYTES * layout.SIZE_COUNT)
disc_of: Callable[[layout.SolidSizes], float] = double_reader(layout.DISC)
axis_of: Callable[[layout.SolidSizes], Vector] = double_vector_reader(layout.AXIS)
round_of: Callable[[layout.SolidSizes], float] = double_reader(layout.ROUND)
slack_of: Callable[[layout.SolidSizes], float] = double_reader(layout.SLACK)
bound_centre_of: Callable[[layout.SolidSizes], Vector] = double_vector_reader(layout.BOUND_CENTRE)
bound_radius_of: Callable[[layout.SolidSizes], float] = double_reader(layout.BOUND_RADIUS)

# Scratch memory
likely_at: Callable[[layout.LikelyBall, int], layout.LikelyBall] = record_reader(INT_BYTES * layout.LIKELY_INTS)
likely_number_of: Callable[[layout.LikelyBall], int] = int_reader(layout.LIKELY_NUMBER)
likely_frame_of: Callable[[layout.LikelyBall], int] = int_reader(layout.LIKELY_FRAME)
likely_body_of: Callable[[layout.LikelyBall], int] = int_reader(layout.LIKELY_BODY)

# Rows: array, numbers in a row, number of the row
joint_row: Callable[[layout.JointValues, int, int], layout.JointValues] = _row_at
checked_row: Callable[[Ints, int, int], Ints] = _int_row
marks_row: Callable[[layout.Marks, int, int], layout.Marks] = _int_row


@inlined
def rotation_row(frame: layout.Frame, row: int) -> Vector:
    """A row of a frame's rotation, in lanes."""
    place = layout.ROTATION + layout.AXES * row
    return lanes_at(frame, place), lanes_at(frame, place + 1), lanes_at(frame, place + 2)


@inlined
def origin_at(frame: layout.Frame, row: int) -> Any:
    """A coordinate of a frame's origin, in lanes."""
    return lanes_at(frame, layout.ORIGIN + row)


@inlined
def set_rotation_row(frame: layout.Frame, row: int, x: Any, y: Any, z: Any) -> None:
    """Set a row of a frame's rotation."""
    place = layout.ROTATION + layout.AXES * row
    set_lanes(frame, place, x)
    set_lanes(frame, place + 1, y)
    set_lanes(frame, place + 2, z)


@inlined
def set_origin(frame: layout.Frame, row: int, value: Any) -> None:
    """Set a coordinate of a frame's origin."""
    set_lanes(frame, layout.ORIGIN + row, value)


@inlined
def stored_centre(centres: layout.Centre, number: int) -> Vector:
    """A centre that is placed, in lanes."""
    place = layout.AXES * number
    return lanes_at(centres, place), lanes_at(centres, place + 1), lanes_at(centres, place + 2)


@inlined
def store_centre(centres: layout.Centre, number: int, x: Any, y: Any, z: Any) -> None:
    """Set a centre."""
    place = layout.AXES * number
    set_lanes(centres, place, x)
    set_lanes(centres, place + 1, y)
    set_lanes(centres, place + 2, z)


@inlined
def corner_block(corners: layout.Corners, block: int) -> Vector:
    """Coordinates of ``WIDTH`` corners of a solid; here lanes hold corners."""
    place = layout.AXES * block
    return lanes_at(corners, place), lanes_at(corners, place + 1), lanes_at(corners, place + 2)


@inlined
def set_likely(likely: layout.LikelyBall, number: int, frame: int, body: int) -> None:
    """Put a ball at a place of a list of likely ones."""
    set_int(likely, layout.LIKELY_NUMBER, number)
    set_int(likely, layout.LIKELY_FRAME, frame)
    set_int(likely, layout.LIKELY_BODY, body)
