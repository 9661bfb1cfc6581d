"""The PUMA 560 arms in closed form."""

import re

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import form_of, solutions
from rrtik_ompl.ik.singularity import singularity_report
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal, PositionGoal
from rrtik_robots.puma560.singular_samples import CASES, singular_configurations
from rrtik_tests.inverse_kinematics import distance_to_branches


@pytest.mark.parametrize("case", CASES)
def test_every_pose_is_solved_and_the_original_or_a_flagged_representative_is_among_the_answers(case):
    robot = load_robot("puma560")
    Q = singular_configurations(robot, case, 20_000 if case == "generic" else 4_000, np.random.default_rng(0))
    found = solutions(robot, robot.fk_batch(Q))
    assert found.valid.any(axis=1).all()
    assert found.residuals[found.real].max() < 1e-9
    assert ((distance_to_branches(found, Q) < 1e-8) | (found.singular > 0)).all()
    assert (found.singular > 0).all() == ("wrist" in case)
    asked = solutions(robot, robot.fk_batch(Q), near=Q, check=False)
    assert distance_to_branches(asked, Q).max() < 1e-8


def test_a_pose_inside_has_eight_different_branches():
    robot = load_robot("puma560")
    q = np.radians([40, 60, -120, 30, 40, 20])
    found = solutions(robot, robot.fk_batch(q[None]))
    assert found.real.all()
    gaps = np.abs(wrapped(found.branches[0][:, None] - found.branches[0][None])).max(axis=2) + 9.0 * np.eye(8)
    assert gaps.min() > 0.1


def test_joints_with_wide_limits_are_turned_into_them():
    robot = load_robot("puma560")
    Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (2_000, 6))
    found = solutions(robot, robot.fk_batch(Q), near=Q, check=False)
    errors = np.where(found.valid, np.abs(found.branches - Q[:, None]).max(axis=2), np.inf)
    assert errors.min(axis=1).max() < 1e-8  # the very values, not another turn
    assert robot.within_limits(found.branches[found.valid]).all()


def test_the_height_of_the_base_counts():
    robot = load_robot("puma560", parameters={"base_height": 0.0})
    q = np.radians([40, 60, -120, 30, 40, 20])
    assert distance_to_branches(solutions(robot, robot.fk_batch(q[None])), q[None])[0] < 1e-9


@pytest.mark.parametrize("parameters", [{}, {"lengths": {"d3": 0.05, "a3": -0.02}}])
def test_the_first_three_joints_reach_a_point_in_four_ways(parameters):
    robot = load_robot("puma560_3dof", parameters=parameters)
    Q = np.random.default_rng(2).uniform(robot.lower, robot.upper, (20_000, 3))
    found = solutions(robot, robot.fk_batch(Q))
    assert found.real.all()
    assert found.branches.shape == (20_000, 4, 3)
    assert found.residuals.max() < 1e-9
    assert distance_to_branches(found, Q).max() < 1e-8
    points = solutions(robot, robot.fk_batch(Q)[:, :3, 3])
    np.testing.assert_array_equal(points.branches, found.branches)


def test_a_point_beside_the_azimuth_axis_is_out_of_reach():
    robot = load_robot("puma560_3dof")
    found = solutions(robot, [[0.05, 0.0, 0.3]])  # the arm plane passes the axis at d3 = 0.124 m
    assert not found.real.any()
    assert found.residuals[..., 0].min() == pytest.approx(4.9 * 0.0254 - 0.05, abs=1e-9)


SINGULAR = [
    ("generic", (10, 30, -120, 20, 40, 10), 6, ()),
    ("wrist", (10, 30, -120, 20, 0, 10), 5, ("wrist",)),
    ("elbow", (10, 30, -np.degrees(np.arctan2(0.4318, 0.0203)), 20, 40, 10), 5, ("elbow",)),
]


@pytest.mark.parametrize(("what", "degrees", "rank", "active"), SINGULAR, ids=[row[0] for row in SINGULAR])
def test_singular_postures_are_named(what, degrees, rank, active):
    report = singularity_report(load_robot("puma560"), np.radians(degrees))
    assert (report.rank, report.active) == (rank, active)


def test_over_the_shoulder_the_arm_is_singular():
    robot = load_robot("puma560")
    for q in singular_configurations(robot, "shoulder", 20, np.random.default_rng(3)):
        report = singularity_report(robot, q)
        assert report.rank == 5
        assert "shoulder" in report.active


def test_the_form_says_what_its_branches_are():
    form = form_of(load_robot("puma560"))
    assert (form.kind, len(form.branches), form.families) == ("pose", 8, ("wrist",))
    assert form_of(load_robot("puma560_3dof")).kind == "position"


@pytest.mark.parametrize("d7", [0.05588, 0.2])
def test_five_joints_reach_their_own_poses_and_the_posture_asked_for_is_among_the_answers(d7):
    robot = load_robot("puma560_5dof", parameters={"lengths": {"d7": d7}})
    Q = np.random.default_rng(3).uniform(robot.lower, robot.upper, (20_000, 5))
    Q[:5_000, 4] = 0.0  # a straight wrist
    found = solutions(robot, robot.fk_batch(Q), near=Q)
    assert distance_to_branches(found, Q).max() < 1e-8
    assert found.residuals[found.real].max() < 1e-9
    assert found.valid.any(axis=1).all()


def test_five_joints_do_not_reach_a_pose_that_is_turned_about_its_approach_axis():
    robot = load_robot("puma560_5dof")
    q = np.radians([40.0, -60.0, 20.0, 30.0, 40.0])
    pose = robot.fk(q) * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.02), np.zeros(3))
    assert not solutions(robot, pose.homogeneous[None]).real.any()
    result = solve_ik(robot, PoseGoal(pose))
    assert (result.method, result.reason) == ("closed-form", "unreachable")
    assert re.search(r"the closest configuration is [\d.]+ mm and [01]\.\d* degrees away", result.detail)
    assert solve_ik(robot, PoseGoal(pose, orientation_tolerance=0.03)).found


def test_a_point_leaves_five_joints_free_so_auto_is_numeric_and_the_closed_form_says_why_it_does_not_fit():
    robot = load_robot("puma560_5dof")
    goal = PositionGoal(robot.fk(np.radians([40.0, -60.0, 20.0, 30.0, 40.0])).translation)
    assert solve_ik(robot, goal).method == "numeric"
    with pytest.raises(InputError, match=r"pose.*position.*numeric"):
        solve_ik(robot, goal, method="closed-form")
