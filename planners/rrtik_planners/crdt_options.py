"""What the planners that move one joint at a time have in common: their options, and what these mean for the trees."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.errors import InputError
from rrtik_ompl.fast.search.crdt.rules import CrdtRules
from rrtik_ompl.moves.rules import (
    Joints,
    PerJoint,
    costs_of_joints,
    joint_numbers,
    long_enough,
    smallest_moves,
)


class AxisOptions:
    """The options, checked.

    Args:
        scale_by_range: Divide each coordinate by its range in the metric of the nearest neighbour.
        joint_costs: Cost of a joint's motion, greater than 0, shape (n,): a slow or risky joint costs more. The metric
            multiplies its coordinate by it, and of the samples it takes part only in the share lowest cost / its cost,
            so that it moves less often; where it has to, it still does. All equal if None.
        frozen_joints: Joints that must not move, by number (from 0) or, with a world, by name. Starts and goals have to
            agree in them exactly; those that do not are left out.
        smallest_move: No move of a path is shorter [unit of the joint: rad or m], one number or one for each joint.
        max_iterations: The K of the paper; without limit if None.
        names: The joints' names, if known.
        dof: Number of joints.

    Raises:
        InputError: If an option is out of range.
        UnknownNameError: If there is no joint of a name.
    """

    def __init__(
        self,
        *,
        scale_by_range: bool,
        joint_costs: PerJoint | None,
        frozen_joints: Joints,
        smallest_move: PerJoint,
        max_iterations: int | None,
        names: Sequence[str],
        dof: int,
    ) -> None:
        self.scale_by_range = scale_by_range
        self.joint_costs = costs_of_joints(joint_costs, dof)
        self.smallest_move = smallest_moves(smallest_move, dof)
        self.frozen_joints = joint_numbers(frozen_joints, names, dof, "frozen_joints")
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

    def rules(self, lower: Vector, upper: Vector, start: Vector, others: Sequence[int] = ()) -> CrdtRules:
        """How trees grow within bounds, shapes (n,), if frozen joints and ``others`` stay where they are at a start."""
        scale = self.joint_costs / (upper - lower) if self.scale_by_range else self.joint_costs
        lower, upper = lower.copy(), upper.copy()
        staying = [*self.frozen_joints, *others]
        lower[staying] = upper[staying] = start[staying]
        return CrdtRules(lower, upper, scale, self.smallest_move, self.joint_costs.min() / self.joint_costs)

    def accepts(self, path: Matrix) -> bool:
        """Whether no move of a path, shape (k, n), is too short, once those of the same joint in a row are joined."""
        return long_enough(path, self.smallest_move)


def joint_names(world: Any) -> Sequence[str]:
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
