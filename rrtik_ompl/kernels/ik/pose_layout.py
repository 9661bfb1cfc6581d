"""The tables of a whole inverse kinematics of one pose in one call of a kernel."""

from __future__ import annotations

from rrtik_ompl.kernels.ik import branch_layout
from rrtik_ompl.kernels.ik.branch_layout import Matrices
from rrtik_ompl.kernels.ik.ik_layout import Aim, CallTable, LimbTable
from rrtik_ompl.kernels.layout import Configuration
from rrtik_ompl.kernels.record import Doubles, Ints, Record

KERNELS = "ik.pose_kernels"  # their library


class ArmTable(Record):
    """What is known of an arm."""

    numbers: Doubles  # of an arm of parallel axes, see `branch_layout`; may be absent
    lowest: Configuration  # limits with their tolerance
    highest: Configuration
    weights: Configuration  # of joints in distances
    turning: Ints  # whether a joint's limits go beyond half a turn
    endless: Ints  # whether a joint has no limits
    limb: LimbTable


class PoseTable(Record):
    """What one call works on."""

    arm: ArmTable
    pose: Matrices  # T_world_tip
    near: Configuration
    aim: Aim  # the pose, which is written here, and its tolerances
    slack: float  # how near to a singular pose a pose counts as singular, where it has no solution
    walk: CallTable  # of the numeric method: a single row
    rows: Doubles  # answers: configurations one after the other, then the distance and the angle of each
    lanes: Doubles  # scratch memory, see below


MOST_JOINTS = 12  # of an arm of the numeric method
ANSWER_NUMBERS = branch_layout.BRANCHES * (MOST_JOINTS + 2)

SHARES = 100.0  # tolerances of a goal over those of its aim

# Answers of kernels: UNKNOWN: the pose or the hint needs more than is done here. Else the number of steps times
# STEPS_UNIT plus the number of configurations.
UNKNOWN = -1
STEPS_UNIT = 256

# Scratch memory, in wide lanes that are branches: their joint values, the square of their distance from the hint, and
# their residuals.
VALUES, DISTANCE, AWAY, ANGLE, LANES = 0, 6, 7, 8, 9
