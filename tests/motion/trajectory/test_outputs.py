"""What leaves the library: samples, messages, files, the report, the plot, the page."""

import json
import re

import numpy as np
import pytest
import yaml

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.files.text import MAX_BYTES
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import RateLimits, Trajectory, time_parameterize
from rrtik_ompl.motion.trajectory.text import is_own_mcap
from rrtik_ompl.viewer import view
from rrtik_ompl.viewer.plots.joints import plot_joints

LIMITS = RateLimits([1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [20.0, 20.0, 20.0])
ODD = RateLimits([1.07] * 3, [2.3] * 3, [19.0] * 3)  # with them phases of a motion end between two ticks of a drive
ROWS = [[0.0, 0.0, 0.0], [0.97, -0.53, 0.21], [0.3, 0.4, 0.0]]


@pytest.fixture(scope="module")
def robot():
    return load_robot("planar3")


@pytest.fixture(scope="module")
def motion(robot):
    return time_parameterize(JointPath.of(robot, [[0.0, 0.0, 0.0], [1.0, -0.5, 0.2]]), LIMITS)


def test_samples_come_at_the_control_rate_and_end_at_the_end(motion):
    samples = motion.sample(125.0)
    clock = samples.times
    assert np.allclose(np.diff(clock)[:-1], 0.008)
    assert 0.0 < clock[-1] - clock[-2] <= 0.008 * (1 + 1e-6)
    assert clock[-1] == motion.duration
    assert (samples.positions == motion(clock).positions).all()
    for rate in (0.0, -1.0, np.nan, "fast"):
        with pytest.raises(InputError, match="control rate"):
            motion.sample(rate)


def test_samples_are_the_array_of_their_positions(motion):
    samples = motion.sample(rate=125)
    assert np.asarray(samples) is samples.positions
    assert len(samples) == len(samples.times) == len(samples.velocities) == len(samples.accelerations)
    assert (samples[-1] == motion(motion.duration).positions).all()
    assert samples[2:5].shape == (3, 3)
    assert (np.array(list(samples)) == samples.positions).all()
    assert not samples.times.flags.writeable


def test_a_trajectory_is_an_array_at_a_rate_only_and_says_so(motion):
    for taken in (np.asarray, np.array, JointPath):
        with pytest.raises(InputError, match=r"at a rate: write .*sample\(rate=500\)"):
            taken(motion)
    with pytest.raises(TypeError, match="no len"):
        len(motion)


@pytest.mark.parametrize(("ending", "accelerations"), [("yaml", True), ("yaml", False), ("ros.json", True)])
def test_yaml_and_ros_json_are_the_message_of_ros_and_nothing_else(tmp_path, robot, motion, ending, accelerations):
    file = tmp_path / f"motion.{ending}"
    motion.save(file, rate=100.0, accelerations=accelerations)
    document = yaml.safe_load(file.read_text())
    assert list(document) == ["header", "joint_names", "points"]
    fields = {"positions", "velocities", "time_from_start"} | ({"accelerations"} if accelerations else set())
    for point in document["points"]:
        assert set(point) == fields
        assert set(point["time_from_start"]) == {"sec", "nanosec"}
        assert all(type(value) is int for value in point["time_from_start"].values())
        assert 0 <= point["time_from_start"]["nanosec"] < 10**9
    again = Trajectory.load(file, robot)
    clock = np.linspace(0.0, motion.duration, 500)
    assert np.abs(again(clock).positions - motion(clock).positions).max() < 1e-5
    assert not re.search(r"-0\.0[,\]]", file.read_text())


@pytest.mark.parametrize(
    ("text", "words"),
    [("a: [1", "line"), ("- 1", "points"), ("points: [{positions: [0]}]", "velocities"), ("{}", "points")],
)
def test_yaml_that_is_no_trajectory_is_refused_in_one_line(tmp_path, text, words):
    file = tmp_path / "a.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        Trajectory.load(file)
    assert "\n" not in str(caught.value)


def test_mcap_holds_joint_states_at_their_times(tmp_path, motion):
    reader = pytest.importorskip("mcap.reader")
    file = tmp_path / "motion.mcap"
    motion.save(file, rate=50.0)
    samples = motion.sample(50.0)
    with file.open("rb") as source:
        messages = [(m.log_time, json.loads(m.data)) for _, _, m in reader.make_reader(source).iter_messages()]
    assert [stamp for stamp, _ in messages] == [round(t * 1e9) for t in samples.times]
    assert np.allclose([found["position"] for _, found in messages], samples)
    assert messages[0][1]["name"] == list(motion.joint_names)


def test_mcap_is_read_back_as_the_motion_that_was_saved(tmp_path, motion):
    pytest.importorskip("mcap.reader")
    for options in ({}, {"rate": 50.0}):
        motion.save(tmp_path / "motion.mcap", **options)
        motion.save(tmp_path / "motion.csv", **options)
        read, same = (Trajectory.load(tmp_path / f"motion.{ending}") for ending in ("mcap", "csv"))
        assert read.joint_names == motion.joint_names
        assert np.abs(read.times - same.times).max() < 1e-9
        clock = np.linspace(0.0, motion.duration, 101)
        assert np.abs(read(clock).positions - same(clock).positions).max() < 1e-7

    data = (tmp_path / "motion.mcap").read_bytes()
    (tmp_path / "motion.mcap").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="MCAP") as caught:
        Trajectory.load(tmp_path / "motion.mcap")
    assert "\n" not in str(caught.value)


