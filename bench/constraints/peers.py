"""The planners of others under the same path constraints: OMPL's ProjectedStateSpace in our world, and roboplan."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

import rrtik_ompl as rrtik
from bench.constraints.judge import judged
from bench.constraints.problems import generated
from bench.constraints.runs import LIMIT, WALL
from bench.peers.description import task_of
from bench.peers.host import Host
from bench.peers.task import Region, Rows
from bench.shared.problems import goal_joints
from rrtik_ompl.constraints.held_region import ANYWHERE
from rrtik_ompl.ompl_bridge.attempt import quiet
from rrtik_ompl.ompl_bridge.region_constraint import RegionConstraint
from rrtik_ompl.world.problem import Problem

DELTA = 0.2  # [rad] of a step along OMPL's manifold; with its own default of 0.05 it is slower


@dataclass(frozen=True)
class Other:
    """What a peer made of a problem.

    Attributes:
        found: Whether it says that it has a path.
        seconds: Processor time [s].
        metres, degrees, contacts: What the judge saw, see :class:`bench.constraints.judge.Verdict`.
        failed: What went wrong with the peer itself, or "".
    """

    found: bool
    seconds: float
    metres: float
    degrees: float
    contacts: int
    failed: str


@dataclass(frozen=True)
class Others:
    """What the peers made of a problem."""

    ompl: Other
    roboplan: Other


def others(python: str, name: str, kind: str, seed: int) -> Others:
    """The peers at one of the generated problems.

    Args:
        python: Interpreter in whose environment roboplan is installed.
        name: Of the robot.
        kind: Of the constraint.
        seed: Of problem and searches.
    """
    problem = generated(name, kind, seed).problem
    if problem is None:
        nothing = Other(False, 0.0, 0.0, 0.0, 0, "")
        return Others(nothing, nothing)
    rrtik.plan(problem, "cbirrt", seconds=LIMIT, seed=seed)  # the tables of the world, which OMPL's checks use too
    first = _seen(problem, *projected(problem, seed), "")
    with TemporaryDirectory() as folder:
        free = Problem(problem.world.unheld, problem.start, problem.goal)
        task = replace(task_of(free, Path(folder), WALL * LIMIT), regions=[_region(problem)])
        answer = _host(python).ask(task, seed)
    return Others(first, _seen(problem, answer.rows, answer.cpu, answer.failed))


def _seen(problem: Problem, rows: Rows | None, seconds: float, failed: str) -> Other:
    """An answer, judged; one that took longer than the limit counts as none."""
    if rows is None or seconds > LIMIT:
        return Other(False, seconds, 0.0, 0.0, 0, failed)
    seen = judged(problem, rows)
    return Other(True, seconds, seen.metres, seen.degrees, seen.contacts, failed)


def projected(problem: Problem, seed: int) -> tuple[Rows | None, float]:
    """RRTConnect in OMPL's ProjectedStateSpace, motions checked in our world; path, shape (k, dof), and time [s]."""
    robot, world = problem.robot, problem.world.unheld
    with quiet():
        ou.RNG.setSeed(seed + 1)
        begin = time.process_time()
        ambient, bounds = ob.RealVectorStateSpace(robot.dof), ob.RealVectorBounds(robot.dof)
        for k, (low, high) in enumerate(zip(*robot.finite_range(), strict=True)):
            bounds.setLow(k, float(low))
            bounds.setHigh(k, float(high))
        ambient.setBounds(bounds)
        constraint = RegionConstraint(problem)
        space = ob.ProjectedStateSpace(ambient, constraint)
        space.setDelta(DELTA)
        si = ob.ConstrainedSpaceInformation(space)
        setup = og.SimpleSetup(si)
        setup.setStateValidityChecker(lambda state: world.valid(np.array([state[k] for k in range(robot.dof)])))
        states = [si.allocState() for _ in range(2)]
        for state, q in zip(states, (problem.start, goal_joints(problem)), strict=True):
            state.copy(q)
        setup.setStartAndGoalStates(*states)
        setup.setPlanner(og.RRTConnect(si))
        setup.solve(ob.PlannerTerminationCondition(lambda: time.process_time() - begin > LIMIT))
        if not setup.haveExactSolutionPath():
            return None, time.process_time() - begin
        path = setup.getSolutionPath()
        path.interpolate()
        count = path.getStateCount()
        rows = np.array([[path.getState(i)[k] for k in range(robot.dof)] for i in range(count)])
        return rows, time.process_time() - begin


def _region(problem: Problem) -> Region:
    """The constraint of a problem in plain numbers."""
    region = problem.constraints[0]
    assert np.allclose(region.T_w_tip.homogeneous, np.eye(4)), "roboplan's frame of the tip is the tip"
    free = np.append(np.repeat(ANYWHERE, 3), np.repeat(np.pi, 3)) - 1e-9
    low, high = region.bounds.T
    return Region(
        pose=region.T_world_w.homogeneous.tolist(),
        lower=[float(x) if x > -most else None for x, most in zip(low, free, strict=True)],
        upper=[float(x) if x < most else None for x, most in zip(high, free, strict=True)],
        position_tolerance=float(region.position_tolerance),
        orientation_tolerance=float(region.orientation_tolerance),
    )


@cache
def _host(python: str) -> Host:
    """The process of roboplan, one for all problems."""
    return Host("roboplan", python)


def absent(python: str) -> str:
    """Why roboplan is absent, or ""."""
    return _host(python).absent


def versions(python: str) -> str:
    """Of roboplan and what it stands on."""
    return _host(python).versions
