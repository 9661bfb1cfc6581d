"""A film out of a film; from photographs to a scene, a plan and a film; solids that grow by their uncertainty."""

import resource
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest

import rrtik_robots
from rrtik_ompl import JointPath, load_problem, load_robot
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.pilot.overlay.film import ArmInPictures, write_film
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture, pictures_from, read_picture
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_tests.command_line import rrtik
from rrtik_tests.places import ROOT

SHIPPED = Path(rrtik_robots.__file__).parent / "problems" / "pilot"
PHOTOGRAPH = read_picture(SHIPPED / "photographs" / "panel_1.jpg")
LENS = ["--camera-file", SHIPPED / "camera_640.yaml", "--map", SHIPPED / "titan4_panel_markers.yaml"]
BASE_MAP = """version: 1
dictionary: 4x4_50
objects: [{name: stand, role: base, markers: [{id: 40, side: 0.08}]}]
"""


def film_of(path, count=4, picture=PHOTOGRAPH):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (640, 480))
    for _ in range(count):
        writer.write(picture)
    writer.release()


def arm_in_pictures(waypoints, map_file=SHIPPED / "titan4_panel_markers.yaml", **how):
    sensor = Sensor(Camera.load(SHIPPED / "camera_640.yaml"), MarkerMap.load(map_file))
    return ArmInPictures(load_robot("titan4"), sensor, waypoints, **({"seconds": 2.0} | how))


def test_the_arm_goes_from_the_first_waypoint_to_the_last_and_then_stands_still():
    problem = load_problem("titan4_sdu")
    start = problem.start
    goal = problem.goal.q
    arm = arm_in_pictures([start, goal], ghosts=0)
    drawn = [arm.draw(Picture(PHOTOGRAPH, "p", t)) for t in (0.0, 1.0, 2.0, 3.0)]
    assert (drawn[0] != PHOTOGRAPH).any(axis=2).sum() > 5000
    assert (drawn[0] != drawn[1]).any(axis=2).sum() > 2000
    assert (drawn[1] != drawn[2]).any(axis=2).sum() > 2000
    assert (drawn[2] != drawn[3]).any(axis=2).sum() < 500  # the axes of the valve tremble


def test_ghosts_stand_ahead_of_the_arm_and_vanish_when_it_arrives():
    problem = load_problem("titan4_sdu")
    seen = {}
    for ghosts in (0, 1):
        arm = arm_in_pictures([problem.start, problem.goal.q], ghosts=ghosts)
        seen[ghosts] = [arm.draw(Picture(PHOTOGRAPH, "p", t)) for t in (0.0, 2.0)]
    assert (seen[0][0] != seen[1][0]).any(axis=2).sum() > 2000
    assert np.array_equal(seen[0][1], seen[1][1])


def test_without_a_base_pictures_stay_as_they_are(tmp_path):
    (tmp_path / "map.yaml").write_text(BASE_MAP)
    arm = arm_in_pictures([load_problem("titan4_sdu").start], tmp_path / "map.yaml")
    assert np.array_equal(arm.draw(Picture(PHOTOGRAPH, "p", 0.0)), PHOTOGRAPH)
    assert arm.without_base == 1


@pytest.mark.parametrize(
    "wrong", [{"seconds": 0.0}, {"seconds": float("nan")}, {"ghosts": -1}, {"waypoints": np.zeros((0, 6))}]
)
def test_a_film_that_cannot_be_is_refused(wrong):
    with pytest.raises(InputError):
        arm_in_pictures(**({"waypoints": np.zeros((1, 6))} | wrong))


@pytest.mark.parametrize("ending", [".mp4", ".avi"])
def test_a_film_comes_out_of_a_film_with_its_rate(capsys, tmp_path, ending):
    film_of(tmp_path / "in.avi", picture=np.full((480, 640, 3), 128, np.uint8))  # the map says where the camera is
    code, out, err = rrtik(
        capsys, "overlay", tmp_path / "in.avi", "titan4_sdu", *LENS, "--out", tmp_path / f"out{ending}"
    )
    assert (code, err) == (0, "")
    assert "4 pictures, 10 a second" in out
    frames = list(pictures_from(tmp_path / f"out{ending}"))
    assert [frame.time for frame in frames] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert (np.abs(frames[0].pixels.astype(int) - 128).max(axis=2) > 30).sum() > 5000
    assert sorted(file.name for file in tmp_path.iterdir()) == ["in.avi", f"out{ending}"]


