"""Where things stand in the tables that Python packs and kernels read.

A table is an int64 array of fields; a field is a number or the address of an array. The names below are the fields'
places. Frames are counted like Pinocchio's joints: 0 is the world. This module imports nothing, so that packing needs
no compiler and compiling no collision library.
"""

from __future__ import annotations

ALIGNMENT = 64  # [bytes] of every array that whole vectors are read from
FREE, UNDECIDED, COLLIDING = 0, 1, 2  # answers

# World: addresses of the tables that a check needs.
ARM, OUTER, INNER, OUTER_PRIMITIVES, INNER_PRIMITIVES, SCRATCH, MOVING_SOLIDS, STANDING_SOLIDS = range(8)

# Arm: placements are 12 floats a joint, the rotation row by row and then the translation.
JOINT_COUNT, PARENTS, SLIDING, PLACEMENTS = range(4)

# Balls (of the outer cover, or inner ones). Balls are 4 floats: centre in the joint frame and radius.
# group: frame, clusters from, to · cluster: body, frame, balls from, to · body: frame, clusters from, to
# pair group: group, group, pairs from, to · pair: body, body
GROUP_COUNT, GROUPS, GROUP_BALLS, CLUSTERS, CLUSTER_BALLS, BALLS, BODIES, BODY_BALLS = range(8)
PAIR_GROUP_COUNT, PAIR_GROUPS, PAIRS, CLUSTER_COUNT, BODY_COUNT, PAIR_COUNT = range(8, 14)

# Primitives: what stands still. BOXES: 6 runs of PADDED_COUNT floats, lowest x, highest x, lowest y, ... · numbers:
# kind, body, planes from, to · PLANES: outward normal and offset · CHECKED: one int for each moving and standing body,
# 0 to ignore that pair · EXCLUDING: for each moving body whether it has a pair to ignore · OWN: for each standing body
# the primitive that has its formula, or any of its balls, -1 if it has none
PRIMITIVE_COUNT, PADDED_COUNT, BOXES, PRIMITIVES, NUMBERS, PLANES, STANDING_COUNT, CHECKED, EXCLUDING, OWN = range(10)

# Kinds of primitives, and their floats.
BALL = 0  # centre, radius
CAPSULE = 1  # one end, the way to the other end, 1 / length^2 (0 for a ball), radius
BOX = 2  # centre, axes, half sizes
CYLINDER = 3  # centre, axis, half length, radius
HALF_SPACE = 4  # outward normal, offset
CONVEX = 5  # 1 if a ball meets it that reaches behind all planes, 0 if the ball's centre must lie behind them
PRIMITIVE_FLOATS = 16

# Solids of bodies, moving ones or those that stand still · span: of a body, frame, solids around it from, to, solids
# inside it from, to · solid: kind, blocks of corners from, to, whether it is inside its body · block: WIDTH floats of
# x, of y, of z
SPANS, SOLIDS, SIZES, CORNERS = range(4)

# Sizes of a solid: radius of its disc (offset of a half-space), axis, radius of its ball, slack, bounding ball.
DISC, AXIS, ROUND, SLACK, BOUND = 0, 1, 4, 5, 6
SIZE_COUNT = 10
UNKNOWN_SOLID, CONVEX_SOLID, HALF_SPACE_SOLID, MERE_CORNERS = range(4)  # the last: nothing between

# Scratch memory: wide lanes of joint values; lanes of frames (rotation row by row, then origin), of the groups' centres
# and of the balls' centres; flags of clusters whose balls are placed; three lists of primitives; flags of what meets;
# configurations that wait for a second check; for the outer and the inner balls what met last: ball, frame and
# primitive (-1: nothing yet); lanes for a note.
VALUES, FRAMES, GROUP_CENTRES, CENTRES, PLACED, FOUND, NEAR, MET, MARKS, WAITING, OUTER_LAST, INNER_LAST, NOTE = range(
    13
)

# Probe, for distances: lanes of the smallest distance so far, ints of the pair that has it, lanes of distances of
# listed primitives.
BEST, WHICH, GAPS = range(3)
