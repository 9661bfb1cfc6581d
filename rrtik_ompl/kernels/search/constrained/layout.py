"""The tables of path constraints and of searches along them: what each field is.

Regions, measures and bounds are those of :class:`rrtik_ompl.constraints.held_region.HeldRegion`.
"""

from __future__ import annotations

from rrtik_ompl.kernels.ik.ik_layout import CallTable, LimbTable, StepRules, Twist
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.record import Doubles, Record, Tables
from rrtik_ompl.kernels.search.two_trees_layout import TwoTreesTable

KERNELS = "search.constrained.kernels"  # the library of these searches


class HeldTable(StepRules):
    """Path constraints."""

    count: int  # regions
    regions: Tables
    per_radian: float
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


class ConstrainedTable(TwoTreesTable):
    """A search along path constraints. Lengths are in the unit of the configurations."""

    held: HeldTable
    unchecked: int  # 1 to leave collisions out
    walk_room: int  # vertices that one walk adds at most

    longest: float  # step
    shortest: float
    step: float  # in use
    aim: Configuration  # where a walk goes


SOLVED, EXHAUSTED, RUNNING, FULL = range(4)  # status
OUTSIDE = -1  # status that a root is not in the box; less its number
ROOM = 256  # vertices of a walk in steps of usual length
