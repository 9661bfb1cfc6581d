"""The workspace tree of a real arm: nodes are frames of joints, edges are links inside joint limits and free.

The angle of a joint is drawn from its useful angles: those inside the limits that keep the goal in reach of the
remaining links. That is sampling on arcs of intersection, on the circle on which a real joint moves the next one.
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

TRIES = 24  # number of other nodes of the same level that are tried where an edge is not possible
SLACK = 1e-12  # allowance for rounding in cosines and angles, where an interval can be a single value
FLAT = 1e-24  # [m^2]: a circle this small counts as a point

# A function of a level and configurations, shape (m, dof), of which joints 0..level count; returns which are free.
LinkFree = Callable[[int, Matrix], Mask]


class WorkspaceTree:
    """Grows branches towards a point, several passes at a time.

    A pass goes on from its own last node. If that has no useful angle, or the link would collide, it goes on from
    random other nodes of the same level.

    Attributes:
        passes: Number of passes so far.
        edges: Number of links tried so far.
    """

    def __init__(
        self, axes: Axes, goal: Vector, start: Vector, rng: np.random.Generator, link_is_free: LinkFree | None = None
    ) -> None:
        """Plant the tree.

        Args:
            axes: The arm.
            goal: The aimed point in the world [m], shape (3,).
            start: Configuration that gives the values of joints that need not move, shape (dof,).
            rng: Source of random numbers.
            link_is_free: Checks which configurations are free up to the link of a level; all are if None.
        """
        self._axes = axes
        self._goal = goal
        self._rng = rng
        self._start = np.array(start)[None]
        self.passes = 0
        self.edges = 0
        self.check_links(link_is_free)

    def check_links(self, link_is_free: LinkFree | None) -> None:
        """Clear the tree and check the links of all further edges; earlier edges were not checked."""
        self._link_is_free = link_is_free
        self._q: list[Matrix] = [self._start, *(np.zeros((0, self._start.shape[1])),) * self._axes.count]
        self._frames: list[NDArray[np.float64]] = [self._axes.fixed[:1], *(np.zeros((0, 4, 4)),) * self._axes.count]

    def nodes(self, level: int) -> Matrix:
        """Return the configurations of a level, of which the joints before it count, in order; shape (k, dof)."""
        return self._q[level]

    def grow(self, width: int = 1) -> Matrix:
        """Do ``width`` passes at once.

        Returns:
            Configurations of the passes that reached the end of the arm, shape (k, dof), k <= width.
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
        """Add a link to each branch, or to a random other node of the same level in its place.

        Args:
            level: Number of the joint, from 0.
            q: Configurations of the branches, shape (m, dof).
            frames: Frames of the joint, T_world_joint, shape (m, 4, 4).

        Returns:
            Configurations and frames of the next joint, for those that succeeded, shapes (k, dof) and (k, 4, 4).
        """
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
        """Turn the level's joint to a random useful angle.

        Args:
            level: Number of the joint, from 0.
            q: Configurations, shape (m, dof).
            frames: Frames of the joint, shape (m, 4, 4).
            keep_idle_joints: Whether a joint that cannot bring the tip nearer to the goal keeps its start value.

        Returns:
            Configurations with the joint turned, shape (m, dof), and whether each is usable, shape (m,).
        """
        axes = self._axes
        angle, useful = draw_turns(axes, level, frames, self._goal, self._rng)
        # If the regions are not exact, "useful" is only a hint; the polish decides whether a branch gets to the goal.
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
        """Return the frames of the next joint, shape (m, 4, 4), from those of a level and the configurations."""
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
    """Draw a useful angle of a joint for each of several branches.

    The squared distance of the next point from the goal is a constant minus an amplitude times the cosine of the angle
    from the direction of the goal. So the angles that keep this distance within the span of the remaining links form
    two mirrored arcs.

    Args:
        axes: The arm.
        level: Number of the joint, from 0.
        frames: Frames of the joint in each branch before it turns, T_world_joint, shape (m, 4, 4).
        goal: The aimed point in the world [m], shape (3,).
        rng: Source of random numbers.

    Returns:
        Angles inside the limits [rad], shape (m,), uniform on the useful arcs, and whether they are useful, shape (m,).
        If no angle is useful, it is the one that comes nearest to it.
    """
    local = np.einsum("mji,mj->mi", frames[:, :3, :3], goal - frames[:, :3, 3])
    point = axes.points[level]
    max_distance = float(axes.max_span[level])
    min_distance = float(axes.min_span[level])

    constant = np.einsum("mi,mi->m", local, local) + point @ point - 2.0 * local[:, 2] * point[2]
    amplitude = 2.0 * np.hypot(local[:, 0], local[:, 1]) * np.hypot(point[0], point[1])
    centre = np.arctan2(local[:, 1], local[:, 0]) - np.arctan2(point[1], point[0])

    # If the point or the goal is on the axis, turning does not change their distance.
    turn_changes_nothing = amplitude < FLAT
    divisor = np.where(turn_changes_nothing, 1.0, amplitude)
    min_cosine = (constant - max_distance**2) / divisor
    max_cosine = (constant - min_distance**2) / divisor
    rounding = SLACK * (1.0 + np.abs(constant) / divisor)

    # Without an amplitude these are no cosines; the squared distance is within its bounds if they enclose 0.
    any_turn_is_useful = (min_cosine <= rounding) & (max_cosine >= -rounding)
    some_turn_is_useful = (min_cosine <= 1.0 + rounding) & (max_cosine >= -1.0 - rounding)
    useful = np.where(turn_changes_nothing, any_turn_is_useful, some_turn_is_useful)
    outer = np.where(turn_changes_nothing, np.pi, np.arccos(np.clip(min_cosine, -1.0, 1.0)))
    inner = np.where(turn_changes_nothing, 0.0, np.arccos(np.clip(max_cosine, -1.0, 1.0)))

    # The last link has to point exactly at the goal; arccos would return the square root of rounding.
    if max_distance == 0.0 and bool(axes.exact):
        outer = np.where(turn_changes_nothing, outer, 0.0)
        inner = np.where(turn_changes_nothing, inner, 0.0)

    drawn, is_inside = _draw(centre, inner, outer, float(axes.lower[level]), float(axes.upper[level]), rng)
    return drawn, useful & is_inside


