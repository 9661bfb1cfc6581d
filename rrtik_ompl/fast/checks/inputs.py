"""What callers may give to the collision checks: joint values that the margin covers, and numbers of steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.arrays import Vector, finite_array
from rrtik_ompl.errors import InputError
from rrtik_ompl.robot import Chain

LARGEST_ANGLE = 1e8  # [rad]; float64 cannot hold larger ones to the precision of the margin
STROKE = 4.0  # [m] a sliding joint may go this far from its zero unless told otherwise
MOST_STEPS = 2**30


def joint_limits(chain: Chain, strokes: ArrayLike) -> Vector:
    """Largest absolute value of each joint that the margin covers [rad or m], shape (joints,).

    Args:
        chain: The tree of joints.
        strokes: Largest value of sliding joints [m], a number or shape (joints,).

    Raises:
        InputError: If ``strokes`` are not numbers of metres.
    """
    given = np.asarray(strokes, dtype=np.float64)
    if given.shape not in ((), chain.prismatic.shape) or not (np.isfinite(given) & (given >= 0.0)).all():
        raise InputError(f"strokes: expected one number of metres or {len(chain.parent)}, none negative")
    return np.where(chain.prismatic, given, LARGEST_ANGLE)


def checked_step_counts(counts: ArrayLike, count: int) -> NDArray[np.int32]:
    """Numbers of steps of ``count`` motions as kernels read them, shape (count,).

    Raises:
        InputError: If one is not a positive integer, or they are not as many.
    """
    values = finite_array(counts, (count,), "steps of motions")
    if len(values) and (values.min() < 1.0 or values.max() > MOST_STEPS or not np.array_equal(values, values.round())):
        raise InputError(f"steps of motions: expected whole numbers from 1 to {MOST_STEPS}")
    return values.astype(np.int32)
