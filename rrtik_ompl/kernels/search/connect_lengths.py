"""The two lengths of RRT-Connect with dynamic domain, for kernels and for plain Python."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import TAU, Mask, Vector, positive

RANGE_SHARE = 0.08  # of the diagonal of the box of an arm, no joint counted for more than a turn
PLAIN_RANGE_SHARE = 0.2  # of the diagonal of any other box, as in OMPL
# Of the diagonal of the box: four fifths of the root mean square distance of two random configurations, which is
# 6 ** -0.5 of it. Searches among narrow passages are a quarter shorter than with all of it, others as long; with half
# of it most are longer.
DOMAIN_SHARE = 0.8 * 6.0**-0.5
MIN_RANGE = 1e-9  # [unit of the box] where lower and upper bounds coincide


def connect_lengths(
    lower: Vector, upper: Vector, range_: float | None, domain: float | None, *, turning: Mask | None
) -> tuple[float, float]:
    """Range and domain in use: as given, or else a share of the box of configurations, whatever its unit.

    Args:
        lower: Lower bounds of the box, shape (n,).
        upper: Its upper bounds, shape (n,).
        range_: Length of a motion of the trees, at most.
        domain: Radius in which a vertex is extended once it was blocked.
        turning: Which joints of an arm turn, shape (n,): a range spans no more than a turn of one. None where the box
            is not that of an arm, so that nobody knows what its numbers mean.

    Raises:
        InputError: If one of them is not a number above 0.
    """
    if range_ is None:
        range_ = max(_usual_range(upper - lower, turning), MIN_RANGE)
    used = positive(range_, "range")
    if domain is None:
        domain = max(DOMAIN_SHARE * float(np.linalg.norm(upper - lower)), used)
    return used, positive(domain, "domain")


def _usual_range(extent: Vector, turning: Mask | None) -> float:
    if turning is None:
        return PLAIN_RANGE_SHARE * float(np.linalg.norm(extent))
    return RANGE_SHARE * float(np.linalg.norm(np.where(turning, np.minimum(extent, TAU), extent)))
