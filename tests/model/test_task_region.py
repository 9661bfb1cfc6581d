"""Task-space regions: what lies in them, the nearest pose, inverse kinematics onto them, bad input."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose, pose_from_rpy, rotation_angles, rpy_matrices
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.ik.numeric.projection import project
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.ik.targets import targets
from rrtik_ompl.model.goal import GoalSet, PoseGoal, PositionGoal
from rrtik_ompl.model.goal_kind import TaskRegion, nearest_angles
from rrtik_ompl.model.robot import metres_per_radian

FREE = [-np.pi, np.pi]
angles = st.floats(-4.0, 4.0)
widths = st.sampled_from([0.0, 0.3, 2.0, 2 * np.pi])


def region(rng, free=0.7):
    """A random region: frames anywhere, some coordinates without a range."""
    low = rng.uniform(-1.0, 1.0, 6)
    wide = rng.uniform(0.0, 2.5, 6) * (rng.uniform(size=6) < free)
    frames = [pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-3, 3, 3)), rng.uniform(-1, 1, 3)) for _ in range(2)]
    return TaskRegion(frames[0], np.column_stack([low, low + wide]), frames[1])


@given(st.lists(st.tuples(angles, widths), min_size=3, max_size=3), st.integers(0, 1000))
def test_rotations_inside_the_bounds_are_their_own_nearest(ranges, seed):
    bounds = np.array([[low, low + width] for low, width in ranges])
    inside = rpy_matrices(np.random.default_rng(seed).uniform(bounds[:, 0], bounds[:, 1], (20, 3)))
    found = nearest_angles(inside, bounds)
    assert ((bounds[:, 0] <= found) & (found <= bounds[:, 1])).all()
    assert rotation_angles(np.swapaxes(rpy_matrices(found), 1, 2) @ inside).max() < 1e-6


@given(st.integers(0, 2), angles, widths, st.integers(0, 1000))
def test_with_one_range_no_rotation_inside_it_is_nearer_than_the_nearest(k, low, width, seed):
    rng, bounds = np.random.default_rng(seed), np.zeros((3, 2))
    bounds[k] = low, low + width
    given_ones = rpy_matrices(rng.uniform(-3, 3, (5, 3)))
    found = rpy_matrices(nearest_angles(given_ones, bounds))
    grid = rpy_matrices(np.linspace(bounds[:, 0], bounds[:, 1], 60))
    for R, nearest in zip(given_ones, found, strict=True):
        assert rotation_angles((nearest.T @ R)[None])[0] <= rotation_angles(np.swapaxes(grid, 1, 2) @ R).min() + 1e-6


def test_a_free_pitch_passes_the_quarter_turn_where_roll_and_yaw_cannot_be_told_apart():
    bounds = np.array([[0.0, 0.0], FREE, [0.0, 0.0]])
    for pitch in (0.5 * np.pi, 0.5 * np.pi + 1e-9, 2.0, 3.1, -0.5 * np.pi + 1e-7):
        R = rpy_matrices(np.array([[0.0, pitch, 0.0]])) @ rpy_matrices(np.array([[1e-5, 0.0, 1e-5]]))
        off = np.swapaxes(rpy_matrices(nearest_angles(R, bounds)), 1, 2) @ R
        assert rotation_angles(off)[0] < 2e-5


@given(st.integers(0, 10_000))
def test_drawn_poses_lie_in_the_region_and_the_nearest_pose_of_the_region_is_no_farther_than_any(seed):
    rng = np.random.default_rng(seed)
    asked = region(rng)
    poses = asked.poses(asked.drawn(20, rng))
    np.testing.assert_allclose(asked.poses(asked.nearest(poses)), poses, atol=1e-6)
    aside = poses.copy()
    aside[:, :3, 3] += rng.normal(size=(20, 3))
    nearest = asked.poses(asked.nearest(aside))
    away, farther = (np.linalg.norm((some - aside)[:, :3, 3], axis=1) for some in (nearest, poses))
    assert (away <= farther + 1e-6).all()


def test_a_pose_with_a_box_and_a_free_axis_and_the_same_task_region_agree():
    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    place = pose_from_rpy([0.3, 0.2, 0.5], [0.4, -0.8, 1.0])
    freed = GoalSet([PoseGoal(place)], "y", [0.2, 0.0, 0.1])
    same = TaskRegion(place, [[-0.1, 0.1], [0, 0], [-0.05, 0.05], [0, 0], FREE, [0, 0]])
    Q = rng.uniform(-3, 3, (50, 6))
    np.testing.assert_allclose(freed.distance(robot, Q), same.distance(robot, Q))
    tips = np.linalg.inv(place.homogeneous) @ robot.fk_batch(Q)
    tilt = np.arccos(np.clip(tips[:, 1, 1], -1.0, 1.0))  # what no turn about y removes
    np.testing.assert_allclose(same.errors(robot, Q)[1], tilt, atol=1e-7)


def test_positions_poses_and_regions_are_measured_in_the_same_metres():
    robot = load_robot("ur5")
    q = np.full((1, 6), 0.4)
    tip = robot.fk(q[0])
    lever = metres_per_radian(robot)
    aside = tip * pose([0.003, 0.0, 0.0])
    turned = PoseGoal(tip * pose_from_rpy([0, 0, 0], [0, 0, 0.2]), 1e-6, 1e-6)
    parts = {
        "position": (PositionGoal(tip.act(np.array([0.0, 0.5, 0.0]))), 0.5, (0.5, 0.0)),
        "pose": (PoseGoal(aside, 1e-6, 1e-6), 0.003, (0.003, 0.0)),
        "turned": (turned, 0.2 * lever, (0.0, 0.2)),
        "region": (TaskRegion(tip * pose([0.0, 0.0, 0.1]), np.zeros((6, 2))), 0.1, (0.1, 0.0)),
    }
    for part, distance, _ in parts.values():
        assert part.distance(robot, q) == pytest.approx([distance])
    for names in (("position", "pose"), ("position", "turned"), ("pose", "turned", "region"), ("region", "position")):
        _, distance, errors = min((parts[name] for name in names), key=lambda part: part[1])
        goal = GoalSet([parts[name][0] for name in names])
        assert goal.distance(robot, q) == pytest.approx([distance])
        assert np.ravel(goal.errors(robot, q)) == pytest.approx(errors, abs=1e-7)


def test_a_grasp_of_a_bar_turns_about_the_bar_and_slides_along_it():
    tip = pose([0.5, 0.0, 0.3])
    grasp = TaskRegion.about_axis(tip, [0, 1, 0], through=[0.6, 9.0, 0.3], turn=[0.0, 0.5 * np.pi], slide=[-0.1, 0.2])
    slid, turned = [0.0, 0.2, -0.1, 0.0], [0.0, 0.0, 0.5 * np.pi, 0.5]
    corners = grasp.poses(np.column_stack([np.zeros((4, 2)), slid, np.zeros((4, 2)), turned]))
    np.testing.assert_allclose(corners[0], tip.homogeneous, atol=1e-12)
    np.testing.assert_allclose(corners[1][:3, 3], [0.5, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(corners[2][:3, 3], [0.6, -0.1, 0.4], atol=1e-12)  # 0.1 m before the bar, now above it
    np.testing.assert_allclose(np.hypot(*(corners[:, [0, 2], 3] - [0.6, 0.3]).T), 0.1)


def test_poses_and_positions_are_regions_too():
    robot = load_robot("ur5")
    Q = np.random.default_rng(0).uniform(-3, 3, (20, 6))
    for goal in (PoseGoal(robot.fk(Q[0]), 0.02, 0.3), PositionGoal(robot.fk(Q[1]).translation, 0.05)):
        asked = goal.region()
        np.testing.assert_array_equal(asked.satisfied(robot, Q), goal.satisfied(robot, Q))
        np.testing.assert_allclose(asked.errors(robot, Q)[0], goal.errors(robot, Q)[0], atol=1e-12)


@pytest.mark.parametrize("name", ["ur5", "panda", "planar3"])
@settings(max_examples=5)
@given(seed=st.integers(0, 1000))
def test_every_walk_that_arrives_is_in_the_region_and_inside_the_limits(name, seed):
    robot, rng = load_robot(name), np.random.default_rng(seed)
    asked = region(rng)
    here = robot.clamp(rng.uniform(*robot.finite_range()))
    middle = pin.SE3(asked.poses(asked.drawn(1, rng))[0])
    asked = TaskRegion(robot.fk(here) * middle.inverse() * asked.T_world_w, asked.bounds, asked.T_w_tip)
    rows = project(robot, asked, np.vstack([here, rng.uniform(*robot.finite_range(), (30, robot.dof))]))
    assert robot.within_limits(rows).all()
    assert asked.satisfied(robot, rows)[0]


def test_an_arm_of_three_joints_reaches_a_region_that_leaves_the_rest_free():
    robot = load_robot("planar3")
    anywhere = TaskRegion(pose([1.0, 1.0, 0.0]), [[-0.2, 0.2], [0, 0], [0, 0], FREE, FREE, FREE], pose([0.1, 0, 0]))
    found = solve_ik(robot, anywhere, method="projection", seconds=30.0)
    assert found.found
    assert anywhere.satisfied(robot, found.solutions).all()
    assert found.residuals.max() < 1e-3


@pytest.mark.parametrize("name", ["titan4", "panda"])
def test_solve_ik_takes_grasp_sets_by_whatever_method_fits(name):
    robot = load_robot(name)
    q = robot.clamp(np.full(robot.dof, -0.4))
    handle = TaskRegion.about_axis(robot.fk(q), [0, 0, 1], slide=[-0.05, 0.05])
    goal = GoalSet([PoseGoal(pose([9, 0, 0])), handle])
    assert goal.has_regions
    found = solve_ik(robot, goal, seconds=20.0)
    assert found.found, found.detail
    assert found.method == {"titan4": "closed-form", "panda": "projection"}[name]
    assert goal.satisfied(robot, found.solutions).all()
    distance, angle = goal.errors(robot, found.solutions)
    assert distance.max() < 1e-3
    assert angle.max() < 1e-2


def test_a_region_out_of_reach_is_unreachable_and_says_by_how_much():
    found = solve_ik(load_robot("panda"), TaskRegion(pose([3, 0, 0]), [[0, 0.1]] + 5 * [[0, 0]]), seconds=20.0)
    assert found.reason == "unreachable"
    assert "m and" in found.detail


def test_of_a_large_grasp_set_any_member_may_be_drawn():
    goal = GoalSet([PoseGoal(pose([k, 0, 0])) for k in range(100)])
    drawn = {t.T_world_tip.translation[0] for seed in range(20) for t in targets(goal, 32, np.random.default_rng(seed))}
    assert len(drawn) > 90


AT = pose()
FIXED = np.zeros((6, 2))
BAD = {
    "bounds of another shape": (lambda: TaskRegion(AT, np.zeros((3, 2))), "bounds"),
    "not a number": (lambda: TaskRegion(AT, np.full((6, 2), np.nan)), r"bounds.*finite.*\[0, 0\] is nan"),
    "upside down": (lambda: TaskRegion(AT, [*FIXED[:4].tolist(), [0.3, 0.1], [0, 0]]), "pitch goes from 0.3 up to 0.1"),
    "a frame that scales": (lambda: TaskRegion(2.0 * np.eye(4), FIXED), "T_world_w"),
    "a tip that mirrors": (lambda: TaskRegion(AT, FIXED, np.diag([1.0, 1, -1, 1])), "T_w_tip.*orthonormal"),
    "no tolerance": (lambda: TaskRegion(AT, FIXED, position_tolerance=0.0), "position_tolerance: must be greater"),
    "a long axis": (lambda: TaskRegion.about_axis(AT, [0, 2, 0]), "axis must have length 1, but has 2"),
    "an axis of nothing": (lambda: TaskRegion.about_axis(AT, [0, 0, 0]), "axis must have length 1"),
    "a slide upside down": (
        lambda: TaskRegion.about_axis(AT, [0, 0, 1], slide=[0.1, 0]),
        "slide goes from 0.1 up to 0",
    ),
    "an empty set": (lambda: GoalSet([]), "at least one pose"),
    "a pose that is no list": (lambda: GoalSet(PoseGoal(AT)), "a list of at least one pose"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_regions_are_refused_in_one_line(case):
    make, message = BAD[case]
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
