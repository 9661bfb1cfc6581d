"""What callers may give to the collision checks: joint values that the margin covers, and numbers of steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Chain

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
    values = counts if isinstance(counts, np.ndarray) and counts.dtype.kind in "if" else None
    if values is None or values.shape != (count,):
        values = finite_array(counts, (count,), "steps of motions")
    if len(values) and (values.min() < 1.0 or values.max() > MOST_STEPS or not np.array_equal(values, values.round())):
        raise InputError(f"steps of motions: expected whole numbers from 1 to {MOST_STEPS}")
    return values.astype(np.int32)


def kernel_values(V: ArrayLike, limits: Vector, smallest: float, what: str) -> tuple[Matrix, Mask | None]:
    """Rows of joint values as the kernels want them, and which of them lie beyond the limits, if any.

    Args:
        V: Shape (m, joints).
        limits: Largest absolute values, shape (joints,).
        smallest: The smallest of these.
        what: They are, for messages.
    """
    rows = V if isinstance(V, np.ndarray) and V.dtype == np.float64 else None
    if rows is None or rows.ndim != 2 or rows.shape[1] != len(limits):
        rows = finite_array(V, (None, len(limits)), what)
    rows = np.ascontiguousarray(rows)
    if not rows.size or (rows.max() <= smallest and rows.min() >= -smallest):
        return rows, None
    rows = finite_array(rows, (None, len(limits)), what)
    beyond: Mask = np.any(np.abs(rows) > limits, axis=1)
    return (np.where(beyond[:, None], 0.0, rows), beyond) if beyond.any() else (rows, None)


def require_sound(count: int) -> int:
    """What a kernel returns, unless it has met a primitive of a kind that it does not know."""
    if count < 0:
        raise InputError("collision check: a primitive is of a kind that the kernels do not know")
    return count
