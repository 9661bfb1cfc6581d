"""What the planners that move one joint at a time have in common: their options, and what these mean for the trees."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.planning.moves.rules import MoveRules, long_enough


class OneJointOptions(MoveRules):
    """The options, checked: what moves have to keep to, and how the trees grow.

    Args:
        names: The joints' names, empty if they are not known.
        dof: Number of joints.
        scale_by_range: This option and the others are those of
            :class:`~rrtik_planners.one_joint_planner.OneJointPlanner`.
        max_iterations: As there.
        rules: As there, and as of MoveRules.

    Raises:
        InputError: If an option is out of range.
        UnknownNameError: If there is no joint of a name.
    """

    def __init__(
        self, names: Sequence[str], dof: int, *, scale_by_range: bool, max_iterations: int | None, **rules: Any
    ) -> None:
        super().__init__(names, dof=dof, **rules)
        self.scale_by_range = scale_by_range
        self.max_iterations = iteration_limit(max_iterations)
        self._names = names or [str(k) for k in range(dof)]

    def agreeing(self, starts: Matrix, goals: Matrix) -> tuple[Matrix, Matrix]:
        """The first start that a goal agrees with in the frozen joints, and all starts and goals that do so too.

        Raises:
            InputError: If there is none.
        """
        frozen = self.frozen_joints
        if not frozen:
            return starts, goals

        for start in starts:
            fitting = (goals[:, frozen] == start[frozen]).all(axis=1)
            if fitting.any():
                return starts[(starts[:, frozen] == start[frozen]).all(axis=1)], goals[fitting]

        joint = next(k for k in frozen if starts[0, k] != goals[0, k])
        raise InputError(
            f"frozen_joints: joint '{self._names[joint]}' must not move, but it is at {starts[0, joint]:.9g} at the "
            f"start and at {goals[0, joint]:.9g} at the goal; let it move or change one of them"
        )

    @property
    def staying(self) -> list[int]:
        """Joints that do not move before the last moves."""
        return [*self.frozen_joints, *self.last_joints]

    def growth(self, lower: Vector, upper: Vector, start: Vector) -> CrdtRules:
        """How trees grow within bounds, shapes (n,), if the joints that stay are where they are at a start."""
        scale = self.joint_costs / (upper - lower) if self.scale_by_range else self.joint_costs
        lower = lower.copy()
        upper = upper.copy()
        lower[self.staying] = upper[self.staying] = start[self.staying]
        return CrdtRules(lower, upper, scale, self.smallest_move, self.joint_costs.min() / self.joint_costs)

    def accepts(self, path: Matrix) -> bool:
        """Whether no move of a path, shape (k, n), is too short, once those of the same joint in a row are joined."""
        return long_enough(path, self.smallest_move)


def joint_names(world: object) -> Sequence[str]:
    """Names of the joints of a world's robot, none if it has no robot."""
    names: Sequence[str] = getattr(getattr(world, "robot", None), "joint_names", ())
    return names


def iteration_limit(limit: int | None) -> int | None:
    """The largest number of iterations, checked.

    Raises:
        InputError: If the limit is no number of at least 1.
    """
    if limit is None or limit == np.inf:
        return None
    if isinstance(limit, bool) or not isinstance(limit, int | float) or not limit >= 1:
        raise InputError(f"max_iterations: expected at least 1, got {limit!r}")
    return ceil(limit)
