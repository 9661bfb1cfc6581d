"""A page in the hands of somebody without a mouse, and in a browser that has no memory left."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.page import page
from rrtik_tests.browser import DRAWING_3D, Browser, planning_page
from rrtik_tests.programs import needs_chromium

pytestmark = [
    pytest.mark.kernels,
    needs_chromium,
]
GOAL_ON_SCREEN = """(() => {
  const r = pane.getBoundingClientRect();
  const places = [];
  for (let x = r.left + 5; x < r.right; x += 12) for (let y = r.top + 5; y < r.bottom; y += 12) {
    pointerAt({ clientX: x, clientY: y });
    if (hitThing()?.name === "goal" && !hitHandle()) places.push([x, y]);
  }
  return places[Math.floor(places.length / 2)];
})()"""
CHANGED = "state.goal.some((value, j) => Math.abs(value - %s[j]) > 1e-6)"


@pytest.fixture(scope="module")
def text() -> str:
    problem = rrtik.load_problem("planar3_boxes")
    return page(problem, rrtik.plan(problem, seed=1).path)


def press(browser: Any, key: str, code: int, *, text: str = "") -> None:
    words = {"key": key, "windowsVirtualKeyCode": code} | ({"text": text} if text else {})
    browser.call("Input.dispatchKeyEvent", type="keyDown", **words)
    browser.call("Input.dispatchKeyEvent", type="keyUp", **words)


def test_arrows_move_the_slider_of_a_joint_and_the_path_follows(text: str, tmp_path: Path) -> None:
    with planning_page(text, tmp_path) as browser:
        before = browser.ask("Array.from(state.goal)")
        browser.ask("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
        browser.ask("document.querySelector('#plan-fields input').focus()")
        for _ in range(3):
            press(browser, "ArrowRight", 39)
        browser.wait(CHANGED % before)
        browser.wait("Math.abs(story.waypoints.at(-1)[0] - state.goal[0]) < 1e-9")
        assert browser.ask("Array.from(state.goal)")[0] > before[0]
        assert browser.ask("Number(scrub.value)") == 0  # the arrows of the slider are its own


def test_what_is_typed_into_a_problem_stays_there(text: str, tmp_path: Path) -> None:
    with planning_page(text, tmp_path) as browser:
        browser.ask("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
        browser.ask("document.querySelector('textarea').focus()")
        for letter in "a b":
            press(browser, letter, ord(letter.upper()), text=letter)
        press(browser, "Home", 36)
        press(browser, "c", 67, text="c")
        assert browser.ask("document.querySelector('textarea').value") == "ca b"


def test_a_finger_drags_the_goal(text: str, tmp_path: Path) -> None:
    with planning_page(text, tmp_path) as browser:
        before = np.array(browser.ask("Array.from(state.goal)"))
        x, y = browser.ask(GOAL_ON_SCREEN)
        for kind, points in (
            ("touchStart", [{"x": x, "y": y}]),
            *(("touchMove", [{"x": x - 2 * k, "y": y - 2 * k}]) for k in range(1, 8)),
            ("touchEnd", []),
        ):
            browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        browser.wait(CHANGED % before.tolist())
        browser.wait("Math.abs(story.waypoints.at(-1)[0] - state.goal[0]) < 1e-9")


def test_without_memory_the_page_says_so_and_plays_on(text: str, tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    spent = "WebAssembly.Memory = class { constructor() { throw new RangeError('out of memory'); } };"
    with closing(Browser(DRAWING_3D)) as browser:
        browser.open("about:blank")
        browser.call("Page.enable")
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=spent)
        browser.call("Page.navigate", url=(tmp_path / "page.html").as_uri())
        browser.wait("document.body.innerText.includes('the page cannot plan: out of memory')")
        press(browser, "End", 35)
        browser.wait("Number(document.getElementById('scrub').value) > 0")
