"""Ghosts and further bodies in the 3-D page."""

import json
import re

import numpy as np
import pytest

from bench.shared.mb_rrt_tree import tree_marks
from rrtik_ompl import Scene, load_robot, view
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.mb_rrt.links import Links
from rrtik_ompl.ik.mb_rrt.published import grow
from rrtik_ompl.viewer.drawing.marks import balls, tubes
from rrtik_ompl.viewer.page import page
from rrtik_tests.page_pictures import document_of


def story_of(text):
    return json.loads(text.split('id="story"', 1)[1].split(">", 1)[1].split("</script>", 1)[0])


def test_a_page_without_a_robot_frames_its_marks_and_lists_them(tree):
    marks = tree_marks(tree)
    story = story_of(page(Scene(), marks=marks, title="tree"))
    assert [each["name"] for each in story["marks"]] == [mark.name for mark in marks]
    everything = np.concatenate([mark.vertices for mark in marks])
    np.testing.assert_allclose(story["frame"]["low"], everything.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(story["frame"]["high"], everything.max(axis=0), atol=1e-6)


def test_ghosts_take_the_place_of_start_and_goal_and_are_taken_into_the_picture(tmp_path):
    robot = load_robot("puma560")
    rows = np.radians([[0.0] * 6, [90, 60, -120, 30, 40, 20]])
    story = story_of(page(robot, ghosts=rows))
    np.testing.assert_allclose([ghost["q"] for ghost in story["ghosts"]], rows, atol=1e-8)
    assert story["ghosts"][0]["color"] != story["ghosts"][1]["color"]
    assert story["start_ghost"] is None
    assert story["goal_ghost"] is None
    assert view(robot, ghosts=rows, html=tmp_path / "ghosts.html") == tmp_path / "ghosts.html"


def test_ghosts_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="has 6 joints"):
        page(load_robot("puma560"), ghosts=np.zeros((2, 5)))
    with pytest.raises(InputError, match="needs a robot"):
        page(Scene(), ghosts=np.zeros((2, 6)))


def test_lines_and_points_become_bodies_of_their_size():
    line = tubes("line", "#112233", [[[0, 0, 0], [1, 0, 0]], [[0, 1, 0], [0, 2, 0]]], 0.01, opacity=0.5)
    np.testing.assert_allclose(line.vertices.max(axis=0), [1.0, 2.0, 0.01], atol=2e-3)
    assert (line.opacity, line.faces.max()) == (0.5, len(line.vertices) - 1)
    two = balls("balls", "#112233", [[0, 0, 0], [5, 0, 0]], 0.1)
    np.testing.assert_allclose(two.vertices.max(axis=0), [5.1, 0.1, 0.1], atol=1e-3)


def test_marks_without_a_face_are_left_out():
    empty = tubes("nothing", "#112233", [], 0.01)
    assert story_of(page(Scene(), marks=[empty]))["marks"] == []


def test_a_browser_lists_ghosts_and_marks_with_a_switch_each(tmp_path):
    rows = np.radians([[0.0] * 6, [90, 60, -120, 30, 40, 20]])
    marks = tree_marks(grow(Links([0.1] * 4, 3), [0.2, 0.1, 0.2], tolerance=0.01, rng=np.random.default_rng(0)))
    file = view(load_robot("puma560"), ghosts=rows, marks=marks, html=tmp_path / "page.html")
    tree = document_of(file.as_uri()).split('id="tree"', 1)[1].split("</aside>", 1)[0]
    entries = re.findall(r"</span>([^<]+)</label>", tree)
    wanted = ["solution 1", "solution 2", *(mark.name for mark in marks)]
    assert [entry for entry in entries if entry in wanted] == wanted
