"""Arms whose axes 2, 3, 4 are parallel and whose axes 5, 6 meet: found by their shape, all branches, singular poses."""

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import form_of, has_closed_form, solutions
from rrtik_ompl.ik.analytic.parallel_arm import SAMPLES, STEPS, parallel_form
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal

BASE = pose_from_rpy([1.0, -2.0, 0.5], [0.4, -0.7, 2.0])
ARMS = ("ur3_gripper", "ur5", "ur5_gripper", "ur10_limited", "z1")
IN_LINE = {"z1": np.pi / 2}  # values of joint 5 with which axis 6 is parallel to axis 2; 0 for the others


def drawn(robot, count, seed=0):
    return np.random.default_rng(seed).uniform(*robot.finite_range(), (count, robot.dof))


def off(found, Q):
    """How far each row of Q is from the nearest real branch, full turns aside."""
    errors = np.abs(wrapped(found.branches - Q[:, None])).max(axis=2)
    return np.where(found.real, errors, np.inf).min(axis=1)


def family(rng, **first):
    """A random arm of the family by its table; axes 3 and 4 may point the other way."""
    a, d, theta = rng.uniform(-0.5, 0.5, (3, 6))
    flips = np.pi * rng.integers(0, 2, 2)
    alpha = [rng.uniform(0.3, 2.8), *flips, rng.uniform(0.3, 2.8), rng.uniform(0.3, 2.8), rng.uniform(-3, 3)]
    a[4] = 0.0
    rows = [DhRow(*row) for row in zip(a, alpha, d, theta, strict=True)]
    return robot_from_dh(
        "arm", rows, convention="standard", tool=pose_from_rpy(*rng.uniform(-0.3, 0.3, (2, 3))), **first
    )


@pytest.mark.parametrize("name", ARMS)
def test_the_posture_that_a_pose_was_made_with_is_among_its_branches(name):
    robot = load_robot(name, base_pose=BASE)
    Q = drawn(robot, 300)
    found = solutions(robot, robot.fk_batch(Q), near=Q[0])
    assert off(found, Q).max() < 1e-6
    assert found.residuals[found.real].max() < 1e-9
    assert found.valid.any(axis=1).all()
    assert not found.singular.any()


def test_any_arm_of_the_family_is_solved_whichever_way_its_axes_point():
    rng = np.random.default_rng(3)
    for _ in range(20):
        robot = family(rng, base_pose=BASE)
        Q = drawn(robot, 20)
        found = solutions(robot, robot.fk_batch(Q))
        assert off(found, Q).max() < 1e-5
        assert found.residuals[found.real].max() < 1e-9


@pytest.mark.parametrize(("place", "value"), [((1, "alpha"), 1e-7), ((4, "a"), 1e-7), ((4, "alpha"), 1e-3)])
def test_an_arm_that_is_nearly_of_the_family_is_not_of_it(place, value):
    rows = [{"alpha": 1.5, "d": 0.1}, {"a": 0.4}, {"a": 0.4}, {"alpha": 1.5, "d": 0.1}, {"alpha": -1.5}, {"d": 0.1}]
    assert has_closed_form(robot_from_dh("arm", [DhRow(**row) for row in rows], convention="standard"))
    rows[place[0]] = {**rows[place[0]], place[1]: value}
    robot = robot_from_dh("arm", [DhRow(**row) for row in rows], convention="standard")
    assert not has_closed_form(robot)
    with pytest.raises(InputError, match="2, 3, 4 are parallel and 5, 6 meet"):
        form_of(robot)


@pytest.mark.parametrize("name", ARMS)
def test_of_a_pose_with_axis_6_along_axis_2_the_members_that_are_wanted_are_given(name):
    robot = load_robot(name)
    Q = drawn(robot, 100)
    Q[:, 4] = IN_LINE.get(name, 0.0)
    Q[:, 4] += np.pi * np.random.default_rng(1).integers(-1, 1, 100)
    found = form_of(robot)(robot.fk_batch(Q), Q)  # joint limits aside
    assert (found.singular == 1).all()
    errors = np.abs(wrapped(found.q - Q[:, None])).max(axis=2)
    assert np.where(found.real, errors, np.inf).min(axis=1).max() < 1e-6
    assert (form_of(robot).nearness(Q)["wrist"] < 1e-9).all()
    assert (form_of(robot).nearness(drawn(robot, 100))["wrist"] > 1e-9).all()


@pytest.mark.parametrize("away", [1e-6, 1e-5, 1e-3])
def test_poses_next_to_singular_ones_are_solved_as_well_as_others(away):
    robot = load_robot("ur5")
    Q = drawn(robot, 100, 5)
    Q[:, 4] = away
    found = solutions(robot, robot.fk_batch(Q), near=Q)
    assert found.residuals[found.real].max() < 1e-9
    assert not found.singular.any()
    assert solutions(robot, robot.fk_batch(Q), near=Q, slack=2.0 * away).singular.all()


def test_where_p_is_on_axis_1_the_members_that_are_wanted_are_given():
    robot = load_robot("titan4")  # whose own form is another
    form = parallel_form(robot)
    Q = drawn(robot, 400, 2)
    Q[:, 2] = -np.pi / 2  # P goes through axis 1 somewhere
    for _ in range(60):
        sizes = form.nearness(Q)["shoulder"]
        Q[:, 1] -= sizes * 1e-6 / (form.nearness(Q + np.array([0, 1e-6, 0, 0, 0, 0]))["shoulder"] - sizes)
    Q = Q[form.nearness(Q)["shoulder"] < 1e-12]
    assert len(Q) > 100
    found = form(robot.fk_batch(Q), Q)
    assert (found.singular & 2).all()
    errors = np.abs(wrapped(found.q - Q[:, None])).max(axis=2)
    assert np.where(found.real, errors, np.inf).min(axis=1).max() < 1e-5


def test_members_are_tried_from_the_wanted_one_outwards_over_half_a_turn():
    assert len(np.unique(STEPS.round(9))) == SAMPLES
    assert (np.diff(np.abs(STEPS)) >= 0.0).all()
    assert np.ptp(STEPS) == pytest.approx(np.pi, abs=0.2)


@pytest.mark.parametrize("name", ARMS)
def test_auto_solves_singular_poses_inside_the_limits(name):
    robot = load_robot(name)
    Q = drawn(robot, 60, 4)
    Q[:, 4] = IN_LINE.get(name, 0.0)
    Q = Q[robot.within_limits(Q)]
    for q in Q:
        goal = PoseGoal(robot.fk(q))
        result = solve_ik(robot, goal, near=q)
        assert result.found
        assert goal.satisfied(robot, result.solutions).all()


def test_every_branch_of_a_ur_stands_in_the_turns_nearest_to_the_hint():
    robot = load_robot("ur5")
    q = np.array([0.3, -1.2, 1.0, -0.4, 1.1, 0.2])
    near = np.array([6.0, -5.0, 1.0, 5.5, -5.5, 6.0])
    result = solve_ik(robot, robot.fk(q), near=near, all=True)
    assert len(result.solutions) == 8
    steps = np.abs(result.solutions - near)
    turned = (np.abs(result.solutions) > np.pi).any()
    free = (result.solutions + 2 * np.pi * np.sign(near - result.solutions) <= robot.upper) & (
        result.solutions + 2 * np.pi * np.sign(near - result.solutions) >= robot.lower
    )
    assert turned
    assert (steps[free] <= np.pi + 1e-9).all()
