"""Timed motions: they stay on the path, keep every limit everywhere, and survive a round trip through a file."""

import json

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import RateLimits, Trajectory, time_parameterize
from rrtik_ompl.motion.trajectory.limits import default_words
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.world import World

ON_PATH = 1e-9  # [rad]
values = st.one_of(st.floats(-3.0, 3.0), st.integers(-2, 2).map(float))
rates = st.floats(0.01, 20.0)


def rows_of(n):
    return st.lists(st.lists(values, min_size=n, max_size=n), min_size=2, max_size=6)


@st.composite
def tasks(draw):
    """A path that moves, and limits for its joints."""
    n = draw(st.integers(1, 5))
    rows = np.array(draw(rows_of(n).filter(lambda r: np.ptp(r, axis=0).max() > 1e-3)))
    if draw(st.booleans()):  # waypoints that coincide, and waypoints on a straight line
        rows = np.repeat(rows, 2, axis=0)
    limits = [draw(st.lists(rates, min_size=n, max_size=n)) for _ in range(3)]
    return JointPath(rows), RateLimits(*limits)


def dense(trajectory, count=3000):
    clock = np.linspace(0.0, trajectory.duration, count)
    return np.unique(np.concatenate([clock, trajectory.times]))


def distance_to_path(points, waypoints):
    """How far each point is from the nearest segment between waypoints."""
    ways = np.diff(waypoints, axis=0)
    lengths = np.maximum((ways**2).sum(axis=1), 1e-300)
    away = points[:, None] - waypoints[:-1]  # from the begin of each segment
    shares = np.clip((away * ways).sum(axis=2) / lengths, 0.0, 1.0)
    return np.linalg.norm(away - shares[..., None] * ways, axis=2).min(axis=1)


@settings(max_examples=80)
@given(tasks())
def test_a_motion_keeps_its_limits_on_a_dense_grid_and_in_its_peaks(task):
    path, limits = task
    motion = time_parameterize(path, limits)
    state, peaks = motion(dense(motion)), motion.peaks()
    for sampled, peak, limit in (
        (state.velocities, peaks.velocity, limits.velocity),
        (state.accelerations, peaks.acceleration, limits.acceleration),
    ):
        assert (np.abs(sampled).max(axis=0) <= limit * (1 + 1e-9)).all()
        assert (peak <= limit).all()
        assert (np.abs(sampled).max(axis=0) <= peak * (1 + 1e-9) + 1e-9).all()
    assert (peaks.jerk <= limits.jerk * (1 + 1e-9)).all()


@pytest.mark.slow
@settings(max_examples=80)
@given(tasks())
def test_a_motion_stays_on_the_path_and_keeps_its_ends(task):
    path, limits = task
    motion = time_parameterize(path, limits)
    points = motion(dense(motion)).positions
    assert distance_to_path(points, path.waypoints).max() <= ON_PATH
    assert (points[0] == path.start).all()
    assert (points[-1] == path.end).all()
    assert distance_to_path(path.waypoints, points).max() <= 0.01 * path.length  # and all of the path is travelled


@settings(max_examples=40)
@given(tasks())
@example((JointPath([[0.0], [3.0], [-2.0]]), RateLimits(np.array([0.01]), np.array([1.0]), np.array([10.0]))))
def test_velocities_and_accelerations_are_the_derivatives_of_the_positions(task):
    path, limits = task
    motion = time_parameterize(path, limits)
    step = 1e-7 * motion.duration  # the quotient's own error grows with its square, and is seen in motions of minutes
    clock = np.linspace(2 * step, motion.duration - 2 * step, 400)
    clock = clock[np.abs(clock[:, None] - motion.times).min(axis=1) > step]  # not across a knot
    slope = (motion(clock + step).positions - motion(clock - step).positions) / (2 * step)
    bend = (motion(clock + step).velocities - motion(clock - step).velocities) / (2 * step)
    state = motion(clock)
    assert np.allclose(slope, state.velocities, atol=1e-4 * limits.velocity.max())
    assert np.allclose(bend, state.accelerations, atol=1e-4 * limits.acceleration.max())


@settings(max_examples=40)
@given(tasks())
def test_a_motion_begins_and_ends_at_rest_and_stands_still_outside_its_time(task):
    path, limits = task
    motion = time_parameterize(path, limits)
    for t in (-1.0, 0.0, motion.duration, motion.duration + 1.0):
        assert np.allclose(motion(t).velocities, 0.0, atol=1e-9)
    assert (motion(-1.0).positions == path.start).all()
    assert (motion(motion.duration + 1.0).positions == path.end).all()
    assert (motion(motion.duration + 1.0).accelerations == 0.0).all()


