"""The tables of path constraints and of searches along them: what each field is.

Regions, measures and bounds are those of :class:`rrtik_ompl.constraints.held_region.HeldRegion`.
"""

from __future__ import annotations

from rrtik_ompl.kernels.ik.ik_layout import CallTable, LimbTable, Twist
from rrtik_ompl.kernels.layout import Configuration, JointValues
from rrtik_ompl.kernels.record import Doubles, Floats, Record, Wholes
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.tree_layout import TreeTable

KERNELS = "search.constrained.kernels"  # the library of these searches


class HeldTable(Record):
    """Path constraints."""

    count: int  # regions
    regions: Wholes  # addresses of their tables
    dof: int
    lower: Configuration  # limits
    upper: Configuration
    per_metre: float
    per_radian: float
    damping: float
    largest_step: float
    columns: Twist  # scratch memory: 6 numbers for each coordinate
    square: Doubles  # matrix
    change: Configuration
    error: Twist  # residual
    weights: Twist
    node: Configuration


class RegionRecord(Doubles):
    """Numbers of a region; see below."""


class RegionTable(Record):
    """A region."""

    limb: LimbTable  # the joints that move its frame
    call: CallTable  # memory for their frames
    turning: int  # what it says of the orientation
    record: RegionRecord


FREE_TURN, AXIS, BALL, RANGES = range(4)  # rrtik_ompl.constraints.held_region.Turning

# The record: bounds of the position and of the angles; where the axis has to point; measures up to which a
# configuration is not moved (KEPT), how far it is moved into a region [m; rad] (AIMED), measures that motions may
# reach (MOST); curvature of the orientation's measure; a lever for each joint of the limb
LOW, HIGH, ANGLES_LOW, ANGLES_HIGH, DIRECTION = 0, 3, 6, 9, 12
KEPT, AIMED, MOST, CURVATURE, LEVERS = 15, 17, 19, 21, 22


class ConstrainedTable(Record):
    """A search along path constraints. Lengths are in the unit of the configurations."""

    motions: MotionTable  # of the world
    start_tree: TreeTable
    goal_tree: TreeTable
    held: HeldTable
    lower: Doubles  # the box of configurations
    upper: Doubles
    inverse_bases: Doubles  # of the sequence of samples

    longest: float  # step
    shortest: float
    step: float  # in use
    domain: float  # as of RRT-Connect
    resolve: int  # 1 if undecided motions are inserted, to be asked for
    limit: int  # of the samples
    unchecked: int  # 1 to leave collisions out
    start_rows: Configuration  # roots
    goal_rows: Configuration
    goal_count: int
    walk_room: int  # vertices that one walk adds at most

    grower: int  # side of the tree that was extended towards the last sample
    row: Configuration
    row_values: JointValues  # of the row; the same memory where they are the same
    aim: Configuration
    query: Floats  # the configuration whose nearest vertex is wanted
    point: Doubles  # the last sample, in the unit box
    random: int  # state
    start_meeting: int  # vertices at which the trees meet
    goal_meeting: int
    straight_tried: int  # goals that were walked to straight away

    iterations: int
    checked: int  # motions


SOLVED, EXHAUSTED, RUNNING, FULL = range(4)  # status
OUTSIDE = -1  # status that a root is not in the box; less its number
ROOM = 256  # vertices of a walk in steps of usual length
