"""The tables of the collision checks, which Python packs and kernels read, and what several rooms of kernels share.

Each table is declared here once, as a class; see :mod:`rrtik_ompl.kernels.record`. Some arrays hold rows of so many
numbers, whose places have names beside the class of the array: packers and the reference implementation in numpy use
these names, and kernels read by the named functions of :mod:`rrtik_ompl.kernels.tables.accessors`.

Frames are counted like Pinocchio's joints: 0 is the world. This module imports no library, so that packing needs no
compiler and compiling no collision library.
"""

from __future__ import annotations

from typing import cast

from rrtik_ompl.kernels.record import Doubles, Floats, Ints, Record, Tables, Wholes

ALIGNMENT = 64  # [bytes] of every array that whole vectors are read from
INT_BYTES, FLOAT_BYTES, DOUBLE_BYTES = 4, 4, 8
FREE, UNDECIDED, COLLIDING = 0, 1, 2  # answers
UNSOUND = -1  # what an entry returns in place of a count if a table holds what no kernel knows


class Configuration(Doubles):
    """Rows of one number for each coordinate."""


class JointValues(Doubles):
    """Rows of one number for each joint."""


# What moves: joints.


class Placement(Floats):
    """The rotation row by row, then the origin."""


class Frame(Floats):
    """As a placement, in lanes."""


AXES = 3  # numbers of a point, rows of a rotation
POSE_NUMBERS = 12
ROTATION, ORIGIN = 0, 9


class ArmTable(Record):
    """The joints of an arm."""

    joint_count: int
    parents: Ints  # frame that carries each joint
    joint_kinds: Ints
    placements: Placement  # of each joint in its parent's frame
    phases: Doubles  # what is added to each value


# Kinds of joints. FIRST_TURN: its parent is the world. ALIGNED_TURN: its placement turns about x alone.
TURN, SLIDE, FIRST_TURN, ALIGNED_TURN = range(4)


# What moves: balls, in three levels. A body is a run of clusters too.


class Ball(Floats):
    """Centre in the joint's frame, radius."""


BALL_FLOATS = 4
CENTRE, RADIUS = 0, 3


class Group(Ints):
    """All that a joint carries: frame, clusters from, to."""


GROUP_INTS = 3
GROUP_FRAME, GROUP_FIRST, GROUP_END = range(3)


class Cluster(Ints):
    """Neighbours of a body: number of the body, frame, balls from, to."""


CLUSTER_INTS = 4
CLUSTER_BODY, CLUSTER_FRAME, CLUSTER_FIRST, CLUSTER_END = range(4)


class MovingBody(Ints):
    """Frame, clusters from, to."""


BODY_INTS = 3
BODY_FRAME, BODY_FIRST, BODY_END = range(3)


class PairGroup(Ints):
    """Numbers of two groups, pairs of their bodies from, to."""


PAIR_GROUP_INTS = 4
PAIR_GROUP_ONE, PAIR_GROUP_OTHER, PAIR_GROUP_FIRST, PAIR_GROUP_END = range(4)


class Pair(Ints):
    """Numbers of two bodies that must not touch, and whether they are neighbours, which balls need not look at."""


PAIR_INTS = 3
PAIR_ONE, PAIR_OTHER, PAIR_LOOKED_UP = range(3)


class BallTable(Record):
    """The balls of the outer cover, or inner ones: groups of clusters of balls."""

    group_count: int
    groups: Group
    group_balls: Ball  # around each group
    clusters: Cluster
    cluster_balls: Ball  # around each cluster
    balls: Ball
    bodies: MovingBody
    body_balls: Ball  # around each body
    pair_group_count: int
    pair_groups: PairGroup
    pairs: Pair
    cluster_count: int
    body_count: int
    pair_count: int
    self_margin: Floats  # one number: how far two bodies must stay apart [m]


class BoundTable(Record):
    """How far joints can move what is watched."""

    blocks: int  # of lanes in a row
    # The first row has the last frame that each needs. The second one is added to the sum of the others, one for each
    # joint, times what the joints move.
    rows: Floats


# What stands still: primitives.


class PrimitiveHead(Ints):
    """Kind, number of its standing body, planes from, to (of a cloud: its number among these)."""


HEAD_INTS = 4
KIND, STANDING_BODY, FIRST_PLANE, END_PLANE = range(4)

# Kinds of primitives. A new one needs a branch in `meets_primitive` and `primitive_gap`, in kernels and in numpy.
BALL, CAPSULE, BOX, CYLINDER, HALF_SPACE, CONVEX, CLOUD = KINDS = range(7)
KIND_COUNT, CENTRED_KINDS = len(KINDS), 4  # the latter: so many, the first ones, have a centre


class PrimitiveShape(Floats):
    """Numbers by the kind: all but half-spaces and convex ones begin with their centre, a capsule with one end."""


SHAPE_FLOATS = 16
SHAPE_CENTRE = 0
BALL_RADIUS = 3
CAPSULE_AXIS, CAPSULE_INVERSE_SQUARE, CAPSULE_RADIUS = 3, 6, 7  # vector to the other end; 1 / length^2 (0 for a ball)
BOX_AXES, BOX_HALF_SIZES = 3, 12
CYLINDER_AXIS, CYLINDER_HALF_LENGTH, CYLINDER_RADIUS = 3, 6, 7
HALF_SPACE_NORMAL, HALF_SPACE_OFFSET = 0, 3  # outward
CLOUD_AXES, CLOUD_RADIUS = 3, 12  # a cloud's centre is the origin of its frame
CONVEX_SHARE = 0  # 1 if a ball meets it that reaches behind all planes, 0 if the ball's centre must lie behind them


