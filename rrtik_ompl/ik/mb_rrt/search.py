"""Configurations of a real arm at a position or a pose: the tree's branches, polished where that alone is not exact.

An arm whose axes are all parallel ends exactly on the goal. Elsewhere a sphere about the goal is not all that a joint
with one axis can keep to; the newest branches, which are near the goal and free as far as the links know, are then
polished by Levenberg-Marquardt.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from rrtik_ompl.base.arrays import TAU, Mask, Matrix, Vector
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import DescriptionWarning
from rrtik_ompl.ik.mb_rrt.axes import Axes, axes_of, misfit
from rrtik_ompl.ik.mb_rrt.workspace_tree import WorkspaceTree
from rrtik_ompl.ik.method_interface import IkRequest, IkResponse
from rrtik_ompl.ik.numeric.descent import descend
from rrtik_ompl.ik.numeric.restarts import nearest_posture
from rrtik_ompl.ik.targets import targets
from rrtik_ompl.model.goal import Target, TipGoal, joint_difference
from rrtik_ompl.model.robot import Robot, inside_limits, poses
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.world import World

WIDTH = 16  # passes at a time
MAX_ROUNDS = 64  # after which it gives up
FIRST_STEPS = 12  # of the polish, after which most branches that get to the goal at all are there
POLISHED = 0.1  # of the tolerances, within which few steps have brought a branch to the goal
POSTURE_ONLY_ROUNDS = 2  # that check whole postures alone; where free ones are common, that is faster
ROUNDS_FOR_ALL = 8  # of the workspace tree if every solution is requested
DRAWS = 16  # targets of a planner's goal that leaves freedom
MAX_CONFIGURATIONS = 16  # that a planner gets


def mb_rrt(request: IkRequest) -> IkResponse:
    """A tree in the workspace for one target after the other, until a solution will do."""
    robot = request.robot
    count = len(request.targets)
    rows = np.zeros((0, robot.dof))
    passes = 0
    for target in request.targets:
        found = search(
            robot,
            target,
            near=request.near,
            accept=request.accept,
            rng=request.rng,
            budget=request.budget,
            world=request.world,
            collect_all=request.all,
            rounds=max(1, (ROUNDS_FOR_ALL if request.all else MAX_ROUNDS) // count),
        )
        rows = np.vstack([rows, found.q])
        passes += found.passes
        if found.timed_out or (request.accept(found.q).any() and not request.all):
            break
    return IkResponse(rows, request.near if len(rows) else nearest_posture(request), passes, found.timed_out)


def tree_aims(world: World, goal: TipGoal, near: Vector, rng: np.random.Generator, *, seconds: float) -> Matrix:
    """Free configurations at a goal, nearest to a posture first.

    Args:
        world: The robot, which `rrtik_ompl.ik.mb_rrt.axes.misfit` accepts, and its scene.
        goal: A goal of the tip.
        near: Shape (dof,).
        rng: Random numbers.
        seconds: Time limit.

    Returns:
        Shape (k, dof), k <= `MAX_CONFIGURATIONS`, none if none was found in time.
    """
    budget = Budget(seconds=seconds)
    robot = world.robot
    rows = np.zeros((0, robot.dof))

    def accept(Q: Matrix) -> Mask:
        return world.valid_batch(robot.clamp(Q))

    for target in targets(goal, DRAWS, rng):
        found = search(robot, target, near=near, accept=accept, rng=rng, budget=budget, world=world)
        rows = np.vstack([rows, robot.clamp(found.q)])
        rows = rows[goal.satisfied(robot, rows) & world.valid_batch(rows)] if len(rows) else rows
        if found.timed_out or len(rows) >= MAX_CONFIGURATIONS:
            break

    differences = joint_difference(robot, rows, near)
    order = np.argsort(np.linalg.norm(differences, axis=1), kind="stable")[:MAX_CONFIGURATIONS]
    nearest: Matrix = np.where(robot.continuous, near + differences[order], rows[order])
    return nearest


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
    budget: Budget,
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
        budget: How long it may take.
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
        if budget.over():
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


class LinkWorlds:
    """Checks by World the links up to one joint, with all that they hold.

    Args:
        world: The whole arm and its scene.
        axes: Its joints, base first.
    """

    def __init__(self, world: World, axes: Axes) -> None:
        self._world = world
        order = _joint_order(world.robot, axes)
        self._worlds = [_first_links(world, set(order[level + 1 :])) for level in range(len(order) - 1)] + [world]

    def free(self, level: int, q: Matrix) -> Mask:
        """Which rows, shape (m, dof), are free as far as the link of a level."""
        return self._worlds[level].valid_batch(self._world.robot.clamp(q))


def _joint_order(robot: Robot, axes: Axes) -> list[int]:
    """Pinocchio's numbers of the joints that move the tip, base first."""
    number = int(robot.model.frames[robot.model.getFrameId(robot.tip)].parentJoint)
    numbers: list[int] = []
    while number > 0:
        numbers.insert(0, number)
        number = int(robot.model.parents[number])
    return numbers[-axes.count :]


def _first_links(world: World, later: set[int]) -> World:
    """The world without the bodies that one of the ``later`` joints moves."""
    robot = world.robot
    scene = world.scene
    early_geometry: Any = pin.GeometryModel()
    for item in robot.collision.geometryObjects:
        if not _moves(robot, item.parentJoint, later):
            early_geometry.addGeometryObject(item)

    early_attached = tuple(item for item in scene.attached if not _moves(robot, _joint(robot, item.link), later))
    names = {*(each.name for each in scene.obstacles), *(each.name for each in early_attached), *robot.link_names}
    allowed = tuple(pair for pair in scene.allowed_collisions if set(pair) <= names)
    early_scene = Scene(scene.obstacles, attached=early_attached, allowed_collisions=allowed)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DescriptionWarning)  # said where the whole world was made
        return world.unheld.with_settings(robot=replace(robot, collision=early_geometry), scene=early_scene)


def _moves(robot: Robot, joint: int, later: set[int]) -> bool:
    """Whether a joint is one of the ``later`` ones, by Pinocchio's numbers, or hangs on one of them."""
    while joint > 0:
        if joint in later:
            return True
        joint = int(robot.model.parents[joint])
    return False


def _joint(robot: Robot, link: str) -> int:
    return int(robot.model.frames[robot.model.getFrameId(link, pin.FrameType.BODY)].parentJoint)
