"""Path constraints as OMPL's Constraint: derivatives, satisfaction and OMPL's own projection."""

import numpy as np
import pytest
from ompl import base as ob

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.equations import _leaning, equation_count, equations
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.ompl_bridge.region_constraint import RegionConstraint

START = np.array([0.3, -1.2, 1.4, -0.4, 0.6, 0.2])


def problem_with(*regions):
    robot = rrtik.load_robot("ur5_limited")
    return rrtik.Problem(rrtik.World(robot), START, START, constraints=regions)


def cases():
    robot = rrtik.load_robot("ur5_limited")
    T = robot.fk(START)
    return {
        "upright": rrtik.constraints.upright(robot, "x"),
        "orientation": rrtik.constraints.orientation_of(T, 4.0),
        "ranges": rrtik.constraints.orientation_of(T, [1.0, 2.0, 3.0]),
        "plane": rrtik.constraints.on_plane(T.translation, [0.0, 0.6, 0.8]),
        "line": rrtik.constraints.on_line(T.translation, [0.0, 1.0, 0.0]),
    }


@pytest.mark.parametrize("spread", [0.3, 2.0])
@pytest.mark.parametrize("kind", cases())
def test_derivatives_are_those_of_differences(kind, spread):
    robot = rrtik.load_robot("ur5_limited")
    held = held_regions(robot, Scene(), [cases()[kind]], START)
    for q in START + np.random.default_rng(1).normal(0.0, spread, (20, 6)):
        values, J = equations(robot, held, q)
        assert values.shape == (equation_count(held),)
        steps = 1e-6 * np.eye(6)
        ends = [(equations(robot, held, q + s)[0] - equations(robot, held, q - s)[0]) / 2e-6 for s in steps]
        np.testing.assert_allclose(J, np.array(ends).T, atol=1e-6 * np.abs(J).max())


@pytest.mark.parametrize("kind", cases())
def test_ompl_projects_onto_the_region(kind):
    problem = problem_with(cases()[kind])
    constraint = RegionConstraint(problem)
    assert constraint.isSatisfied(START)
    done = 0
    for q in START + np.random.default_rng(2).normal(0.0, 0.2, (20, 6)):
        x = np.array(q)
        if constraint.project(x):
            done += 1
            assert problem.world.constraints.held(x[None])[0]
    assert done >= 15


def test_it_makes_a_projected_space():
    constraint = RegionConstraint(problem_with(cases()["plane"]))
    ambient, bounds = ob.RealVectorStateSpace(6), ob.RealVectorBounds(6)
    bounds.setLow(-3.0)
    bounds.setHigh(3.0)
    ambient.setBounds(bounds)
    space = ob.ProjectedStateSpace(ambient, constraint)
    assert space.getManifoldDimension() == 5


def test_a_problem_without_constraints_is_refused():
    with pytest.raises(InputError, match="no path constraints"):
        RegionConstraint(problem_with())


@pytest.mark.parametrize("turn", [1.7, 3.0, np.pi, -3.0])
def test_an_orientation_that_is_turned_round_does_not_satisfy_the_equations(turn):
    robot, kept = rrtik.load_robot("ur5"), np.array([0.0, -1.5, 1.5, -1.5, -0.5 * np.pi, 0.0])
    held = held_regions(robot, Scene(), [rrtik.constraints.orientation_of(robot.fk(kept), 2.0)], kept)
    q, step = kept + turn * np.eye(6)[5], 1e-6 * np.array([1.0, 2.0, -1.0, 3.0, 2.0, -2.0])
    assert not held.held(q[None])[0]
    assert np.linalg.norm(equations(robot, held, q)[0]) > 1.0
    if abs(turn) < 3.1:  # the axis of a half turn has no derivative
        change = equations(robot, held, q + step)[0] - equations(robot, held, q - step)[0]
        np.testing.assert_allclose(change, 2.0 * equations(robot, held, q)[1] @ step, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("angle", [0.3, 1.5, 1.6, 2.8, 3.14])
def test_a_leaning_axis_is_farther_the_more_it_leans(angle):
    """Along the way of its own derivatives too: a step of Gauss and Newton from behind leads back."""
    direction = np.array([0.0, 0.6, 0.8])
    across = np.array([1.0, 0.0, 0.0])
    lengths = []
    for each in (angle - 1e-4, angle, angle + 1e-4):
        axis = np.cos(each) * direction + np.sin(each) * np.cross(across, direction)
        lean, slope = _leaning(axis, direction)
        lengths.append(np.linalg.norm(lean))
    assert lengths[0] < lengths[1] < lengths[2]
    growth = lean @ slope @ across / lengths[2]
    assert growth == pytest.approx((lengths[2] - lengths[0]) / 2e-4, rel=0.01)


def test_an_axis_that_points_the_opposite_way_does_not_satisfy_the_equations():
    lean, slope = _leaning(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]))
    assert np.linalg.norm(lean) == pytest.approx(2.0)
    assert np.isfinite(slope).all()
