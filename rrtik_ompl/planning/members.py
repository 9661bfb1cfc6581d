"""Which planners "auto" lets search, in which order; none of them is imported for this."""

from __future__ import annotations

from rrtik_ompl.description.catalog import portfolio
from rrtik_ompl.model.goal import TipGoal
from rrtik_ompl.world.problem import Problem


def members(problem: Problem) -> tuple[str, ...]:
    """Return the names of the planners that try a problem, in their order.

    Planners for a goal of the tip are included only if the goal is one. With path constraints only the planners that
    keep them are included.
    """
    if problem.constraints:
        wanted = {"path constraints"}
    elif isinstance(problem.goal, TipGoal):
        wanted = {"any goal", "goal of the tip"}
    else:
        wanted = {"any goal"}
    return tuple(name for name, solves in portfolio().items() if solves in wanted)
