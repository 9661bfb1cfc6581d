"""Inverse kinematics of an array of poses: closed form and numeric method take all at once, others one by one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, finite_array, frozen, not_negative, seed_of, whole_number
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.choices import IkMethod
from rrtik_ompl.base.copies import as_value, in_one_line
from rrtik_ompl.base.errors import NotFoundError, require
from rrtik_ompl.description.joint_weights import weighted_difference
from rrtik_ompl.ik.analytic.branches import tip_residuals
from rrtik_ompl.ik.analytic.closed_form import branches_of, check_poses, form_of, has_closed_form
from rrtik_ompl.ik.method_interface import EXACT, mid_range_configuration
from rrtik_ompl.ik.methods import load_kernels
from rrtik_ompl.ik.numeric.descent import Search
from rrtik_ompl.ik.solve import SECONDS, chosen_method, free_of_collision, solve_ik
from rrtik_ompl.ik.targets import POSE, pose_rows
from rrtik_ompl.kernels.threads import cores, in_threads
from rrtik_ompl.model.goal import PoseGoal, joint_difference
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.world.world import World, check_world

LEAST_SHARE = 256  # least number of poses of a thread: fewer take less time than to start the thread
MOST_SHARE = 8192  # and the most in one piece of work, as kernels take them all at once and Ctrl-C waits for a kernel


@dataclass(frozen=True, slots=True, eq=False)
class IkBatch:
    """The solutions for an array of m poses: an array of results, with one row for each.

    Attributes:
        q: Solutions, shape (m, dof): by a closed form the nearest to the given configuration, by another method the
            first that it found from there; NaN where there is none.
        found: Whether there is a solution, shape (m,).
        residuals: Distance [m] and angle [rad] from the pose by forward kinematics, shape (m, 2); NaN where there is no
            solution.
        reasons: Why there is no solution, see `IkResult`; "" where there is one.
        details: Each reason as a line: by how much, which joint, what touches.
        seconds: Time taken for all [s].

    Example:
        >>> robot = rrtik.load_robot("ur5")
        >>> poses = robot.fk_batch(np.full((3, 6), 0.4) + np.linspace(0.0, 0.2, 3)[:, None])
        >>> rrtik.solve_ik_many(robot, poses).found
        array([ True,  True,  True])
    """

    q: Matrix
    found: Mask
    residuals: Matrix
    reasons: tuple[str, ...]
    details: tuple[str, ...]
    seconds: float

    __reduce__ = as_value
    __repr__ = in_one_line

    def require(self) -> Matrix:
        """Return the solutions of all poses, shape (m, dof).

        Raises:
            NotFoundError: If a pose has none.

        Example:
            >>> robot = rrtik.load_robot("ur5")
            >>> rrtik.solve_ik_many(robot, robot.fk_batch(np.full((3, 6), 0.4))).require().shape
            (3, 6)
        """
        missing = np.flatnonzero(~self.found)
        if not len(missing):
            return self.q
        first = missing[0]
        what = f"{len(missing)} of {len(self.q)} poses have no configuration"
        raise NotFoundError(f"{what}; pose {first}: {self.reasons[first]}: {self.details[first]}")


def solve_ik_many(
    robot: Robot,
    poses: ArrayLike,
    *,
    method: IkMethod = "auto",
    near: ArrayLike | None = None,
    world: World | None = None,
    seconds: float = SECONDS,
    seed: int | None = 0,
    threads: int | None = None,
) -> IkBatch:
    """Find for each pose a solution inside the limits and, if a world is given, free of collision.

    Args:
        robot: The arm.
        poses: T_world_tip, shape (m, 4, 4).
        method: As for `solve_ik`; "closed-form" and "numeric" take all poses at once.
        near: Configuration near which solutions are wanted, shape (dof,); the middle of the limits if None.
        world: If given, solutions in collision are left out. Its robot must be this one.
        seconds: Wall time for each pose that has no closed-form solution [s].
        seed: Seed of the random numbers; None draws one.
        threads: Number of threads that share the poses; the number of cores if None. Solutions do not depend on it.

    Raises:
        UnknownNameError: If there is no such method.
        InputError: If a matrix is no pose, the method does not fit the robot, or an argument is out of range.

    Example:
        >>> robot = rrtik.load_robot("panda")
        >>> rows = robot.posture("default") + np.linspace(0.0, 0.3, 50)[:, None]
        >>> rrtik.solve_ik_many(robot, robot.fk_batch(rows)).q.shape
        (50, 7)
    """
    budget = Budget()
    check_world(world, robot)
    require(method, str, "method of inverse kinematics", "see list_methods()")
    load_kernels(robot)
    targets = finite_array(poses, (None, 4, 4), "poses")
    posture = mid_range_configuration(robot) if near is None else robot.configuration(near, "near")
    limit = not_negative(seconds, "seconds")
    first_seed = seed_of(seed)
    count = cores() if threads is None else whole_number(threads, "threads", 1)
    check_poses(targets, "poses")

    share = min(max(LEAST_SHARE, -(-len(targets) // count)), MOST_SHARE)
    how = partial(_solved, robot, targets, method, posture, world, limit, first_seed)
    parts = in_threads(how, [slice(k, k + share) for k in range(0, max(len(targets), 1), share)], count)

    q, residuals = (np.concatenate([each[k] for each in parts]) for k in (0, 1))
    reasons, details = (tuple(line for each in parts for line in each[k]) for k in (2, 3))
    found = frozen(~np.isnan(q[:, 0]), bool)
    return IkBatch(frozen(q), found, frozen(residuals), reasons, details, budget.elapsed)


def free_configurations(robot: Robot, poses: NDArray[np.float64], near: Vector, world: World, rounds: int) -> Matrix:
    """Return a configuration for each of many poses, in a few rounds that take all of them at once.

    Args:
        robot: The arm.
        poses: T_world_tip, shape (m, 4, 4).
        near: Configuration near which they are wanted, shape (dof,).
        world: The world in which they are free.
        rounds: How many configurations are tried for each pose, where there is no closed form.

    Returns:
        Configurations inside the limits, shape (m, dof); NaN where there is none among those that were tried.
    """
    load_kernels(robot)
    q = np.full((len(poses), robot.dof), np.nan)
    residuals = np.full((len(poses), 2), np.nan)
    if has_closed_form(robot) and form_of(robot).kind == "pose":
        _by_closed_form(robot, poses, near, world, q, residuals)
    else:
        _by_search(robot, poses, near, world, Budget(), q, residuals, rounds)
    return q


def _solved(
    robot: Robot,
    poses: NDArray[np.float64],
    asked: IkMethod,
    near: Vector,
    world: World | None,
    seconds: float,
    seed: int,
    part: slice,
) -> tuple[Matrix, Matrix, list[str], list[str]]:
    """Solve for a part of the poses, in one thread.

    Args:
        robot: The arm.
        poses: All poses, shape (m, 4, 4).
        asked: The method that was asked for.
        near: Configuration near which solutions are wanted, shape (dof,).
        world: The world that checks for collision, or None.
        seconds: Wall time for each pose [s].
        seed: Seed for the first of all poses.
        part: The poses to solve for.

    Returns:
        q, residuals, reasons and details as in :class:`IkBatch`, for the poses of the part.
    """
    method = asked
    targets = poses[part]
    budget = Budget(seconds=seconds * len(targets))
    q = np.full((len(targets), robot.dof), np.nan)
    residuals = np.full((len(targets), 2), np.nan)
    reasons = [""] * len(targets)
    details = [""] * len(targets)

    if len(targets):
        method = chosen_method(robot, (PoseGoal(targets[0]),), asked)
    if method == "closed-form" and form_of(robot).kind == "pose":
        _by_closed_form(robot, targets, near, world, q, residuals)
        q[residuals.max(axis=1) > EXACT] = np.nan  # alone they are led nearer
    elif method == "numeric":
        _by_search(robot, targets, near, world, budget, q, residuals)

    # Remaining poses are solved one by one. Each has a seed by its index, so answers do not depend on the threads.
    for k in np.flatnonzero(np.isnan(q[:, 0])).tolist():
        goal = PoseGoal(targets[k])
        own_seed = seed + part.start + k
        result = solve_ik(robot, goal, method=asked, near=near, world=world, seconds=seconds, seed=own_seed)
        reasons[k] = result.reason
        details[k] = result.detail
        if result.found:
            q[k] = result.solutions[0]
            residuals[k] = result.residuals[0]

    return q, residuals, reasons, details


def _by_closed_form(
    robot: Robot, targets: NDArray[np.float64], near: Vector, world: World | None, q: Matrix, residuals: Matrix
) -> None:
    """Write the nearest valid branch of each target into q, shape (m, dof), and residuals, shape (m, 2), in place.

    Rows of targets without a valid branch stay as they are.
    """
    found = branches_of(robot, targets, np.broadcast_to(near, (len(targets), robot.dof)))
    valid = np.array(found.valid)
    valid[valid] = free_of_collision(world, found.branches[valid])

    distance = np.linalg.norm(weighted_difference(robot, found.branches, near), axis=2)
    best = np.argmin(np.where(valid, distance, np.inf), axis=1)

    done = np.flatnonzero(valid.any(axis=1))
    nearest = found.branches[done, best[done]]
    q[done] = robot.clamp(nearest)
    residuals[done] = np.asarray(found.residuals)[done, best[done]]
    moved = done[(q[done] != nearest).any(axis=1)]
    residuals[moved] = tip_residuals(robot, q[moved].T[:, None], targets[moved])[:, 0].T


def _by_search(
    robot: Robot,
    targets: NDArray[np.float64],
    near: Vector,
    world: World | None,
    budget: Budget,
    q: Matrix,
    residuals: Matrix,
    rounds: float = np.inf,
) -> None:
    """Write numeric solutions into q, shape (m, dof), and residuals, shape (m, 2), in place.

    Targets whose solution is in collision are tried again, until a solution is free, or the starts, the time or the
    rounds run out.
    """
    search = Search(robot, pose_rows(targets), near)
    going = np.arange(len(targets))

    while len(going) and rounds > 0 and not budget.over():
        rounds -= 1
        going = going[search.advance(going)]
        free = free_of_collision(world, search.q[going])
        done = going[free]
        going = going[~free]
        found = search.q[done]
        q[done] = np.where(robot.continuous, near + joint_difference(robot, found, near), found)

    residuals[:] = _checked(robot, targets, q)


def _checked(robot: Robot, targets: NDArray[np.float64], q: Matrix) -> Matrix:
    """Return residuals by forward kinematics, shape (m, 2) [m, rad]; NaN where q is not at its target.

    Such rows of q, shape (m, dof), become NaN in place.
    """
    residuals = tip_residuals(robot, q.T[:, None], targets)[:, 0].T
    residuals[~(residuals <= POSE.tolerances).all(axis=1)] = np.nan
    q[np.isnan(residuals[:, 0])] = np.nan
    return residuals
