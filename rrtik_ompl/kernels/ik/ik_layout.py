"""The tables of inverse kinematics in kernels, and how a goal is written as a row of numbers."""

from __future__ import annotations

from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.record import Doubles, Ints, Record, Wholes

KERNELS = "ik.ik_kernels"  # their library


class Pose(Doubles):
    """The rotation row by row, then the origin."""


class Aim(Pose):
    """A goal; see below."""


class Twist(Doubles):
    """A residual or a column of the Jacobian: along, about."""


class StepRules(Record):
    """What bounds a step of damped least squares."""

    dof: int
    lower: Configuration  # limits
    upper: Configuration
    per_metre: float  # weight of a residual of the position
    damping: float
    largest_step: float  # of a coordinate


class LimbTable(StepRules):
    """The joints from the base to the tip."""

    joints: int
    fixed: Pose  # before each joint and after the last, every joint's axis being z
    sliding: Ints  # whether a joint slides
    column: Ints  # joint value = gain q[column] + offset
    gain: Doubles
    offset: Doubles
    seed_count: int
    seeds: Configuration
    seed_tips: Pose  # where seeds bring the tip to
    per_chord: float
    share: float  # of the squared residual, that is added to the damping
    share_growth: float
    stalled: float


class CallTable(Record):
    """What one call of a kernel works on."""

    rows: int  # goals or starts
    aims: Aim
    aim_numbers: int  # from one goal to the next; 0: all the same
    near: Configuration  # postures
    near_numbers: int  # from one posture to the next
    q: Configuration  # where each row has come to
    reached: Ints  # whether that is at its goal
    next: Wholes  # number of the start that comes next: 0: the posture, k: the k-th nearest seed
    steps: int  # most of a start
    patience: int  # steps in which the residual must fall to ``stalled`` of what it was, or the start is given up

    # Scratch memory.
    first: Pose  # of the frame before the first joint, seen from the goal
    frames: Pose  # of the joints and the tip
    columns: Twist  # of the Jacobian
    error: Twist
    weights: Twist
    square: Doubles  # matrix
    change: Configuration
    farness: Doubles  # of the seeds
    done: int  # steps taken
    lanes: Doubles  # of starts side by side, see below; may be absent
    starts: Wholes  # number of the start in each lane


class ChoiceTable(Record):
    """Configurations of which some are chosen."""

    rows: int
    dof: int
    most: int  # to choose
    least: float  # difference of a joint by which two differ
    q: Configuration
    away: Doubles  # distance of each from the start
    apart: Doubles  # largest difference of a joint from the nearest that is known or chosen
    endless: Ints  # whether a joint has no limits
    chosen: Ints  # their numbers, in the order of the choice


# Lanes: places of wide lanes. Of each start: share of damping, the squared residual some steps ago and one step ago,
# steps, whether it moves (1 or 0), residual, lower half of the square, the tip by rows, columns of the Jacobian; behind
# these coordinates, and axis and origin of each joint.
SHARE, MARK, BEFORE, AGE, MOVES, ERROR, SQUARE, TIPS, COLUMNS = 0, 1, 2, 3, 4, 5, 11, 32, 44

# Places of a pose's and of a twist's numbers.
AXES = 3  # rows of a rotation
POSE_NUMBERS = 12
ROTATION, ORIGIN = 0, 9
TWIST_NUMBERS = 6
LINEAR, ANGULAR = 0, 3

# Aim: T_world_tip as a pose, then tolerances [m] and of the chord 2 sin(angle / 2), half sides of the box in the goal
# frame within which the position is free [m], and what turn is free.
POSITION_TOLERANCE, CHORD_TOLERANCE, BOX, FREE_TURN = 12, 13, 14, 17
AIM_FLOATS = 18
NO_TURN, ANY_TURN = -1, 3  # else 0, 1, 2: about x, y or z of the goal
AS_ANGLES = 4  # of what is felt of a turn: the changes of roll, pitch and yaw
