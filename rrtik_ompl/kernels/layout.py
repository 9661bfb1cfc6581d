"""Where things stand in the tables that Python packs and kernels read, and the types of their addresses.

A table is an int64 array of fields; a field is a number or the address of an array. An array holds records, each of so
many numbers. The names below are the places of the fields in a table and of the numbers in a record; packers, kernels
and the reference implementation in numpy all use these names, so that every place stands here once. Kernels read by the
named functions of :mod:`rrtik_ompl.kernels.tables.accessors`.

Frames are counted like Pinocchio's joints: 0 is the world. This module imports no library, so that packing needs no
compiler and compiling no collision library.
"""

from __future__ import annotations

from typing import NewType

from rrtik_ompl.kernels.record import Doubles

ALIGNMENT = 64  # [bytes] of every array that whole vectors are read from
INT_BYTES, FLOAT_BYTES, DOUBLE_BYTES = 4, 4, 8
FREE, UNDECIDED, COLLIDING = 0, 1, 2  # answers
UNSOUND = -1  # what an entry returns in place of a count if a table holds what no kernel knows

# Addresses of tables.
WorldTable = NewType("WorldTable", int)
ArmTable = NewType("ArmTable", int)
BallTable = NewType("BallTable", int)
PrimitiveTable = NewType("PrimitiveTable", int)
SolidTable = NewType("SolidTable", int)
ScratchTable = NewType("ScratchTable", int)
ProbeTable = NewType("ProbeTable", int)
BoundTable = NewType("BoundTable", int)


class Configuration(Doubles):
    """Rows of one number for each coordinate."""


class JointValues(Doubles):
    """Rows of one number for each joint."""


# Addresses of arrays, by what they hold.
BallArray = NewType("BallArray", int)
HeadArray = NewType("HeadArray", int)
ShapeArray = NewType("ShapeArray", int)
PlaneArray = NewType("PlaneArray", int)
CloudArray = NewType("CloudArray", int)  # addresses of tables, int64
GroupArray = NewType("GroupArray", int)
PairGroupArray = NewType("PairGroupArray", int)
PairArray = NewType("PairArray", int)
FrameArray = NewType("FrameArray", int)
CentreArray = NewType("CentreArray", int)  # of points, lanes of x, of y and of z each
CornerArray = NewType("CornerArray", int)
PrimitiveList = NewType("PrimitiveList", int)  # numbers of primitives, int32
Marks = NewType("Marks", int)  # for each pair of bodies the lanes in which it is in doubt, int32
NO_MARKS = Marks(0)
Watch = NewType("Watch", int)  # for each group, then each pair of groups, of outer balls one float
NO_WATCH = Watch(0)

# Addresses of records.
Placement = NewType("Placement", int)
Frame = NewType("Frame", int)
Group = NewType("Group", int)
Cluster = NewType("Cluster", int)
MovingBody = NewType("MovingBody", int)
PairGroup = NewType("PairGroup", int)
Pair = NewType("Pair", int)
PrimitiveHead = NewType("PrimitiveHead", int)
PrimitiveShape = NewType("PrimitiveShape", int)
Plane = NewType("Plane", int)
Span = NewType("Span", int)
Solid = NewType("Solid", int)
SolidSizes = NewType("SolidSizes", int)
LikelyBalls = NewType("LikelyBalls", int)
LikelyBall = NewType("LikelyBall", int)

# World: addresses of the tables that a check needs.
ARM, OUTER, INNER, OUTER_PRIMITIVES, INNER_PRIMITIVES, SCRATCH, MOVING_SOLIDS, STANDING_SOLIDS = range(8)
WIDER_SOLIDS = 8  # the moving solids, each with the margin around it that the arm keeps from itself
MOTION_BOUNDS = 9