def _draw(
    centre: Vector, inner: Vector, outer: Vector, lower: float, upper: float, rng: np.random.Generator
) -> tuple[Vector, Mask]:
    """Draw uniform angles on the arcs centre + inner..outer and centre - outer..-inner, inside the limits.

    Args:
        centre: Centres of the arcs [rad], shape (m,).
        inner: Inner ends of the arcs relative to the centre [rad], shape (m,).
        outer: Outer ends of the arcs relative to the centre [rad], shape (m,).
        lower: Lower limit [rad].
        upper: Upper limit [rad].
        rng: Source of random numbers.

    Returns:
        Angles [rad], shape (m,), or the limits nearest to an arc where no part of one is inside; and whether the arcs
        reach into the limits, shape (m,).
    """
    turns = TAU * np.arange(np.floor((lower - np.pi) / TAU) - 1.0, np.ceil((upper + np.pi) / TAU) + 2.0)
    centre = wrapped(centre)
    begins = np.stack([centre + inner, centre - outer], axis=1)[:, :, None] + turns
    widths = (outer - inner)[:, None, None]
    starts = np.clip(begins, lower, upper).reshape(len(centre), -1)
    ends = np.clip(begins + widths, lower, upper).reshape(len(centre), -1)
    miss = np.maximum(np.maximum(lower - begins - widths, begins - upper), 0.0).reshape(len(centre), -1)

    # Arcs inside the limits are weighted by their lengths; if there are none, those that miss the limits least count.
    is_inside = miss.min(axis=1) <= SLACK
    weight = np.where(miss <= np.minimum(miss.min(axis=1), np.pi)[:, None] + SLACK, ends - starts + SLACK, 0.0)

    # Choose one of them, then an angle on it.
    total = np.cumsum(weight, axis=1)
    pick = (total > (rng.uniform(size=len(centre)) * total[:, -1])[:, None]).argmax(axis=1)
    rows = np.arange(len(centre))
    first = starts[rows, pick]
    last = ends[rows, pick]
    return first + rng.uniform(size=len(centre)) * (last - first), is_inside


@dataclass(frozen=True, slots=True, eq=False)
class AxisRun:
    """Result of `grow_by_rule_b`.

    Attributes:
        q: Entries of q (joint angles minus offsets) at the end of each pass, in the order of the axes, shape
            (passes, n).
        misses: Distance of each end from the goal [m], shape (passes,).
        solved_in: The first pass, counted from 1, within the tolerance; 0 if there is none.
    """

    q: Matrix
    misses: Vector
    solved_in: int


def grow_by_rule_b(axes: Axes, goal: Vector, *, tolerance: float, passes: int, rng: np.random.Generator) -> AxisRun:
    """Grow a tree of frames pass by pass, by surface sampling and rule B for joints with one axis.

    This is the direct transfer of [3] to real arms, without looking ahead; it shows what the arcs and the polish add.
    The parent of a node is the one whose circle of next points passes closest to the sample. Joint limits are ignored.

    Args:
        axes: The arm.
        goal: The aimed point in the world [m], shape (3,).
        tolerance: Distance of an end from the goal that ends the search [m].
        passes: Largest number of passes.
        rng: Source of random numbers.
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
    """Find the frame whose rotation about z brings a point closest to a sample.

    Args:
        frames: Frames, shape (k, 4, 4).
        point: The point in each frame [m], shape (3,).
        sample: The sample in the world [m], shape (3,).

    Returns:
        Index of the frame, and the rotation [rad].
    """
    local = np.einsum("mji,mj->mi", frames[:, :3, :3], sample - frames[:, :3, 3])
    off = (np.hypot(local[:, 0], local[:, 1]) - np.hypot(point[0], point[1])) ** 2 + (local[:, 2] - point[2]) ** 2
    best = int(np.argmin(off))
    turn = np.arctan2(local[best, 1], local[best, 0]) - np.arctan2(point[1], point[0])
    return best, float(wrapped(turn))


def _about_z(angle: float) -> NDArray[np.float64]:
    """Return the rotation about z by an angle [rad], shape (4, 4)."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn
