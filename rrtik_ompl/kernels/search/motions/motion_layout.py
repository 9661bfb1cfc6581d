"""The motion table of a world: what each field is, and by what rule a straight motion is divided into steps."""

from __future__ import annotations

from typing import NewType

from rrtik_ompl.kernels.record import Doubles

MotionTable = NewType("MotionTable", int)  # of a motion table


class Configuration(Doubles):
    """Rows of one number for each coordinate."""


# WORLD: the tables of the checks · joint values are GAIN @ q + OFFSET, shapes (JOINTS, DOF) and (JOINTS,)
# WEIGHTS: no point of the arm moves farther than WEIGHTS @ |b - a| [m] from a to b · NUMBERS: float64, see below
# ENDS: memory for the joint values of both ends of a motion · RESOLVE: 1 if doubtful motions are resolved, by the
# narrow phase and what it leaves undecided by the world; 0 in a conservative world · PROOF: the table of proofs of a
# world where only proven motions count as free, else 0
WORLD, DOF, JOINTS, GAIN, OFFSET, WEIGHTS, NUMBERS, ENDS, RESOLVE, PROOF = range(10)

# A motion takes WEIGHTS @ |b - a| / RESOLUTION [m] steps, or STEPS_PER_UNIT times its Euclidean length if those are
# more, rounded up.
RESOLUTION, STEPS_PER_UNIT = range(2)
STEP_TOLERANCE = 1e-9  # [steps] by which a motion may be longer than its whole number of steps
