"""Inverse kinematics of a whole trajectory by one call: configurations that follow a sequence of poses or points."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, dimensions, finite_array, frozen, not_negative, positive
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import FrameAxis, GeneticPreset, IkMethod, TrajectoryIkMethod, one_of
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.analytic.branch_choice import JUMP, follow
from rrtik_ompl.ik.analytic.closed_form import check_poses, form_of
from rrtik_ompl.ik.genetic.options import PRESETS, GeneticOptions
from rrtik_ompl.ik.genetic.search import follow_targets
from rrtik_ompl.ik.method_interface import RandomStream, unwind
from rrtik_ompl.ik.methods import METHODS, load_kernels
from rrtik_ompl.ik.numeric.track import Tracker
from rrtik_ompl.ik.solve import free_of_collision, solve_ik
from rrtik_ompl.model.goal import GoalSet, PoseGoal, PositionGoal, Target, TipGoal, joint_difference
from rrtik_ompl.model.result import required
from rrtik_ompl.model.robot import Robot, inside_limits
from rrtik_ompl.world.world import World, check_world

SECONDS = 60.0
SECONDS_A_POINT = 5.0  # longest time to find out why one point has no configuration [s]


@dataclass(frozen=True, slots=True, eq=False)
class IkTrajectory:
    """Configurations along a trajectory of k points.

    Attributes:
        q: Configurations, shape (k, dof), inside the limits, and free if a world was given; rows of NaN for points
            without a configuration.
        residuals: Distance [m] and angle [rad] of each from its target by forward kinematics, shape (k, 2), or NaN.
        reasons: For each point why it has no configuration, ``unreachable``, ``limits``, ``collision`` or ``time``; ""
            if it has one.
        detail: The first of these reasons in a line; "" if there is none.
        jumps: Indices of points at which a joint moves farther than a jump, or that follow a point without a
            configuration.
        blocked: Indices of points to which the straight motion from the previous point collides; empty if no world was
            given.
        method: The method that answered.
        iterations: Generations of a genetic algorithm, steps of a numeric method, or 0 for a closed form.
        seconds: Time taken [s].

    Example:
        >>> robot = rrtik.load_robot("planar3")
        >>> poses = robot.fk_batch(np.linspace([0.0, 0.3, 0.3], [0.3, 0.6, 0.3], 5))
        >>> tracked = rrtik.ik.solve_trajectory(robot, poses, near=[0.0, 0.3, 0.3])
        >>> tracked.found, tracked.q.shape, len(tracked.jumps)
        (True, (5, 3), 0)
    """

    q: Matrix
    residuals: Matrix
    reasons: tuple[str, ...]
    detail: str
    jumps: tuple[int, ...]
    blocked: tuple[int, ...]
    method: TrajectoryIkMethod
    iterations: int
    seconds: float

    __reduce__ = as_value
    __repr__ = in_one_line

    @property
    def found(self) -> bool:
        """Whether every point has a configuration."""
        return not any(self.reasons)

    @property
    def reason(self) -> str:
        """Why the first point without a configuration has none; "" if all have one."""
        return next(filter(None, self.reasons), "")

    @property
    def statistics(self) -> Mapping[str, Any]:
        """The method, its iterations, and the numbers of points without a configuration, of jumps and blocked ones."""
        return {
            "method": self.method,
            "iterations": self.iterations,
            "missing": sum(map(bool, self.reasons)),
            "jumps": len(self.jumps),
            "blocked": len(self.blocked),
        }

    def require(self) -> Matrix:
        """Return the configurations, shape (k, dof).

        Raises:
            NotFoundError: If a point has none.

        Example:
            >>> robot = rrtik.load_robot("ur5")
            >>> points = np.linspace([0.4, 0.1, 0.4], [0.4, 0.3, 0.4], 5)
            >>> rrtik.ik.solve_trajectory(robot, points).require().shape
            (5, 6)
        """
        return required(self.q if self.found else None, "no configurations for the whole trajectory", self.detail)


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """The checked arguments of `solve_trajectory`, as the methods that follow a trajectory get them."""

    robot: Robot
    poses: Matrix
    targets: tuple[Target, ...]
    goals: tuple[TipGoal, ...]  # the targets, with a free rotation axis if one was given
    near: Vector | None
    world: World | None
    jump: float
    options: GeneticOptions
    rng: np.random.Generator
    budget: Budget

    def accept(self, Q: Matrix) -> Mask:
        """Check which configurations, shape (k, dof), are free of collision; shape (k,)."""
        return free_of_collision(self.world, Q)


def list_ik_trajectory_methods() -> tuple[str, ...]:
    """Return the names that `solve_trajectory` takes as a method, apart from "auto"."""
    return tuple(FOLLOWERS)


def solve_trajectory(
    robot: Robot,
    poses: ArrayLike,
    *,
    method: TrajectoryIkMethod = "auto",
    near: ArrayLike | None = None,
    world: World | None = None,
    position_tolerance: float = 1e-3,
    orientation_tolerance: float = 1e-2,
    free_rotation_axis: FrameAxis | None = None,
    jump: float = JUMP,
    options: GeneticOptions | GeneticPreset = "refined",
    seconds: float = SECONDS,
    seed: int | None = 0,
) -> IkTrajectory:
    """Find a configuration for each pose of a trajectory such that the joints move on without jumps.

    Args:
        robot: The arm.
        poses: T_world_tip, shape (k, 4, 4), or points [m] with any orientation, shape (k, 3).
        method: "closed-form" (the shortest path through the branches), "genetic" (GA-REB), "numeric" (follows several
            solutions side by side), or "auto": the closed form where it fits, else "numeric".
        near: Configuration before the first point, shape (dof,); any if None.
        world: If given, all configurations are free of collision. Its robot must be this one.
        position_tolerance: Largest distance from each point [m].
        orientation_tolerance: Largest angle from each pose [rad].
        free_rotation_axis: Axis of the tip, "x", "y" or "z", about which every pose may be turned, as for a drill or a
            torch; only "numeric" supports it.
        jump: Motion of one joint between two points [rad or m] above which it counts as a jump; the genetic algorithm
            makes none.
        options: Options of the genetic algorithm, or the name of a preset: "standard", "historical", "refined".
        seconds: Time that a method may take [s]; the closed form is not limited.
        seed: Seed of the random numbers; None draws one.

    Raises:
        UnknownNameError: If there is no such method or preset.
        InputError: If the method does not fit the robot, a matrix is no pose, or an argument is out of range.

    Example:
        >>> robot = rrtik.load_robot("planar3")
        >>> poses = robot.fk_batch(np.linspace([0.0, 0.3, 0.3], [0.3, 0.6, 0.3], 5))
        >>> rrtik.ik.solve_trajectory(robot, poses, near=[0.0, 0.3, 0.3]).require().shape
        (5, 3)
    """
    check_world(world, robot)
    load_kernels(robot)
    begin = time.monotonic()
    rows = _checked_poses(poses)
    targets = tuple(_target(row, position_tolerance, orientation_tolerance) for row in rows)

    task = Task(
        robot=robot,
        poses=rows,
        targets=targets,
        goals=_with_free_axis(targets, free_rotation_axis),
        near=None if near is None else robot.configuration(near, "near"),
        world=world,
        jump=positive(jump, "jump"),
        options=_options(options),
        rng=RandomStream(seed).rng,
        budget=Budget(seconds=not_negative(seconds, "seconds"), begun=begin),
    )

    name = _chosen_method(task, method)
    q, iterations = FOLLOWERS[name](task)
    unwind(robot, q, task.near)
    residuals = _keep_only_checked(task, q)
    reasons, detail = _why(task, name, q)

    return IkTrajectory(
        q=frozen(q),
        residuals=frozen(residuals),
        reasons=reasons,
        detail=detail,
        jumps=_jumps(robot, q, task.jump),
        blocked=_blocked(world, q),
        method=name,
        iterations=iterations,
        seconds=task.budget.elapsed,
    )


def _checked_poses(poses: ArrayLike) -> Matrix:
    """Check poses or points and return them as an array, shape (k, 4, 4) or (k, 3)."""
    rows = finite_array(poses, (None, 4, 4) if dimensions(poses) == 3 else (None, 3), "poses")
    if len(rows) == 0:
        raise InputError("poses: a trajectory needs at least one point")
    if rows.ndim == 3:
        check_poses(rows, "poses")
    return rows


def _target(row: Matrix, position_tolerance: float, orientation_tolerance: float) -> Target:
    """Return the goal for one pose, shape (4, 4), or point, shape (3,)."""
    if row.ndim == 1:
        return PositionGoal(row, position_tolerance)
    return PoseGoal(row, position_tolerance, orientation_tolerance)


def _with_free_axis(targets: tuple[Target, ...], axis: FrameAxis | None) -> tuple[TipGoal, ...]:
    """Return the targets, or goals that leave the rotation about an axis of the tip free."""
    if axis is None:
        return targets
    if not targets[0].oriented:
        raise InputError("free_rotation_axis: points leave every turn free; give poses, or leave it out")
    return tuple(GoalSet([target], free_rotation_axis=axis) for target in targets)


def _options(options: GeneticOptions | GeneticPreset) -> GeneticOptions:
    """Return the options themselves, or those of a preset."""
    if isinstance(options, GeneticOptions):
        return options
    return PRESETS[one_of(PRESETS, options, "preset of the genetic algorithm")]


def _chosen_method(task: Task, method: TrajectoryIkMethod) -> TrajectoryIkMethod:
    """Return the name of the method for a trajectory: the first that fits if ``method`` is "auto".

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If it does not fit.
    """
    one_of(get_args(TrajectoryIkMethod), method, "inverse kinematics method for trajectories")
    misfits = {name: METHODS[name].misfit(task.robot, task.targets[0]) for name in FOLLOWERS}
    if not misfits["closed-form"] and form_of(task.robot).kind == "position" and task.poses.ndim == 3:
        misfits["closed-form"] = "its closed form knows positions alone; give points, shape (k, 3)"
    if task.goals is not task.targets:
        misfits |= dict.fromkeys(("closed-form", "genetic"), "it knows no free axis; leave out free_rotation_axis")

    fitting = [name for name, misfit in misfits.items() if not misfit]
    if method != "auto" and misfits[method]:
        raise InputError(
            f"method '{method}' does not fit robot '{task.robot.name}' and this trajectory: {misfits[method]}; "
            f"what fits: {', '.join(fitting)}"
        )

    return fitting[0] if method == "auto" else method


def _closed_form(task: Task) -> tuple[Matrix, int]:
    """Follow the branches of the closed form; where none reaches a point exactly, look for one within the tolerances.

    Returns:
        Configurations, shape (k, dof), NaN where there is none, and 0 iterations.
    """
    q = np.array(follow(task.robot, task.poses, task.near, jump=task.jump, accept=task.accept).q)
    for k in np.flatnonzero(np.isnan(q[:, 0])):
        before = task.near if k == 0 or np.isnan(q[k - 1, 0]) else q[k - 1]
        alone = solve_ik(task.robot, task.targets[k], method="closed-form", near=before, world=task.world)
        if alone.found:
            q[k] = alone.solutions[0]
    return q, 0


def _genetic(task: Task) -> tuple[Matrix, int]:
    """Follow the points by the genetic algorithm.

    Returns:
        Configurations, shape (k, dof), NaN from the point where the run stopped, and the number of generations.
    """
    quick = None if task.world is None else task.world.valid_batch  # The independent check follows at the end.
    options = replace(task.options, largest_step=task.options.largest_step or task.jump)
    run = follow_targets(task.robot, task.targets, options, task.rng, accept=quick, near=task.near, budget=task.budget)
    q = np.full((len(task.targets), task.robot.dof), np.nan)
    q[: len(run.q)] = run.q
    return q, run.generations


def _numeric(task: Task) -> tuple[Matrix, int]:
    return Tracker(task.robot, task.goals, task.accept, task.jump, task.rng, task.budget).follow(task.near)


FOLLOWERS: Mapping[TrajectoryIkMethod, Callable[[Task], tuple[Matrix, int]]] = MappingProxyType(
    {"closed-form": _closed_form, "numeric": _numeric, "genetic": _genetic}
)


def _keep_only_checked(task: Task, q: Matrix) -> Matrix:
    """Check all configurations by forward kinematics, limits and collision, and return their residuals.

    Args:
        task: The trajectory.
        q: Configurations, shape (k, dof), changed in place: rows that fail a check become NaN, the others are clamped
            to the limits.

    Returns:
        Distance [m] and angle [rad] from the targets, shape (k, 2), NaN where q is.
    """
    residuals = np.full((len(q), 2), np.nan)
    for k in np.flatnonzero(~np.isnan(q[:, 0])):
        residuals[k] = np.ravel(task.goals[k].errors(task.robot, q[k : k + 1]))

    usable = (residuals <= task.targets[0].tolerances).all(axis=1) & inside_limits(task.robot, q)
    usable[usable] = task.accept(q[usable])
    q[~usable] = np.nan
    residuals[~usable] = np.nan
    q[:] = task.robot.clamp(q)
    return residuals


def _why(task: Task, name: TrajectoryIkMethod, q: Matrix) -> tuple[tuple[str, ...], str]:
    """Find out why points have no configuration, by solving for each of them alone while time is left.

    The genetic algorithm tries no point after the one where it stopped; for these, and once the time is up, the reason
    is ``time``.

    Returns:
        A reason for each point, "" if it has a configuration, and the first reason in a line.
    """
    reasons = [""] * len(q)
    detail = ""

    for k in np.flatnonzero(np.isnan(q[:, 0])):
        left = task.budget.left
        reasons[k] = "time"
        line = f"method '{name}' came to its limit before it found a way there"
        if left > 0.0 and (name != "genetic" or not detail):
            method: IkMethod = "numeric" if name == "genetic" else name
            alone = solve_ik(
                task.robot, task.goals[k], method=method, world=task.world, seconds=min(left, SECONDS_A_POINT)
            )
            reasons[k] = alone.reason or "time"
            line = alone.detail or line
        detail = detail or f"point {k}: {line}"
    return tuple(reasons), detail


def _jumps(robot: Robot, q: Matrix, jump: float) -> tuple[int, ...]:
    """Return the indices of points after a jump or after a gap; points before the first configuration do not count."""
    is_solved = ~np.isnan(q[1:, 0])
    was_solved = ~np.isnan(q[:-1, 0])
    has_jumped = np.abs(joint_difference(robot, q[1:], q[:-1])).max(axis=1) > jump
    after_gap = is_solved & ~was_solved & np.logical_or.accumulate(was_solved)
    return tuple(int(k) + 1 for k in np.flatnonzero((is_solved & was_solved & has_jumped) | after_gap))


def _blocked(world: World | None, q: Matrix) -> tuple[int, ...]:
    """Return the indices of points to which the straight motion from the previous point collides."""
    solved_pairs = np.flatnonzero(~np.isnan(q[1:, 0]) & ~np.isnan(q[:-1, 0]))
    if world is None or len(solved_pairs) == 0:
        return ()
    free = world.motion_valid_batch(q[solved_pairs], q[solved_pairs + 1])
    return tuple(int(k) + 1 for k in solved_pairs[~free])