# Arm. PARENTS: frame that carries each joint · JOINT_KINDS · PLACEMENTS: of each joint in its parent's frame ·
# PHASES: what is added to each value
JOINT_COUNT, PARENTS, JOINT_KINDS, PLACEMENTS, PHASES = range(5)
# Kinds of joints. FIRST_TURN: its parent is the world. ALIGNED_TURN: its placement turns about x alone.
TURN, SLIDE, FIRST_TURN, ALIGNED_TURN = range(4)
# Placement (of floats) and frame (of lanes): the rotation row by row, then the origin.
AXES = 3  # numbers of a point, rows of a rotation
POSE_NUMBERS = 12
ROTATION, ORIGIN = 0, 9

# Balls (of the outer cover, or inner ones) in three levels: groups (all that a joint carries) of clusters of balls;
# a body is a run of clusters too. GROUP_BALLS, CLUSTER_BALLS, BODY_BALLS: a ball around each group, cluster, body ·
# SELF_MARGIN: one float, how far two bodies must stay apart
GROUP_COUNT, GROUPS, GROUP_BALLS, CLUSTERS, CLUSTER_BALLS, BALLS, BODIES, BODY_BALLS = range(8)
PAIR_GROUP_COUNT, PAIR_GROUPS, PAIRS, CLUSTER_COUNT, BODY_COUNT, PAIR_COUNT, SELF_MARGIN = range(8, 15)
# Ball (floats): centre in the joint frame, radius.
BALL_FLOATS = 4
CENTRE, RADIUS = 0, 3
# Group (ints): frame, clusters from, to.
GROUP_INTS = 3
GROUP_FRAME, GROUP_FIRST, GROUP_END = range(3)
# Cluster (ints): number of its body, frame, balls from, to.
CLUSTER_INTS = 4
CLUSTER_BODY, CLUSTER_FRAME, CLUSTER_FIRST, CLUSTER_END = range(4)
# Body (ints): frame, clusters from, to.
BODY_INTS = 3
BODY_FRAME, BODY_FIRST, BODY_END = range(3)
# Pair group (ints): numbers of two groups, pairs of their bodies from, to.
PAIR_GROUP_INTS = 4
PAIR_GROUP_ONE, PAIR_GROUP_OTHER, PAIR_GROUP_FIRST, PAIR_GROUP_END = range(4)
# Pair (ints): numbers of two bodies.
PAIR_INTS = 2
PAIR_ONE, PAIR_OTHER = range(2)

# Bounds of what is watched: BOUND_BLOCKS of lanes in a row of BOUNDS. The first row has the last frame that it needs.
# The second one is added to the sum of the others, one for each joint, times what the joints move.
BOUND_BLOCKS, BOUNDS = range(2)

# Primitives: what stands still. BOXES: BOX_RUNS of PADDED_COUNT floats · NUMBERS: the heads · PRIMITIVES: the
# shapes · CHECKED: one int for each moving and standing body, 0 to ignore that pair ·
# EXCLUDING: for each moving body whether it has a pair to ignore · OWN: for each standing body the primitive that has
# its formula, or any of its balls, -1 if it has none · CLOUDS: addresses of the tables of clouds · BLOCK_BOXES: as
# BOXES, around each BLOCK primitives, BLOCK_COUNT of them; 0 where primitives are few
PRIMITIVE_COUNT, PADDED_COUNT, BOXES, PRIMITIVES, NUMBERS, PLANES, STANDING_COUNT, CHECKED, EXCLUDING, OWN = range(10)
CLOUDS, BLOCK_COUNT, BLOCK_BOXES = range(10, 13)
BLOCK = 16  # primitives: boxes are compared this many at a time, or half as many
LOW_X, HIGH_X, LOW_Y, HIGH_Y, LOW_Z, HIGH_Z = BOX_RUNS = range(6)
# Head of a primitive (ints): kind, number of its standing body, planes from, to (of a cloud: its number among these).
HEAD_INTS = 4
KIND, STANDING_BODY, FIRST_PLANE, END_PLANE = range(4)
# Plane (floats): outward normal, offset.
PLANE_FLOATS = 4
PLANE_NORMAL, PLANE_OFFSET = 0, 3

