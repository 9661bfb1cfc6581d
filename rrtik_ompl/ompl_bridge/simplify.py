"""OMPL's own shortening, PathSimplifier, as arrays in and out."""

from __future__ import annotations

import time

from ompl import base as ob
from ompl import geometric as og

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import PlannerError
from rrtik_ompl.ompl_bridge.attempt import in_short, interrupt_ends, quiet, seed_ompl
from rrtik_ompl.ompl_bridge.setup import ValidityCallback, space_information
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.world.problem import Problem

MAX_SECONDS = 1e9  # [s]


def simplified(problem: Problem, route: Matrix, budget: Budget) -> tuple[Matrix, int]:
    """Let ``ompl.geometric.PathSimplifier`` shorten a route, shape (k, n); also how many motions were checked.

    Its last step checks configurations alone of what it has bent, so the result must be checked. When the time is up
    no motion counts as free, and what was found so far is returned.

    Raises:
        PlannerError: If a check raised an error.
        KeyboardInterrupt: After it has stopped in good order.
    """
    with quiet():
        seed_ompl(budget.seed)
        validity = ValidityCallback(problem.world)
        si = space_information(problem, route, validity)

        seconds = 0.0 if budget.over() else min(budget.left, MAX_SECONDS)
        validity.deadline = time.monotonic() + seconds
        condition = ob.timedPlannerTerminationCondition(seconds)
        validity.stop = condition.terminate

        states = StateIO(si)
        path = states.path(si, route)
        with interrupt_ends(condition):
            og.PathSimplifier(si).simplify(path, condition, True)

        if validity.error is not None:
            raise PlannerError(f"PathSimplifier broke: {in_short(validity.error)}")
        return states.rows(path), validity.motions
