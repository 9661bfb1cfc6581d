"""The motion table of a world, and by what rule a straight motion is divided into steps."""

from __future__ import annotations

from rrtik_ompl.kernels.layout import Configuration, JointValues, WorldTable
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.record import Doubles, Record

__all__ = ["STEP_TOLERANCE", "Configuration", "MotionTable"]


class MotionTable(Record):
    """What a check of motions needs.

    A motion takes ``weights @ |b - a| / resolution`` [m] steps, or ``steps_per_unit`` times its Euclidean length if
    those are more, rounded up.
    """

    world: WorldTable  # the tables of the checks
    dof: int
    joints: int
    gain: Doubles  # joint values are gain @ q + offset, shape (joints, dof)
    offset: Doubles
    weights: Doubles  # no point of the arm moves farther than weights @ |b - a| [m] from a to b
    resolution: float  # [m]
    steps_per_unit: float
    ends: JointValues  # memory for those of both ends of a motion
    resolve: int  # 1 if doubtful motions are resolved; 0 in a conservative world
    proof: ProofTable  # of a world where only proven motions count as free; else there is none


STEP_TOLERANCE = 1e-9  # [steps] by which a motion may be longer than its whole number of steps