def test_the_report_names_peaks_switches_and_jumps(motion):
    found = motion.report(LIMITS)
    assert found.kept
    assert found.velocity.max() == pytest.approx(1.0)
    assert (found.switches * motion.duration == 1).all()  # once from pushing to braking
    assert (found.jump == 0.0).all()
    assert "within all limits" in str(found)
    brisk = time_parameterize(JointPath([[0.0], [1.0]]), RateLimits(1.0, 2.0))
    shown = brisk.report(RateLimits(0.5, 2.0))
    assert shown.jump == pytest.approx([2.0])
    assert not shown.kept
    assert "exceeds" in str(shown)
    assert "jumps by" in str(shown)
    with pytest.raises(InputError, match="limits for 3"):
        brisk.report(LIMITS)


def test_the_plot_draws_limits_and_marks_jumps(tmp_path):
    brisk = time_parameterize(JointPath([[0.0], [1.0]]), RateLimits(1.0, 2.0))
    files = [tmp_path / name for name in ("plain.svg", "limits.svg")]
    plot_joints(brisk, files[0])
    plot_joints(brisk, files[1], limits=RateLimits(1.0, 2.0))
    texts = [file.read_text() for file in files]
    assert len(texts[1]) > len(texts[0])
    smooth = time_parameterize(JointPath([[0.0], [1.0]]), RateLimits(1.0, 2.0, 10.0))
    plot_joints(smooth, files[1])
    assert files[1].read_text().count("<use") < texts[0].count("<use")  # four triangles less
    with pytest.raises(InputError, match="limits for 2"):
        plot_joints(brisk, files[0], limits=RateLimits([1.0, 1.0], 1.0))


def test_a_timed_motion_is_played_in_real_time(tmp_path, robot, motion):
    file = view(robot, motion, html=tmp_path / "page.html")
    text = file.read_text()
    story = json.loads(text[text.index('{"title"') :].partition("</script>")[0].rstrip().rstrip(";"))
    assert story["timed"] is True
    assert story["times"][-1] == pytest.approx(motion.duration)
    assert np.allclose(story["waypoints"], motion(story["times"]).positions, atol=1e-6)
    with pytest.raises(InputError, match="planar3"):
        view(robot, Trajectory([0.0, 1.0], [[0.0], [0.0]], [[0.0], [0.0]]), html=file)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, 1e300, 1e-300, "slow", None])
