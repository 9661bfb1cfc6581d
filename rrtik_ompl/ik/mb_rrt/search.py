"""Configurations of a real arm at a position or a pose: branches of the workspace tree, polished where need be.

For an arm whose axes are all parallel, the branches of the tree end exactly on the goal. For other arms the distances
that the tree considers are not the whole constraint, so the newest branches only come near the goal. They are free as
far as their links were checked, and are polished by Levenberg-Marquardt.
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

WIDTH = 16  # number of passes that are done at once
MAX_ROUNDS = 64  # number of rounds after which the search gives up
FIRST_STEPS = 12  # steps of a first polish, after which most branches that reach the goal at all are there
POLISHED = 0.1  # share of the tolerances within which a branch counts as polished after these steps
POSTURE_ONLY_ROUNDS = 2  # first rounds, which check only whole configurations; faster where free ones are common
ROUNDS_FOR_ALL = 8  # number of rounds if every solution is requested
DRAWS = 16  # number of targets drawn from a planner's goal that leaves freedom
MAX_CONFIGURATIONS = 16  # largest number of configurations that a planner gets


def mb_rrt(request: IkRequest) -> IkResponse:
    """Solve a request by a tree in the workspace for one target after the other, until a solution is accepted."""
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


def tree_aims(
    world: World,
    goal: TipGoal,
    near: Vector,
    rng: np.random.Generator,
    *,
    seconds: float,
    on_links: Callable[[list[Matrix]], object] | None = None,
) -> Matrix:
    """Return free configurations at a goal, nearest to a given configuration first.

    Args:
        world: The robot, which `rrtik_ompl.ik.mb_rrt.axes.misfit` accepts, and its scene.
        goal: A goal of the tip.
        near: The given configuration, shape (dof,).
        rng: Source of random numbers.
        seconds: Time limit [s].
        on_links: Called with the links of each tree, see :func:`placed_links`.

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
        if on_links is not None and found.tree is not None:
            on_links(placed_links(robot, axes_of(robot, target.oriented), found.tree))
        if found.timed_out or len(rows) >= MAX_CONFIGURATIONS:
            break

    differences = joint_difference(robot, rows, near)
    order = np.argsort(np.linalg.norm(differences, axis=1), kind="stable")[:MAX_CONFIGURATIONS]
    nearest: Matrix = np.where(robot.continuous, near + differences[order], rows[order])
    return nearest


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Result of a search.

    Attributes:
        q: Configurations at the goal inside the limits, shape (k, dof).
        passes: Number of passes done.
        timed_out: Whether the time was up.
        tree: What was grown; None if the goal is out of reach.
    """

    q: Matrix
    passes: int
    timed_out: bool = False
    tree: WorkspaceTree | None = None


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
    """Grow the tree until a configuration at the goal is accepted.

    Args:
        robot: An arm that `rrtik_ompl.ik.mb_rrt.axes.misfit` accepts.
        target: The goal.
        near: Configuration that gives the values of joints that the tree does not move, shape (dof,).
        accept: Checks which configurations at the goal, shape (k, dof), are acceptable; returns shape (k,).
        rng: Source of random numbers.
        budget: Time limit, read between rounds.
        world: If given, and if the first `POSTURE_ONLY_ROUNDS` rounds find no accepted configuration, the links of all
            further edges are checked for collision too.
        collect_all: Whether to go on for all ``rounds`` and collect every solution.
        width: Number of passes in one round.
        rounds: Largest number of rounds.
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
            return Found(solutions, tree.passes, True, tree)

    return Found(solutions, tree.passes, tree=tree)


def placed_links(robot: Robot, axes: Axes, tree: WorkspaceTree) -> list[Matrix]:
    """Return the links that a tree has placed, in order: for each joint from its origin to the next one, or the tip.

    Args:
        robot: The arm.
        axes: Its joints.
        tree: The tree.

    Returns:
        For each joint shape (k, 2, 3) [m].
    """
    joints = _joint_order(robot, axes)
    links = []
    for level, joint in enumerate(joints):
        rows = tree.nodes(level + 1)
        frames = robot.chain.joint_frames(rows)[:, :, :3, 3]
        last = level + 1 == len(joints)
        ends = robot.fk_batch(rows)[:, :3, 3] if last else frames[:, joints[level + 1]]
        links.append(np.stack([frames[:, joint], ends], axis=1))
    return links


