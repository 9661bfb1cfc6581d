"""Path constraints for anybody's OMPL code: an ``ompl.base.Constraint``, as for a ProjectedStateSpace [18]."""

from __future__ import annotations

import numpy as np
from ompl import base as ob

from rrtik_ompl.arrays import Matrix, Vector
from rrtik_ompl.constraints.equations import equation_count, equations
from rrtik_ompl.errors import InputError
from rrtik_ompl.problem import Problem
from rrtik_ompl.world.holding_world import HoldingWorld


class RegionConstraint(ob.Constraint):  # type: ignore[misc]  # OMPL has no types
    """The path constraints of a problem as ``function`` and ``jacobian`` of OMPL.

    Args:
        problem: With path constraints.

    Raises:
        InputError: If it has none.

    Example:
        >>> constraint = RegionConstraint(problem)
        >>> constraint.isSatisfied(problem.start)
        True
    """

    def __init__(self, problem: Problem) -> None:
        if not isinstance(problem.world, HoldingWorld):
            raise InputError("problem: it has no path constraints")
        held = problem.world.constraints
        super().__init__(problem.robot.dof, equation_count(held), 1.0)
        self._robot, self._held = problem.robot, held

    def function(self, x: Vector, out: Vector) -> None:
        """Write the values of the equations at x, shape (dof,)."""
        out[:] = equations(self._robot, self._held, np.array(x))[0]

    def jacobian(self, x: Vector, out: Matrix) -> None:
        """Write their derivatives, shape (k, dof)."""
        out[:] = equations(self._robot, self._held, np.array(x))[1]