def test_a_factor_that_is_none_is_refused(factor):
    with pytest.raises(InputError, match="factor of a trajectory"):
        Trajectory([0.0, 1.0], [[0.0], [1.0]], [[0.0], [0.0]]).slowed(factor)


@pytest.mark.parametrize("rate", [50.0, 125.0, 300.0, 1000.0])
@pytest.mark.parametrize("ending", [".json", ".csv", ".yaml", ".ros.json"])
def test_set_points_stay_what_they_are_and_keep_the_limits_of_their_motion(tmp_path, robot, ending, rate):
    motion = time_parameterize(JointPath.of(robot, ROWS), ODD)
    file, again = tmp_path / f"motion{ending}", tmp_path / f"again{ending}"
    motion.save(file, rate=rate)
    found = Trajectory.load(file, robot)
    samples = motion.sample(rate)
    clock = samples.times
    state = (samples.positions, samples.velocities, samples.accelerations)
    at = found.set_points
    np.testing.assert_allclose(found.times[at], clock, rtol=0.0, atol=1e-9)
    for rows, wanted in zip((found.positions, found.velocities, found.accelerations), state, strict=True):
        np.testing.assert_array_equal(rows[at], wanted)
    np.testing.assert_allclose(found(clock).positions, samples, rtol=0.0, atol=2e-9)
    dense = np.linspace(0.0, motion.duration, 5000)
    assert np.abs(found(dense).positions - motion(dense).positions).max() < 20.0 / rate**3
    report = found.report(ODD)
    assert report.kept
    assert not report.jump.any()
    assert not found.report(RateLimits(ODD.velocity, ODD.acceleration, 0.9 * ODD.jerk)).kept
    found.save(again)
    assert again.read_text() == file.read_text()
    assert found.slowed(2.0).peaks().velocity == pytest.approx(0.5 * found.peaks().velocity)


def test_points_that_are_far_from_each_other_are_no_set_points(tmp_path, robot):
    motion = time_parameterize(JointPath.of(robot, ROWS), ODD)
    motion.save(tmp_path / "sparse.json", rate=10.0)
    sparse = Trajectory.load(tmp_path / "sparse.json")
    samples = motion.sample(10.0)
    state = (samples.positions, samples.velocities, samples.accelerations)
    assert sparse.set_points is None
    for found, wanted in zip(sparse(samples.times), state, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-9)
    assert not sparse.jumps().max() > 1e-6
    assert not sparse.report(ODD).kept


def test_set_points_of_a_motion_that_jumps_exceed_a_jerk_limit(tmp_path, robot):
    hard = time_parameterize(JointPath.of(robot, ROWS), RateLimits(1.07, 2.3))
    hard.save(tmp_path / "hard.csv", rate=100.0)
    found = Trajectory.load(tmp_path / "hard.csv")
    assert found.set_points is not None
    assert found.report(RateLimits(1.07, 2.3)).kept
    assert not found.report(ODD).kept


def test_a_tick_just_before_the_end_is_the_end(tmp_path, robot):
    motion = time_parameterize(JointPath.of(robot, ROWS), LIMITS)
    assert 3.1 < motion.duration < 3.1 + 1e-9
    assert np.diff(motion.sample(1000.0).times).min() > 0.9e-3
    motion.save(tmp_path / "motion.yaml", rate=1000.0)
    assert Trajectory.load(tmp_path / "motion.yaml").duration == pytest.approx(3.1)


def test_a_large_bag_of_another_program_is_told_by_its_header_alone(tmp_path):
    writer = pytest.importorskip("mcap.writer")
    bag = tmp_path / "bag.mcap"
    with bag.open("wb") as file:
        other = writer.Writer(file)
        other.start(library="another one")
        other.finish()
        file.truncate(MAX_BYTES + 1)
    assert not is_own_mcap(bag)
