"""Singular poses of the TITAN 4 inside the joint limits: a solution there is found whenever there is one."""

from types import MappingProxyType

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik import solve as module
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import form_of, solutions
from rrtik_ompl.ik.batch import solve_ik_many
from rrtik_ompl.ik.method_interface import IkResponse, Method
from rrtik_ompl.ik.methods import METHODS
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal
from rrtik_robots.titan4.singular_samples import CASES, configurations_inside, singular_configurations

FAMILIES = ("shoulder", "wrist", "shoulder wrist")
SINGULAR = [case for case in CASES if case not in ("generic", "elbow")]  # an elbow has no curve of solutions
SWEEP = 720


def inside(robot, case, count, seed=0):
    return configurations_inside(case, count, np.random.default_rng(seed), (robot.lower, robot.upper))


def within(q, low, high):
    """Which configurations, shape (..., 6), are inside limits up to full turns and the rounding of the last digits."""
    return (np.mod(q - low + 1e-7, TAU) <= high - low + 2e-7).all(axis=-1)


@pytest.mark.parametrize("case", SINGULAR)
def test_poses_made_inside_the_limits_have_a_branch_inside_them(titan, case):
    Q = inside(titan, case, 1_000)
    found = solutions(titan, titan.fk_batch(Q))
    assert found.valid.any(axis=1).all()
    assert titan.within_limits(found.branches[found.valid]).all()
    assert found.residuals[found.valid].max() < 1e-9


@pytest.mark.parametrize("case", SINGULAR)
def test_asked_near_the_original_the_original_is_kept(titan, case):
    Q = inside(titan, case, 1_000, seed=1)
    found = solutions(titan, titan.fk_batch(Q), near=Q, check=False)
    errors = np.abs(wrapped(found.branches - Q[:, None])).max(axis=2)
    assert np.where(found.valid, errors, np.inf).min(axis=1).max() < 1e-5


@pytest.mark.parametrize("method", ["auto", "closed-form"])
@pytest.mark.parametrize("case", FAMILIES)
def test_a_batch_of_a_thousand_poses_is_answered_whole(titan, case, method):
    poses = titan.fk_batch(inside(titan, case, 1_000, seed=2))
    batch = solve_ik_many(titan, poses, method=method)
    assert batch.found.all()
    assert titan.within_limits(batch.q, 0.0).all()
    np.testing.assert_allclose(titan.fk_batch(batch.q), poses, rtol=0, atol=1e-7)


@pytest.mark.parametrize("case", FAMILIES)
def test_single_poses_are_answered_by_the_closed_form_alone(titan, case):
    for q in inside(titan, case, 50, seed=3):
        goal = PoseGoal(titan.fk(q))
        for options in ({"method": "auto"}, {"method": "closed-form"}, {"method": "closed-form", "all": True}):
            result = solve_ik(titan, goal, **options)
            assert result.found, (np.degrees(q), result.detail)
            assert result.method == "closed-form"
            assert titan.within_limits(result.solutions, 0.0).all()
            assert goal.satisfied(titan, result.solutions).all()


def tip_by_pinocchio(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.pinocchio_configuration(q[None])[0])
    return data.oMf[robot.model.getFrameId(robot.tip)].homogeneous


def beside(robot, case, away, count, seed):
    """Configurations so far beside singular ones of a case, inside the limits."""
    rng = np.random.default_rng(seed)
    found = np.zeros((0, 6))
    while len(found) < count:
        Q = singular_configurations(case, 2_000, rng) + rng.uniform(-away, away, (2_000, 6))
        found = np.vstack([found, Q[robot.within_limits(Q, 0.0)]])
    return found[:count]


