"""Choice among branches: nearest to a posture, and without jumps along a trajectory."""

from dataclasses import replace

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.analytic.branch_choice import follow, nearest
from rrtik_ompl.ik.analytic.closed_form import solutions

LINE = np.linspace(0.0, 1.0, 201)[:, None]


def between(start, end):
    return np.radians(start) + LINE * (np.radians(end) - np.radians(start))


def residual(robot, q, poses):
    return np.abs(robot.fk_batch(q) - poses).max()


PATHS = {
    "regular": ("titan4", (10, 20, -60, 30, 10, 0), (60, 50, -100, 50, -40, 60)),
    "over the base": ("titan4", (0, 80, 20, 30, 20, 10), (0, 80, 60, 40, 20, 10)),
    "elbow": ("titan4", (10, 20, -30, 30, 10, 0), (10, 20, 30, -30, 10, 0)),
    "wrist on its limit": ("titan4", (10, 20, -60, 30, 90, 0), (40, 30, -80, 30, 90, 20)),
    "straight wrist of a puma": ("puma560", (10, 30, -120, 20, -40, 10), (20, 40, -100, 20, 40, 10)),
    "more than a turn": ("puma560", (10, 30, -120, 20, -40, -250), (20, 40, -100, 20, -40, 250)),
}


@pytest.mark.parametrize("name", PATHS)
def test_a_trajectory_is_followed_without_jumps_also_through_singular_postures(name):
    arm, start, end = PATHS[name]
    robot, path = load_robot(arm), between(start, end)
    poses = robot.fk_batch(path)
    track = follow(robot, poses, path[0])
    assert (track.jumps, track.gaps) == ((), ())
    assert np.abs(np.diff(track.q, axis=0)).max() < np.radians(5.0)
    assert residual(robot, track.q, poses) < 1e-9
    assert robot.within_limits(track.q).all()


@pytest.mark.parametrize("name", ["regular", "over the base", "straight wrist of a puma", "more than a turn"])
def test_where_the_way_is_unique_it_is_the_original_one(name):
    arm, start, end = PATHS[name]
    path = between(start, end)
    np.testing.assert_allclose(follow(load_robot(arm), load_robot(arm).fk_batch(path), path[0]).q, path, atol=1e-8)


def test_past_a_singular_posture_the_label_changes_and_is_reported():
    arm, start, end = PATHS["over the base"]
    path = between(start, end)
    track = follow(load_robot(arm), load_robot(arm).fk_batch(path), path[0])
    assert len(track.changes) == 1
    change = track.changes[0]
    assert track.branch[change - 1].startswith("front")
    assert track.branch[change].startswith("back")


def test_a_branch_that_runs_into_a_limit_later_is_not_taken():
    """Of two branches that both reach the first point, only one stays inside the limits up to the last."""
    robot = load_robot("planar3")
    path = between((40, -80, 60), (20, -80, 60))
    poses = robot.fk_batch(path)
    track = follow(robot, poses)
    assert (track.jumps, track.gaps) == ((), ())
    first, last = solutions(robot, poses[[0, -1]]).valid.sum(axis=1)
    assert (first, last) == (2, 1)


def test_points_out_of_reach_are_gaps_and_the_point_after_is_reported():
    robot, path = load_robot("titan4"), between(*PATHS["regular"][1:])
    poses = robot.fk_batch(path)
    poses[50:60, :3, 3] *= 3.0
    track = follow(robot, poses, path[0])
    assert track.gaps == tuple(range(50, 60))
    assert 60 in track.jumps
    assert np.isnan(track.q[50:60]).all()
    assert np.isfinite(track.q[60:]).all()


def test_a_trajectory_that_breaks_is_reported_where_it_jumps():
    robot, path = load_robot("titan4"), between(*PATHS["regular"][1:])
    track = follow(robot, robot.fk_batch(np.vstack([path[:20], path[150:]])), path[0])
    assert track.jumps == (20,)


def test_an_empty_trajectory_is_refused():
    with pytest.raises(InputError, match="at least one point"):
        follow(load_robot("titan4"), np.zeros((0, 4, 4)))


def test_the_nearest_solution_is_the_nearest_of_all_inside_the_limits():
    robot, rng = load_robot("titan4"), np.random.default_rng(0)
    Q, near = rng.uniform(robot.lower, robot.upper, (2, 300, 6))
    poses = robot.fk_batch(Q)
    q, reached = nearest(robot, poses, near)
    found = solutions(robot, poses)
    least = np.where(found.valid, np.linalg.norm(found.branches - near[:, None], axis=2), np.inf).min(axis=1)
    assert reached.all()
    np.testing.assert_allclose(np.linalg.norm(q - near, axis=1), least)


def test_weights_decide_which_solution_is_nearest():
    robot = load_robot("planar3")
    pose = robot.fk_batch(np.radians([[60, -60, 30]]))
    near = np.radians([60, 60, 30])  # the first joint of one solution, the second of the other
    by_first, _ = nearest(robot, pose, near, weights=[1, 0, 0])
    by_second, _ = nearest(robot, pose, near, weights=[0, 1, 0])
    np.testing.assert_allclose(np.degrees(by_first[0]), [60, -60, 30])
    assert np.degrees(by_second[0, 1]) == pytest.approx(60)


def test_of_a_singular_pose_the_nearest_member_of_the_curve_is_found():
    robot = load_robot("titan4")
    q = np.radians([20, 30, -70, 40, 90, 10])
    pose = robot.fk_batch(q[None])
    here, _ = nearest(robot, pose, q)
    np.testing.assert_allclose(here[0], q, atol=1e-6)
    near = q + np.radians([0, 10, -5, 20, -3, 10])
    found, reached = nearest(robot, pose, near)
    null = np.linalg.svd(robot.jacobian(found[0]))[2][-1]
    assert reached[0]
    assert robot.within_limits(found)[0]
    assert abs(null @ (found[0] - near)) < 1e-3  # at the foot of the perpendicular from the posture to the curve


def test_an_unreachable_target_has_no_nearest_solution():
    robot = load_robot("titan4")
    pose = robot.fk_batch(np.zeros((1, 6)))
    pose[0, 0, 3] += 1.0
    q, reached = nearest(robot, pose, np.zeros(6))
    assert not reached[0]
    assert np.isnan(q).all()


@pytest.mark.parametrize("near", [True, False])
def test_a_wrist_that_may_turn_several_times_is_followed_through_all_turns(near):
    arm = load_robot("puma560")
    wide = replace(arm, lower=np.append(arm.lower[:5], -20.0), upper=np.append(arm.upper[:5], 20.0))
    rows = np.tile([0.3, 0.5, -0.4, 0.2, 0.6, -19.0], (400, 1))
    rows[:, 5] = np.linspace(-19.0, 19.0, 400)
    track = follow(wide, wide.fk_batch(rows), rows[0] if near else None)
    assert (track.gaps, track.jumps) == ((), ())
    assert wide.within_limits(track.q).all()
    assert np.allclose(wide.fk_batch(track.q), wide.fk_batch(rows), atol=1e-9)
