"""TITAN-4's inverse kinematics in closed form, its Jacobian and its singularities: the rows of its acceptance table."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import UnknownNameError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.analytic.analytic_solver import wrapped
from rrtik_ompl.ik.analytic.closed_form import family, form_of, solutions
from rrtik_ompl.ik.singularity import singularity_report
from rrtik_ompl.model.goal import pose_errors
from rrtik_robots.titan4 import TitanGeometry
from rrtik_robots.titan4.families import psi_interval
from rrtik_robots.titan4.singular_samples import CASES, singular_configurations
from rrtik_robots.titan4.singularities import determinant, nearness, wrist_radius
from rrtik_tests.inverse_kinematics import distance_to_branches

G = TitanGeometry()
RIGHT = np.pi / 2


@pytest.mark.parametrize("case", CASES)
def test_every_pose_is_solved_and_the_original_or_a_flagged_representative_is_among_the_answers(titan, case):
    count = 20_000 if case == "generic" else 4_000
    Q = singular_configurations(case, count, np.random.default_rng(0))
    poses = titan.fk_batch(Q)
    found = solutions(titan, poses)
    assert found.real.any(axis=1).all()
    assert found.residuals[found.real].max() < 1e-9
    bar = 1e-8 if case == "generic" else 1e-5  # a double root: theta3 is known to the square root of the rounding
    assert ((distance_to_branches(found, Q) < bar) | (found.singular > 0)).all()
    if case == "generic":
        assert not found.singular.any()


@pytest.mark.parametrize("case", [case for case in CASES if case != "generic"])
@pytest.mark.parametrize("away", [1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-4])
def test_poses_next_to_singular_ones_are_solved_too(titan, case, away):
    rng = np.random.default_rng(16)
    Q = singular_configurations(case, 1_000, rng) + away * rng.normal(size=(1_000, 6))
    found = solutions(titan, titan.fk_batch(Q))
    assert found.real.any(axis=1).all()
    assert found.residuals[found.real].max() < 1e-9


@pytest.mark.parametrize("case", CASES)
def test_asked_near_the_original_the_original_is_among_the_answers_of_every_singular_pose(titan, case):
    Q = singular_configurations(case, 4_000, np.random.default_rng(1))
    found = form_of(titan)(titan.fk_batch(Q), Q)  # joint limits aside, for so are the originals
    errors = np.abs(wrapped(found.q - Q[:, None])).max(axis=2)
    assert np.where(found.real, errors, np.inf).min(axis=1).max() < 1e-5


def test_a_singular_pose_that_is_asked_for_again_has_the_same_answers_near_each_posture(titan):
    Q = singular_configurations("shoulder wrist", 3, np.random.default_rng(3))
    pose = titan.fk_batch(Q[:1])
    first = solutions(titan, pose, near=Q[0])
    solutions(titan, pose, near=Q[1])  # the same pose near another posture, and others near the same
    solutions(titan, titan.fk_batch(Q[1:2]), near=Q[0])
    again, whole = solutions(titan, pose, near=Q[0]), solutions(titan, titan.fk_batch(Q), near=Q[[0, 0, 0]])
    np.testing.assert_array_equal(first.residuals, again.residuals)
    for name in ("branches", "real", "valid", "singular"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
        np.testing.assert_array_equal(getattr(first, name)[0], getattr(whole, name)[0])


@pytest.mark.parametrize(
    ("case", "flag"), [("wrist", 1), ("shoulder", 2), ("shoulder wrist", 3), ("case 1", 3), ("case 2", 2)]
)
def test_singular_families_are_flagged_by_name(titan, case, flag):
    found = solutions(titan, titan.fk_batch(singular_configurations(case, 500, np.random.default_rng(2))))
    assert (found.singular == flag).all()
    assert form_of(titan).families == ("wrist", "shoulder")


def test_the_residuals_are_those_of_the_robots_own_forward_kinematics(titan):
    poses = titan.fk_batch(singular_configurations("generic", 20, np.random.default_rng(3)))
    poses[10:, :3, 3] *= 1.5  # some out of reach
    found = solutions(titan, poses)
    for k in range(20):
        position, angle = pose_errors(titan.fk_batch(found.branches[k]), pin.SE3(poses[k]))
        np.testing.assert_allclose(found.residuals[k], np.column_stack([position, angle]), atol=1e-7)


def test_a_pose_out_of_reach_has_no_real_branch_and_its_residual_says_by_how_much(titan):
    pose = titan.fk_batch(np.zeros((1, 6)))
    pose[0, 0, 3] += 0.25
    found = solutions(titan, pose)
    assert not found.real.any()
    assert found.residuals[..., 0].min() == pytest.approx(0.25, abs=1e-9)


def test_the_number_of_real_branches_is_that_of_the_published_measurement(titan):
    """Mean over fully random postures 6.5; inside the limits 1 (63 %) or 2 (37 %) solutions, never more."""
    rng = np.random.default_rng(4)
    everywhere = solutions(titan, titan.fk_batch(rng.uniform(-np.pi, np.pi, (20_000, 6))), check=False)
    assert everywhere.real.sum(axis=1).mean() == pytest.approx(6.5, abs=0.1)
    inside = solutions(titan, titan.fk_batch(rng.uniform(titan.lower, titan.upper, (20_000, 6))), check=False)
    counts = np.bincount(inside.valid.sum(axis=1), minlength=3) / 20_000
    np.testing.assert_allclose(counts, [0, 0.63, 0.37], atol=0.015)


def test_valid_branches_are_within_the_limits_and_the_others_are_not(titan):
    found = solutions(titan, titan.fk_batch(np.random.default_rng(5).uniform(titan.lower, titan.upper, (500, 6))))
    rows = found.branches.reshape(-1, 6)
    np.testing.assert_array_equal((found.real.ravel() & titan.within_limits(rows)), found.valid.ravel())


def test_the_published_representative_of_a_wrist_pose_has_link_4_level_where_that_is_reachable(titan):
    Q = singular_configurations("wrist", 2_000, np.random.default_rng(6))
    found = form_of(titan)(titan.fk_batch(Q))
    psi = wrapped(found.q[..., 1:4].sum(axis=2))
    level = np.abs(psi[:, [0, 1]]).max(axis=1) < 1e-9  # front, first way of the wrist, both elbows
    radius = np.hypot(*(titan.fk_batch(Q) @ [0, 0, -G.d6, 1])[:, :2].T)
    height = (titan.fk_batch(Q) @ [0, 0, -G.d6, 1])[:, 2]
    reach = np.hypot(radius - G.a1 - G.a4, height)
    np.testing.assert_array_equal(level, (reach <= G.a2 + G.a3) & (reach >= G.a2 - G.a3))


def test_the_intervals_of_psi_are_where_a_scan_finds_the_triangle_closed():
    rng = np.random.default_rng(7)
    radius, height = rng.uniform(-1.5, 1.5, (2, 200, 1))
    psi = np.linspace(-np.pi, np.pi, 73)
    reach = np.hypot(radius - G.a1 - G.a4 * np.cos(psi), height - G.a4 * np.sin(psi))
    scanned = (reach <= G.a2 + G.a3) & (reach >= G.a2 - G.a3)
    centre, low, high, exists = psi_interval(G, radius, height)
    away = np.abs(wrapped(psi - centre))
    np.testing.assert_array_equal(scanned, exists & (away >= low) & (away <= high))


def test_the_family_of_a_singular_pose_is_a_curve_of_solutions_inside_the_limits(titan):
    q = np.radians([20, 30, -70, 40, 90, 10])
    curve = family(titan, titan.fk(q).homogeneous, samples=360)
    position, angle = pose_errors(titan.fk_batch(curve), titan.fk(q))
    assert len(curve) > 50
    assert max(position.max(), angle.max()) < 1e-9
    assert titan.within_limits(curve).all()
    assert np.abs(curve - q).max(axis=1).min() < np.radians(1.0)


def test_a_regular_pose_has_no_family_but_its_branches(titan):
    q = np.radians([20, 30, -70, 20, 30, 40])
    rows = family(titan, titan.fk(q).homogeneous)
    assert 1 <= len(rows) <= 2
    assert np.abs(rows - q).max(axis=1).min() < 1e-9


def frame_4_jacobian(q):
    """The published matrix, rows (angular; linear), in the axes of link 4 at the wrist point."""
    _, _, t3, t4, t5, _ = q
    psi, t34 = q[1:4].sum(), t3 + t4
    j51 = wrist_radius(G, q[None])[0]
    return np.array(
        [
            [np.sin(psi), 0, 0, 0, 0, np.cos(t5)],
            [0, -1, -1, -1, 0, np.sin(t5)],
            [np.cos(psi), 0, 0, 0, 1, 0],
            [0, G.a3 * np.sin(t4) + G.a2 * np.sin(t34), G.a3 * np.sin(t4), 0, 0, 0],
            [j51, 0, 0, 0, 0, 0],
            [0, G.a4 + G.a3 * np.cos(t4) + G.a2 * np.cos(t34), G.a4 + G.a3 * np.cos(t4), G.a4, 0, 0],
        ]
    )


def test_the_jacobian_is_the_published_one_moved_to_the_wrist_point(titan):
    for q in np.random.default_rng(8).uniform(-np.pi, np.pi, (50, 6)):
        tip, jacobian = titan.fk(q), titan.jacobian(q)
        arm = -G.d6 * tip.rotation[:, 2]
        linear = jacobian[:3] + np.cross(jacobian[3:].T, arm).T
        c1, s1, cp, sp = np.cos(q[0]), np.sin(q[0]), np.cos(q[1:4].sum()), np.sin(q[1:4].sum())
        axes = np.array([[c1 * cp, s1 * cp, sp], [-s1, c1, 0], [-c1 * sp, -s1 * sp, cp]])
        np.testing.assert_allclose(np.vstack([axes @ jacobian[3:], axes @ linear]), frame_4_jacobian(q), atol=1e-12)


def test_the_determinant_is_the_published_product(titan):
    Q = np.random.default_rng(9).uniform(-np.pi, np.pi, (1_000, 6))
    expected = determinant(G, Q)
    np.testing.assert_allclose(np.linalg.det([frame_4_jacobian(q) for q in Q]), expected, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.linalg.det(titan.jacobian_batch(Q))), np.abs(expected), atol=1e-12)


def stretched_over_the_base(bend, yaw):
    """The wrist point on axis 1 with a stretched elbow: theta4 = bend, theta5 = yaw."""
    along, across = G.a2 + G.a3 + G.a4 * np.cos(bend), G.a4 * np.sin(bend)
    lift = np.arccos(-G.a1 / np.hypot(along, across)) - np.arctan2(across, along)
    return np.array([0.3, lift, 0.0, bend, yaw, 0.2])


RANKS = [
    ("generic", (10, 20, -60, 30, 10, 0), 6, ()),
    ("straight wrist is regular", (10, 20, -60, 30, 0, 0), 6, ()),
    ("elbow", (10, 20, 0, 30, 10, 0), 5, ("elbow",)),
    ("wrist", (10, 20, -60, 30, 90, 0), 5, ("wrist", "case 3")),
    ("elbow and wrist", (10, 20, 0, 30, 90, 0), 5, ("elbow", "wrist", "case 3")),
    ("elbow and wrist, all in line", (10, 20, 0, 0, 90, 0), 4, ("elbow", "wrist", "case 3")),
]


@pytest.mark.parametrize(("what", "degrees", "rank", "active"), RANKS, ids=[row[0] for row in RANKS])
def test_the_rank_is_that_of_the_table(titan, what, degrees, rank, active):
    report = singularity_report(titan, np.radians(degrees))
    assert (report.rank, report.active) == (rank, active)


@pytest.mark.parametrize(("case", "rank"), [("shoulder", 5), ("shoulder wrist", 5), ("case 1", 5), ("case 2", 5)])
def test_the_rank_over_the_base_is_5(titan, case, rank):
    for q in singular_configurations(case, 50, np.random.default_rng(10)):
        report = singularity_report(titan, q)
        assert report.rank == rank
        assert "shoulder" in report.active


def test_rank_4_needs_the_listed_coincidences(titan):
    level = singular_configurations("case 1", 20, np.random.default_rng(11))
    level[:, 4] = RIGHT  # shoulder and wrist with link 4 level
    assert {singularity_report(titan, q).rank for q in level} == {4}
    ranks = {(bend, yaw): singularity_report(titan, stretched_over_the_base(bend, yaw)).rank
             for bend in (0.0, 0.5) for yaw in (0.0, 0.3, RIGHT)}  # fmt: skip
    assert ranks == {
        (0.5, 0.0): 4,  # elbow and shoulder, straight wrist
        (0.5, 0.3): 5,
        (0.5, RIGHT): 5,  # all three families together
        (0.0, 0.0): 4,
        (0.0, 0.3): 4,  # elbow and shoulder with A, B, C and P in line: not listed in [1, ch. 3]
        (0.0, RIGHT): 4,
    }


def test_cases_1_and_2_are_told_apart():
    for case in ("case 1", "case 2"):
        near = nearness(G, singular_configurations(case, 100, np.random.default_rng(12)))
        assert near[case].max() < 1e-7
        assert near[{"case 1": "case 2", "case 2": "case 1"}[case]].min() > 1e-3


@pytest.mark.parametrize("case", ["case 1", "case 2", "wrist"])
def test_moving_along_the_null_vector_keeps_the_pose(titan, case):
    """Ten degrees of self-motion in small steps, each brought back onto the pose by one Newton step."""
    for start in singular_configurations(case, 5, np.random.default_rng(13)):
        q, pose, moved, direction = start.copy(), titan.fk(start), 0.0, np.zeros(6)
        while moved < np.radians(10.0):
            null = np.linalg.svd(titan.jacobian(q))[2][-1]
            direction = null if null @ direction >= 0.0 else -null
            q = q + np.radians(0.25) * direction
            moved += np.radians(0.25)
            here = titan.fk(q)
            turn = pin.log3(pose.rotation @ here.rotation.T)
            q = q + np.linalg.pinv(titan.jacobian(q), rcond=1e-3) @ np.r_[pose.translation - here.translation, turn]
        position, angle = pose_errors(titan.fk_batch(q[None]), pose)
        assert max(position[0], angle[0]) < 1e-6
        assert np.linalg.norm(q - start) > np.radians(5.0)


def test_the_envelope_has_the_vendors_measures():
    """Straight wrist; from the azimuth axis and the mounting face: reach 1922, top 1984, bottom -1308, rear 1125 mm."""
    robot = load_robot("titan4", parameters={"limits": "envelope"})
    rng = np.random.default_rng(14)
    Q = rng.uniform(robot.lower, robot.upper, (200_000, 6))
    corners = rng.random((200_000, 6)) < 0.5  # extremes lie on limits and on the stretched arm
    Q = np.where(corners, np.clip(np.where(rng.random(Q.shape) < 0.5, 0.0, Q * 1e6), robot.lower, robot.upper), Q)
    x, y, z = robot.fk_batch(Q)[:, :3, 3].T
    assert np.hypot(x, y).max() == pytest.approx(1.922, abs=0.02)
    assert z.max() + G.shoulder_height == pytest.approx(1.984, abs=0.02)
    assert z.min() + G.shoulder_height == pytest.approx(-1.308, abs=0.02)
    assert x.min() == pytest.approx(-1.125, abs=0.02)


def test_another_geometry_has_its_own_closed_form():
    robot = load_robot("titan4", parameters={"lengths": {"d6": 0.333, "a4": 0.15}})
    Q = np.random.default_rng(15).uniform(-np.pi, np.pi, (500, 6))
    found = solutions(robot, robot.fk_batch(Q))
    assert distance_to_branches(found, Q).max() < 1e-8
    assert found.residuals[found.real].max() < 1e-9


def test_the_limits_stop_a_motion_that_the_jacobian_would_allow(titan):
    report = singularity_report(titan, [titan.upper[0], 0.3, -1.0, 0.4, 0.2, titan.lower[5]])
    assert report.at_limits == ("azimuth", "wrist_rotate")
    assert (report.rank, report.rank_inside_limits) == (6, 4)


def test_an_unknown_singular_case_names_those_there_are():
    with pytest.raises(UnknownNameError, match="case 1"):
        singular_configurations("case 9", 1, np.random.default_rng(0))
