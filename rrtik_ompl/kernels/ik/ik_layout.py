"""The tables of inverse kinematics in kernels: what each field is, and how a goal is written as a row of numbers.

Kernels read by the named functions of :mod:`rrtik_ompl.kernels.ik.ik_accessors`.
"""

from __future__ import annotations

from typing import NewType

KERNELS = "ik.ik_kernels"  # their library

# Addresses.
LimbTable = NewType("LimbTable", int)
CallTable = NewType("CallTable", int)
Pose = NewType("Pose", int)
Aim = NewType("Aim", Pose)
Configuration = NewType("Configuration", int)
Columns = NewType("Columns", int)
Twist = NewType("Twist", int)
Square = NewType("Square", int)
Doubles = NewType("Doubles", int)
Ints = NewType("Ints", int)
NextStart = NewType("NextStart", int)

# Limb: the joints from the base to the tip, float64. FIXED: poses before each joint and after the last, every joint's
# axis being z · SLIDING, COLUMN: int32 · joint value = GAIN q[COLUMN] + OFFSET · LOWER, UPPER: limits of q · SEEDS:
# configurations, SEED_TIPS: poses that they bring the tip to · NUMBERS: see below
JOINTS, DOF, FIXED, SLIDING, COLUMN, GAIN, OFFSET, LOWER, UPPER, SEED_COUNT, SEEDS, SEED_TIPS, NUMBERS = range(13)
PER_METRE, PER_CHORD, DAMPING, SHARE, SHARE_GROWTH, LARGEST_STEP, STALLED = range(7)  # the numbers

# Pose (float64): the rotation row by row, then the origin. Twist, a residual or a column of the Jacobian: along, about.
AXES = 3  # rows of a rotation
POSE_NUMBERS = 12
ROTATION, ORIGIN = 0, 9
TWIST_NUMBERS = 6
LINEAR, ANGULAR = 0, 3

# Call. ROWS: how many goals or starts · AIMS: goals, AIM_BYTES apart (0: all the same) · NEAR: postures, NEAR_BYTES
# apart · Q: where each row has come to · REACHED: int32, whether that is at its goal · NEXT: int64, number of the start
# that comes next (0: the posture, k: the k-th nearest seed) · STEPS: most steps of a start; PATIENCE: steps in which
# the residual must fall to STALLED of what it was, or the start is given up
ROWS, AIMS, AIM_BYTES, NEAR, NEAR_BYTES, Q, REACHED, NEXT, STEPS, PATIENCE = range(10)
# Its scratch memory: FIRST frame seen from the goal, FRAMES of the joints and the tip, COLUMNS of the Jacobian, ERROR,
# its WEIGHTS, SQUARE matrix, CHANGE of the joints, FARNESS of the seeds; DONE: steps taken
FIRST, FRAMES, COLUMNS, ERROR, WEIGHTS, SQUARE, CHANGE, FARNESS, DONE = range(10, 19)

# Aim: T_world_tip as a pose, then tolerances [m] and of the chord 2 sin(angle / 2), half sides of the box in the goal
# frame within which the position is free [m], and what turn is free.
POSITION_TOLERANCE, CHORD_TOLERANCE, BOX, FREE_TURN = 12, 13, 14, 17
AIM_FLOATS = 18
NO_TURN, ANY_TURN = -1, 3  # else 0, 1, 2: about x, y or z of the goal