def test_single_joint_moves_are_made_one_after_the_other():
    path = JointPath([[0, 0], [1, 0], [1, -1], [0.5, -1]])
    motion = time_parameterize(path, RateLimits([1, 1], [2, 2], [10, 10]))
    moving = np.abs(motion(dense(motion)).velocities) > 1e-9
    assert moving.sum(axis=1).max() == 1
    # ruckig's own figure for 1 rad under 1 rad/s, 2 rad/s^2, 10 rad/s^3 is 1.7 s
    assert motion.duration == pytest.approx(
        1.7 + 1.7 + time_parameterize(JointPath([[0], [0.5]]), RateLimits(1, 2, 10)).duration
    )


def test_without_a_jerk_limit_a_straight_motion_is_the_trapezoid():
    motion = time_parameterize(JointPath([[0.0], [1.0]]), RateLimits(1.0, 2.0))
    assert motion.duration == pytest.approx(1.5)
    assert motion.peaks().jerk == [np.inf]
    assert motion(0.25).velocities == pytest.approx([0.5])
    assert motion([0.75]).accelerations == pytest.approx(np.zeros((1, 1)))


def test_waypoints_that_coincide_or_lie_on_a_line_are_no_stops():
    limits = RateLimits([1.0, 1.0], [2.0, 2.0], [10.0, 10.0])
    once = time_parameterize(JointPath([[0, 0], [1, 1]]), limits)
    often = time_parameterize(
        JointPath([[0, 0], [0, 0], [0.3, 0.3], [0.3, 0.3 + 1e-12], [0.7, 0.7], [1, 1], [1, 1]]), limits
    )
    assert often.duration == pytest.approx(once.duration)
    there_and_back = time_parameterize(JointPath([[0, 0], [1, 1], [0.5, 0.5]]), limits)
    assert there_and_back.duration > once.duration
    assert (np.abs(there_and_back.positions - 1.0).max(axis=1) < ON_PATH).any()


# Rounded corners ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sdu():
    problem = load_problem("titan4_sdu")
    return problem, plan(problem, "RRTConnect", seed=1, shorten=False).path


@pytest.mark.parametrize("blend", [0.05, 0.3, 2.0])
def test_rounded_corners_are_faster_free_and_near_the_path(sdu, blend):
    problem, path = sdu
    limits = RateLimits.of(problem.robot, jerk=np.inf)
    motion = time_parameterize(path, limits, blend=blend, world=problem.world)
    peaks = motion.peaks()
    assert motion.duration < time_parameterize(path, limits).duration
    assert motion.faults(problem.world) == ()
    assert (peaks.velocity <= limits.velocity).all()
    assert (peaks.acceleration <= limits.acceleration).all()
    assert distance_to_path(motion(dense(motion)).positions, path.waypoints).max() <= 0.22 * blend
    assert (motion.positions[0] == path.start).all()
    assert (motion.positions[-1] == path.end).all()


@settings(max_examples=25)
@given(rows_of(3).filter(lambda r: np.ptp(r, axis=0).max() > 1e-3), st.floats(0.01, 1.0))
def test_rounded_corners_keep_velocity_and_acceleration_on_any_path(rows, blend):
    world = World(load_robot("planar3"))
    path, limits = JointPath.of(world.robot, rows), RateLimits([1.0, 0.5, 2.0], [2.0, 3.0, 0.7])
    motion = time_parameterize(path, limits, blend=blend, world=world)
    state = motion(dense(motion))
    assert (np.abs(state.velocities).max(axis=0) <= limits.velocity * (1 + 1e-9)).all()
    assert (np.abs(state.accelerations).max(axis=0) <= limits.acceleration * (1 + 1e-9)).all()
    assert distance_to_path(state.positions, path.waypoints).max() <= 0.22 * blend + ON_PATH


def test_a_corner_that_cannot_be_rounded_is_a_stop():
    import pinocchio as pin

    from rrtik_ompl.model.scene import Obstacle, Scene
    from rrtik_ompl.model.shapes import Box

    box = Obstacle("box", Box([2, 2, 2]), pin.SE3(np.eye(3), np.array([6.0, 4.0, 0.0])))
    world = World(load_robot("point2d", parameters={"radius": 0.1, "bounds": [[0, 10], [0, 10]]}), Scene([box]))
    path = JointPath.of(world.robot, [[4.89, 1.0], [4.89, 5.11], [9.0, 5.11]])  # close round the corner of the box
    motion = time_parameterize(path, RateLimits(1.0, 1.0), blend=3.0, world=world)
    assert motion.faults(world) == ()
    assert distance_to_path(motion.positions, path.waypoints).max() < 0.05