def out_of_reach(robot: Robot, target: Target) -> bool:
    """Check whether a target is certainly out of reach by the arm's lengths; False for an arm with a `misfit`."""
    if misfit(robot):
        return False
    axes = axes_of(robot, target.oriented)
    return axes.shortfall(aimed_point(axes, target)) > target.tolerances[0]


def aimed_point(axes: Axes, target: Target) -> Vector:
    """Return the point in the world that the tree aims at [m], shape (3,)."""
    if not target.oriented:
        return target.point
    point: Vector = target.pose.rotation @ axes.aim + target.point
    return point


def polished(robot: Robot, axes: Axes, target: Target, ends: Matrix, *, wait_for_all: bool = True) -> Matrix:
    """Polish the ends of the tree's branches and return those that are at the goal then, shape (k, dof).

    Args:
        robot: The arm.
        axes: The axes of the arm for this kind of target.
        target: The goal.
        ends: Configurations at the ends of branches, shape (m, dof).
        wait_for_all: Whether to polish until the slowest has arrived; if not, those that arrive after `FIRST_STEPS`
            are enough.
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
    """Turn the last joint of configurations, shape (m, dof), as near to the target's orientation as possible.

    The joint's axis goes through the aimed point, which therefore stays where it is.
    """
    joint = int(axes.joints[-1])
    angles = np.array(ends)
    angles[:, joint] = -axes.offset[-1]
    frames = poses(robot, angles)[:, :3, :3] @ axes.fixed[-1][:3, :3].T
    wanted = target.pose.rotation @ axes.fixed[-1][:3, :3].T

    # The rotation about z that is nearest to the remaining rotation.
    off = np.swapaxes(frames, 1, 2) @ wanted
    turn = np.arctan2(off[:, 1, 0] - off[:, 0, 1], off[:, 0, 0] + off[:, 1, 1])
    turn += TAU * np.ceil((axes.lower[-1] - turn) / TAU - 1e-9)  # Move it to the lowest full turn inside the limits.
    angles[:, joint] = np.clip(turn, axes.lower[-1], axes.upper[-1]) - axes.offset[-1]
    return angles


class LinkWorlds:
    """Checks for collision only the links up to a given joint, with the objects that they hold.

    Args:
        world: The whole arm and its scene.
        axes: The joints of the arm, base first.
    """

    def __init__(self, world: World, axes: Axes) -> None:
        self._world = world
        order = _joint_order(world.robot, axes)
        self._worlds = [_first_links(world, set(order[level + 1 :])) for level in range(len(order) - 1)] + [world]

    def free(self, level: int, q: Matrix) -> Mask:
        """Check which configurations, shape (m, dof), are free up to the link of a level; shape (m,)."""
        return self._worlds[level].valid_batch(self._world.robot.clamp(q))


def _joint_order(robot: Robot, axes: Axes) -> list[int]:
    """Return Pinocchio's numbers of the joints that move the tip, base first."""
    number = int(robot.model.frames[robot.model.getFrameId(robot.tip)].parentJoint)
    numbers: list[int] = []
    while number > 0:
        numbers.insert(0, number)
        number = int(robot.model.parents[number])
    return numbers[-axes.count :]


def _first_links(world: World, later: set[int]) -> World:
    """Return the world without the bodies that any of the ``later`` joints (Pinocchio's numbers) moves."""
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
        warnings.simplefilter("ignore", DescriptionWarning)  # The whole world has warned already.
        early_robot = replace(robot, collision=early_geometry)
        return World.of(replace(world.unheld.settings, robot=early_robot, scene=early_scene))


def _moves(robot: Robot, joint: int, later: set[int]) -> bool:
    """Check whether a joint is one of the ``later`` ones or a descendant of one, by Pinocchio's numbers."""
    while joint > 0:
        if joint in later:
            return True
        joint = int(robot.model.parents[joint])
    return False


def _joint(robot: Robot, link: str) -> int:
    return int(robot.model.frames[robot.model.getFrameId(link, pin.FrameType.BODY)].parentJoint)
