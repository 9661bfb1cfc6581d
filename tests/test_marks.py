"""Ghosts and further bodies in the 3-D page, MB-RRT's tree, and the genetic algorithm's picture."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from rrtik_ompl import PositionGoal, Scene, load_robot, view
from rrtik_ompl.errors import InputError
from rrtik_ompl.ik.genetic.options import STANDARD
from rrtik_ompl.ik.genetic.search import follow_targets
from rrtik_ompl.ik.mb_rrt.growth import grow
from rrtik_ompl.ik.mb_rrt.links import Links
from rrtik_ompl.plots.genetic import plot_distances
from rrtik_ompl.viewer.drawing.marks import balls, tubes
from rrtik_ompl.viewer.drawing.tree_marks import tree_marks
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.subject import subject_of


def story_of(text):
    return json.loads(text.split('id="story"', 1)[1].split(">", 1)[1].split("</script>", 1)[0])


@pytest.fixture(scope="module", params=[2, 3])
def tree(request):
    goal = [0.2, 0.1, 0.2][: request.param]
    return grow(Links([0.1] * 4, request.param), goal, tolerance=0.002, rng=np.random.default_rng(0))


def test_every_index_of_a_tree_has_its_links_and_its_ball_and_the_answer_ends_at_the_goal(tree):
    marks = {mark.name: mark for mark in tree_marks(tree)}
    for index in range(1, 5):
        tube = marks[f"links of index {index}"]
        ends = tree.nodes[index]
        near = np.linalg.norm(tube.vertices[:, None, : ends.shape[1]] - ends[None], axis=2).min(axis=0)
        assert near.max() < 0.002  # every node lies on a tube
    assert "links of index 5" not in marks
    ball = marks["where joint 2 can be"].vertices
    centre = np.pad(tree.goal, (0, 3 - len(tree.goal)))
    np.testing.assert_allclose(np.linalg.norm(ball - centre, axis=1), 0.3, rtol=1e-9)
    assert np.linalg.norm(marks["answer"].vertices - centre, axis=1).min() < 0.006


def test_units_scale_the_whole_tree(tree):
    one, hundredth = tree_marks(tree), tree_marks(tree, unit=0.01)
    for a, b in zip(one, hundredth, strict=True):
        assert np.ptp(b.vertices, axis=0).max() == pytest.approx(0.01 * np.ptp(a.vertices, axis=0).max(), rel=1e-9)


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
    window, _ = draw(subject_of(robot, None, None, rows))
    assert any("/ghost/" in path for path in window.paths)
    assert not any("/ghost/" in path for path in draw(subject_of(robot))[0].paths)
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


def test_the_distance_of_the_best_is_drawn_for_every_run(tmp_path):
    robot = load_robot("puma560_3dof")
    goals = [
        PositionGoal(point, 1e-4)
        for point in robot.fk_batch(robot.posture("start") + np.array([[0.0], [0.01]]))[:, :3, 3]
    ]
    runs = {name: follow_targets(robot, goals, STANDARD, np.random.default_rng(k)) for k, name in enumerate("ab")}
    plot_distances(runs, tmp_path / "ga.svg", tolerance=1e-4)
    text = (tmp_path / "ga.svg").read_text()
    for name, run in runs.items():
        assert f"{name}: 2 points in {run.generations} generations" in text
    assert "tolerance" in text
    with pytest.raises(InputError, match="there is none"):
        plot_distances({}, tmp_path / "ga.svg")


def test_a_browser_lists_ghosts_and_marks_with_a_switch_each(tmp_path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no chromium on PATH: pages cannot be looked at")
    rows = np.radians([[0.0] * 6, [90, 60, -120, 30, 40, 20]])
    marks = tree_marks(grow(Links([0.1] * 4, 3), [0.2, 0.1, 0.2], tolerance=0.01, rng=np.random.default_rng(0)))
    file = view(load_robot("puma560"), ghosts=rows, marks=marks, html=tmp_path / "page.html")
    options = ("--headless=new", "--no-sandbox", "--virtual-time-budget=8000", "--use-angle=swiftshader")
    graphics = ("--enable-unsafe-swiftshader", "--dump-dom")
    command = [browser, *options, *graphics, file.as_uri()]
    page = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    legend = page.split('id="legend"', 1)[1].split("</ul>", 1)[0]
    entries = re.findall(r"</span>([^<]+)</label>", legend)
    wanted = ["solution 1", "solution 2", *(mark.name for mark in marks)]
    assert [entry for entry in entries if entry in wanted] == wanted