@pytest.mark.parametrize("ending", [".avi", ".mp4"])
def test_a_film_for_which_there_is_no_room_is_said_and_leaves_no_file(tmp_path, ending):
    frames = np.random.default_rng(1).integers(0, 256, (8, 120, 160, 3), dtype=np.uint8)
    write_film(tmp_path / f"whole{ending}", iter(frames), 10.0)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, ((tmp_path / f"whole{ending}").stat().st_size // 2, limits[1]))
    try:
        with pytest.raises(InputError, match="cannot be written whole; is there room on the disk"):
            write_film(tmp_path / f"a{ending}", iter(frames), 10.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [file.name for file in tmp_path.iterdir()] == [f"whole{ending}"]


def test_a_failure_in_the_middle_leaves_no_file(tmp_path):
    def frames():
        yield PHOTOGRAPH
        raise InputError("the camera was lost")

    with pytest.raises(InputError, match="lost"):
        write_film(tmp_path / "out.avi", frames(), 10.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"source": "none.mp4"}, "no such file"),
        ({"source": "text.mp4"}, "not a video"),
        ({"source": "0"}, "--frames"),
        ({"--out": "out.gif"}, ".mp4"),
        ({"--out": "nowhere/out.mp4"}, "nowhere"),
        ({"--seconds": "0"}, "seconds above 0"),
        ({"--map": "base.yaml"}, "add their ids to the map"),
        ({"problem": "titan5"}, "titan4"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(capsys, tmp_path, monkeypatch, change, message):
    monkeypatch.chdir(tmp_path)
    film_of(Path("in.avi"), 2)
    Path("text.mp4").write_text("no film")
    Path("base.yaml").write_text(BASE_MAP)
    lens = dict(zip(LENS[::2], LENS[1::2], strict=True))
    words = {"source": "in.avi", "problem": "titan4_sdu", "--out": "out.avi"} | lens | change
    first = words.pop("source"), words.pop("problem")
    code, _, err = rrtik(capsys, "overlay", *first, *(word for pair in words.items() for word in pair))
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
    assert not Path("out.avi").exists()


# --- from photographs to a plan ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_commands_of_the_page_on_sensing_lead_from_photographs_to_a_film(capsys, tmp_path, monkeypatch):
    page = (ROOT / "docs" / "sensing.md").read_text()
    (block,) = (b for b in page.split("```")[1::2] if "rrtik overlay" in b)
    lines = [line for line in block.replace("\\\n", " ").splitlines() if line.startswith("rrtik ")]
    monkeypatch.chdir(tmp_path)
    for line in lines:
        words = [word.replace("$PANEL", str(SHIPPED)) for word in shlex.split(line)[1:]]
        if words[0] == "pilot":  # serves until it is stopped; its own tests open it
            continue
        assert rrtik(capsys, *words)[0] == 0, line
    assert {line.split()[1] for line in lines} == {"markers", "plan", "overlay", "pilot"}
    problem = load_problem("task.yaml")
    path = JointPath.load("path.json", problem.robot)
    assert path.violations(problem.world) == ()
    valve = next(o for o in problem.world.scene.obstacles if o.name == "valve.body")
    assert valve.pose.translation == pytest.approx([1.36, 0.15, 0.12], abs=2e-3)
    assert 0.0 < valve.margin < 0.01
    for name in ("seen.png", "page.html", "film.mp4"):
        assert Path(name).stat().st_size > 50_000


@pytest.mark.parametrize(
    ("grasp", "message"),
    [("valve:aslant:9", "levels 1 to 3"), ("valve:under:1", "aslant"), ("tap:aslant:1", "was not seen"),
     ("valve", "OBJECT:TYPE:LEVEL"), (None, "go together")],
)  # fmt: skip
def test_a_task_that_cannot_be_is_one_line(capsys, tmp_path, grasp, message):
    options = [] if grasp is None else ["--problem", "titan4_sdu", "--grasp", grasp]
    code, _, err = rrtik(
        capsys, "markers", "sense", SHIPPED / "photographs", *LENS, "--task", tmp_path / "t.yaml", *options
    )
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
