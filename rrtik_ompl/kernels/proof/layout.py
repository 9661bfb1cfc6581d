"""Where things stand in the table of a proof; see :mod:`rrtik_ompl.kernels.layout` for how tables are made."""

from __future__ import annotations

from typing import NewType

ProofTable = NewType("ProofTable", int)

# Joints: PARENTS: frame that carries each joint · SLIDING: whether it slides · JOINTS: records of float64 (below)
# Solids: SOLIDS: records of int32 · SIZES: records of float64 · CORNERS: float64, blocks (below)
# Sweeps: a body seen from a frame that it moves in. SWEEPS: records of int32 · REACHES: JOINT_COUNT float64 each
# Pairs: PAIRS: records of int32, those of whole bodies first · MARGINS: what each keeps [m], rounding included
JOINT_COUNT, PARENTS, SLIDING, JOINTS, SOLIDS, SIZES, CORNERS = range(7)
SWEEP_COUNT, SWEEPS, REACHES, BODY_PAIR_COUNT, PAIR_COUNT, PAIRS, MARGINS = range(7, 14)
# What a proof computes in. FRAMES: of all joints at each node · STAMPS: the motion that a node's frames are of ·
# BENDS: largest acceleration of each sweep in this motion [m] · WAYS: of each pair the normal of its last plane ·
# LISTS: open pairs at each level · STACK: levels and numbers of intervals · SEEN: frames seen from another one ·
# LAST_STAMP: one int32, counts motions
FRAMES, STAMPS, BENDS, WAYS, LISTS, COUNTS, STACK, SEEN, LAST_STAMP = range(14, 23)
# TOP_COUNT, TOP_PAIRS: numbers of the pairs to begin with, groups of bodies before their bodies (int32)
TOP_COUNT, TOP_PAIRS = range(23, 25)
# What a proof tells of itself. LOG_ROOM: records that there is room for, 0 for a proof that tells nothing · LOG:
# records of int32 · LOG_WAYS: of each the unit normal of its plane, seen from the base of its pair, or zeros ·
# LOG_COUNT: one int32, counts records, also those for which there was no room
LOG_ROOM, LOG, LOG_WAYS, LOG_COUNT = range(25, 29)
# CLOUDS: addresses of the tables of clouds · CLOUD_POSES: their frames in the world
CLOUDS, CLOUD_POSES = range(29, 31)

# Joint (doubles): rotation of its placement row by row, origin, axis.
JOINT_SIZE = 15
TURN, SHIFT, JOINT_AXIS = 0, 9, 12
# Frame (doubles): rotation row by row, origin.
FRAME_SIZE = 12
# Corners (doubles): x, y and z of as many corners as there are lanes; the last block of a solid is filled up.
# Solid (ints): frame, blocks of corners from, to, kind.
SOLID_SIZE = 4
SOLID_FRAME, FIRST_BLOCK, END_BLOCK, SOLID_KIND = range(4)
CONVEX_SOLID, HALF_SPACE, WHOLE_BODY, UNKNOWN = range(4)  # a whole body, or several, has a ball and a box, no corners
CLOUD = 4  # and its number among the clouds; its corners are the points that are compared at the moment
# Sizes (doubles): bounding ball; axes of the box row by row, its middle along them, its half sides; radius of the disc
# (offset of a half-space) and its axis; radius of the ball around every point.
SIZE_COUNT = 24
BALL_CENTRE, BALL_RADIUS, BOX_AXES, BOX_MIDDLE, BOX_HALF, DISC, DISC_AXIS, ROUND = 0, 3, 4, 13, 16, 19, 20, 23
# Sweep (ints): frame of the body, frame it is seen from.
SWEEP_SIZE = 2
SWEEP_FRAME, SWEEP_BASE = range(2)
# Pair (ints): two solids, the frame that both are seen from, their sweeps (-1: it stands still there), pairs of their
# parts from, to.
PAIR_SIZE = 7
PAIR_ONE, PAIR_OTHER, PAIR_BASE, ONE_SWEEP, OTHER_SWEEP, PARTS_FIRST, PARTS_END = range(7)
# Record of the log (ints): pair, level and number of an interval on which it is proven apart, by what.
LOG_SIZE = 4
LOG_PAIR, LOG_LEVEL, LOG_NUMBER, LOG_MEANS = range(4)
OPEN, BY_BALL, BY_PLANE = range(3)  # not proven; by a ball and a ball or box; by a plane

DEEPEST = 9  # an interval of a motion is 1 / 2**DEEPEST of it at least
NODES = (1 << DEEPEST) + 1
