"""What a contract case draws: a planner, a space, starts, goals, a checker and a condition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from ompl import base as ob
from ompl import geometric as og

from rrtik_planners import (
    CRDT,
    IKURT,
    MBRRT,
    BiCRDT,
    CBiRRT,
    DRRTCon,
    FastAORRTC,
    FastRRTConnect,
    FewestMoves,
    RestartShorten,
    RoadmapPlanner,
)

PLANNERS = (
    BiCRDT,
    CBiRRT,
    CRDT,
    DRRTCon,
    FastAORRTC,
    FastRRTConnect,
    FewestMoves,
    IKURT,
    MBRRT,
    RestartShorten,
    RoadmapPlanner,
)
GOALS = ("state", "states", "sampled", "no samples", "region", "none")
CHECKERS = ("bool", "numpy", "raises")
CONDITIONS = ("seconds", "function", "no time")
UNITS = (1e-3, 1.0, 1e3)


@dataclass(frozen=True)
class Case:
    """One question to a planner: what is drawn; the last ``angles`` of ``dof`` coordinates are angles of SO(2)."""

    planner: int
    dof: int
    angles: int
    unit: float
    balls: int
    starts: int
    goal: str
    checker: str
    condition: str
    seed: int

    def row(self, state: ob.State) -> np.ndarray:
        """The coordinates of a state, shape (dof,)."""
        reals = self.dof - self.angles
        if self.angles == 0:
            return np.array(state[0 : self.dof])
        if self.is_se2:
            return np.array([state.getX(), state.getY(), state.getYaw()])
        if self.dof == 1:
            return np.array([state.value])
        first = list(state[0][0:reals]) if reals else []
        return np.array(first + [state[k + (reals > 0)].value for k in range(self.angles)])

    def put(self, state: ob.State, row: np.ndarray) -> None:
        """Set the coordinates of a state."""
        values, reals = row.tolist(), self.dof - self.angles
        if self.angles == 0:
            state[0 : self.dof] = values
        elif self.is_se2:
            state.setXY(*values[:2])
            state.setYaw(values[2])
        elif self.dof == 1:
            state.value = values[0]
        else:
            if reals:
                state[0][0:reals] = values[:reals]
            for k, value in enumerate(values[reals:]):
                state[k + (reals > 0)].value = value

    @property
    def is_se2(self) -> bool:
        """Whether the space is SE(2): of those with two reals and an angle each second one."""
        return (self.dof, self.angles, self.seed % 2) == (3, 1, 1)

    @property
    def half(self) -> np.ndarray:
        """Half of how far each coordinate goes, shape (dof,)."""
        return np.repeat([self.unit, np.pi], [self.dof - self.angles, self.angles])

    def apart(self, rows: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Difference of rows from a row, angles the short way round, in parts of ``half``."""
        turns = 2.0 * self.half * np.repeat([0.0, 1.0], [self.dof - self.angles, self.angles])
        away = rows - row
        shares: np.ndarray = (away - turns * np.round(away / (2.0 * self.half))) / self.half
        return shares


def cases(turning: bool) -> st.SearchStrategy[Case]:
    """What is drawn: spaces of reals, or spaces with coordinates of SO(2) beside them or alone."""

    def of(dof: int) -> st.SearchStrategy[Case]:
        return st.builds(
            Case,
            planner=st.integers(0, len(PLANNERS) - 1),
            dof=st.just(dof),
            angles=st.integers(1, dof) if turning else st.just(0),
            unit=st.sampled_from(UNITS),
            balls=st.integers(0, 12),
            starts=st.sampled_from((0, 1, 1, 1, 2, 3)),
            goal=st.sampled_from(GOALS),
            checker=st.sampled_from(("bool",) * 4 + CHECKERS[1:]),
            condition=st.sampled_from(CONDITIONS),
            seed=st.integers(0, 10_000),
        )

    return (st.integers(1, 8) | st.sampled_from([20, 60])).flatmap(of)


class Sampled(ob.GoalSampleableRegion):  # type: ignore[misc]  # OMPL has no types
    """Goals from rows, one after the other; there may be none."""

    def __init__(self, si: ob.SpaceInformation, case: Case, rows: np.ndarray) -> None:
        super().__init__(si)
        self.case, self.rows, self.next = case, rows, 0

    def maxSampleCount(self) -> int:
        """How many there are; called by OMPL."""
        return len(self.rows)

    def couldSample(self) -> bool:
        """Whether there is any; called by OMPL."""
        return len(self.rows) > 0

    def sampleGoal(self, state: ob.State) -> None:
        """The next one; called by OMPL."""
        row = self.rows[self.next % len(self.rows)]
        self.next += 1
        self.case.put(state, row)

    def distanceGoal(self, state: ob.State) -> float:
        """To the nearest one; called by OMPL."""
        away = self.case.apart(self.rows, self.case.row(state))
        return float(np.linalg.norm(away, axis=1).min()) if len(self.rows) else 1.0


class Region(ob.GoalRegion):  # type: ignore[misc]  # OMPL has no types
    """A goal that nothing can be sampled from."""

    def distanceGoal(self, state: ob.State) -> float:
        """Far; called by OMPL."""
        return 1.0


def setup_of(case: Case) -> og.SimpleSetup:
    """A SimpleSetup of its space."""
    reals = case.dof - case.angles
    bounds = ob.RealVectorBounds(reals)
    bounds.setLow(-case.unit)
    bounds.setHigh(case.unit)
    if case.angles == 0 or case.is_se2:
        whole = ob.SE2StateSpace() if case.angles else ob.RealVectorStateSpace(reals)
        whole.setBounds(bounds)
        return og.SimpleSetup(whole)
    if case.dof == 1:
        return og.SimpleSetup(ob.SO2StateSpace())
    space = ob.CompoundStateSpace()
    if reals:
        straight = ob.RealVectorStateSpace(reals)
        straight.setBounds(bounds)
        space.addSubspace(straight, 1.0)
    for _ in range(case.angles):
        space.addSubspace(ob.SO2StateSpace(), 1.0)
    return og.SimpleSetup(space)


def goal_of(case: Case, si: ob.SpaceInformation, goals: np.ndarray) -> ob.Goal:
    """The goal of its kind at these rows, shape (k, dof)."""
    state = si.allocState()
    if case.goal == "state":
        goal = ob.GoalState(si)
        case.put(state, goals[0])
        goal.setState(state)
        return goal
    if case.goal == "states":
        several = ob.GoalStates(si)
        for row in goals:
            case.put(state, row)
            several.addState(state)
        return several
    return Region(si) if case.goal == "region" else Sampled(si, case, goals if case.goal == "sampled" else goals[:0])
