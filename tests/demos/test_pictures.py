"""Pictures of demonstrations: things are where a pinhole camera sees them, and datasets have just these pictures."""

import io
import json

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.cli.app import run
from rrtik_ompl.demos import record
from rrtik_ompl.pilot.overlay.demo_pictures import DemoPictures

pytestmark = pytest.mark.kernels

TASK = """\
version: 1
robot: ur5
scene:
  obstacles:
    - {name: ball, sphere: 0.06, pose: {xyz: [0.45, 0.0, 0.3]}}
start: {joints: [0.5, -1.6, 1.8, -0.2, 1.6, 0.0]}
task:
  - move_to: {position: [0.45, -0.3, 0.4]}
random:
  objects:
    ball: {y: [0.2, 0.25]}
"""
VIEW = "version: 1\nviews:\n  - {eye: [1.6, -0.4, 0.9], target: [0.4, 0.1, 0.3], fov_deg: 40}\n"
EYE, TARGET, OPENING = np.array([1.6, -0.4, 0.9]), np.array([0.4, 0.1, 0.3]), np.deg2rad(40.0)
WIDTH, HEIGHT = 96, 64


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "reach.yaml").write_text(TASK)
    (tmp_path / "corner.yaml").write_text(VIEW)


def pixel_of(point):
    """Column and row at which a pinhole camera shows a point."""
    ahead = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    seen = np.array([right, np.cross(ahead, right), ahead]) @ (point - EYE)
    focal = 0.5 * HEIGHT / np.tan(0.5 * OPENING)
    return focal * seen[:2] / seen[2] + 0.5 * (np.array([WIDTH, HEIGHT]) - 1.0)


def pictures(task, arrays):
    return list(DemoPictures(task, ["corner.yaml"], (WIDTH, HEIGHT)).of(arrays))


def test_a_thing_and_the_tip_are_where_a_pinhole_camera_sees_them():
    task = rrtik.Task.load("reach.yaml")
    q = np.array(task.start)
    pose = np.array([0.2, 0.45, 0.35, 0.0, 0.0, 0.0, 1.0])
    gone = pose + np.array([0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    arrays = {"position": np.array([q, q]), "object_pose": np.array([[pose], [gone]])}
    there, bare = (each["corner"].astype(int) for each in pictures(task, arrays))
    assert there.shape == (HEIGHT, WIDTH, 3)
    rows, columns = np.nonzero(np.abs(there - bare).max(axis=2) > 20)
    assert np.abs([columns.mean(), rows.mean()] - pixel_of(pose[:3])).max() < 1.0

    elsewhere = q + np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
    moved = pictures(task, {"position": elsewhere[None], "object_pose": np.array([[gone]])})[0]["corner"].astype(int)
    robot = task.world.robot
    background = bare[0, 0]
    for picture, values in ((bare, q), (moved, elsewhere)):
        forearm = 0.5 * (robot.fk(values, "forearm_link").translation + robot.fk(values, "wrist_1_link").translation)
        column, row = np.rint(pixel_of(forearm)).astype(int)
        assert np.abs(picture[row, column] - background).max() > 30
    assert (np.abs(moved - bare).max(axis=2) > 20).sum() > 50


def test_the_dataset_of_lerobot_has_the_pictures_and_their_statistics(tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    Image = pytest.importorskip("PIL.Image")
    command = (
        "demos reach.yaml --count 2 --rate 5 --jobs 1 --format lerobot --camera corner.yaml --camera top --size 96x64"
    )
    assert run([*command.split(), "--out", "one"]) == 0
    assert run([*command.split(), "--out", "two"]) == 0
    root = tmp_path / "one" / "lerobot"
    file = "data/chunk-000/file-000.parquet"
    assert (root / file).read_bytes() == (tmp_path / "two" / "lerobot" / file).read_bytes()

    name = "observation.images.corner"
    info = json.loads((root / "meta" / "info.json").read_text())
    assert info["features"][name] == {
        "dtype": "image", "shape": [HEIGHT, WIDTH, 3], "names": ["height", "width", "channels"],
    }  # fmt: skip
    rows = [each["bytes"] for each in pq.read_table(root / file).column(name).to_pylist()]
    seen = np.array([np.asarray(Image.open(io.BytesIO(row))) for row in rows])
    task = rrtik.Task.load("reach.yaml")
    drawn = []
    for number in range(2):
        drawn += [each["corner"] for each in pictures(task, np.load(f"one/episodes/{number:06d}.npz"))]
    assert np.array_equal(seen, drawn)

    found = json.loads((root / "meta" / "stats.json").read_text())[name]
    channels = seen.reshape(-1, 3) / 255.0
    for word, expected in (("mean", channels.mean(0)), ("std", channels.std(0)), ("max", channels.max(0))):
        assert np.allclose(np.ravel(found[word]), expected, atol=1e-9), word
    assert np.shape(found["min"]) == (3, 1, 1)
    assert found["count"] == [len(seen)]


def test_the_hdf5_file_has_the_pictures():
    h5py = pytest.importorskip("h5py")
    task = rrtik.Task.load("reach.yaml")
    record(task, 1, "out", format="hdf5", jobs=1, rate=5.0, pictures=DemoPictures(task, ["corner.yaml"], (96, 64)))
    with h5py.File("out/demos.hdf5") as file:
        seen = file["data/demo_0/obs/corner_image"][:]
    drawn = [each["corner"] for each in pictures(task, np.load("out/episodes/000000.npz"))]
    assert np.array_equal(seen, drawn)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--camera none.yaml --format lerobot", "camera 'none.yaml': expected front, side, top, or a file of a view"),
        ("--camera top --camera top --format lerobot", "expected different names, got top, top"),
        ("--camera top --size 9 --format lerobot", "size: expected WIDTHxHEIGHT"),
        ("--camera top", "format npz has none; use lerobot or hdf5"),
    ],
)
def test_cameras_that_cannot_be_get_a_line(words, said, capsys):
    assert run(["demos", "reach.yaml", "--count", "1", "--out", "out", *words.split()]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
