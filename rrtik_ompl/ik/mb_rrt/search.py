"""Configurations of a real arm at a position or a pose: the tree's branches, polished where that alone is not exact.

An arm whose axes are all parallel ends exactly on the goal. Elsewhere a sphere about the goal is not all that a joint
with one axis can keep to; the newest branches, which are near the goal and free as far as the links know, are then
polished by Levenberg-Marquardt.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.ik.mb_rrt.axes import Axes, axes_of, misfit
from rrtik_ompl.ik.mb_rrt.link_worlds import LinkWorlds
from rrtik_ompl.ik.mb_rrt.workspace_tree import WorkspaceTree
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.model.goal import Target
from rrtik_ompl.model.robot import Robot, inside_limits, poses
from rrtik_ompl.world.world import World

WIDTH = 16  # passes at a time
MAX_ROUNDS = 64  # after which it gives up
FIRST_STEPS = 12  # of the polish, after which most branches that get to the goal at all are there
POLISHED = 0.1  # of the tolerances, within which few steps have brought a branch to the goal
POSTURE_ONLY_ROUNDS = 2  # that check whole postures alone; where free ones are common, that is faster


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Configurations at the goal, shape (k, dof), inside the limits; passes done; whether the time was up."""

    q: Matrix
    passes: int
    timed_out: bool = False


def search(
    robot: Robot,
    target: Target,
    *,
    near: Vector,
    accept: Callable[[Matrix], Mask],
    rng: np.random.Generator,
    deadline: float,
    world: World | None = None,
    collect_all: bool = False,
    width: int = WIDTH,
    rounds: int = MAX_ROUNDS,
) -> Found:
    """Grow the tree until a configuration at the goal will do.

    Args:
        robot: An arm that `rrtik_ompl.ik.mb_rrt.axes.misfit` accepts.
        target: The goal.
        near: Values of joints that the tree does not move, shape (dof,).
        accept: Which configurations, shape (k, dof), at the goal will do.
        rng: Random numbers.
        deadline: Time of ``time.monotonic`` at which to stop.
        world: If given, and if the first rounds end in collision, every further edge of the tree is held clear of
            its obstacles, link by link.
        collect_all: Whether to go on for all ``rounds`` and collect every solution.
        width: Passes at a time.
        rounds: Limit.
    """
    solutions = np.zeros((0, robot.dof))
    if out_of_reach(robot, target):
        return Found(solutions, 0)

    axes = axes_of(robot, target.oriented)
    tree = WorkspaceTree(axes, axes.nearest_in_reach(aimed_point(axes, target)), near, rng)
    for number in range(rounds):
        if number == POSTURE_ONLY_ROUNDS and world is not None and world.pairs:
            tree.check_links(LinkWorlds(world, axes).free)
        ends = polished(robot, axes, target, tree.grow(width), wait_for_all=collect_all)
        solutions = np.vstack([solutions, ends])
        if not collect_all and accept(ends).any():
            break
        if time.monotonic() > deadline:
            return Found(solutions, tree.passes, True)

    return Found(solutions, tree.passes)


def out_of_reach(robot: Robot, target: Target) -> bool:
    """Whether the lengths of an arm do not allow a target, for certain; nothing is known of arms with a `misfit`."""
    if misfit(robot):
        return False
    axes = axes_of(robot, target.oriented)
    return axes.shortfall(aimed_point(axes, target)) > target.tolerances[0]


def aimed_point(axes: Axes, target: Target) -> Vector:
    """The point in the world that the tree aims at, shape (3,)."""
    if not target.oriented:
        return target.point
    point: Vector = target.pose.rotation @ axes.aim + target.point
    return point


def polished(robot: Robot, axes: Axes, target: Target, ends: Matrix, *, wait_for_all: bool = True) -> Matrix:
    """Those of the tree's ends that are at the goal or get there, shape (k, dof).

    Args:
        robot: The arm.
        axes: Of the arm, for this kind of target.
        target: The goal.
        ends: Configurations, shape (m, dof).
        wait_for_all: Whether to wait for the slowest; if not, the first few that get there are enough.
    """
    if len(ends) == 0:
        return ends

    if target.oriented:
        ends = _last_turned(robot, axes, target, ends)
    if axes.exact:
        return ends[target.satisfied(robot, ends) & inside_limits(robot, ends)]

    if not wait_for_all:
        ends, _ = descend(robot, target, ends, iterations=FIRST_STEPS)
        at_goal = target.tightened(POLISHED).satisfied(robot, ends)
        if at_goal.any():
            return ends[at_goal]

    ends, _ = descend(robot, target, ends)
    return ends[target.satisfied(robot, ends)]


def _last_turned(robot: Robot, axes: Axes, target: Target, ends: Matrix) -> Matrix:
    """The last joint, which leaves the aimed point where it is, turned as near to the orientation as it gets."""
    joint = int(axes.joints[-1])
    angles = np.array(ends)
    angles[:, joint] = -axes.offset[-1]
    frames = poses(robot, angles)[:, :3, :3] @ axes.fixed[-1][:3, :3].T
    wanted = target.pose.rotation @ axes.fixed[-1][:3, :3].T

    off = np.swapaxes(frames, 1, 2) @ wanted  # the turn about z nearest to it
    turn = np.arctan2(off[:, 1, 0] - off[:, 0, 1], off[:, 0, 0] + off[:, 1, 1])
    turn += TAU * np.ceil((axes.lower[-1] - turn) / TAU - 1e-9)  # the first full turn inside the limits
    angles[:, joint] = np.clip(turn, axes.lower[-1], axes.upper[-1]) - axes.offset[-1]
    return angles
