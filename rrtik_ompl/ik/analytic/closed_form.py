"""Closed-form inverse kinematics: the branches of a robot, placed in the world, turned into the limits and checked."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, finite_array
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.base.poses import LAST_ROW, LAST_ROW_TOLERANCE, NOT_RIGID, left_handed
from rrtik_ompl.ik.analytic.analytic_solver import AnalyticSolver
from rrtik_ompl.ik.analytic.branches import kernel_branches, reference_branches, tip_fault
from rrtik_ompl.ik.analytic.parallel_arm import parallel_form
from rrtik_ompl.ik.analytic.planar import planar_form
from rrtik_ompl.model.robot import Robot

SAME_ANGLE = 1e-6  # [rad] or [m]: rows that differ by less count as equal
SWEEP = 72  # number of samples along a singular pose's curve of solutions


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """All solutions for m targets, b branches each; ``form_of(robot).branches`` has the labels of the branches.

    Attributes:
        branches: Joint values, shape (m, b, dof), moved by full turns into the joint limits where possible. A branch
            that is not real holds its configuration that comes nearest to the target.
        real: Whether each branch reaches the target, shape (m, b).
        valid: Whether it does so inside the joint limits, shape (m, b).
        singular: Bit k is set where the target belongs to family k of ``form_of(robot).families`` and so has a whole
            curve of solutions, of which ``branches`` holds representatives; shape (m,).
        residuals: Distance [m] and angle [rad] from the target by forward kinematics, shape (m, b, 2); the angle is 0
            for a position. None if no check was asked for.
    """

    branches: NDArray[np.float64]
    real: NDArray[np.bool_]
    valid: NDArray[np.bool_]
    singular: NDArray[np.uint8]
    residuals: NDArray[np.float64] | None


def form_of(robot: Robot) -> AnalyticSolver:
    """Return the closed form that the robot brings, or one that fits its description.

    Raises:
        InputError: If there is none; the message names a method that fits.
    """
    form = _form_of(robot)
    if form is None:
        raise InputError(
            f"robot '{robot.name}' brings no closed-form inverse kinematics, is no planar arm of two or three joints, "
            "and has not six joints of which 2, 3, 4 are parallel and 5, 6 meet; the method that fits every robot is "
            "'numeric'"
        )
    return form


def has_closed_form(robot: Robot) -> bool:
    """Check whether `form_of` finds a closed form."""
    return _form_of(robot) is not None


@kept_with
def _form_of(robot: Robot) -> AnalyticSolver | None:
    if isinstance(robot.closed_form, AnalyticSolver):
        return robot.closed_form
    return planar_form(robot) or parallel_form(robot)


def solutions(
    robot: Robot, targets: ArrayLike, *, near: ArrayLike | None = None, slack: float = 0.0, check: bool = True
) -> ClosedForm:
    """Return all branches for many targets.

    Args:
        robot: An arm with a closed form.
        targets: T_world_tip, shape (m, 4, 4); or points [m], shape (m, 3), if the robot's form is one for positions.
        near: One configuration, shape (dof,), or one for each target, shape (m, dof): singular targets get the members
            of their curve nearest to it, and full turns are chosen to lie near it. Zeros if None.
        slack: A target that is this near to a singular one [m, sine of an angle] is solved as if it were singular, with
            residuals up to about that; for targets that are not known more accurately.
        check: Whether forward kinematics checks every solution (``residuals``), which takes most of the time.

    Raises:
        InputError: If the robot has no closed form, or a target is no pose or not finite.
    """
    poses = _poses(robot, form_of(robot), targets)
    return branches_of(robot, poses, None if near is None else _hints(robot, near, len(poses)), slack, check)


def branches_of(
    robot: Robot, poses: NDArray[np.float64], hints: Matrix | None = None, slack: float = 0.0, check: bool = True
) -> ClosedForm:
    """Return all branches as `solutions` does, for arguments that have been checked.

    Args:
        robot: An arm with a closed form.
        poses: T_world_tip, shape (m, 4, 4).
        hints: For each pose the configuration to be near to, shape (m, dof), or None.
        slack: See `solutions`.
        check: See `solutions`.
    """
    form = form_of(robot)
    fault = tip_fault(robot, form)
    if fault:
        raise InputError(f"robot '{robot.name}': {fault}; method 'numeric' fits every tip")

    answers = kernel_branches(robot, form, poses, hints, slack, check)
    if answers is None:
        answers = reference_branches(robot, form, poses, hints, slack, check)

    for array in answers:
        array.setflags(write=False)
    q, real, valid, singular, residuals = answers
    return ClosedForm(q.T, real.T, valid.T, singular, residuals.T if check else None)


def family(robot: Robot, target: ArrayLike, *, samples: int = SWEEP, slack: float = 0.0) -> Matrix:
    """Return the solutions of one target inside the joint limits; for a singular target samples of its curve.

    Args:
        robot: An arm with a closed form.
        target: T_world_tip, shape (4, 4), or a point, shape (3,).
        samples: Number of values of the free angle over a full turn.
        slack: See `solutions`.

    Returns:
        Configurations, shape (k, dof), branch by branch in the order of the free angle.
    """
    form = form_of(robot)
    near = np.zeros((samples, robot.dof))
    near[:, list(form.free)] = np.linspace(-np.pi, np.pi, samples, endpoint=False)[:, None]

    goal = np.asarray(target, dtype=np.float64)
    found = solutions(robot, goal[None], slack=slack, check=False)
    if found.singular[0]:
        many = np.broadcast_to(goal, (samples, *goal.shape))
        found = solutions(robot, many, near=near, slack=slack, check=False)

    rows: Matrix = found.branches.transpose(1, 0, 2)[found.valid.T]
    new = np.abs(np.diff(rows, axis=0, prepend=np.full((1, robot.dof), np.inf))).max(axis=1) > SAME_ANGLE
    different: Matrix = rows[new]
    return different


def _poses(robot: Robot, form: AnalyticSolver, targets: ArrayLike) -> NDArray[np.float64]:
    if form.kind == "position" and np.ndim(targets) == 2:
        points = finite_array(targets, (None, 3), "targets")
        poses = np.tile(np.eye(4), (len(points), 1, 1))
        poses[:, :3, 3] = points
        return poses
    poses = finite_array(targets, (None, 4, 4), "targets")
    if form.kind == "pose":
        check_poses(poses, "targets")
    return poses


def check_poses(poses: NDArray[np.float64], what: str) -> None:
    """Refuse matrices, shape (m, 4, 4), that are no poses.

    Args:
        poses: The matrices.
        what: Name of the argument, which begins the message.

    Raises:
        InputError: If one is no pose; the message says which one, and how far it is from orthonormal.
    """
    if len(poses) == 0:
        return

    # Products of whole columns are faster than products of many small matrices.
    columns = np.ascontiguousarray(poses[:, :3, :3].transpose(2, 1, 0))
    errors = np.zeros(len(poses))
    with np.errstate(over="ignore", invalid="ignore"):
        for j, k in combinations_with_replacement(range(3), 2):
            np.maximum(errors, np.abs((columns[j] * columns[k]).sum(axis=0) - (j == k)), out=errors)

    worst = int(np.argmax(errors))
    if not errors[worst] <= NOT_RIGID:
        raise InputError(
            f"{what}: entry {worst} is no rotation: its columns are {errors[worst]:.3g} away from orthonormal "
            f"(at most {NOT_RIGID:g}); make it orthonormal"
        )

    mirrored = np.flatnonzero(left_handed(*columns))
    if len(mirrored):
        raise InputError(f"{what}: entry {mirrored[0]} mirrors (determinant -1); a rotation is right-handed")

    odd = np.flatnonzero((np.abs(poses[:, 3] - LAST_ROW) > LAST_ROW_TOLERANCE).any(axis=1))
    if len(odd):
        raise InputError(f"{what}: the last row of entry {odd[0]} must be 0 0 0 1, got {poses[odd[0], 3].tolist()}")


def _hints(robot: Robot, near: ArrayLike, count: int) -> Matrix:
    """Return one configuration for every target, shape (count, dof)."""
    if np.ndim(near) < 2:
        return np.broadcast_to(robot.configuration(near, "near"), (count, robot.dof))
    return finite_array(near, (count, robot.dof), "near")
