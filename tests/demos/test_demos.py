"""Demonstrations: the same data however they are made, interrupted or spread; what they say is what was planned."""

import json
import os
import resource

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.app import run
from rrtik_ompl.demos import Displacement, Randomness, record
from rrtik_ompl.demos.folder import ATTEMPTS, EPISODES, SUMMARY

pytestmark = pytest.mark.kernels

REACH = """\
version: 1
robot: ur5
scene:
  obstacles:
    - {name: post, box: [0.05, 0.05, 0.6], pose: {xyz: [0.45, 0.0, 0.3]}}
start: {joints: [0.5, -1.6, 1.8, -0.2, 1.6, 0.0]}
task:
  - move_to: {position: [0.45, -0.3, 0.4]}
random:
  objects:
    post: {y: [-0.25, 0.25]}
  goals: {x: [-0.1, 0.1], z: [-0.1, 0.1]}
  instruction: reach the point
"""


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "reach.yaml").write_text(REACH)


def content(folder):
    """All files of a folder."""
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_an_so101_takes_its_block_in_each_draw_and_puts_it_down_on_the_other_side():
    made = record("so101_pick_place", 8, "blocks", jobs=1)
    assert made.attempts == made.count
    for file in sorted(made.dataset.iterdir()):
        arrays = np.load(file)
        poses = arrays["object_pose"][:, 0]
        still = np.abs(poses - poses[0]).max(axis=1) < 1e-6
        closed = arrays["gripper"] < 0.2
        assert closed[~still].any()
        assert still[: closed.argmax()].all()  # it is not moved before the jaw has closed
        assert arrays["gripper"][-1] == pytest.approx(0.7, abs=1e-3)
        assert np.abs(poses[-1, :3] - [0.19, -0.095, 0.02]).max() < 0.0401
        assert np.abs(poses[-1, 3:5]).max() < 1e-3  # it stands upright, turned anyhow


def test_the_same_data_come_out_by_processes_after_interruptions_and_in_parts(tmp_path):
    made = record("reach.yaml", 5, "whole", seed=3, jobs=1)
    whole = content(tmp_path / "whole")
    assert made.complete
    assert made.count == 5
    assert len(whole) == 7

    record("reach.yaml", 5, "spread", seed=3, jobs=2)
    assert content(tmp_path / "spread") == whole

    def stop(progress):
        if progress.attempts in (2, 3):
            raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            record("reach.yaml", 5, "killed", seed=3, jobs=1, on_attempt=stop)
    with open(tmp_path / "killed" / ATTEMPTS, "a") as file:
        file.write('{"attempt": 3, "fou')  # half a line, as a process leaves it that is killed as it writes
    kept = content(tmp_path / "killed" / EPISODES)
    assert len(kept) == 3
    record("reach.yaml", 5, "killed", seed=3, jobs=1)
    assert content(tmp_path / "killed") == whole

    record("reach.yaml", 2, "parts", seed=3, jobs=1)
    record("reach.yaml", 5, "parts", seed=3, jobs=1)
    assert content(tmp_path / "parts") == whole

    (tmp_path / "parts" / EPISODES / "000001.npz").unlink()  # it is made again
    record("reach.yaml", 5, "parts", seed=3, jobs=1)
    assert content(tmp_path / "parts") == whole

    record("reach.yaml", 5, "other", seed=4, jobs=1)
    assert content(tmp_path / "other" / EPISODES) != content(tmp_path / "whole" / EPISODES)


def test_failed_attempts_are_counted_and_made_up_for(tmp_path):
    hard = REACH.replace("goals: {x: [-0.1, 0.1]", "goals: {x: [-0.1, 0.8]")  # often out of reach
    (tmp_path / "hard.yaml").write_text(hard)
    made = record("hard.yaml", 4, "out", jobs=1)
    lines = [json.loads(line) for line in (tmp_path / "out" / ATTEMPTS).read_text().splitlines()[1:]]
    assert made.complete
    assert sum(made.failures.values()) == made.attempts - 4 > 0
    assert [line["attempt"] for line in lines] == list(range(made.attempts))
    assert lines[-1]["found"]  # no attempt more than it takes
    summary = json.loads((tmp_path / "out" / SUMMARY).read_text())
    assert (summary["count"], summary["attempts"], summary["failed"]) == (4, made.attempts, made.attempts - 4)


