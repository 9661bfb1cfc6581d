"""Path constraints for anybody's OMPL code: an ``ompl.base.Constraint``, and a ProjectedStateSpace [18] made of it."""

from __future__ import annotations

import numpy as np
from ompl import base as ob

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.equations import equation_count, equations
from rrtik_ompl.ompl_bridge.setup import bounded_space
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.world.problem import Problem

STEP = 0.2  # [rad; m] between two projections; each of them asks Python some ten times
DETOUR = 2.0  # a motion that gets this much longer by projection is none, as in OMPL


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
        held = problem.world.constraints
        if held is None:
            raise InputError("problem: it has no path constraints")

        super().__init__(problem.robot.dof, equation_count(held), 1.0)
        self._robot = problem.robot
        self._held = held

    def function(self, x: Vector, out: Vector) -> None:
        """Write the values of the equations at x, shape (dof,)."""
        out[:] = equations(self._robot, self._held, np.array(x))[0]

    def jacobian(self, x: Vector, out: Matrix) -> None:
        """Write their derivatives, shape (k, dof)."""
        out[:] = equations(self._robot, self._held, np.array(x))[1]


class ProjectedMotions(ob.MotionValidator):  # type: ignore[misc]  # OMPL has no types
    """Motions along a constraint, in the steps that OMPL's ProjectedStateSpace makes of them, each checked by a world.

    OMPL's own validator looks at the ends of the steps alone, and an obstacle may stand between them.
    """

    def __init__(self, si: ob.SpaceInformation, problem: Problem, constraint: RegionConstraint) -> None:
        super().__init__(si)
        self._held = problem.world
        self._free = problem.world.unheld
        self._constraint = constraint
        self._states = StateIO(si)

    def checkMotion(self, first: ob.State, second: ob.State, *_: object) -> bool:
        """Whether the motion between two states keeps to the constraint, is free, and arrives; called by OMPL."""
        at = self._states.read(first)
        end = self._states.read(second)
        left = whole = float(np.linalg.norm(end - at))
        gone = 0.0

        while left > STEP:
            new = at + STEP / left * (end - at)
            if not self._constraint.project(new):
                return False

            step = float(np.linalg.norm(new - at))
            nearer = float(np.linalg.norm(end - new))
            gone += step
            if max(step / STEP, gone / whole) > DETOUR or nearer >= left or not self._checked(at, new):
                return False

            at = new
            left = nearer

        return self._checked(at, end)

    def _checked(self, a: Vector, b: Vector) -> bool:
        return bool(self._held.valid(b) and self._free.motion_valid(a, b))


def projected_space(problem: Problem, lower: Vector, upper: Vector) -> ob.ConstrainedSpaceInformation:
    """A SpaceInformation of a ProjectedStateSpace along the path constraints of a problem, with its motions checked.

    Args:
        problem: With path constraints.
        lower: Lower bounds of the joints, shape (dof,).
        upper: Upper bounds, shape (dof,).
    """
    constraint = RegionConstraint(problem)
    space = ob.ProjectedStateSpace(bounded_space(lower, upper).getStateSpace(), constraint)
    space.setDelta(STEP)

    si = ob.ConstrainedSpaceInformation(space)
    si.setMotionValidator(ProjectedMotions(si, problem, constraint))
    return si
