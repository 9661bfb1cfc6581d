"""The tables of closed forms in kernels, and the bounds that both forms of one arm go by."""

from __future__ import annotations

from rrtik_ompl.kernels.ik.ik_layout import LimbTable
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.record import Doubles, Ints, Record

KERNELS = "ik.branch_kernels"  # their library
BRANCHES, DOF = 8, 6


class Frame(Doubles):
    """12 numbers: the rotation row by row, then the origin."""


class Matrices(Doubles):
    """Of 4 x 4 numbers, row by row."""


class ArmTable(Record):
    """An arm of a closed form."""

    from_world: Frame  # T_base_world
    to_frame: Frame  # T_tip_frame
    numbers: Doubles  # what its kernel takes, see below
    lowest: Doubles  # limits with their tolerance
    highest: Doubles
    turning: Ints  # whether a joint's limits go beyond half a turn
    limb: LimbTable  # that forward kinematics reads


class CallTable(Record):
    """What one call works on. Answers are by target, WIDTH times ``blocks`` of them."""

    rows: int  # targets
    blocks: int  # of WIDTH targets, the last one filled up
    poses: Matrices  # T_world_tip
    near: Configuration  # hints, may be absent
    slack: float  # see `AnalyticSolver`
    q: Doubles  # joint values, joint by joint of each branch
    real: Ints  # truth values, a byte each: whether each branch reaches the target
    fits: Ints  # likewise: whether it is inside the limits
    odd: Ints  # likewise: whether the answer is not to be used
    residuals: Doubles  # of each branch its distance, then of each its angle; may be absent
    scratch: Doubles  # see below


# Numbers of an arm of parallel axes: of its DH table.
A1, A2, A3, A4, D6 = range(5)
# Numbers of any arm of parallel axes: six axes, signs of the joints, ways from axis to axis, the tip's turn and lever.
H1, H2, H5, H6, SIGNS = 0, 3, 12, 15, 18
P01, P12, P23, P34, P45, TURN, LEVER = 24, 27, 30, 33, 36, 39, 48
# Numbers of an arm with a ball wrist: height of the shoulder, a2, d3 of the DH table, and the forearm from elbow to
# wrist, its length and the angle that it is bent by.
SHOULDER, UPPER_ARM, ASIDE, FOREARM, BEND = range(5)

# Frame: places of its numbers.
ROTATION, ORIGIN = 0, 9
FRAME_NUMBERS = 12
MATRIX_SIDE, MATRIX_NUMBERS = 4, 16

# Scratch memory, in wide lanes: TARGET as given and FRAME as the closed form wants it, the joint values of the HINT,
# SINES and COSINES of the joints.
TARGET, FRAME, HINT = 0, FRAME_NUMBERS, 2 * FRAME_NUMBERS
SINES, COSINES, SCRATCH_LANES = HINT + DOF, HINT + 2 * DOF, HINT + 3 * DOF

SINGULAR = 1e-10  # [m] or sine; nearer than this a pose counts as singular, and its answer is still good to 1e-9
DOUBLE_ROOT = 4e-14  # of a squared sine: less is rounding, whose square root would spoil a stretched arm by 1e-8
REACH_TOLERANCE = 1e-10  # in the cosine of an elbow: what rounding may add at a stretched arm

# Of arms of parallel axes
ROUNDING = 3e-16  # [m] of the wrist point: divided by its distance from the azimuth axis, of theta1 and so of h
NORMAL = 4e-10  # sine; largest deviation of the gripper axis from the arm plane's normal that counts as none
UNSURE = 1e-3  # sine; nearer to normal, rounding in psi can open a triangle that closes

# Of arms with a ball wrist
SHOULDER_ROOT = 1e-15  # [m^2] of a squared radius: less is rounding, which moves the wrist centre by less than 1e-14 m
