"""What is drawn of a page: two tips of an arm, each dragged by itself; dark and light; shadows."""

import re
from pathlib import Path

import cv2
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.story import dragged_tips
from rrtik_tests.browser import planning_page
from rrtik_tests.programs import needs_chromium

RIGHT = slice(6, 12)  # joints of the right arm
GRASP = """(() => {
  const r = pane.getBoundingClientRect();
  const places = [];
  for (let x = r.left + 5; x < r.right; x += 12) for (let y = r.top + 5; y < r.bottom; y += 12) {
    pointerAt({ clientX: x, clientY: y });
    const found = hitThing();
    const { point, object } = found?.hit ?? {};
    if (found?.name !== "goal" || hitHandle()) continue;
    const tip = tipOf(object, state.goal, new THREE.Vector3(point.x, -point.z, point.y));
    if (tip.name === "right_grip_point") places.push([x, y]);
  }
  return places[Math.floor(places.length / 2)];
})()"""


@pytest.mark.parametrize(
    ("name", "tips"),
    [("ur5", 1), ("two_titan4", 2), ("baxter", 2), ("baxter_left", 1), ("so101", 1), ("planar3", 1)],
)
def test_every_arm_has_a_tip_to_drag(name: str, tips: int) -> None:
    robot = rrtik.load_robot(name)
    found = dragged_tips(robot, None)
    assert found[0] == robot.tip
    assert len(found) == tips
    if tips == 2:
        assert {tip.split("_")[0] for tip in found} == {"left", "right"}


def test_the_tips_of_a_goal_are_those_that_it_names() -> None:
    problem = rrtik.load_problem("two_titan4")
    assert dragged_tips(problem.robot, problem.goal) == ["left_grip_point", "right_grip_point"]


@pytest.mark.kernels
@needs_chromium
def test_in_a_browser_the_right_arm_is_dragged_and_the_left_one_stays(tmp_path: Path) -> None:
    problem = rrtik.load_problem("two_titan4")
    path = rrtik.plan(problem, "RRTConnect", seed=1, shorten=False).path
    with planning_page(page(problem, path), tmp_path) as browser:
        spot = browser.ask(GRASP)
        browser.drag(spot, [spot[0] + 6.0, spot[1] - 10.0])
        goal = np.array(browser.ask("state.goal"))
        said = browser.ask("document.getElementById('plan-refusal').textContent")
    changed = goal != path.end
    assert changed[RIGHT].any()
    assert not changed[: RIGHT.start].any()
    ends = [problem.robot.fk(q, "right_grip_point") for q in (path.end, goal)]
    assert 0.005 < np.linalg.norm(ends[1].translation - ends[0].translation) < 0.5
    told = re.search(r"goal: (turned by (\d+) deg|out of reach by \d+ mm)", said)
    turned = np.rad2deg(np.linalg.norm(pin.log3(ends[1].rotation @ ends[0].rotation.T)))
    if told is None:
        assert turned < 0.1
    elif told[2]:  # by how much the joints do not let the hand keep its orientation
        assert turned == pytest.approx(float(told[2]), abs=0.6)


@pytest.mark.kernels
@needs_chromium
def test_the_page_is_dark_where_the_system_prefers_that(tmp_path: Path) -> None:
    lightness = "getComputedStyle(document.body).%s.match(/[0-9]+/g).map(Number).reduce((a, b) => a + b, 0)"
    ground = "toned('background_top')"
    with planning_page(page(rrtik.load_problem("planar3_a")), tmp_path) as browser:
        found = {}
        for mode in ("light", "dark"):
            browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": mode}])
            found[mode] = [browser.ask(lightness % which) for which in ("backgroundColor", "color")]
            found[mode].append(browser.ask(ground))
    assert found["light"][0] > 600 > 200 > found["light"][1]
    assert found["dark"][0] < 200 < 600 < found["dark"][1]
    assert found["light"][2] != found["dark"][2]


@pytest.mark.kernels
@needs_chromium
def test_arm_and_obstacles_cast_shadows_on_the_ground_and_on_each_other(tmp_path: Path) -> None:
    drawn = "key.castShadow = %s; viewer.set_dirty(); new Promise((done) => setTimeout(done, 1500))"
    with planning_page(page(rrtik.load_problem("titan4_sdu")), tmp_path) as browser:
        pictures = []
        for on in ("true", "false"):
            browser.ask(drawn % on)
            browser.screenshot(tmp_path / "page.png")
            pictures.append(cv2.imread(str(tmp_path / "page.png")).astype(int).sum(axis=2))
    darker = pictures[1] - pictures[0]
    assert (darker > 30).sum() > 2000  # pixels
    assert (darker < -30).sum() < 20
    coloured = pictures[1] < 500  # arm and obstacles
    assert (darker[coloured] > 30).sum() > 200
    assert (darker[~coloured] > 30).sum() > 2000
