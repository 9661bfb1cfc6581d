"""Problem files in a page that plans: what was saved is read again, what does not fit is refused in a line."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.page import page
from rrtik_tests.browser import Browser, planning_page
from rrtik_tests.programs import needs_chromium

pytestmark = [
    pytest.mark.kernels,
    pytest.mark.usefixtures("coarse_arms"),
    needs_chromium,
]
SAID = "document.getElementById('plan-state').textContent"
REFUSED = "document.getElementById('plan-refusal').textContent"
DROPPED = """(async () => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([%s], "mine.yaml"));
  document.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
  for (let k = 0; k < 30; k += 1) await new Promise((done) => requestAnimationFrame(done));
})()"""


def shown_problem() -> rrtik.Problem:
    """A UR5 beside a box and a plate, which stays."""
    crate = rrtik.Obstacle("crate", rrtik.Box([0.2, 0.2, 0.2]), [0.6, 0.6, 0.6])
    wedge = rrtik.Obstacle("wedge", rrtik.Prism([(0, 0), (0.2, 0), (0, 0.2)], 0.2), [-0.6, -0.6, 0.6])
    world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene((crate, wedge)))
    return rrtik.Problem(world, [0.0, -1.2, 1.0, 0.2, 0.0, 0.0], [1.6, -1.2, 1.0, 0.2, 0.0, 0.0])


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    folder = tmp_path_factory.mktemp("opening")
    problem = shown_problem()
    text = page(problem, rrtik.plan(problem, seed=1).path)
    with planning_page(text, folder) as opened:
        opened.coarsen_shadows()
        yield opened


def saved(browser: Browser) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(browser.ask("problemText()"))
    return found


def test_a_saved_problem_that_is_dropped_gives_the_page_its_state_again(browser: Browser, tmp_path: Path) -> None:
    first = browser.ask("copyOf(state)")
    changed = saved(browser)
    changed["goal"]["joints"][0] = 1.5
    changed["scene"]["obstacles"][0] |= {"box": [0.1, 0.2, 0.3], "pose": {"xyz": [0.5, -0.6, 0.7]}}
    changed["scene"]["obstacles"].append({"name": "sphere 1", "sphere": 0.07, "pose": {"xyz": [0, 0.5, 0.9]}})
    browser.ask(DROPPED % json.dumps(json.dumps(changed)))
    assert "length" in browser.ask(SAID)
    (tmp_path / "problem.yaml").write_text(browser.ask("problemText()"), encoding="utf-8")
    (tmp_path / "path.json").write_text(browser.ask("pathText()"), encoding="utf-8")
    again = rrtik.load_problem(tmp_path / "problem.yaml")
    path = rrtik.JointPath.load(tmp_path / "path.json", again.robot)
    assert [each.name for each in again.world.scene.obstacles] == ["crate", "wedge", "sphere 1"]
    np.testing.assert_allclose(again.world.scene.obstacles[0].pose.translation, [0.5, -0.6, 0.7], atol=1e-12)
    assert path.violations(again.world) == ()
    assert path.end[0] == 1.5
    browser.ask("undo()")
    assert browser.ask("copyOf(state)") == first


def without_wedge(problem: dict[str, Any]) -> None:
    problem["scene"]["obstacles"].pop(1)


BAD = {
    "text": (lambda p: None, "not JSON"),
    "another robot": (lambda p: p.update(robot="panda"), "robot is another than this page's"),
    "no start": (lambda p: p.pop("start"), "start needs joints: a list of 6 numbers"),
    "a value that is no number": (lambda p: p["goal"]["joints"].__setitem__(2, "x"), "goal needs joints"),
    "a joint beyond its limit": (
        lambda p: p["goal"]["joints"].__setitem__(1, 7.0),
        "goal: shoulder_lift_joint is at 401",
    ),
    "a box with no size": (lambda p: p["scene"]["obstacles"][0].update(box=[0.1, 0.0, 0.1]), "crate: box needs size x"),
    "a box with two sizes": (lambda p: p["scene"]["obstacles"][0].update(box=[0.1, 0.1]), "crate: box needs size x"),
    "far away": (lambda p: p["scene"]["obstacles"][0].update(pose={"xyz": [1e9, 0, 0]}), "crate: its pose needs xyz"),
    "another shape": (
        lambda p: p["scene"]["obstacles"].__setitem__(0, {"name": "crate", "sphere": 1}),
        "here it is a box",
    ),
    "a stranger": (lambda p: p["scene"]["obstacles"].append({"name": "mug", "sphere": 0.1}), "mug: this page cannot"),
    "the same name twice": (lambda p: p["scene"]["obstacles"].append(p["scene"]["obstacles"][0]), "used twice"),
    "what stays is gone": (without_wedge, "wedge: it stays in this page"),
    "no list": (lambda p: p["scene"].update(obstacles=4), "obstacles must be a list"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_is_refused_in_a_line_and_changes_nothing(browser: Browser, name: str) -> None:
    spoil, message = BAD[name]
    problem, before = saved(browser), browser.ask("copyOf(state)")
    spoil(problem)
    text = "version: 1\nrobot: ur5" if name == "text" else json.dumps(problem)
    browser.ask(f"openText('mine.yaml', {json.dumps(text)})")
    said = browser.ask(REFUSED)
    assert said.startswith("mine.yaml: ")
    assert message in said
    assert browser.ask("copyOf(state)") == before


def test_a_refusal_stands_while_a_path_is_made_and_goes_with_the_next_change(browser: Browser) -> None:
    browser.ask("planStatus('')")
    browser.ask("changed(); openText('mine.yaml', 'robot: ur5')")
    browser.wait(f"{SAID}.includes('found in')")
    assert browser.ask(REFUSED).startswith("mine.yaml: not JSON")
    browser.ask("changed()")
    assert browser.ask(REFUSED) == ""
    assert browser.ask("document.getElementById('plan-refusal').hidden")


def test_a_start_in_a_wall_is_red_and_named_and_nothing_is_planned(browser: Browser) -> None:
    problem = saved(browser)
    tip = browser.ask("tipPosition(state.start).toArray()")
    problem["scene"]["obstacles"][0] |= {"pose": {"xyz": tip}}
    browser.ask(DROPPED % json.dumps(json.dumps(problem)))
    assert browser.ask(SAID).startswith("start: ")
    assert "crate" in browser.ask(SAID)
    assert browser.ask("story.moves.length") == 0
    browser.ask("undo()")
