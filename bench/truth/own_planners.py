"""Planners as researchers write them: Python, derived from ``ompl.base.Planner``, with states kept as they please."""

from __future__ import annotations

from ompl import base as ob
from ompl import geometric as og

EXACT = ob.PlannerStatus(True, False)


def goal_of(problem: ob.ProblemDefinition) -> ob.State:
    """The first goal, which the problem owns."""
    goal = problem.getGoal()
    return goal.getState() if isinstance(goal, ob.GoalState) else goal.getState(0)


class Plain(ob.Planner):  # type: ignore[misc]  # OMPL has no types
    """The smallest one: the straight motion, between states that the problem owns."""

    def __init__(self, si: ob.SpaceInformation) -> None:
        super().__init__(si, type(self).__name__)

    def solve(self, ptc: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Join start and goal; called by OMPL."""
        problem = self.getProblemDefinition()
        return self.join(problem.getStartState(0), goal_of(problem))

    def join(self, start: ob.State, goal: ob.State) -> ob.PlannerStatus:
        """Hand over the motion between two states."""
        path = og.PathGeometric(self.getSpaceInformation())
        path.append(start)
        path.append(goal)
        self.getProblemDefinition().addSolutionPath(path)
        return EXACT


class AsksForInputs(Plain):
    """Looks at all states of the problem."""

    def solve(self, ptc: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Join start and goal; called by OMPL."""
        states = self.getProblemDefinition().getInputStates()
        return self.join(states[0], states[-1])


class KeepsEverything(Plain):
    """Keeps states, problem and path as attributes."""

    def solve(self, ptc: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Join start and goal; called by OMPL."""
        self.problem, self.space = self.getProblemDefinition(), self.getSpaceInformation()
        self.start, self.goal = self.problem.getStartState(0), goal_of(self.problem)
        self.path = og.PathGeometric(self.space, self.start, self.goal)
        self.states = self.path.getStates()
        return self.join(self.start, self.goal)


class Clones(Plain):
    """Clones states, and frees one that it was given, as in C++."""

    def solve(self, ptc: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Join start and goal; called by OMPL."""
        problem, space = self.getProblemDefinition(), self.getSpaceInformation()
        spare = space.allocState()
        start = space.cloneState(problem.getStartState(0))
        space.copyState(spare, start)
        space.freeState(spare)
        return self.join(start, space.cloneState(goal_of(problem)))


class WalksAtRandom(Plain):
    """OMPL's own example of a planner in Python: a list of states, the first of them the problem's."""

    def __init__(self, si: ob.SpaceInformation) -> None:
        super().__init__(si)
        self.states: list[ob.State] = []

    def solve(self, ptc: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Walk from valid state to valid state; called by OMPL."""
        space, goal = self.getSpaceInformation(), goal_of(self.getProblemDefinition())
        sampler = space.allocStateSampler()
        self.states.append(self.getPlannerInputStates().nextStart())
        while not ptc():
            if space.checkMotion(self.states[-1], goal):
                return self.handed_over([*self.states, goal])
            state = space.allocState()
            sampler.sampleUniform(state)
            if space.checkMotion(self.states[-1], state):
                self.states.append(state)
        return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)

    def handed_over(self, states: list[ob.State]) -> ob.PlannerStatus:
        """Hand over the way through all states."""
        path = og.PathGeometric(self.getSpaceInformation())
        for state in states:
            path.append(state)
        self.getProblemDefinition().addSolutionPath(path)
        return EXACT

    def clear(self) -> None:
        """Forget the walk; called by OMPL."""
        super().clear()
        self.states = []


class TellsItsGraph(Plain):
    """Overrides what the bindings cannot call from C++."""

    def getPlannerData(self, data: ob.PlannerData) -> None:
        """Write nothing; called by nobody, as it would end the process."""


PLANNERS = (Plain, AsksForInputs, KeepsEverything, Clones, WalksAtRandom, TellsItsGraph)
