"""Surface sampling and rule B for joints with one axis, without looking ahead: the direct transfer to real arms.

A node carries a frame, and the parent is the one whose circle of next points passes closest to the sample.
It shows what the arcs and the polish add; joint limits are not regarded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.units import wrapped
from rrtik_ompl.ik.mb_rrt.axes import Axes
from rrtik_ompl.ik.mb_rrt.links import directions
from rrtik_ompl.ik.mb_rrt.run import first_hit


@dataclass(frozen=True, slots=True, eq=False)
class AxisRun:
    """What a search brought.

    Attributes:
        q: Joint angles less their offsets of each pass's end, in the order of the axes, shape (passes, n).
        misses: Distance of each end from the goal [m], shape (passes,).
        solved_in: The first pass, counted from 1, within the tolerance; 0 if there is none.
    """

    q: Matrix
    misses: Vector
    solved_in: int


def grow_by_rule_b(axes: Axes, goal: Vector, *, tolerance: float, passes: int, rng: np.random.Generator) -> AxisRun:
    """Grow a tree of frames pass by pass until an end is within the tolerance [m] of a point, shape (3,)."""
    frames = [np.zeros((passes if level else 1, 4, 4)) for level in range(axes.count + 1)]
    q = [np.zeros((passes if level else 1, axes.count)) for level in range(axes.count + 1)]
    frames[0][0] = axes.fixed[0]
    misses = np.zeros(passes)

    for pass_number in range(passes):
        for level in range(axes.count):
            num_known = pass_number + 1 if level else 1
            sample = goal + axes.max_span[level] * directions(1, 3, rng)[0]
            parent, angle = _closest_circle(frames[level][:num_known], axes.points[level], sample)
            q[level + 1][pass_number] = q[level][parent]
            q[level + 1][pass_number, level] = angle
            frames[level + 1][pass_number] = frames[level][parent] @ _about_z(angle) @ axes.fixed[level + 1]

        end = frames[-1][pass_number]
        misses[pass_number] = np.linalg.norm(end[:3, :3] @ axes.aim + end[:3, 3] - goal)
        if misses[pass_number] < tolerance:
            break

    misses = misses[: pass_number + 1]
    return AxisRun(q[-1][: pass_number + 1] - axes.offset, misses, first_hit(misses, tolerance))


def _closest_circle(frames: NDArray[np.float64], point: Vector, sample: Vector) -> tuple[int, float]:
    """The frame whose circle, on which a turn about z moves a point, passes closest to a sample, and that turn."""
    local = np.einsum("mji,mj->mi", frames[:, :3, :3], sample - frames[:, :3, 3])
    off = (np.hypot(local[:, 0], local[:, 1]) - np.hypot(point[0], point[1])) ** 2 + (local[:, 2] - point[2]) ** 2
    best = int(np.argmin(off))
    turn = np.arctan2(local[best, 1], local[best, 0]) - np.arctan2(point[1], point[0])
    return best, float(wrapped(turn))


def _about_z(angle: float) -> NDArray[np.float64]:
    """The turn about z by an angle [rad], shape (4, 4)."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn
