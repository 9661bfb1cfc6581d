"""Films and stills: as many pictures as were asked for, bodies in collision red; what is missing is said in a line."""

from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import rrtik_ompl as rrtik
from rrtik_ompl.cli.app import run
from rrtik_ompl.description.catalog import find_problem
from rrtik_ompl.problem_files.problem_values import load_unchecked
from rrtik_ompl.viewer import film as module
from rrtik_ompl.viewer.film import film
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.story import story_of
from rrtik_ompl.viewer.subject import Shown, subject_of
from rrtik_ompl.world.judgement import contacts_along
from rrtik_tests.programs import needs_chromium

WAYPOINTS = [[0.0, 0.0, 0.0], [1.0, 0.5, 0.5]]


@pytest.mark.slow
@needs_chromium
def test_a_film_shows_the_arm_moving(tmp_path):
    robot = rrtik.load_robot("planar3")
    with Image.open(film(robot, WAYPOINTS, tmp_path / "film.gif", seconds=1.0, rate=2.0, size=(320, 200))) as moving:
        assert (moving.size, moving.n_frames) == ((320, 200), 3)  # at 0, 0.5 and 1 s
        pictures = []
        for k in range(3):
            moving.seek(k)
            pictures.append(np.asarray(moving.convert("RGB"), dtype=int))
    for before, after in pairwise(pictures):
        assert (np.abs(before - after).max(axis=2) > 60).mean() > 0.002


@pytest.mark.parametrize(
    ("path", "name", "options", "said"),
    [
        (None, "film.gif", {}, "a film needs a path"),
        (WAYPOINTS, "film.avi", {}, "unknown ending '.avi'; use .gif, .mp4, .png"),
        (WAYPOINTS, "film.gif", {"seconds": 1e9}, "out of range"),
    ],
)
def test_what_is_no_film_is_said_in_a_line(path, name, options, said, tmp_path):
    with pytest.raises(rrtik.InputError, match=said):
        film(rrtik.load_robot("planar3"), path, tmp_path / name, **options)


def test_without_a_browser_it_is_said_in_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr(module.shutil, "which", lambda name: None)
    with pytest.raises(rrtik.InputError, match="needs a browser"):
        film(rrtik.load_robot("planar3"), WAYPOINTS, tmp_path / "film.gif")


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
