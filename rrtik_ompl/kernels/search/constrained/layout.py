"""The tables of path constraints and of searches along them: what each field is.

Regions, measures and bounds are those of :class:`rrtik_ompl.constraints.held_region.HeldRegion`.
"""

from __future__ import annotations

from typing import NewType

KERNELS = "search.constrained.kernels"  # the library of these searches

HeldTable = NewType("HeldTable", int)
RegionTable = NewType("RegionTable", int)
RegionRecord = NewType("RegionRecord", int)
ConstrainedTable = NewType("ConstrainedTable", int)

# Held: COUNT addresses of regions in REGIONS · DOF, LOWER, UPPER: of the configurations · HELD_NUMBERS: see below ·
# scratch memory: COLUMNS, 6 numbers for each coordinate, SQUARE matrix, CHANGE of the coordinates, ERROR and WEIGHTS of
# a residual, NODE: a configuration
COUNT, REGIONS, HELD_DOF, HELD_LOWER, HELD_UPPER, HELD_NUMBERS, COLUMNS, SQUARE, CHANGE, ERROR, WEIGHTS = range(11)
NODE = 11
PER_METRE, PER_RADIAN, DAMPING, LARGEST_STEP = range(4)  # the numbers

# Region: the joints that move its frame (LIMB) and memory for their frames (CALL), as of kernels.ik.ik_layout;
# what it says of the orientation; its record
LIMB, CALL, TURNING, RECORD = range(4)
FREE_TURN, AXIS, BALL, RANGES = range(4)  # rrtik_ompl.constraints.held_region.Turning

# The record: bounds of the position and of the angles; where the axis has to point; measures up to which a
# configuration is not moved (KEPT), how far it is moved into a region [m; rad] (AIMED), measures that motions may
# reach (MOST); curvature of the orientation's measure; a lever for each joint of the limb
LOW, HIGH, ANGLES_LOW, ANGLES_HIGH, DIRECTION = 0, 3, 6, 9, 12
KEPT, AIMED, MOST, CURVATURE, LEVERS = 15, 17, 19, 21, 22

# Search. What it works on ...
MOTIONS, START_TREE, GOAL_TREE, HELD, LOWER, UPPER, NUMBERS, INVERSE_BASES = range(8)
# ... its rules. RESOLVE: 1 if undecided motions are inserted, to be asked for · LIMIT: of the samples · UNCHECKED: 1
# to leave collisions out ...
RESOLVE, LIMIT, UNCHECKED, START_ROWS, GOAL_ROWS = range(8, 13)
# ... its state. ROW and AIM: configurations · MEETINGS: the vertices at which the trees meet · STRAIGHT_TRIED: goals
# that were walked to straight away ...
GROWER, ROW, ROW_VALUES, AIM, QUERY, POINT, RANDOM, START_MEETING, GOAL_MEETING, STRAIGHT_TRIED = range(13, 23)
# ... and counts. CHECKED: motions · WALK_ROOM: vertices that one walk adds at most
ITERATIONS, CHECKED, GOAL_COUNT, WALK_ROOM, FIELD_COUNT = range(23, 28)

# The numbers [unit of the configurations]: LONGEST and SHORTEST step, STEP in use, DOMAIN as of RRT-Connect
LONGEST, SHORTEST, STEP, DOMAIN = range(4)

SOLVED, EXHAUSTED, RUNNING, FULL = range(4)  # status
OUTSIDE = -1  # status that a root is not in the box; less its number
ROOM = 256  # WALK_ROOM of steps of usual length