# Kinds of primitives. A new one needs a branch in `meets_primitive` and `primitive_gap`, in kernels and in numpy.
BALL, CAPSULE, BOX, CYLINDER, HALF_SPACE, CONVEX, CLOUD = KINDS = range(7)
KIND_COUNT, CENTRED_KINDS = len(KINDS), 4  # the latter: so many, the first ones, have a centre
# Shape of a primitive (floats): all but half-spaces and convex ones begin with their centre, a capsule with one end.
SHAPE_FLOATS = 16
SHAPE_CENTRE = 0
BALL_RADIUS = 3
CAPSULE_AXIS, CAPSULE_INVERSE_SQUARE, CAPSULE_RADIUS = 3, 6, 7  # vector to the other end; 1 / length^2 (0 for a ball)
BOX_AXES, BOX_HALF_SIZES = 3, 12
CYLINDER_AXIS, CYLINDER_HALF_LENGTH, CYLINDER_RADIUS = 3, 6, 7
HALF_SPACE_NORMAL, HALF_SPACE_OFFSET = 0, 3  # outward
CLOUD_AXES, CLOUD_RADIUS = 3, 12  # a cloud's centre is the origin of its frame
CONVEX_SHARE = 0  # 1 if a ball meets it that reaches behind all planes, 0 if the ball's centre must lie behind them

# Solids of bodies, moving ones or those that stand still. CORNERS: blocks of WIDTH floats of x, of y, of z
SPANS, SOLIDS, SIZES, CORNERS = range(4)
# Span of a body (ints): frame, solids around the body from, to, solids inside it from, to.
SPAN_INTS = 5
SPAN_FRAME, AROUND_FIRST, AROUND_END, INSIDE_FIRST, INSIDE_END = range(5)
# Solid (ints): kind, blocks of corners from, to, whether it is inside its body.
SOLID_INTS = 4
SOLID_KIND, FIRST_BLOCK, END_BLOCK, IS_INSIDE = range(4)
UNKNOWN_SOLID, CONVEX_SOLID, HALF_SPACE_SOLID, MERE_CORNERS = range(4)  # the last: nothing between
CLOUD_SOLID = 4  # stands for one point after the other, which a kernel puts into its corners
# Sizes of a solid (doubles): radius of its disc (offset of a half-space), axis, radius of its ball, slack, bounding
# ball (centre, radius).
SIZE_COUNT = 10
DISC, AXIS, ROUND, SLACK, BOUND_CENTRE, BOUND_RADIUS = 0, 1, 4, 5, 6, 9

# Scratch memory. VALUES: wide lanes of joint values · FRAMES · GROUP_CENTRES, CENTRES: of balls · PLACED: flags of the
# clusters whose balls are placed · FOUND, NEAR, MET: lists of primitives · MARKS: see above, moving and standing bodies
# first · WAITING: configurations that wait for a second check · OUTER_LIKELY, INNER_LIKELY: balls that met something
# lately · NOTE: lanes · WATCH: see below
VALUES, FRAMES, GROUP_CENTRES, CENTRES, PLACED, FOUND, NEAR, MET, MARKS, WAITING = range(10)
OUTER_LIKELY, INNER_LIKELY, NOTE, WATCH = range(10, 14)
# Watch (floats): by how much [m] bounds are widened for the configurations of a motion that are yet to be checked;
# CLEAR if nothing can be met at any of them.
CLEAR = -1.0
# Likely ball (ints): its number (-1: none yet), its frame, its body. There are so many, the likeliest first.
LIKELY_INTS, LIKELY_COUNT = 3, 3
LIKELY_NUMBER, LIKELY_FRAME, LIKELY_BODY = range(3)

# Probe, for distances. BEST: lanes of the smallest distance so far · WHICH: ints of the pair that has it · GAPS: lanes
# of distances of listed primitives
BEST, WHICH, GAPS = range(3)
