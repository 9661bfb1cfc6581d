"""Useful angles of one joint: those that keep the goal in reach of the links still to come, inside the joint limits.

Arc-of-intersection sampling on the circle that a real joint can move the next one on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Vector
from rrtik_ompl.base.units import wrapped
from rrtik_ompl.ik.mb_rrt.axes import Axes

SLACK = 1e-12  # in cosines and angles: what rounding may add where an interval is a single value
FLAT = 1e-24  # [m^2] a circle this small is a point


def draw_turns(
    axes: Axes, level: int, frames: NDArray[np.float64], goal: Vector, rng: np.random.Generator
) -> tuple[Vector, Mask]:
    """Draw an angle for a joint of each of several branches.

    The squared distance of the next point from the goal is a constant less an amplitude times the cosine of the
    angle from the direction of the goal, hence the useful angles are two mirrored arcs.

    Args:
        axes: The arm.
        level: Number of the joint, from 0.
        frames: Of the joint in each branch before it turns, T_world_joint, shape (m, 4, 4).
        goal: The aimed point in the world, shape (3,).
        rng: Random numbers.

    Returns:
        Angles inside the limits, shape (m,), uniform on the useful arcs; and which of them are useful. Where no angle
        is, it is the one that comes nearest to being it.
    """
    local = np.einsum("mji,mj->mi", frames[:, :3, :3], goal - frames[:, :3, 3])
    point = axes.points[level]
    max_distance = float(axes.max_span[level])
    min_distance = float(axes.min_span[level])

    constant = np.einsum("mi,mi->m", local, local) + point @ point - 2.0 * local[:, 2] * point[2]
    amplitude = 2.0 * np.hypot(local[:, 0], local[:, 1]) * np.hypot(point[0], point[1])
    centre = np.arctan2(local[:, 1], local[:, 0]) - np.arctan2(point[1], point[0])

    # a point on the axis, or a goal on it: every turn leaves them as far apart
    turn_changes_nothing = amplitude < FLAT
    divisor = np.where(turn_changes_nothing, 1.0, amplitude)
    min_cosine = (constant - max_distance**2) / divisor
    max_cosine = (constant - min_distance**2) / divisor
    rounding = SLACK * (1.0 + np.abs(constant) / divisor)

    # without an amplitude these are no cosines: the squared distance is within its bounds where they enclose 0
    any_turn_is_useful = (min_cosine <= rounding) & (max_cosine >= -rounding)
    some_turn_is_useful = (min_cosine <= 1.0 + rounding) & (max_cosine >= -1.0 - rounding)
    useful = np.where(turn_changes_nothing, any_turn_is_useful, some_turn_is_useful)
    outer = np.where(turn_changes_nothing, np.pi, np.arccos(np.clip(min_cosine, -1.0, 1.0)))
    inner = np.where(turn_changes_nothing, 0.0, np.arccos(np.clip(max_cosine, -1.0, 1.0)))

    if max_distance == 0.0 and bool(axes.exact):  # pointing at the goal, without the square root of the rounding
        outer = np.where(turn_changes_nothing, outer, 0.0)
        inner = np.where(turn_changes_nothing, inner, 0.0)

    drawn, is_inside = _draw(centre, inner, outer, float(axes.lower[level]), float(axes.upper[level]), rng)
    return drawn, useful & is_inside


def _draw(
    centre: Vector, inner: Vector, outer: Vector, lower: float, upper: float, rng: np.random.Generator
) -> tuple[Vector, Mask]:
    """Uniform angles on centre +- inner..outer inside the limits, shape (m,); where there are none the nearest."""
    turns = TAU * np.arange(np.floor((lower - np.pi) / TAU) - 1.0, np.ceil((upper + np.pi) / TAU) + 2.0)
    centre = wrapped(centre)
    begins = np.stack([centre + inner, centre - outer], axis=1)[:, :, None] + turns
    widths = (outer - inner)[:, None, None]
    starts = np.clip(begins, lower, upper).reshape(len(centre), -1)
    ends = np.clip(begins + widths, lower, upper).reshape(len(centre), -1)
    miss = np.maximum(np.maximum(lower - begins - widths, begins - upper), 0.0).reshape(len(centre), -1)

    # arcs inside the limits count by their lengths; where there are none, those that miss them least
    is_inside = miss.min(axis=1) <= SLACK
    weight = np.where(miss <= np.minimum(miss.min(axis=1), np.pi)[:, None] + SLACK, ends - starts + SLACK, 0.0)

    # one of them, then an angle on it
    total = np.cumsum(weight, axis=1)
    pick = (total > (rng.uniform(size=len(centre)) * total[:, -1])[:, None]).argmax(axis=1)
    rows = np.arange(len(centre))
    first = starts[rows, pick]
    last = ends[rows, pick]
    return first + rng.uniform(size=len(centre)) * (last - first), is_inside