@pytest.mark.parametrize("away", [1e-11, 1e-9, 1e-8, 1e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("case", ["wrist", "elbow wrist", "shoulder wrist", "all psi"])
def test_beside_singular_postures_the_tip_is_at_the_pose_itself(titan, case, away):
    poses = titan.fk_batch(beside(titan, case, away, 40, seed=11))
    for pose in poses:
        result = solve_ik(titan, PoseGoal(pose))
        assert result.method == "closed-form"
        assert titan.within_limits(result.solutions, 0.0).all()
        np.testing.assert_allclose(tip_by_pinocchio(titan, result.solutions[0]), pose, rtol=0, atol=1e-9)

    batch = solve_ik_many(titan, poses)
    np.testing.assert_allclose(titan.fk_batch(batch.q), poses, rtol=0, atol=1e-9)
    assert batch.residuals.max() < 1e-9


def test_the_example_that_was_blamed_on_a_limit_is_solved(titan):
    q = np.radians([-67.5507, 77.5157, 63.4846, -84.1249, -90, -43.8143])  # the wrist point 26 nm beside the axis
    for options in ({"method": "auto"}, {"method": "closed-form"}, {"method": "closed-form", "all": True}):
        assert solve_ik(titan, PoseGoal(titan.fk(q)), **options).found


@pytest.mark.parametrize("width", [1.0, 1e-2, 1e-5])
@pytest.mark.parametrize("case", SINGULAR)
def test_however_narrow_the_limits_around_a_posture_it_is_found(titan, case, width):
    rng, form = np.random.default_rng(4), form_of(titan)
    Q = singular_configurations(case, 60, rng)
    for q, pose in zip(Q, titan.fk_batch(Q), strict=True):
        low, high = q - rng.uniform(0, width, 6), q + rng.uniform(0, width, 6)
        found = form(pose[None], None, 0.0, (low, high))
        fits = found.real[0] & within(found.q[0], low, high)
        assert fits.any(), np.degrees(q)
        turned = found.q[0, fits] + TAU * np.round((q - found.q[0, fits]) / TAU)
        np.testing.assert_allclose(titan.fk_batch(turned), np.tile(pose, (len(turned), 1, 1)), rtol=0, atol=1e-9)


@pytest.mark.parametrize("case", FAMILIES)
def test_where_none_is_found_a_sweep_along_the_curve_finds_none_either(titan, case):
    form = form_of(titan)
    Q = singular_configurations(case, 300, np.random.default_rng(5))
    poses = titan.fk_batch(Q)
    without = np.flatnonzero(~solutions(titan, poses, check=False).valid.any(axis=1))
    assert len(without) > 20
    hints = np.zeros((SWEEP, 6))
    hints[:, 0] = hints[:, 1] = np.linspace(-np.pi, np.pi, SWEEP, endpoint=False)
    for k in without:
        swept = form(np.tile(poses[k], (SWEEP, 1, 1)), hints)
        assert not (swept.real & within(swept.q, titan.lower, titan.upper)).any(), np.degrees(Q[k])


def test_the_nearest_members_lie_where_a_joint_comes_to_its_limit(titan):
    """Asked for psi = 0 the arm goes as far towards it as the limits allow, as a sweep along the curve does."""
    q = np.radians([20, 30, -70, 40, 90, 10])
    pose, form = titan.fk(q).homogeneous, form_of(titan)
    limits = q - np.radians([5, 4, 6, 7, 5, 8]), q + np.radians([5, 4, 6, 7, 5, 8])
    sums = np.linspace(q[1:4].sum() - 0.5, q[1:4].sum() + 0.5, 20_001)
    hints = np.zeros((len(sums), 6))
    for wanted in (sums[0], sums[-1]):
        near = np.array([[0.0, wanted, 0, 0, 0, 0]])
        found = form(pose[None], near, 0.0, limits)
        psi = found.q[0, found.real[0] & within(found.q[0], *limits), 1:4].sum(axis=1)
        hints[:, 1] = sums
        swept = form(np.tile(pose, (len(sums), 1, 1)), hints)
        reached = sums[(swept.real & within(swept.q, *limits)).any(axis=1)]
        assert np.abs(wrapped(psi - wanted)).min() == pytest.approx(np.abs(reached - wanted).min(), abs=1e-4)


def out_of_limits(titan):
    """A wrist pose that the arm reaches only with its azimuth beyond the limits, or folded backwards."""
    Q = singular_configurations("wrist", 100, np.random.default_rng(6))
    poses = titan.fk_batch(Q)
    return PoseGoal(poses[np.flatnonzero(~solutions(titan, poses, check=False).valid.any(axis=1))[0]])


@pytest.mark.parametrize("method", ["auto", "closed-form"])
def test_a_singular_pose_with_no_member_inside_says_that_of_all_of_them(titan, method):
    result = solve_ik(titan, out_of_limits(titan), method=method, seconds=0.05)
    assert (result.found, result.reason, result.method) == (False, "limits", "closed-form")
    assert "in many postures, all outside the limits" in result.detail


def test_auto_asks_the_numeric_method_where_the_closed_form_finds_nothing_of_a_curve(titan, monkeypatch):
    silent = Method(METHODS["closed-form"].misfit, lambda task: IkResponse(np.zeros((0, 6)), task.near, singular=True))
    monkeypatch.setattr(module, "METHODS", MappingProxyType({**METHODS, "closed-form": silent}))
    q = inside(titan, "wrist", 1)[0]
    assert not solve_ik(titan, PoseGoal(titan.fk(q)), method="closed-form").found
    result = solve_ik(titan, PoseGoal(titan.fk(q)))
    assert result.found
    assert result.method == "numeric"


def test_limits_that_no_sample_fits_into_are_refused(titan, monkeypatch):
    monkeypatch.setattr("rrtik_robots.titan4.singular_samples.ROUNDS", 2)
    with pytest.raises(InputError, match=r"0 of 5.*'wrist'"):
        configurations_inside("wrist", 5, np.random.default_rng(0), (titan.upper, titan.lower))
