"""What kernels read from the tables, by name: each function here reads one number, or finds one address.

The places are those of :mod:`rrtik_ompl.kernels.layout`. By the types mypy knows which address is meant, so that it
refuses a table that is passed for another; to the compiler all addresses are whole numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.layout import DOUBLE_BYTES, FLOAT_BYTES, INT_BYTES
from rrtik_ompl.kernels.record import Doubles, Floats, Ints
from rrtik_ompl.kernels.simd.access import (
    double_reader,
    double_vector_reader,
    field_reader,
    float_column,
    float_reader,
    int_column,
    int_reader,
    member_reader,
    record_reader,
    vector_reader,
)
from rrtik_ompl.kernels.simd.access import int_row as _int_row
from rrtik_ompl.kernels.simd.compiled import WIDTH, inlined
from rrtik_ompl.kernels.simd.lanes import float_at, lanes_at, set_int, set_lanes
from rrtik_ompl.kernels.simd.records import row_at as _row_at

Vector: TypeAlias = Any  # three numbers

FRAME_BYTES = layout.POSE_NUMBERS * FLOAT_BYTES * WIDTH

# World
arm_of: Callable[[layout.WorldTable], layout.ArmTable] = field_reader(layout.ARM)
outer_balls_of: Callable[[layout.WorldTable], layout.BallTable] = field_reader(layout.OUTER)
inner_balls_of: Callable[[layout.WorldTable], layout.BallTable] = field_reader(layout.INNER)
outer_primitives_of: Callable[[layout.WorldTable], layout.PrimitiveTable] = field_reader(layout.OUTER_PRIMITIVES)
inner_primitives_of: Callable[[layout.WorldTable], layout.PrimitiveTable] = field_reader(layout.INNER_PRIMITIVES)
scratch_of: Callable[[layout.WorldTable], layout.ScratchTable] = field_reader(layout.SCRATCH)
moving_solids_of: Callable[[layout.WorldTable], layout.SolidTable] = field_reader(layout.MOVING_SOLIDS)
standing_solids_of: Callable[[layout.WorldTable], layout.SolidTable] = field_reader(layout.STANDING_SOLIDS)
wider_solids_of: Callable[[layout.WorldTable], layout.SolidTable] = field_reader(layout.WIDER_SOLIDS)

bounds_of: Callable[[layout.WorldTable], layout.BoundTable] = field_reader(layout.MOTION_BOUNDS)

# Arm
joint_count_of: Callable[[layout.ArmTable], int] = field_reader(layout.JOINT_COUNT)
parents_of: Callable[[layout.ArmTable], Ints] = field_reader(layout.PARENTS)
joint_kinds_of: Callable[[layout.ArmTable], Ints] = field_reader(layout.JOINT_KINDS)
phases_of: Callable[[layout.ArmTable], Doubles] = field_reader(layout.PHASES)
placement_of: Callable[[layout.ArmTable, int], layout.Placement] = member_reader(
    layout.PLACEMENTS, FLOAT_BYTES * layout.POSE_NUMBERS
)
first_row_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ROTATION)
second_row_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ROTATION + 3)
third_row_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ROTATION + 6)
origin_of: Callable[[layout.Placement], Vector] = vector_reader(layout.ORIGIN)
frame_at: Callable[[layout.FrameArray, int], layout.Frame] = record_reader(FRAME_BYTES)

# Balls of the arm
group_count_of: Callable[[layout.BallTable], int] = field_reader(layout.GROUP_COUNT)
cluster_count_of: Callable[[layout.BallTable], int] = field_reader(layout.CLUSTER_COUNT)
body_count_of: Callable[[layout.BallTable], int] = field_reader(layout.BODY_COUNT)
pair_group_count_of: Callable[[layout.BallTable], int] = field_reader(layout.PAIR_GROUP_COUNT)
pair_count_of: Callable[[layout.BallTable], int] = field_reader(layout.PAIR_COUNT)
self_margins_of: Callable[[layout.BallTable], int] = field_reader(layout.SELF_MARGIN)
balls_of: Callable[[layout.BallTable], layout.BallArray] = field_reader(layout.BALLS)
group_balls_of: Callable[[layout.BallTable], layout.BallArray] = field_reader(layout.GROUP_BALLS)
cluster_balls_of: Callable[[layout.BallTable], layout.BallArray] = field_reader(layout.CLUSTER_BALLS)
body_balls_of: Callable[[layout.BallTable], layout.BallArray] = field_reader(layout.BODY_BALLS)
radius_at: Callable[[layout.BallArray, int], float] = float_column(layout.BALL_FLOATS, layout.RADIUS)
ball_x: Callable[[layout.BallArray, int], float] = float_column(layout.BALL_FLOATS, layout.CENTRE)
ball_y: Callable[[layout.BallArray, int], float] = float_column(layout.BALL_FLOATS, layout.CENTRE + 1)
ball_z: Callable[[layout.BallArray, int], float] = float_column(layout.BALL_FLOATS, layout.CENTRE + 2)
groups_of: Callable[[layout.BallTable], layout.GroupArray] = field_reader(layout.GROUPS)
group_at: Callable[[layout.GroupArray, int], layout.Group] = record_reader(INT_BYTES * layout.GROUP_INTS)
frame_of_group: Callable[[layout.Group], int] = int_reader(layout.GROUP_FRAME)
first_cluster_of_group: Callable[[layout.Group], int] = int_reader(layout.GROUP_FIRST)
end_cluster_of_group: Callable[[layout.Group], int] = int_reader(layout.GROUP_END)
cluster_of: Callable[[layout.BallTable, int], layout.Cluster] = member_reader(
    layout.CLUSTERS, INT_BYTES * layout.CLUSTER_INTS
)
body_of_cluster: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_BODY)
frame_of_cluster: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_FRAME)
first_ball_of: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_FIRST)
end_ball_of: Callable[[layout.Cluster], int] = int_reader(layout.CLUSTER_END)
body_of: Callable[[layout.BallTable, int], layout.MovingBody] = member_reader(
    layout.BODIES, INT_BYTES * layout.BODY_INTS
)
frame_of_body: Callable[[layout.MovingBody], int] = int_reader(layout.BODY_FRAME)
first_cluster_of_body: Callable[[layout.MovingBody], int] = int_reader(layout.BODY_FIRST)
end_cluster_of_body: Callable[[layout.MovingBody], int] = int_reader(layout.BODY_END)
pair_groups_of: Callable[[layout.BallTable], layout.PairGroupArray] = field_reader(layout.PAIR_GROUPS)
pair_group_at: Callable[[layout.PairGroupArray, int], layout.PairGroup] = record_reader(
    INT_BYTES * layout.PAIR_GROUP_INTS
)
one_group_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_ONE)
other_group_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_OTHER)
first_pair_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_FIRST)
end_pair_of: Callable[[layout.PairGroup], int] = int_reader(layout.PAIR_GROUP_END)
pairs_of: Callable[[layout.BallTable], layout.PairArray] = field_reader(layout.PAIRS)
pair_at: Callable[[layout.PairArray, int], layout.Pair] = record_reader(INT_BYTES * layout.PAIR_INTS)
one_body_of: Callable[[layout.Pair], int] = int_reader(layout.PAIR_ONE)
other_body_of: Callable[[layout.Pair], int] = int_reader(layout.PAIR_OTHER)

# Bounds of motions
bound_blocks_of: Callable[[layout.BoundTable], int] = field_reader(layout.BOUND_BLOCKS)
bound_rows_of: Callable[[layout.BoundTable], Floats] = field_reader(layout.BOUNDS)

# Primitives: what stands still
primitive_count_of: Callable[[layout.PrimitiveTable], int] = field_reader(layout.PRIMITIVE_COUNT)
padded_count_of: Callable[[layout.PrimitiveTable], int] = field_reader(layout.PADDED_COUNT)
standing_count_of: Callable[[layout.PrimitiveTable], int] = field_reader(layout.STANDING_COUNT)
boxes_of: Callable[[layout.PrimitiveTable], Floats] = field_reader(layout.BOXES)
block_count_of: Callable[[layout.PrimitiveTable], int] = field_reader(layout.BLOCK_COUNT)
block_boxes_of: Callable[[layout.PrimitiveTable], Floats] = field_reader(layout.BLOCK_BOXES)
planes_of: Callable[[layout.PrimitiveTable], layout.PlaneArray] = field_reader(layout.PLANES)
checked_of: Callable[[layout.PrimitiveTable], Ints] = field_reader(layout.CHECKED)
excluding_of: Callable[[layout.PrimitiveTable], Ints] = field_reader(layout.EXCLUDING)
own_of: Callable[[layout.PrimitiveTable], Ints] = field_reader(layout.OWN)
clouds_of: Callable[[layout.PrimitiveTable], layout.CloudArray] = field_reader(layout.CLOUDS)
head_of: Callable[[layout.PrimitiveTable, int], layout.PrimitiveHead] = member_reader(
    layout.NUMBERS, INT_BYTES * layout.HEAD_INTS
)
heads_of: Callable[[layout.PrimitiveTable], layout.HeadArray] = field_reader(layout.NUMBERS)
standing_body_at: Callable[[layout.HeadArray, int], int] = int_column(layout.HEAD_INTS, layout.STANDING_BODY)
head_at: Callable[[layout.HeadArray, int], layout.PrimitiveHead] = record_reader(INT_BYTES * layout.HEAD_INTS)
standing_body_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.STANDING_BODY)
kind_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.KIND)
first_plane_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.FIRST_PLANE)
end_plane_of: Callable[[layout.PrimitiveHead], int] = int_reader(layout.END_PLANE)
plane_at: Callable[[layout.PlaneArray, int], layout.Plane] = record_reader(FLOAT_BYTES * layout.PLANE_FLOATS)
normal_of: Callable[[layout.Plane], Vector] = vector_reader(layout.PLANE_NORMAL)
offset_of: Callable[[layout.Plane], float] = float_reader(layout.PLANE_OFFSET)
shape_of: Callable[[layout.PrimitiveTable, int], layout.PrimitiveShape] = member_reader(
    layout.PRIMITIVES, FLOAT_BYTES * layout.SHAPE_FLOATS
)
shapes_of: Callable[[layout.PrimitiveTable], layout.ShapeArray] = field_reader(layout.PRIMITIVES)
shape_at: Callable[[layout.ShapeArray, int], layout.PrimitiveShape] = record_reader(FLOAT_BYTES * layout.SHAPE_FLOATS)

# Numbers of the shapes of primitives that several modules read
centre_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.SHAPE_CENTRE)
first_axis_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.BOX_AXES)
second_axis_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.BOX_AXES + 3)
third_axis_of: Callable[[layout.PrimitiveShape], Vector] = vector_reader(layout.BOX_AXES + 6)
cloud_radius_of: Callable[[layout.PrimitiveShape], float] = float_reader(layout.CLOUD_RADIUS)

# Solids
span_of: Callable[[layout.SolidTable, int], layout.Span] = member_reader(layout.SPANS, INT_BYTES * layout.SPAN_INTS)
frame_of_span: Callable[[layout.Span], int] = int_reader(layout.SPAN_FRAME)
first_around_of: Callable[[layout.Span], int] = int_reader(layout.AROUND_FIRST)
end_around_of: Callable[[layout.Span], int] = int_reader(layout.AROUND_END)
first_inside_of: Callable[[layout.Span], int] = int_reader(layout.INSIDE_FIRST)
end_inside_of: Callable[[layout.Span], int] = int_reader(layout.INSIDE_END)
solid_of: Callable[[layout.SolidTable, int], layout.Solid] = member_reader(layout.SOLIDS, INT_BYTES * layout.SOLID_INTS)
kind_of_solid: Callable[[layout.Solid], int] = int_reader(layout.SOLID_KIND)
first_block_of: Callable[[layout.Solid], int] = int_reader(layout.FIRST_BLOCK)
end_block_of: Callable[[layout.Solid], int] = int_reader(layout.END_BLOCK)
is_inside: Callable[[layout.Solid], int] = int_reader(layout.IS_INSIDE)
sizes_of: Callable[[layout.SolidTable, int], layout.SolidSizes] = member_reader(
    layout.SIZES, DOUBLE_BYTES * layout.SIZE_COUNT
)
disc_of: Callable[[layout.SolidSizes], float] = double_reader(layout.DISC)
axis_of: Callable[[layout.SolidSizes], Vector] = double_vector_reader(layout.AXIS)
round_of: Callable[[layout.SolidSizes], float] = double_reader(layout.ROUND)
slack_of: Callable[[layout.SolidSizes], float] = double_reader(layout.SLACK)
bound_centre_of: Callable[[layout.SolidSizes], Vector] = double_vector_reader(layout.BOUND_CENTRE)
bound_radius_of: Callable[[layout.SolidSizes], float] = double_reader(layout.BOUND_RADIUS)
corners_of: Callable[[layout.SolidTable], layout.CornerArray] = field_reader(layout.CORNERS)

# Scratch memory
values_of: Callable[[layout.ScratchTable], Floats] = field_reader(layout.VALUES)
frames_of: Callable[[layout.ScratchTable], layout.FrameArray] = field_reader(layout.FRAMES)
group_centres_of: Callable[[layout.ScratchTable], layout.CentreArray] = field_reader(layout.GROUP_CENTRES)
centres_of: Callable[[layout.ScratchTable], layout.CentreArray] = field_reader(layout.CENTRES)
placed_flags_of: Callable[[layout.ScratchTable], Ints] = field_reader(layout.PLACED)
found_of: Callable[[layout.ScratchTable], layout.PrimitiveList] = field_reader(layout.FOUND)
near_of: Callable[[layout.ScratchTable], layout.PrimitiveList] = field_reader(layout.NEAR)
met_of: Callable[[layout.ScratchTable], layout.PrimitiveList] = field_reader(layout.MET)
marks_of: Callable[[layout.ScratchTable], layout.Marks] = field_reader(layout.MARKS)
waiting_of: Callable[[layout.ScratchTable], Ints] = field_reader(layout.WAITING)
outer_likely_of: Callable[[layout.ScratchTable], layout.LikelyBalls] = field_reader(layout.OUTER_LIKELY)
inner_likely_of: Callable[[layout.ScratchTable], layout.LikelyBalls] = field_reader(layout.INNER_LIKELY)
watch_of: Callable[[layout.ScratchTable], layout.Watch] = field_reader(layout.WATCH)
note_of: Callable[[layout.ScratchTable], Floats] = field_reader(layout.NOTE)
likely_at: Callable[[layout.LikelyBalls, int], layout.LikelyBall] = record_reader(INT_BYTES * layout.LIKELY_INTS)
likely_number_of: Callable[[layout.LikelyBall], int] = int_reader(layout.LIKELY_NUMBER)
likely_frame_of: Callable[[layout.LikelyBall], int] = int_reader(layout.LIKELY_FRAME)
likely_body_of: Callable[[layout.LikelyBall], int] = int_reader(layout.LIKELY_BODY)

# Probe
best_of: Callable[[layout.ProbeTable], Floats] = field_reader(layout.BEST)
which_of: Callable[[layout.ProbeTable], Ints] = field_reader(layout.WHICH)
gaps_of: Callable[[layout.ProbeTable], Floats] = field_reader(layout.GAPS)

# Rows: array, numbers in a row, number of the row
joint_row: Callable[[layout.JointValues, int, int], layout.JointValues] = _row_at
checked_row: Callable[[Ints, int, int], Ints] = _int_row
marks_row: Callable[[layout.Marks, int, int], layout.Marks] = _int_row


@inlined
def self_margin_of(balls: layout.BallTable) -> float:
    """How far two bodies of the arm must stay apart."""
    margin: float = float_at(self_margins_of(balls), 0)
    return margin


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
def stored_centre(centres: layout.CentreArray, number: int) -> Vector:
    """A centre that is placed, in lanes."""
    place = layout.AXES * number
    return lanes_at(centres, place), lanes_at(centres, place + 1), lanes_at(centres, place + 2)


@inlined
def store_centre(centres: layout.CentreArray, number: int, x: Any, y: Any, z: Any) -> None:
    """Set a centre."""
    place = layout.AXES * number
    set_lanes(centres, place, x)
    set_lanes(centres, place + 1, y)
    set_lanes(centres, place + 2, z)


@inlined
def corner_block(corners: layout.CornerArray, block: int) -> Vector:
    """Coordinates of ``WIDTH`` corners of a solid; here lanes hold corners."""
    place = layout.AXES * block
    return lanes_at(corners, place), lanes_at(corners, place + 1), lanes_at(corners, place + 2)


@inlined
def set_likely(likely: layout.LikelyBall, number: int, frame: int, body: int) -> None:
    """Put a ball at a place of a list of likely ones."""
    set_int(likely, layout.LIKELY_NUMBER, number)
    set_int(likely, layout.LIKELY_FRAME, frame)
    set_int(likely, layout.LIKELY_BODY, body)