# Files --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", [".json", ".csv"])
@settings(max_examples=25)
@given(task=tasks())
def test_a_file_gives_back_the_same_motion(tmp_path_factory, ending, task):
    file = tmp_path_factory.mktemp("motions") / f"motion{ending}"
    motion = time_parameterize(*task)
    motion.save(file)
    again = Trajectory.load(file)
    for name in ("times", "positions", "velocities", "accelerations"):
        assert (getattr(again, name) == getattr(motion, name)).all()
    assert again.joint_names == motion.joint_names


def test_the_json_has_the_shape_of_a_joint_trajectory(tmp_path, sdu):
    problem, path = sdu
    file = tmp_path / "motion.json"
    time_parameterize(path, problem.robot).save(file)
    document = json.loads(file.read_text())
    assert document["joint_names"] == list(problem.robot.joint_names)
    assert set(document["points"][0]) == {"positions", "velocities", "accelerations", "time_from_start"}
    assert Trajectory.load(file, problem.robot).robot_name == "titan4"
    with pytest.raises(InputError, match="planar3"):
        Trajectory.load(file, load_robot("planar3"))


def test_a_message_of_ros_is_read_even_if_its_points_are_joined_by_other_curves(tmp_path):
    file = tmp_path / "message.json"
    points = [
        {"positions": [x], "velocities": [v], "accelerations": [7.0], "time_from_start": {"sec": k, "nanosec": 500}}
        for k, (x, v) in enumerate([(0.0, 0.0), (0.5, 0.75), (1.0, 0.0)])
    ]
    points[0]["time_from_start"] = {"sec": 0, "nanosec": 0}
    file.write_text(json.dumps({"joint_names": ["a"], "points": points}))
    motion = Trajectory.load(file)
    assert motion(1.0 + 5e-7).positions == pytest.approx([0.5])
    assert motion.duration == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.txt", "", "a path, not a timed motion"),
        ("a.json", "[1]", "trajectory file"),
        ("a.json", '{"points": [1]}', "list of objects"),
        ("a.json", '{"points": [{"positions": [0], "time_from_start": 0}]}', "point 1: no velocities"),
        ("a.json", '{"points": [{"positions": [0], "velocities": [0], "time_from_start": 0}]}', "two or more"),
        ("a.csv", "time,a\n0,0\n1,1\n", "is this a trajectory file"),
        ("a.csv", "time,a,a velocity,a acceleration\n0,0,0,0\n0,1,0,0\n", "greater than the last"),
        ("a.csv", "time,a,a velocity,a acceleration\n0,0,0,0\n1,1,nan,0\n", "finite"),
    ],
)
def test_a_file_that_holds_no_trajectory_is_refused_in_one_line(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        Trajectory.load(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path / name))


# Bad input ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "limit", [0.0, -1.0, float("nan"), [1.0, 0.0, 1.0], [1.0, 1.0], [], "fast", [[1.0], [1.0, 2.0]], None]
)
@pytest.mark.parametrize("name", ["velocity", "acceleration", "jerk"])
def test_limits_that_are_no_limits_are_refused(name, limit):
    given_limits = {"velocity": [1.0] * 3, "acceleration": [1.0] * 3, "jerk": [1.0] * 3} | {name: limit}
    with pytest.raises(InputError, match=f"{name} limits") as caught:
        RateLimits(**given_limits)
    assert "\n" not in str(caught.value)


def test_infinite_velocity_is_refused_and_infinite_jerk_is_none():
    with pytest.raises(InputError, match="finite"):
        RateLimits(np.inf, 1.0)
    assert np.isinf(RateLimits(1.0, 1.0).jerk).all()


@pytest.mark.parametrize(
    ("rows", "words"),
    [([[0.0, 0.0]], "one waypoint"), ([[1.0, 2.0]] * 3, "no motion"), ([[0.0] * 3, [1.0] * 3], "limits for 2")],
)
def test_a_path_that_cannot_be_timed_is_refused(rows, words):
    with pytest.raises(InputError, match=words):
        time_parameterize(JointPath(rows), RateLimits([1.0, 1.0], [1.0, 1.0]))


def test_a_path_with_a_number_that_is_none_is_refused():
    with pytest.raises(InputError, match="finite"):
        time_parameterize(JointPath([[0.0], [np.nan]]), RateLimits(1.0, 1.0))


@pytest.mark.parametrize("blend", [-1.0, np.nan])
def test_a_blend_that_is_none_is_refused(blend):
    with pytest.raises(InputError, match="blend"):
        time_parameterize(JointPath([[0.0], [1.0]]), RateLimits(1.0, 1.0), blend=blend)


