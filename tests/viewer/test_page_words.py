"""What a page that plans says, and where: by the pointer, by the player, of clearance and of proof."""

import re
from collections.abc import Callable, Iterator

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.page import page
from rrtik_tests.browser import Browser, planning_page
from rrtik_tests.page_drags import IDLE, RESET, SPOTS, begin
from rrtik_tests.programs import needs_chromium

pytestmark = [pytest.mark.kernels, needs_chromium]
LINES = """Object.fromEntries(["plan-state", "plan-refusal", "now", "title", "proof-note"].map((id) => {
  const line = document.getElementById(id);
  return [id, { text: line.hidden || line.closest("section")?.hidden ? "" : line.textContent, kind: line.className }];
}))"""
BESIDE_HAND = """(() => {
  placeLabels();
  const label = labels.find(({ kind }) => kind === "reach")?.element;
  if (!label) return null;
  const [inner, outer] = [label, pane].map((each) => each.getBoundingClientRect());
  const across = inner.left >= outer.left && inner.right <= outer.right;
  return { text: label.textContent, inside: across && inner.top >= outer.top && inner.bottom <= outer.bottom };
})()"""
PLACES = 201


@pytest.fixture(scope="module")
def problem() -> rrtik.Problem:
    return rrtik.load_problem("planar3_boxes")


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory, problem: rrtik.Problem) -> Iterator[Browser]:
    text = page(problem, rrtik.plan(problem, seed=1).path)
    with planning_page(text, tmp_path_factory.mktemp("words")) as browser:
        begin(browser)
        yield browser


@pytest.fixture
def browser(opened: Browser) -> Browser:
    opened.ask(RESET)
    opened.ask(IDLE)
    return opened


def held_goal(browser: Browser, target: Callable[[list[float]], list[float]]) -> None:
    """Take hold of the goal, and move the pointer to where a function of its place says [px]."""
    spots = browser.ask(SPOTS % '"goal"')
    spot = spots[len(spots) // 2]
    wanted = target(spot)
    halfway = [(a + b) / 2 for a, b in zip(spot, wanted, strict=True)]
    for kind, place in (("mousePressed", spot), ("mouseMoved", halfway), ("mouseMoved", wanted)):
        browser.call("Input.dispatchMouseEvent", type=kind, x=place[0], y=place[1], button="left", buttons=1)


def let_go(browser: Browser) -> None:
    browser.call("Input.dispatchMouseEvent", type="mouseReleased", x=1, y=1, button="left", buttons=0, clickCount=1)
    browser.ask(IDLE)


def test_the_clearance_that_is_said_is_not_more_than_there_is(browser: Browser, problem: rrtik.Problem) -> None:
    browser.ask("state.goal = state.start.map((value) => value + 0.1); changed()")
    said = browser.ask(IDLE)
    told = re.search(r"at least ([\d.]+) mm clear at each of 201 places", said["text"])
    assert told is not None, said["text"]
    rows = np.array(said["waypoints"])
    shares = np.linspace(0.0, len(rows) - 1.0, PLACES)
    between = np.column_stack([np.interp(shares, range(len(rows)), column) for column in rows.T])
    clearances = [problem.world.clearance(q) for q in between]
    assert 0.0 < float(told[1]) / 1000.0 <= min(clearances) + 1e-4


def test_a_lower_bound_below_nothing_is_not_called_a_clearance(browser: Browser) -> None:
    browser.ask("kernels.nearest = (q) => ({ metres: -0.002, pair: null }); changed()")
    said = browser.ask(IDLE)["text"]
    browser.ask("delete kernels.nearest")
    assert "free but close: nearer than the covers can measure" in said
    assert "-" not in said


def test_a_path_of_the_page_is_not_called_proven_until_undo_gives_back_the_one_that_is(browser: Browser) -> None:
    browser.ask("shortening += 1; replacePath(given.waypoints)")
    judged = browser.ask(LINES)["proof-note"]
    assert judged["text"].startswith("every move is proven free")
    assert judged["kind"] == "proven"
    browser.ask("remember(); moveSelected(new THREE.Vector3(-0.05, 0.05, 0), 0)")
    browser.ask(IDLE)
    own = browser.ask(LINES)["proof-note"]
    assert own["kind"] == "doubtful"
    assert "not proven" in own["text"]
    browser.ask("undo()")
    assert browser.ask(LINES)["proof-note"] == judged


def test_names_stand_at_a_new_path_before_the_next_picture(browser: Browser) -> None:
    browser.ask("replacePath([state.start, state.goal])")
    hidden = browser.ask(
        "labels.filter(({ kind }) => ['start', 'goal'].includes(kind)).map((each) => each.element.hidden)"
    )
    assert hidden == [False, False]


def test_what_keeps_a_ghost_back_stands_beside_the_hand_within_the_picture_and_is_mild_in_the_end(
    browser: Browser,
) -> None:
    pane = browser.ask("(({ left, top }) => [left, top])(pane.getBoundingClientRect())")
    held_goal(browser, lambda spot: [pane[0] + 3.0, pane[1] + 3.0])
    browser.ask(IDLE)
    beside = browser.ask(BESIDE_HAND)
    line = browser.ask(LINES)["plan-refusal"]
    let_go(browser)
    assert beside["inside"]
    assert beside["text"] in (line["text"], browser.ask(LINES)["plan-state"]["text"])
    assert line["text"].startswith("goal: out of reach by")
    assert "mild" not in line["kind"]
    after = browser.ask(LINES)["plan-refusal"]
    assert after == {"text": line["text"], "kind": "mild"}
    assert browser.ask(BESIDE_HAND) is None


def test_a_goal_in_an_obstacle_says_so_beside_the_hand_and_by_the_player(browser: Browser) -> None:
    browser.ask("state.obstacles[0].pose = rowsOf(poseOf('goal')); applyObstacle(0); changed()")
    browser.ask(IDLE)
    browser.ask("viewer.render()")  # a press meets what is where it is drawn
    held_goal(browser, lambda spot: [spot[0] + 12.0, spot[1]])
    browser.wait("labels.some(({ kind }) => kind === 'reach')", 20.0)
    browser.ask(IDLE)
    lines = browser.ask(LINES)
    beside = browser.ask(BESIDE_HAND)
    let_go(browser)
    assert lines["plan-state"]["text"].endswith("too near each other")
    assert lines["now"]["text"] == lines["plan-state"]["text"]
    assert beside == {"text": lines["plan-state"]["text"], "inside": True}
    assert lines["title"]["text"].endswith("no path")


def test_a_turn_that_few_joints_cannot_keep_is_no_fault(browser: Browser) -> None:
    browser.ask("placeSelected(movedPose(poseOf('goal'), new THREE.Vector3(), 1.0, AXES[1]))")  # out of the plane
    browser.ask(IDLE)
    line = browser.ask(LINES)["plan-refusal"]
    assert line["text"].startswith("goal: turned by")
    assert line["kind"] == "mild"


def test_the_mark_of_the_goal_and_the_subtitle_are_those_of_the_goal_that_is_shown(browser: Browser) -> None:
    subtitle = "document.getElementById('subtitle').textContent"
    mark = "node('goal').visible"
    assert browser.ask(subtitle).endswith("goal: tip position")
    assert browser.ask(mark) is True
    browser.ask("remember(); moveSelected(new THREE.Vector3(-0.05, 0.05, 0), 0)")
    browser.ask(IDLE)
    assert browser.ask(subtitle).endswith("goal: joint values")
    assert browser.ask(mark) is False
    browser.ask("undo()")
    assert browser.ask(mark) is True
