"""The table of a tip that follows a rail in kernels, and how a rail is written as numbers."""

from __future__ import annotations

from rrtik_ompl.kernels.ik.ik_layout import POSE_NUMBERS, Pose
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.record import Doubles, Record

KERNELS = "ik.rail_kernels"  # their library


class Rail(Pose):
    """The pose of the tip at its beginning, then how it goes on; see below."""


class RailTable(Record):
    """A tip that follows a rail."""

    rail: Rail
    capacity: int  # rows that there is room for
    count: int  # of the configurations so far; the first one is given
    q: Configuration
    shares: Doubles  # of the rail at each
    levers: Doubles  # how far the tip is from each joint of the limb at most [m]
    reference: Configuration  # towards which what the rail leaves free is drawn
    pull: Doubles  # how much, by joint
    deviation: float  # of the tip from the rail at most, on the straight motions too [m]
    chord: float  # likewise, 2 sin(angle / 2)
    smallest: float  # step, as a share of the rail
    first_step: float
    homing: int  # 1 to be drawn so that the reference is reached at the end
    momentum: int  # 1 to begin each step with what the one before did
    trial: Configuration  # scratch memory
    middle: Configuration


# Rail: the pose of the tip at its beginning, then how the tip goes on with a share s of the rail. The place
# turns about CENTRE and ARC_AXIS by s ARC_ANGLE and is shifted by s SLIDE; axes turn about TURN_AXIS by s TURN_ANGLE.
BEGIN, CENTRE, ARC_AXIS, SLIDE, TURN_AXIS = 0, POSE_NUMBERS, POSE_NUMBERS + 3, POSE_NUMBERS + 6, POSE_NUMBERS + 9
ARC_ANGLE, TURN_ANGLE, ARC_RADIUS = POSE_NUMBERS + 12, POSE_NUMBERS + 13, POSE_NUMBERS + 14
RAIL_NUMBERS = POSE_NUMBERS + 15


# The method, for the kernels and for their reference implementation.
REMAINDER = 0.0080188  # sqrt(3) / 216: the largest |t (t - 1/2) (t - 1)| / 6 for t from 0 to 1
NEWTON_STEPS = 8
DAMPING = 1e-10  # in units of the squared residual: too little to be felt but in singular postures
ARRIVED = 1e-3  # share of the deviation within which a point of the rail is reached
ROOM = 2.5e-3  # share of the deviation that is left for that, and for rounding
LARGEST_CHANGE = 0.25  # [rad] or [m] of a joint in one step
LARGEST_GROWTH, SMALLEST_SHRINKING = 2.0, 0.3  # of a step from one to the next
