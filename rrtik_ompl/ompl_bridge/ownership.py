"""Protection of OMPL's states from being freed by Python too, while a planner written in Python works.

OMPL 2.0.1's bindings return ``ProblemDefinition.getStartState`` and ``getInputStates`` as if Python owned the states:
each state is freed once by Python and once by OMPL, and the process dies, at once or later. The bindings make one
Python object for each C++ state, and return the same object as long as it lives, whoever asks. Nothing is therefore
freed twice while there are non-owning objects for these states, as other methods return them.
"""

from __future__ import annotations

import faulthandler
from collections.abc import Iterator
from contextlib import contextmanager

from rrtik_ompl.ompl_bridge.bindings import ob
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner

STANDARD_ERROR = 2  # its file descriptor; sys.stderr may have none, as in a notebook

# The reason why a planner that is_plain() may end the process.
PLAIN_HINT = (
    "OMPL 2.0.1's bindings free states twice that such a class keeps or frees; "
    "derive it from rrtik_ompl.ompl_bridge.SafePlanner, which searches on arrays"
)


def is_plain(planner: object) -> bool:
    """Check whether a planner's class is written in Python on top of ``ompl.base.Planner`` without SafePlanner."""
    if not isinstance(planner, type) or not issubclass(planner, ob.Planner) or issubclass(planner, SafePlanner):
        return False
    return planner.__module__.partition(".")[0] != "ompl"


@contextmanager
def foreign_code(planner: ob.Planner, definition: ob.ProblemDefinition) -> Iterator[None]:
    """Protect states from being freed twice inside a ``with`` block, if the planner is a plain one.

    If its code ends the process nevertheless, the Python line that did so is written to standard error.
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
    """Return non-owning objects of the starts and goals of a problem.

    They must not be kept, because the states are freed with the problem.
    """
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
