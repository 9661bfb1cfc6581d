"""Films and pictures: of the size, rate and camera that were asked for, whole or not at all; faults in a line."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from PIL import Image

import rrtik_ompl as rrtik
from rrtik_ompl.cli.app import run
from rrtik_ompl.description.catalog import find_problem
from rrtik_ompl.problem_files.problem_values import load_unchecked
from rrtik_ompl.tasks.captions import motion_names
from rrtik_ompl.viewer import browser as module
from rrtik_ompl.viewer.film import film, picture
from rrtik_ompl.viewer.film_view import camera_of
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.story import story_of
from rrtik_ompl.viewer.subject import Shown, subject_of
from rrtik_ompl.world.judgement import contacts_along
from rrtik_tests.programs import needs_chromium

WAYPOINTS = [[0.0, 0.0, 0.0], [1.0, 0.5, 0.5]]


def frames_of(file):
    """Pictures of a film as OpenCV reads them, and how many there are a second."""
    opened = cv2.VideoCapture(str(file))
    frames = []
    while (read := opened.read())[0]:
        frames.append(read[1].astype(int))
    return frames, opened.get(cv2.CAP_PROP_FPS)


def differ(one, other):
    """Share of pixels that clearly differ."""
    return (np.abs(one - other).max(axis=2) > 60).mean()


@pytest.mark.slow
@needs_chromium
def test_a_film_shows_the_arm_moving(tmp_path):
    robot = rrtik.load_robot("planar3")
    with Image.open(film(robot, tmp_path / "film.gif", WAYPOINTS, seconds=1.0, rate=2.0, size="320x200")) as moving:
        assert (moving.size, moving.n_frames) == ((320, 200), 3)  # at 0, 0.5 and 1 s
        pictures = []
        for k in range(3):
            moving.seek(k)
            pictures.append(np.asarray(moving.convert("RGB"), dtype=int))
    for before, after in pairwise(pictures):
        assert differ(before, after) > 0.002


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize(("ending", "codec"), [(".mp4", "h264"), (".webm", "VP90")])
def test_a_film_has_its_size_rate_and_codec_and_holds_its_last_picture(tmp_path, ending, codec):
    told = []
    file = tmp_path / f"film{ending}"
    size, say = (320, 200), lambda *done: told.append(done)
    film(rrtik.load_robot("planar3"), file, WAYPOINTS, seconds=0.5, rate=10.0, size=size, on_picture=say)
    frames, rate = frames_of(file)
    assert rate == pytest.approx(10.0)
    assert {each.shape for each in frames} == {(200, 320, 3)}
    assert len(frames) == 6 + 8  # 0.5 s and both ends of it, then 0.8 s
    assert differ(frames[0], frames[5]) > 0.01
    assert differ(frames[5], frames[-1]) == 0.0
    assert told == [(k, 6) for k in range(1, 7)]
    code = int(cv2.VideoCapture(str(file)).get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode()
    assert code == codec
    assert [each.name for each in tmp_path.iterdir()] == [file.name]


@pytest.mark.slow
@needs_chromium
def test_a_camera_of_a_file_is_where_the_file_says(tmp_path):
    """Seen from above by a camera of 90 degrees, a post is where a pinhole camera has it."""
    views = tmp_path / "views.yaml"
    views.write_text("views: [{eye: [0, -0.001, 2], target: [0, 0, 0], fov_deg: 90}]")
    scene = rrtik.Scene(
        [rrtik.Obstacle("post", rrtik.Box([0.2, 0.2, 0.2]), rrtik.pose([0.5, 0.25, 0.9]), color="#c0392b")]
    )
    shot = picture(scene, tmp_path / "a.png", size=(400, 400), camera=views, hide="frames,grid,labels")
    pixels = np.asarray(Image.open(shot).convert("RGB"), dtype=int)
    seen = np.argwhere(pixels.max(axis=2) - pixels.min(axis=2) > 60)
    # The upper face, 1 m below the eye, covers 0.4 to 0.6 and 0.15 to 0.35 m; half of the picture shows 1 m there.
    row, column = np.sort(seen, axis=0)[[5, -5]].T
    assert column == pytest.approx([200 + 200 * 0.4 * 1.0 / 1.2, 200 + 200 * 0.6], abs=6)
    assert row == pytest.approx([200 - 200 * 0.35, 200 - 200 * 0.15 * 1.0 / 1.2], abs=6)


@pytest.mark.slow
@needs_chromium
def test_what_is_hidden_is_not_in_the_picture(tmp_path):
    scene = rrtik.Scene(
        [
            rrtik.Obstacle(name, rrtik.Box([0.2, 0.2, 0.2]), rrtik.pose([x, 0.0, 0.5]), color="#c0392b")
            for name, x in (("a", 0.0), ("b", 1.0))
        ]
    )
    shares = []
    for hide in ("", "b", "obstacles"):
        shot = picture(scene, tmp_path / "a.png", size=(400, 300), camera="side", hide=f"frames,grid,labels,{hide}")
        pixels = np.asarray(Image.open(shot).convert("RGB"), dtype=int)
        shares.append((pixels.max(axis=2) - pixels.min(axis=2) > 60).mean())
    assert shares[0] == pytest.approx(2.0 * shares[1], rel=0.1)
    assert shares[2] == 0.0
    with pytest.raises(rrtik.InputError, match="nothing here is called 'ghost'; what can be hidden: robot, ghosts"):
        picture(scene, tmp_path / "b.png", hide="ghost")
    assert not (tmp_path / "b.png").exists()


@pytest.mark.parametrize(
    ("path", "name", "options", "said"),
    [
        (None, "film.gif", {}, "a film needs a path"),
        (WAYPOINTS, "film.avi", {}, "unknown ending '.avi'; use .mp4, .webm, .gif"),
        (WAYPOINTS, "film.gif", {"seconds": 1e9}, "out of range"),
        (WAYPOINTS, "film.gif", {"seconds": float("nan")}, "seconds of a film: must be a finite number"),
        (WAYPOINTS, "film.gif", {"rate": "fast"}, "rate of a film: expected numbers"),
        (WAYPOINTS, "film.mp4", {"size": "641x400"}, "needs even numbers; use 642x400"),
        (WAYPOINTS, "film.mp4", {"size": "big"}, "expected WIDTHxHEIGHT in pixels"),
        (WAYPOINTS, "film.mp4", {"size": "9000x400"}, "out of range"),
        (WAYPOINTS, "film.mp4", {"camera": "spin"}, "camera 'spin': use overview, front, side, top, orbit, follow"),
        (WAYPOINTS, "film.mp4", {"camera": "none.yaml"}, "no such file"),
        (WAYPOINTS, "film.mp4", {"hide": 3}, "hide"),
    ],
)
def test_what_is_no_film_is_said_in_a_line(path, name, options, said, tmp_path):
    with pytest.raises(rrtik.InputError, match=said):
        film(rrtik.load_robot("planar3"), tmp_path / name, path, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("views: []", "views"),
        ("views: [{eye: [0, 0, 1], target: [0, 0, 1]}]", "is the same point as eye; move one of them"),
        ("views: [{eye: [0, 0, 1], target: [0, 0, 0], fov_deg: 200}]", "must be 150 or less"),
        ("scene: {obstacles: []}", "a scene, not views of a film"),
    ],
)
def test_a_file_of_views_that_is_none_is_said_in_a_line(text, said, tmp_path):
    (tmp_path / "views.yaml").write_text(text)
    with pytest.raises(rrtik.InputError, match=said) as error:
        camera_of(tmp_path / "views.yaml")
    assert "\n" not in str(error.value)


def test_views_are_taken_in_the_order_of_their_times(tmp_path):
    (tmp_path / "views.yaml").write_text(
        "views: [{eye: [0, 0, 1], target: [0, 0, 0], time: 2}, {eye: [0, 0, 3], target: [0, 0, 0]}]"
    )
    assert [view["time"] for view in camera_of(tmp_path / "views.yaml")] == [0.0, 2.0]


def test_without_a_browser_it_is_said_in_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr(module.shutil, "which", lambda name: None)
    with pytest.raises(rrtik.InputError, match="needs a browser"):
        film(rrtik.load_robot("planar3"), tmp_path / "film.gif", WAYPOINTS)


def test_a_browser_that_draws_nothing_is_said_in_a_line(tmp_path, monkeypatch):
    browser = tmp_path / "chromium"
    browser.write_text("#!/bin/sh\nexit 0\n")
    browser.chmod(0o755)
    monkeypatch.setattr(module.shutil, "which", lambda name: str(browser))
    with pytest.raises(rrtik.InputError, match="chromium ended or drew nothing more"):
        film(rrtik.load_robot("planar3"), tmp_path / "film.mp4", WAYPOINTS)
    assert [each.name for each in tmp_path.iterdir()] == ["chromium"]


@pytest.mark.parametrize("name", ["film.mp4", "film.webm", "film.gif"])
def test_ctrl_c_ends_the_browser_and_leaves_no_file(tmp_path, monkeypatch, name):
    ended = []

    def interrupted(*_):
        try:
            yield b"K", b"half a picture"
            raise KeyboardInterrupt
        finally:
            ended.append(True)

    monkeypatch.setattr("rrtik_ompl.viewer.film.posts", interrupted)
    with pytest.raises(KeyboardInterrupt):
        film(rrtik.load_robot("planar3"), tmp_path / name, WAYPOINTS)
    assert ended == [True]
    assert list(tmp_path.iterdir()) == []


def test_the_command_refuses_before_it_works(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for options, said in {
        ("--film", "a.avi"): "unknown ending '.avi'",
        ("--picture", "a.jpg"): "unknown ending '.jpg'",
        ("--film", "a.mp4", "--camera", "spin"): "camera 'spin'",
        ("--film", "a.mp4", "--size", "641x400"): "use 642x400",
        ("--rate", "60"): "--rate is for --film and --picture",
    }.items():
        for command in (["show", "planar3_boxes"], ["task", "panda_pick_place"], ["replan", "replan_walls"]):
            assert run([*command, *options]) == 2
            assert said in capsys.readouterr().err


def test_a_start_in_collision_is_shown_with_its_bodies_red(tmp_path, capsys):
    text = find_problem("titan4_prisms").read_text().replace("start: {joints_deg: [0,", "start: {joints_deg: [-10,")
    (tmp_path / "bad.yaml").write_text(text)
    assert run(["show", str(tmp_path / "bad.yaml"), "--html", str(tmp_path / "bad.html")]) == 1
    assert "start is in collision" in capsys.readouterr().err
    settings, start, _ = load_unchecked(tmp_path / "bad.yaml")
    touching = contacts_along(rrtik.World.of(settings).checks, start[None])
    shown = Shown(settings.robot, settings.scene, None, start, touching)
    (told,) = story_of(subject_of(shown), draw(subject_of(shown))[1], "")["contacts"]
    assert "'prism_10'" in told["text"]
    assert ["obstacles", ":prism_10"] in told["nodes"]


def test_a_robot_is_shown_alone_and_in_a_scene(tmp_path, capsys):
    assert run(["show", "planar3", "--html", str(tmp_path / "robot.html")]) == 0
    scene = str(find_problem("planar3_boxes"))
    assert run(["show", "planar3", "--scene", scene, "--html", str(tmp_path / "both.html")]) == 0
    assert "box" in (tmp_path / "both.html").read_text()
    assert run(["show", "planar3_boxes", "--scene", scene]) == 2
    assert "is for a robot" in capsys.readouterr().err


def test_the_motions_of_a_task_have_names_of_what_is_held():
    plan = rrtik.Task.load("panda_pick_place").plan(seconds=60.0, seed=1)
    wanted = ["move to cup", "reach for cup", "lift cup", "carry cup", "put cup down", "leave cup", "move to ready"]
    assert list(motion_names(plan)) == wanted
