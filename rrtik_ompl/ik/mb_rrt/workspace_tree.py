"""The tree of a real arm: nodes are frames of joints, edges are links held to limits and free of obstacles.

A joint is drawn from its useful angles: those that keep the goal in reach of the links still to come, inside the joint
limits. That is arc-of-intersection sampling on the circle that a real joint can move the next one on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.units import wrapped
from rrtik_ompl.ik.mb_rrt.axes import Axes
from rrtik_ompl.ik.mb_rrt.links import directions
from rrtik_ompl.ik.mb_rrt.published import first_hit

TRIES = 24  # other nodes of the same index that are tried where an edge cannot be
SLACK = 1e-12  # in cosines and angles: what rounding may add where an interval is a single value
FLAT = 1e-24  # [m^2] a circle this small is a point

LinkFree = Callable[[int, Matrix], Mask]  # from level and rows of q, of which joints 0..level count


class WorkspaceTree:
    """Grows branches towards a point, several passes at a time.

    A pass goes on from its own node; where that has no useful angle, or the link would touch something, from other
    nodes of the same index, drawn at random.

    Attributes:
        passes: Done so far.
        edges: Links tried so far.
    """

    def __init__(
        self, axes: Axes, goal: Vector, start: Vector, rng: np.random.Generator, link_is_free: LinkFree | None = None
    ) -> None:
        """Plant the tree.

        Args:
            axes: The arm.
            goal: The point in the world that it aims at, shape (3,).
            start: Values of joints that need not move, shape (dof,).
            rng: Random numbers.
            link_is_free: Which rows are free of collision as far as the link of a level; everything if None.
        """
        self._axes = axes
        self._goal = goal
        self._rng = rng
        self._start = np.array(start)[None]
        self.passes = 0
        self.edges = 0
        self.check_links(link_is_free)

    def check_links(self, link_is_free: LinkFree | None) -> None:
        """Plant the tree anew: its further edges are held free, and no earlier one is built on."""
        self._link_is_free = link_is_free
        self._q: list[Matrix] = [self._start, *(np.zeros((0, self._start.shape[1])),) * self._axes.count]
        self._frames: list[NDArray[np.float64]] = [self._axes.fixed[:1], *(np.zeros((0, 4, 4)),) * self._axes.count]

    def nodes(self, level: int) -> Matrix:
        """Configurations up to a level's joint, in the order in which they were added, shape (k, dof)."""
        return self._q[level]

    def grow(self, width: int = 1) -> Matrix:
        """Do some passes at a time.

        Returns:
            Configurations of those that came to the end of the arm, shape (k, dof), k <= width.
        """
        self.passes += width
        q = np.repeat(self._q[0], width, axis=0)
        frames = np.repeat(self._frames[0], width, axis=0)
        for level in range(self._axes.count):
            q, frames = self._add_link(level, q, frames)
            if len(q) == 0:
                break
            self._q[level + 1] = np.vstack([self._q[level + 1], q])
            self._frames[level + 1] = np.concatenate([self._frames[level + 1], frames])
        return q

    def _add_link(self, level: int, q: Matrix, frames: NDArray[np.float64]) -> tuple[Matrix, NDArray[np.float64]]:
        """Add a link to each branch, or to another of the same index in its place; those that succeed."""
        done_q = []
        done_frames = []
        num_missing = len(q)
        for attempt in range(TRIES):
            turned, usable = self._turn_joint(level, q, frames, keep_idle_joints=attempt == 0)
            done_q.append(turned[usable])
            done_frames.append(self._next_frames(level, frames[usable], turned[usable]))
            num_missing -= int(usable.sum())
            if num_missing == 0 or len(self._q[level]) < 2:
                break
            others = self._rng.integers(len(self._q[level]), size=num_missing)
            q = self._q[level][others]
            frames = self._frames[level][others]

        return np.vstack(done_q), np.concatenate(done_frames)

    def _turn_joint(
        self, level: int, q: Matrix, frames: NDArray[np.float64], *, keep_idle_joints: bool
    ) -> tuple[Matrix, Mask]:
        """Rows with the level's joint turned to a useful angle, and which of them will do.

        With ``keep_idle_joints`` a joint that cannot bring the goal nearer keeps its value.
        """
        axes = self._axes
        angle, useful = draw_turns(axes, level, frames, self._goal, self._rng)
        # Where the regions are not exact, "useful" is a hint: what counts is whether the polish gets to the goal.
        usable = useful if axes.exact else np.ones(len(q), dtype=bool)

        if keep_idle_joints and axes.idle[level]:
            current_angle = self._start[0, axes.joints[level]] + axes.offset[level]
            angle = np.full(len(q), np.clip(current_angle, axes.lower[level], axes.upper[level]))

        turned = np.array(q)
        turned[:, axes.joints[level]] = angle - axes.offset[level]
        self.edges += len(q)
        if self._link_is_free is not None and usable.any():
            usable[usable] = self._link_is_free(level, turned[usable])
        return turned, usable

    def _next_frames(self, level: int, frames: NDArray[np.float64], q: Matrix) -> NDArray[np.float64]:
        """Frames of the next joint."""
        angle = q[:, self._axes.joints[level]] + self._axes.offset[level]
        turn = np.tile(np.eye(4), (len(q), 1, 1))
        cosine = np.cos(angle)
        sine = np.sin(angle)
        turn[:, 0, 0] = cosine
        turn[:, 0, 1] = -sine
        turn[:, 1, 0] = sine
        turn[:, 1, 1] = cosine

        moved: NDArray[np.float64] = frames @ turn @ self._axes.fixed[level + 1]
        return moved


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


@dataclass(frozen=True, slots=True, eq=False)
class AxisRun:
    """What `grow_by_rule_b` brought.

    Attributes:
        q: Joint angles less their offsets of each pass's end, in the order of the axes, shape (passes, n).
        misses: Distance of each end from the goal [m], shape (passes,).
        solved_in: The first pass, counted from 1, within the tolerance; 0 if there is none.
    """

    q: Matrix
    misses: Vector
    solved_in: int


def grow_by_rule_b(axes: Axes, goal: Vector, *, tolerance: float, passes: int, rng: np.random.Generator) -> AxisRun:
    """Grow a tree of frames pass by pass until an end is within the tolerance [m] of a point, shape (3,).

    Surface sampling and rule B for joints with one axis, without looking ahead: the direct transfer of [3] to real
    arms, which shows what the arcs and the polish add. The parent is the node whose circle of next points passes
    closest to the sample; joint limits are not regarded.
    """
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