def test_a_task_that_never_succeeds_ends_with_its_reason(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("rrtik_ompl.demos.recording.FIRST", 3)
    (tmp_path / "far.yaml").write_text(REACH.replace("position: [0.45, -0.3, 0.4]", "position: [9.0, 0.0, 0.4]"))
    assert run(["demos", "far.yaml", "--out", "out", "--count", "5", "--jobs", "1"]) == 1
    assert "0 of 5 demonstrations after 3 attempts; 3 times: " in capsys.readouterr().err.replace("\n  ", " ")


def test_a_pick_and_place_says_where_arm_gripper_and_object_are(tmp_path):
    aside = Displacement(x=(-0.05, 0.05), yaw=(-0.5, 0.5))
    loaded = rrtik.Task.load("panda_pick_place")
    task = rrtik.Task(loaded.stages, loaded.world, loaded.start, name="cups", random=Randomness({"cup": aside}))
    record(task, 1, "out", rate=50.0, jobs=1)
    arrays = np.load(tmp_path / "out" / EPISODES / "000000.npz")
    robot = task.world.robot
    line = json.loads((tmp_path / "out" / ATTEMPTS).read_text().splitlines()[1])

    assert np.allclose(np.diff(arrays["time"]), 1.0 / 50.0)
    assert (np.abs(arrays["position"][0] - robot.posture("ready")) < 1e-9).all()
    assert np.allclose(arrays["velocity"][[0, -1]], 0.0, atol=1e-6)
    middle = 0.5 * (arrays["velocity"][1:] + arrays["velocity"][:-1])
    assert np.abs(50.0 * np.diff(arrays["position"], axis=0) - middle).max() < 0.1  # [rad/s] at 20 ms

    poses = arrays["object_pose"][:, 0]
    assert np.allclose(poses[0], line["drawn"]["cup"])
    assert np.abs(np.diff(poses, axis=0)).max() < 0.06  # it does not jump
    moving = np.flatnonzero(np.abs(np.diff(poses[:, :3], axis=0)).max(axis=1) > 1e-9)
    held = slice(moving[0] + 1, moving[-1] + 1)

    # While it moves the hand holds it: its place in the hand stays, and the fingers are as far apart as it is wide.
    hand = robot.fk_batch(arrays["position"][held], "panda_hand")
    in_hand = np.einsum("kji,kj->ki", hand[:, :3, :3], poses[held, :3] - hand[:, :3, 3])
    assert np.ptp(in_hand, axis=0).max() < 1e-9
    assert np.allclose(arrays["gripper"][held], 0.05 / robot.gripper.width)
    assert arrays["gripper"][0] == arrays["gripper"][-1] == 1.0
    assert np.abs(np.diff(arrays["gripper"])).max() < 0.1 + 1e-9  # at 0.2 m/s, the limit of its joints
    assert (np.diff(arrays["motion"]) >= 0).all()


def test_the_dataset_of_lerobot_has_the_same_numbers(tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    pd = pytest.importorskip("pandas")
    made = record("reach.yaml", 3, "out", format="lerobot", jobs=1)
    root = tmp_path / "out" / "lerobot"
    info = json.loads((root / "meta" / "info.json").read_text())
    rows = pd.read_parquet(root / info["data_path"].format(chunk_index=0, file_index=0))
    episodes = pd.read_parquet(root / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    assert made.dataset.resolve() == root
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["fps"]) == (3, len(rows), 30)
    assert set(info["features"]) == set(rows.columns)
    tasks = pd.read_parquet(root / "meta" / "tasks.parquet")
    assert tasks.index.tolist() == ["reach the point"]
    assert tasks.task_index.tolist() == [0]

    robot = rrtik.load_robot("ur5")
    for episode in range(3):
        arrays = np.load(tmp_path / "out" / EPISODES / f"{episode:06d}.npz")
        row = episodes.iloc[episode]
        own = rows.iloc[row.dataset_from_index : row.dataset_to_index]
        state = np.vstack(own["observation.state"])
        assert row.length == len(own) == len(arrays["time"])
        assert (own.episode_index == episode).all()
        assert np.allclose(np.radians(state), arrays["position"], atol=1e-6)
        assert np.allclose(np.vstack(own["action"])[:-1], state[1:])
        assert np.allclose(own.timestamp, arrays["time"], atol=1e-6)
        around = np.vstack(own["observation.environment_state"])
        assert np.allclose(around, arrays["object_pose"].reshape(len(own), 7), atol=1e-6)
    assert info["features"]["action"]["names"] == [f"{name}.pos" for name in robot.joint_names]

    statistics = json.loads((root / "meta" / "stats.json").read_text())
    for name, found in statistics.items():
        values = np.vstack(rows[name]).astype(np.float64)
        for word, expected in (("mean", values.mean(0)), ("std", values.std(0)), ("min", values.min(0))):
            assert np.allclose(found[word], expected, rtol=1e-9, atol=1e-9), (name, word)
        assert found["count"] == [len(rows)]
        assert (np.diff([found[word] for word in ("min", "q01", "q10", "q50", "q90", "q99", "max")], axis=0) >= 0).all()
    assert pq.read_schema(root / "data" / "chunk-000" / "file-000.parquet").field("action").type.list_size == 6


def test_large_datasets_of_lerobot_have_several_files(tmp_path, monkeypatch):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    monkeypatch.setattr("rrtik_ompl.demos.lerobot.FILE_MB", 0.01)
    monkeypatch.setattr("rrtik_ompl.demos.lerobot.CHUNK", 2)
    record("reach.yaml", 3, "out", format="lerobot", jobs=1, rate=200)
    root = tmp_path / "out" / "lerobot"
    episodes = pd.concat(pd.read_parquet(file) for file in sorted((root / "meta" / "episodes").rglob("*.parquet")))
    assert len(list((root / "data").rglob("*.parquet"))) > 1
    for _, row in episodes.iterrows():
        file = root / "data" / f"chunk-{row['data/chunk_index']:03d}" / f"file-{row['data/file_index']:03d}.parquet"
        own = pd.read_parquet(file)
        assert (own.episode_index == row.episode_index).sum() == row.length


def test_the_hdf5_file_has_the_same_numbers(tmp_path):
    h5py = pytest.importorskip("h5py")
    record("reach.yaml", 2, "out", format="hdf5", jobs=1)
    with h5py.File(tmp_path / "out" / "demos.hdf5") as file:
        assert json.loads(file["data"].attrs["env_args"])["env_name"] == "reach"
        assert sorted(file["data"]) == ["demo_0", "demo_1"]
        for number, demo in enumerate(file["data"].values()):
            arrays = np.load(tmp_path / "out" / EPISODES / f"{number:06d}.npz")
            assert demo.attrs["num_samples"] == len(arrays["time"]) == len(demo["dones"])
            assert np.array_equal(demo["obs/joint_pos"], arrays["position"])
            assert np.array_equal(demo["actions"][:-1], demo["states"][1:])
            assert demo["dones"][:].tolist() == [0] * (len(demo["dones"]) - 1) + [1]


@pytest.mark.parametrize(("format", "size"), [("npz", 3_000), ("hdf5", 12_000), ("lerobot", 12_000)])
def test_a_full_disk_gets_a_line_and_leaves_nothing_half(tmp_path, format, size):
    for name in {"hdf5": "h5py", "lerobot": "pyarrow", "npz": "numpy"}[format].split():
        pytest.importorskip(name)
    record("reach.yaml", 2, "out", jobs=1, rate=10.0)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))  # a file larger than that cannot be written
        with pytest.raises(InputError, match="what is done is kept") as error:
            record("reach.yaml", 3, "out", jobs=1, rate=10.0, format=format)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "\n" not in str(error.value)
    assert not [name for name in os.listdir(tmp_path / "out") if name.startswith(".")]
    record("reach.yaml", 3, "out", jobs=1, rate=10.0, format=format)
    record("reach.yaml", 3, "new", jobs=1, rate=10.0, format=format)
    whole, resumed = (content(tmp_path / name) for name in ("new", "out"))
    assert whole.keys() == resumed.keys()
    assert [name for name in whole if whole[name] != resumed[name] and not name.endswith("hdf5")] == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"count": 0}, "count"),
        ({"rate": float("nan")}, "rate"),
        ({"share": -1.0}, "share"),
        ({"pause": -1.0}, "pause"),
        ({"format": "csv"}, "no format 'csv'"),
        ({"format": "lerobot", "rate": 12.5}, "a whole number of ticks per second, got 12.5"),
        ({"jobs": 0}, "jobs"),
        ({"jobs": 2, "scheduler": "tcp://127.0.0.1:1"}, "give jobs or scheduler, not both"),
        ({"task": "none.yaml"}, "none.yaml: no such file"),
        ({"task": "titan4_drawer"}, "give its file a section random:"),
        ({"out": 3}, "name of a file"),
    ],
)
def test_wrong_arguments_get_a_line(options, said):
    given = {"task": "reach.yaml", "count": 1, "out": "out", **options}
    with pytest.raises(InputError) as error:
        record(given.pop("task"), given.pop("count"), given.pop("out"), **given)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_another_recording_in_the_folder_is_refused(tmp_path):
    record("reach.yaml", 1, "out", jobs=1)
    with pytest.raises(InputError, match="was begun with another seed; choose another --out"):
        record("reach.yaml", 1, "out", jobs=1, seed=1)
    (tmp_path / "reach.yaml").write_text(REACH.replace("0.25]}", "0.2]}"))
    with pytest.raises(InputError, match="was begun with another content"):
        record("reach.yaml", 1, "out", jobs=1)

    lines = (tmp_path / "out" / ATTEMPTS).read_text()
    for bad, said in (
        (lines.replace('"found": true', '"found": 1'), "found cannot be 1"),
        (lines + "[]\n", ":3: not a line of JSON"),
        ("{}\n" + lines, ":1: not the head of demonstrations"),
    ):
        (tmp_path / "out" / ATTEMPTS).write_text(bad)
        (tmp_path / "reach.yaml").write_text(REACH)
        with pytest.raises(InputError, match=said):
            record("reach.yaml", 1, "out", jobs=1)


def test_a_damaged_episode_is_named(tmp_path):
    pytest.importorskip("h5py")
    record("reach.yaml", 1, "out", jobs=1)
    (tmp_path / "out" / EPISODES / "000000.npz").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"000000\.npz: not a whole \.npz file"):
        record("reach.yaml", 1, "out", format="hdf5", jobs=1)


def test_the_command_prints_what_has_come_of_it(capsys):
    assert run(["demos", "reach.yaml", "--out", "out", "--count", "2", "--jobs", "1", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["count"], said["wanted"], said["reason"]) == (2, 2, "")
    assert run(["demos", "reach.yaml", "--out", "out", "--count", "2", "--seed", "5"]) == 2
    assert "was begun with another seed" in capsys.readouterr().err.replace("\n  ", " ")


def test_angles_in_degrees_are_no_displacement():
    with pytest.raises(InputError, match="yaw: 45 rad is more than a turn; give radians"):
        Displacement(yaw=(-45, 45))