class Plane(Floats):
    """Outward normal, offset."""


PLANE_FLOATS = 4
PLANE_NORMAL, PLANE_OFFSET = 0, 3


class PrimitiveTable(Record):
    """Primitives around what stands still, or inside it, sorted by kind."""

    count: int
    padded_count: int
    boxes: Floats  # around each, in ``BOX_RUNS`` of ``padded_count``
    shapes: PrimitiveShape
    heads: PrimitiveHead
    planes: Plane
    standing_count: int  # bodies
    checked: Ints  # for each moving and standing body 0 to ignore that pair, LOOKED_UP for neighbours
    excluding: Ints  # for each moving body whether it has a pair that balls need not look at
    own: Ints  # for each standing body the primitive that has its formula, or any of its balls, -1 if it has none
    clouds: Tables
    block_count: int  # 0 where primitives are few
    block_boxes: Floats  # as ``boxes``, around each ``BLOCK`` primitives


IGNORED, BY_BALLS, LOOKED_UP = range(3)  # how a pair is checked; neighbours of the arm are looked up
BLOCK = 16  # primitives: boxes are compared this many at a time, or half as many
LOW_X, HIGH_X, LOW_Y, HIGH_Y, LOW_Z, HIGH_Z = BOX_RUNS = range(6)


# Solids of bodies: those that move and those that stand still.


class Span(Ints):
    """Of a body: frame, solids around it from, to, solids inside it from, to."""


SPAN_INTS = 5
SPAN_FRAME, AROUND_FIRST, AROUND_END, INSIDE_FIRST, INSIDE_END = range(5)


class Solid(Ints):
    """Kind, blocks of corners from, to, whether it is inside its body."""


SOLID_INTS = 4
SOLID_KIND, FIRST_BLOCK, END_BLOCK, IS_INSIDE = range(4)
UNKNOWN_SOLID, CONVEX_SOLID, HALF_SPACE_SOLID, MERE_CORNERS = range(4)  # the last: nothing between
CLOUD_SOLID = 4  # stands for one point after the other, which a kernel puts into its corners


class SolidSizes(Doubles):
    """Radius of the disc (offset of a half-space), axis, radius of the ball, slack, bounding ball (centre, radius)."""


SIZE_COUNT = 10
DISC, AXIS, ROUND, SLACK, BOUND_CENTRE, BOUND_RADIUS = 0, 1, 4, 5, 6, 9


class Corners(Floats):
    """Blocks of ``WIDTH`` numbers of x, of y, of z."""


class SolidTable(Record):
    """Convex solids around and inside bodies."""

    spans: Span
    solids: Solid
    sizes: SolidSizes
    corners: Corners


# Neighbours of the arm, whose distance depends on one or two joints alone.


class Neighbours(Ints):
    """Of a pair of bodies: its place among the marks, the joints of the rows and of the columns of its cells."""


NEIGHBOUR_INTS = 3
NEIGHBOUR_MARK, NEIGHBOUR_ROW, NEIGHBOUR_COLUMN = range(3)
CELLS = 64  # of a whole turn; as many as a whole number has bits
CELLS_APART = 0.0005  # [m] that bodies keep in cells in which they are apart


class NeighbourTable(Record):
    """Where neighbours are apart: cells of the values of the joints between them."""

    count: int
    pairs: Neighbours
    # Of each pair ``CELLS`` rows of cells, a bit each: whether the bodies are apart in it; then as many rows that say
    # whether they are in all cells around it, too.
    cells: Wholes
    joint_count: int  # the first joints, among which are those of all rows and columns


# What a check computes in.


class Centre(Floats):
    """Points: lanes of x, of y and of z each."""


class PrimitiveList(Ints):
    """Numbers of primitives."""


class Marks(Ints):
    """For each pair of bodies the lanes in which it is in doubt, moving and standing bodies first."""


NO_MARKS = cast(Marks, 0)


class LikelyBall(Ints):
    """A ball that met something lately: number (-1: none yet), frame, body. The likeliest of a list comes first."""


LIKELY_INTS, LIKELY_COUNT = 3, 3
LIKELY_NUMBER, LIKELY_FRAME, LIKELY_BODY = range(3)


class Watch(Floats):
    """For each group, then each pair of groups, of outer balls one number.

    It is by how much [m] bounds are widened for the configurations of a motion that are yet to be checked; CLEAR if
    nothing can be met at any of them.
    """


CLEAR = -1.0
NO_WATCH = cast(Watch, 0)


class ScratchTable(Record):
    """The memory of one thread."""

    values: Doubles  # wide lanes of joint values
    frames: Frame
    group_centres: Centre  # of balls
    centres: Centre
    placed: Ints  # flags of the clusters whose balls are placed
    found: PrimitiveList
    near: PrimitiveList
    met: PrimitiveList
    marks: Marks
    waiting: Ints  # configurations that wait for a second check
    outer_likely: LikelyBall
    inner_likely: LikelyBall
    note: Floats  # lanes
    watch: Watch


class ProbeTable(Record):
    """What distances are measured in."""

    best: Floats  # lanes of the smallest distance so far
    which: Ints  # the pair that has it, for each lane
    gaps: Floats  # lanes of distances of listed primitives


class WorldTable(Record):
    """All that a check needs."""

    arm: ArmTable
    outer_balls: BallTable
    inner_balls: BallTable
    outer_primitives: PrimitiveTable
    inner_primitives: PrimitiveTable
    scratch: ScratchTable
    moving_solids: SolidTable
    standing_solids: SolidTable
    wider_solids: SolidTable  # the moving ones, each with the margin around it that the arm keeps from itself
    motion_bounds: BoundTable
    neighbours: NeighbourTable
