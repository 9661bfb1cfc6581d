"""Goals of the tip as rows of numbers, for methods that walk to many of them at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix
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
from rrtik_ompl.model.goal import GoalSet, PoseGoal, Target, TipGoal

POSE = PoseGoal(np.eye(4))  # for its tolerances
UPRIGHT = np.eye(3).ravel()  # where the orientation does not count


def goal_rows(goal: TipGoal) -> Matrix:
    """A goal as rows that `rrtik_ompl.kernels.ik.ik_layout` describes, one for each member of a region, shape (k, 18).

    Tolerances are a hundredth of the goal's: a solution on their rim would not survive rounding.

    Raises:
        InputError: If the goal is a task-space region or has one, whose freedom no row can hold.
    """
    if not isinstance(goal, GoalSet):
        return _row(goal)[None]
    rows = np.array([_row(member) for member in goal.members])
    # points and single turns have neither a box nor an axis to choose
    posed = rows[:, FREE_TURN] == NO_TURN
    rows[posed, BOX : BOX + 3] = 0.5 * goal.box
    if goal.free_rotation_axis is not None:
        rows[posed, FREE_TURN] = "xyz".index(goal.free_rotation_axis)
    return rows


def pose_rows(poses: NDArray[np.float64]) -> Matrix:
    """Poses with the tolerances of a `PoseGoal`, shape (k, 4, 4), as rows, shape (k, 18); see `goal_rows`."""
    rows = np.tile(_row(POSE), (len(poses), 1))
    rows[:, :9] = poses[:, :3, :3].reshape(-1, 9)
    rows[:, 9:12] = poses[:, :3, 3]
    return rows


def _row(goal: TipGoal) -> NDArray[np.float64]:
    if not isinstance(goal, Target):
        raise InputError("goal: no row holds a task-space region; use projection, or targets drawn from it")
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
