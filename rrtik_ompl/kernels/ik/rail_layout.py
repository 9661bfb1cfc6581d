"""The table of a tip that follows a rail in kernels: what each field is, and how a rail is written as numbers.

Kernels read by the named functions of :mod:`rrtik_ompl.kernels.ik.rail_accessors`.
"""

from __future__ import annotations

from typing import NewType

from rrtik_ompl.kernels.ik.ik_layout import POSE_NUMBERS

KERNELS = "ik.rail_kernels"  # their library

# Addresses.
RailTable = NewType("RailTable", int)
Rail = NewType("Rail", int)

# Rail (float64): the pose of the tip at its beginning, then how the tip goes on with a share s of the rail. The place
# turns about CENTRE and ARC_AXIS by s ARC_ANGLE and is shifted by s SLIDE; axes turn about TURN_AXIS by s TURN_ANGLE.
BEGIN, CENTRE, ARC_AXIS, SLIDE, TURN_AXIS = 0, POSE_NUMBERS, POSE_NUMBERS + 3, POSE_NUMBERS + 6, POSE_NUMBERS + 9
ARC_ANGLE, TURN_ANGLE, ARC_RADIUS = POSE_NUMBERS + 12, POSE_NUMBERS + 13, POSE_NUMBERS + 14
RAIL_NUMBERS = POSE_NUMBERS + 15

# RAIL: see above · CAPACITY: rows that there is room for · Q: configurations, SHARES: of the rail at each · COUNT: of
# them so far; the first of each is given · LEVERS: of each joint of the limb how far the tip is from it at most [m] ·
# REFERENCE: configuration towards which what the rail leaves free is drawn, PULL: how much, by joint · SETTINGS: see
# below · scratch memory: TRIAL and MIDDLE configurations
RAIL, CAPACITY, COUNT, Q, SHARES, LEVERS, REFERENCE, PULL, SETTINGS, TRIAL, MIDDLE = range(11)
# DEVIATION [m] and CHORD (2 sin(angle / 2)) of the tip from the rail at most, on the straight motions too; SMALLEST and
# FIRST step, shares of the rail; HOMING: 1 to be drawn so that the reference is reached at the end; MOMENTUM: 1 to
# begin each step with what the one before did
DEVIATION, CHORD, SMALLEST, FIRST_STEP, HOMING, MOMENTUM = range(6)
SETTING_COUNT = 6

# The method, for the kernels and for their reference implementation.
REMAINDER = 0.0080188  # sqrt(3) / 216: the largest |t (t - 1/2) (t - 1)| / 6 for t from 0 to 1
NEWTON_STEPS = 8
DAMPING = 1e-10  # in units of the squared residual: too little to be felt but in singular postures
ARRIVED = 1e-3  # share of the deviation within which a point of the rail is reached
ROOM = 2.5e-3  # share of the deviation that is left for that, and for rounding
LARGEST_CHANGE = 0.25  # [rad] or [m] of a joint in one step
LARGEST_GROWTH, SMALLEST_SHRINKING = 2.0, 0.3  # of a step from one to the next
