"""Planes that bound a convex solid, thinned out."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.arrays import Matrix


def most_different(planes: Matrix, count: int) -> Matrix:
    """At most ``count`` of the planes, each time the one whose normal is farthest from those already taken."""
    if len(planes) <= count:
        return planes
    taken = [0]
    nearest = planes[:, :3] @ planes[0, :3]
    while len(taken) < count:
        taken.append(int(np.argmin(nearest)))
        nearest = np.maximum(nearest, planes[:, :3] @ planes[taken[-1], :3])
    return planes[taken]
