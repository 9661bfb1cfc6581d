"""Angles of SO(2): which spaces are taken, what is read and written, and which way motions turn."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ompl import base as ob
from ompl import geometric as og

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ompl_bridge import StateIO, space_bounds, states
from rrtik_ompl.ompl_bridge.unrolled import MOST_GOALS, Unrolled, on_circles, pieces
from rrtik_planners import BiCRDT, FastRRTConnect

pytestmark = pytest.mark.usefixtures("quiet_ompl")

ANGLE = st.floats(-np.pi, np.pi)
ROW = st.tuples(ANGLE, st.floats(-2.0, 2.0), ANGLE).map(np.array)
TURNING = np.array([True, False, True])


def real(dof: int) -> Any:
    space, bounds = ob.RealVectorStateSpace(dof), ob.RealVectorBounds(dof)
    bounds.setLow(-2.0)
    bounds.setHigh(2.0)
    space.setBounds(bounds)
    return space


def compound(*parts: Any) -> Any:
    space = ob.CompoundStateSpace()
    for part in parts:
        space.addSubspace(part, 1.0)
    return space


def plane() -> Any:
    space, bounds = ob.SE2StateSpace(), ob.RealVectorBounds(2)
    bounds.setLow(-2.0)
    bounds.setHigh(2.0)
    space.setBounds(bounds)
    return space


SPACES = {
    "so2": (ob.SO2StateSpace, [True]),
    "se2": (plane, [False, False, True]),
    "mixed": (lambda: compound(ob.SO2StateSpace(), real(2), ob.SO2StateSpace()), [True, False, False, True]),
    "nested": (lambda: compound(compound(real(1), ob.SO2StateSpace()), plane()), [False, True, False, False, True]),
}


@pytest.mark.parametrize("capsule", [True, False])
@pytest.mark.parametrize("name", SPACES)
def test_a_state_survives_the_way_there_and_back(name: str, capsule: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not capsule:
        monkeypatch.setattr(states, "_capsule", lambda buffer: None)
    make, turning = SPACES[name]
    si = ob.SpaceInformation(make())
    io, state = StateIO(si), si.allocState()
    assert io.turning.tolist() == turning
    assert io.fast == capsule
    q = np.random.default_rng(1).uniform(-2.0, 2.0, len(turning))
    io.write(state, q)
    np.testing.assert_array_equal(io.read(state), q)
    io.write(state, q + 2.0 * np.pi * io.turning)
    np.testing.assert_allclose(io.read(state), q, atol=1e-12)
    assert si.satisfiesBounds(state)
    np.testing.assert_array_equal(space_bounds(si)[1], np.where(turning, np.pi, 2.0))


REFUSED = {
    "SE3StateSpace": ob.SE3StateSpace,
    "DubinsStateSpace": lambda: ob.DubinsStateSpace(1.0),
    "SO3StateSpace in a compound": lambda: compound(real(1), ob.SO3StateSpace()),
}


@pytest.mark.parametrize("name", REFUSED)
def test_spaces_with_other_states_or_other_motions_are_refused(name: str) -> None:
    wanted = f"needs a RealVectorStateSpace, an SO2StateSpace or a compound .* got a {name}"
    with pytest.raises(InputError, match=wanted):
        FastRRTConnect(ob.SpaceInformation(REFUSED[name]()))


@settings(deadline=None)
@given(ROW, ROW)
def test_goals_lie_on_both_sides_of_the_start_and_are_the_same_postures(start: Any, goal: Any) -> None:
    line = Unrolled(start[None], goal[None], TURNING)
    lower, upper = line.bounds(np.full(3, -2.0), np.full(3, 2.0))
    assert len(line.goals) == 4
    assert ((line.goals >= lower - 1e-12) & (line.goals <= upper + 1e-12)).all()
    turns = (line.goals - goal) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert np.abs(line.goals[0] - start)[TURNING].max() <= np.pi + 1e-12
    for row in line.goals:
        path = line.path(np.stack([line.starts[0], row]))
        np.testing.assert_array_equal(path[0], start)
        np.testing.assert_array_equal(path[-1], goal)


@settings(deadline=None)
@given(ROW, st.tuples(st.floats(-7, 7), st.floats(-2, 2), st.floats(-7, 7)).map(np.array))
def test_pieces_turn_the_short_way_and_the_same_way_on_the_circle(a: Any, b: Any) -> None:
    points = pieces(a, b, TURNING)
    np.testing.assert_array_equal(points[[0, -1]], [a, b])
    for one, two in pairwise(points):
        assert np.abs(two - one)[TURNING].max() < np.pi - 0.5
    on = np.array([on_circles(q, TURNING) for q in points])
    assert np.abs(on[:, TURNING]).max() <= np.pi
    np.testing.assert_allclose(np.cos(on), np.cos(points), atol=1e-9)
    np.testing.assert_allclose(np.sin(on), np.sin(points), atol=1e-9)


def test_many_angles_do_not_make_a_crowd_of_goals() -> None:
    dof = 20
    line = Unrolled(np.zeros((1, dof)), np.ones((1, dof)), np.ones(dof, dtype=bool))
    assert len(line.goals) == 1 + dof
    many = Unrolled(np.zeros((1, 3)), np.random.default_rng(1).uniform(-1.0, 1.0, (200, 3)), np.ones(3, dtype=bool))
    assert len(many.goals) == 200
    assert MOST_GOALS < 200


MADE = {
    "ours": lambda si, world: FastRRTConnect(si, seed=1),
    "ours in kernels": lambda si, world: FastRRTConnect(si, seed=1, world=world),
    "single joints": lambda si, world: BiCRDT(si, seed=1, world=world),
    "OMPL's": lambda si, world: og.RRTConnect(si),
    "OMPL's with a projection": lambda si, world: og.KPIECE1(si),
}


@pytest.mark.parametrize("name", MADE)
def test_joints_without_limits_are_angles_in_ompl(name: str) -> None:
    robot = rrtik.load_robot("kinova")
    world = rrtik.World(robot)
    start, goal = np.array(robot.posture("arm_up")), np.array(robot.posture("arm_up"))
    start[0], goal[0] = 3.0, -3.0
    assert robot.continuous[0]
    setup = rrtik.ompl.simple_setup(rrtik.Problem(world, start, goal), so2=True)
    si = setup.getSpaceInformation()
    assert type(si.getStateSpace()) is ob.CompoundStateSpace
    setup.setPlanner(MADE[name](si, world))
    assert str(setup.solve(10.0)) == "Exact solution"
    assert setup.getSolutionPath().check()
    if name.startswith("ours"):  # straight, the short way past half a turn
        assert setup.getSolutionPath().length() == pytest.approx(2.0 * np.pi - 6.0, abs=1e-6)


OMPLS = [each for each in vars(og).values() if isinstance(each, type) and issubclass(each, ob.Planner)]


@pytest.mark.parametrize("kind", OMPLS, ids=lambda kind: kind.__name__)
def test_a_planner_of_ompl_that_does_not_know_angles_is_refused_in_one_line(kind: type) -> None:
    robot = rrtik.load_robot("kinova")
    middle = np.array(robot.posture("arm_up"))
    middle[1] += 1.0
    turn = np.eye(robot.dof)[0]
    box = rrtik.Obstacle("in the way", rrtik.Box([0.05, 0.05, 0.05]), robot.fk(middle).translation)
    world = rrtik.World(robot, rrtik.Scene([box]))
    setup = rrtik.ompl.simple_setup(rrtik.Problem(world, middle - turn, middle + turn), so2=True)
    setup.setPlanner(kind(setup.getSpaceInformation()))
    if kind.__name__ in ("BITstar", "InformedRRTstar", "SORRTstar", "AORRTC"):
        with pytest.raises(InputError, match=r"does not know this space: .* leave so2 out") as caught:
            setup.solve(0.1)
        assert "\n" not in str(caught.value)
    else:
        setup.solve(0.1)
