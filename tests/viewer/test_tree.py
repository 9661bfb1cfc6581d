"""The tree of what is shown, buttons and keys of a page, in a browser."""

import time

import numpy as np
import pytest

from rrtik_ompl import Obstacle, Problem, Scene, Sphere, World, load_problem, load_robot
from rrtik_ompl.replanning import ConstantVelocity
from rrtik_ompl.viewer.drawing.marks import tubes
from rrtik_ompl.viewer.page import asset, page
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.subject import subject_of
from rrtik_tests.crane import WAYPOINTS, problem
from rrtik_tests.page_pictures import opened
from rrtik_tests.programs import needs_chromium

VISIBLE = """story.obstacles.map(({ node: leaf }) => {
  let drawn = false;
  const look = (item) => { if (item.isMesh && item.layers.test(viewer.camera.layers)) drawn = true; };
  node("obstacles", leaf).traverseVisible(look);
  return drawn && node("obstacles").visible;
})"""
CHANGED = """(() => {
  const looks = () => {
    const found = new Map();
    viewer.scene.traverse(({ uuid, visible, layers }) => {
      found.set(`${uuid} visible`, visible);
      found.set(`${uuid} layer`, layers.mask);
    });
    return found;
  };
  return things.map((thing) => {
    thing.show(true);
    const before = looks();
    thing.show(false);
    const changed = [...looks()].filter(([key, look]) => before.get(key) !== look).map(([key]) => key);
    thing.show(isSeen(thing));
    return [thing.text, changed];
  });
})()"""
CLICK = "[...document.querySelectorAll('#tree .eye')].find((eye) => eye.ariaLabel === 'show {}').click()"


def test_everything_that_is_drawn_has_an_eye(crane, scene):
    """Each node right below the root, of a picture with all kinds of things, is one that the tree shows and hides."""
    marks = [tubes("a mark", "#112233", [np.eye(3)], 0.01)]
    shown = subject_of(problem(crane, scene), WAYPOINTS, WAYPOINTS[:2], marks=tuple(marks))
    held = subject_of(load_problem("ur5_upright"))
    drawn = {path.split("/")[2] for subject in (shown, held) for path in draw(subject)[0].paths}
    assert {"robot", "obstacles", "later", "trail", "before", "constraints", "marks", "frames"} <= drawn
    assert {name for name in drawn if f'"{name}"' not in asset("tree.js")} == set()


@pytest.mark.slow
@needs_chromium
def test_no_two_eyes_are_of_one_thing_and_many_courses_are_hidden_at_first(tmp_path):
    robot = load_robot("planar3", parameters={"radius": 0.02})
    flying = [
        Obstacle(f"ball {k}", Sphere(0.1), [6.0, k, 0.0], ConstantVelocity([0.1, 0.0, 0.0]), margin=0.05)
        for k in range(4)
    ]
    file = tmp_path / "page.html"
    file.write_text(page(Problem(World(robot, Scene(flying)), [0.0] * 3, [1.0, 0.0, 0.0])), encoding="utf-8")
    with opened(file.as_uri()) as found:
        changed = found.ask(CHANGED)
        owners = [key for _, keys in changed for key in keys]
        assert len(owners) > 10
        assert len(owners) == len(set(owners)), changed
        assert found.ask("node('later').visible") is False
        found.ask(CLICK.format("Courses: of 4 obstacles"))
        assert found.ask("node('later').visible") is True


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    boxes = load_problem("planar3_boxes")
    waypoints = [boxes.start, [0.1, 0.1, 0.1]]
    file = tmp_path_factory.mktemp("page") / "page.html"
    file.write_text(page(boxes, waypoints, before=[*waypoints, boxes.start]), encoding="utf-8")
    with opened(file.as_uri()) as found:
        found.wait("document.documentElement.dataset.plans === 'yes'")
        found.ask("window.kept = []; keepFile = (name, blob) => kept.push([name, blob])")
        yield found


@pytest.mark.slow
@needs_chromium
def test_an_eye_hides_one_obstacle_and_that_of_the_group_all(browser):
    everything = browser.ask(VISIBLE)
    assert len(everything) > 1
    assert all(everything)
    first = browser.ask("story.obstacles[0].name")
    browser.ask(CLICK.format(first))
    assert browser.ask(VISIBLE) == [False, *everything[1:]]
    browser.ask(CLICK.format("Obstacles"))
    assert not any(browser.ask(VISIBLE))
    browser.ask(CLICK.format("Obstacles"))
    assert browser.ask(VISIBLE) == [False, *everything[1:]]  # the eye of the first is still closed
    browser.ask(CLICK.format(first))
    assert browser.ask(VISIBLE) == everything


@pytest.mark.slow
@needs_chromium
def test_keys_change_speed_loop_and_view(browser):
    browser.ask("dispatchEvent(new KeyboardEvent('keydown', { key: '+' }))")
    assert browser.ask("document.getElementById('speed').value") == "2"
    browser.ask("dispatchEvent(new KeyboardEvent('keydown', { key: '-' }))")
    assert browser.ask("document.getElementById('speed').value") == "1"
    for wanted in (True, False):
        browser.ask("dispatchEvent(new KeyboardEvent('keydown', { key: 'l' }))")
        assert browser.ask("document.getElementById('loop').checked") is wanted
    browser.ask("dispatchEvent(new KeyboardEvent('keydown', { key: '3' }))")
    assert browser.ask("viewpoint") == browser.ask("Object.keys(VIEWPOINTS)[2]")


@pytest.mark.slow
@needs_chromium
def test_a_picture_a_view_and_a_film_are_handed_out(browser):
    for name in ("picture", "view"):
        browser.ask(f"document.getElementById('{name}-button').click()")
    browser.ask("total = 0.4; document.getElementById('film-button').click()")
    end = time.monotonic() + 90.0
    while browser.ask("kept.length") < 3 and time.monotonic() < end:
        time.sleep(0.2)
    kinds = dict(browser.ask("kept.map(([name, blob]) => [name.split('.')[0], blob.size])"))
    assert set(kinds) == {"picture", "view", "film"}
    assert min(kinds["picture"], kinds["film"]) > 1000
    browser.ask("newPath()")  # the whole path again


@pytest.mark.slow
@needs_chromium
def test_the_title_follows_the_path_and_the_one_for_comparison_goes_with_it(browser):
    assert browser.ask("document.getElementById('title').textContent") == "planar3_boxes: path of 1 move"
    assert "before" in browser.ask("document.getElementById('tree').textContent")
    browser.ask("replacePath([state.start, state.start.map((value) => value + 0.01), state.start])")
    assert browser.ask("document.getElementById('title').textContent") == "planar3_boxes: path of 2 moves"
    assert browser.ask("document.title") == "planar3_boxes: path of 2 moves"
    assert "before" not in browser.ask("document.getElementById('tree').textContent")
