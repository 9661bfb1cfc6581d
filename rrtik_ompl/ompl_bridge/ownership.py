"""States that OMPL owns, kept from being freed by Python as well while a planner written in Python works.

OMPL 2.0.1's bindings return ``ProblemDefinition.getStartState`` and ``getInputStates`` as if Python owned them: the
state is freed once by Python, once by OMPL, and the process dies, then or later. The bindings make one Python object
for each state of C++ and return it again as long as it lives, whoever asks. So nothing is freed twice while there are
objects of these states that own nothing, as other methods return them.
"""

from __future__ import annotations

import faulthandler
from collections.abc import Iterator
from contextlib import contextmanager

from ompl import base as ob

from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner

STANDARD_ERROR = 2  # its file; sys.stderr may be none, as in a notebook

# Why a planner that is_plain() may end the process.
PLAIN_HINT = (
    "OMPL 2.0.1's bindings free states twice that such a class keeps or frees; "
    "derive it from rrtik_ompl.ompl_bridge.SafePlanner, which searches on arrays"
)


def is_plain(planner: object) -> bool:
    """Whether a planner's class is written in Python and derived from ``ompl.base.Planner``, not from SafePlanner."""
    if not isinstance(planner, type) or not issubclass(planner, ob.Planner) or issubclass(planner, SafePlanner):
        return False
    return planner.__module__.partition(".")[0] != "ompl"


@contextmanager
def foreign_code(planner: ob.Planner, definition: ob.ProblemDefinition) -> Iterator[None]:
    """For the time in which a planner solves a problem: if it is a plain one, no state is freed twice.

    Should its code end the process all the same, the line of Python that did so is written to standard error.
    """
    if not is_plain(type(planner)):
        yield
        return

    states = borrowed_states(definition)
    silent = not faulthandler.is_enabled()
    if silent:
        faulthandler.enable(STANDARD_ERROR)

    try:
        yield
    finally:
        states.clear()
        if silent:
            faulthandler.disable()


def borrowed_states(definition: ob.ProblemDefinition) -> list[ob.State]:
    """Objects of the starts and goals of a problem that own nothing; not to be kept, as states go with the problem."""
    inputs = ob.PlannerInputStates()
    inputs.use(definition)
    states = []
    while inputs.haveMoreStartStates():
        states.append(inputs.nextStart())

    goal = definition.getGoal()
    if isinstance(goal, ob.GoalStates):
        states += [goal.getState(k) for k in range(goal.getStateCount())]
    elif isinstance(goal, ob.GoalState):
        states.append(goal.getState())

    return states