@pytest.mark.parametrize("clearance", [-1e-3, np.nan, np.inf, "wide"])
def test_a_clearance_that_is_none_is_refused_also_where_nothing_is_blended(clearance):
    with pytest.raises(InputError, match="clearance"):
        time_parameterize(JointPath([[0.0], [1.0]]), RateLimits(1.0, 1.0), clearance=clearance)


@pytest.mark.parametrize("rows", [[[0.0, 0.0, 0.0], [0.5, 0.2, 0.0]], [[0.0] * 3, [0.1, 0.0, 0.0], [1e-11, 0.0, 0.0]]])
def test_a_path_that_is_shorter_than_what_a_blend_merges_stops_at_its_corners(rows):
    arm = load_robot("planar3")
    path, limits = JointPath.of(arm, rows), RateLimits([1.0] * 3, [2.0] * 3)
    for blend in (4.9, 5.1, 50.0, 1e6):
        motion = time_parameterize(path, limits, blend=blend, world=World(arm))
        assert motion.duration == pytest.approx(time_parameterize(path, limits).duration)


def test_a_blend_needs_a_world():
    with pytest.raises(InputError, match=r"world=problem\.world"):
        time_parameterize(JointPath([[0, 0], [1, 0], [1, 1]]), RateLimits(1.0, 1.0), blend=0.1)


@pytest.mark.parametrize("t", [np.nan, [0.0, np.inf], "now", [[1.0], [2.0, 3.0]], None])
def test_a_time_that_is_none_is_refused(t):
    with pytest.raises(InputError, match="time of a trajectory"):
        time_parameterize(JointPath([[0.0], [1.0]]), RateLimits(1.0, 1.0))(t)


def test_knots_that_do_not_fit_together_are_refused():
    with pytest.raises(InputError, match="point 2"):
        Trajectory([0.0, 1.0], [[0.0], [1.0]], [[0.0], [0.0]], [[0.0], [0.0]])


def test_the_limits_of_a_robot_are_taken_and_the_rest_is_a_documented_default():
    titan, planar = load_robot("titan4"), load_robot("planar3")
    assert (RateLimits.of(titan).velocity == titan.velocity).all()
    found = RateLimits.of(planar, acceleration=3.0)
    assert found.velocity.tolist() == [0.5] * 3
    assert found.acceleration.tolist() == [3.0] * 3
    assert found.jerk.tolist() == [30.0] * 3
    assert RateLimits.of(planar, share=0.5).velocity.tolist() == [0.25] * 3
    assert default_words(load_robot("panda")) == ""
    assert "acceleration of all joints (full speed after 0.5 s)" in default_words(load_robot("ur5"))
    assert "acceleration of" not in default_words(load_robot("ur5"), ["acceleration"])
    for share in (0.0, 1.5, np.nan):
        with pytest.raises(InputError, match="share"):
            RateLimits.of(planar, share=share)
    with pytest.raises(InputError, match="planar3"):
        RateLimits.of(planar, velocity=[1.0, 1.0])


@pytest.mark.kernels
@pytest.mark.parametrize("blend", [0.0, 0.2])
def test_many_paths_are_timed_to_the_bit_as_each_alone(blend):
    world = rrtik.load_problem("planar3_boxes").world
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 3))
    starts = starts[world.valid_batch(starts)]
    paths = [plan.path for plan in rrtik.plan_many(world, starts[:-1], starts[1:]) if plan.found][:8]
    limits = rrtik.RateLimits(1.0, 2.0, 20.0)
    alone = [rrtik.time_parameterize(path, limits, blend=blend, world=world) for path in paths]
    for threads in (1, 3):
        many = rrtik.time_parameterize_many(paths, limits, blend=blend, world=world, threads=threads)
        for one, other in zip(alone, many, strict=True):
            for name in ("times", "positions", "velocities", "accelerations"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_many_paths_name_the_one_that_cannot_be_timed():
    path = rrtik.JointPath([[0.0, 0.0], [1.0, 0.0]])
    still = rrtik.JointPath([[0.0, 0.0]])
    limits = rrtik.RateLimits(1.0, 2.0, 20.0)
    assert rrtik.time_parameterize_many([], limits) == []
    with pytest.raises(InputError, match=r"^paths\[1\]: path to time: it has one waypoint"):
        rrtik.time_parameterize_many([path, still], limits)
    with pytest.raises(InputError, match="expected one for each of 2, or one, got 1"):
        rrtik.time_parameterize_many([path, path], limits, blend=0.1, world=[None])
    with pytest.raises(InputError, match="threads"):
        rrtik.time_parameterize_many([path, path], limits, threads=0)
