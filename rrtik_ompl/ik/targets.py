"""A goal of the tip as methods take it: targets without freedom drawn from it, or rows of numbers for kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import TAU, Matrix
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.residual import SHARE
from rrtik_ompl.kernels.ik.ik_layout import (
    AIM_FLOATS,
    ANY_TURN,
    BOX,
    CHORD_TOLERANCE,
    FREE_TURN,
    NO_TURN,
    POSITION_TOLERANCE,
)
from rrtik_ompl.model.goal import GoalPart, GoalSet, PoseGoal, PositionGoal, Target, TipGoal
from rrtik_ompl.model.goal_kind import TaskRegion, displacements

POSE = PoseGoal(np.eye(4))  # for its tolerances
UPRIGHT = np.eye(3).ravel()  # a rotation for rows whose orientation does not count


def targets(goal: TipGoal, max_count: int, rng: np.random.Generator) -> list[Target]:
    """Return targets without freedom: the parts of a goal, or displacements drawn from them where they are regions.

    Args:
        goal: The goal.
        max_count: Largest number of targets; of more parts a random choice is taken. A goal that leaves freedom gets
            exactly so many.
        rng: Source of random numbers.
    """
    exact = [part for part in goal.parts if isinstance(part, Target)]
    if len(exact) == len(goal.parts) <= max_count:
        return exact  # so nothing is drawn
    parts, coordinates = _drawn(goal, max_count, rng)
    places = iter(displacements(coordinates))
    return [part if isinstance(part, Target) else _target(part.region(), next(places)) for part in parts]


def skip_targets(goal: TipGoal, max_count: int, rng: np.random.Generator) -> None:
    """Draw the random numbers of :func:`targets` without making targets, so that later numbers stay the same."""
    _drawn(goal, max_count, rng)


def leaves_freedom(part: GoalPart) -> bool:
    """Check whether different targets can be drawn from a part of a goal."""
    return part.freedom is not None and bool(part.freedom.free.any())


def _drawn(goal: TipGoal, max_count: int, rng: np.random.Generator) -> tuple[list[GoalPart], Matrix]:
    """Return the part of the goal for each target, and random coordinates for each of them that is a region.

    Returns:
        Parts, and the coordinates x, y, z, roll, pitch, yaw in their regions, shape (regions, 6) [m, rad].
    """
    parts = goal.parts
    if len(parts) > max_count:
        parts = tuple(parts[k] for k in rng.permutation(len(parts))[:max_count])
    goal_leaves_freedom = any(leaves_freedom(part) for part in parts)
    count = max_count if goal_leaves_freedom else len(parts)
    drawn = [parts[k % len(parts)] for k in range(count)]
    bounds = np.array([part.freedom.bounds for part in drawn if part.freedom is not None]).reshape(-1, 6, 2)
    return drawn, rng.uniform(bounds[..., 0], bounds[..., 1])


def _target(part: TaskRegion, displacement: Matrix) -> Target:
    """Return the target without freedom at a displacement, shape (4, 4), in a region."""
    pose = part.T_world_w.homogeneous @ displacement @ part.T_w_tip.homogeneous
    any_turn = (part.bounds[3:, 1] - part.bounds[3:, 0] >= TAU).all()
    if any_turn and not part.T_w_tip.translation.any():
        return PositionGoal(pose[:3, 3], part.position_tolerance)
    return PoseGoal(pose, part.position_tolerance, part.orientation_tolerance)


def goal_rows(goal: TipGoal) -> Matrix:
    """Return a goal as rows of numbers for kernels, one for each member of a region, shape (k, 18).

    `rrtik_ompl.kernels.ik.ik_layout` describes a row. Tolerances are a hundredth of the goal's, since a solution right
    at the tolerance would fail a later check by rounding.

    Raises:
        InputError: If the goal is a task-space region or has one, whose freedom no row can hold.
    """
    if not isinstance(goal, GoalSet):
        return _row(goal)[None]
    rows = np.array([_row(member) for member in goal.members])
    # Only members with a full orientation have a box and an axis of free rotation.
    posed = rows[:, FREE_TURN] == NO_TURN
    rows[posed, BOX : BOX + 3] = 0.5 * goal.box
    if goal.free_rotation_axis is not None:
        rows[posed, FREE_TURN] = "xyz".index(goal.free_rotation_axis)
    return rows


def pose_rows(poses: NDArray[np.float64]) -> Matrix:
    """Return poses, shape (k, 4, 4), with the tolerances of a `PoseGoal` as rows, shape (k, 18); see `goal_rows`."""
    rows = np.tile(_row(POSE), (len(poses), 1))
    rows[:, :9] = poses[:, :3, :3].reshape(-1, 9)
    rows[:, 9:12] = poses[:, :3, 3]
    return rows


def _row(goal: TipGoal) -> NDArray[np.float64]:
    if not isinstance(goal, Target):
        raise InputError("goal: no row holds a task-space region; use projection, or targets drawn from it")
    # A row holds the rotation, the position, the tolerances and the kind of free rotation.
    near, turned = goal.tolerances
    row = np.zeros(AIM_FLOATS)
    row[9:12] = goal.point
    row[POSITION_TOLERANCE] = SHARE * near
    if goal.oriented:
        row[:9] = goal.pose.rotation.ravel()
        row[CHORD_TOLERANCE] = SHARE * turned
        row[FREE_TURN] = NO_TURN
    else:
        row[:9] = UPRIGHT
        row[CHORD_TOLERANCE] = 1.0
        row[FREE_TURN] = ANY_TURN
    return row
