"""Acts of a person in a page that plans: clicks on what stays, the ball in the middle, keys, buttons without use."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.page import page
from rrtik_tests.browser import Browser, planning_page
from rrtik_tests.page_drags import IDLE, RESET, SPOTS, begin
from rrtik_tests.programs import needs_chromium

pytestmark = [pytest.mark.kernels, needs_chromium]
ON_SCREEN = """(([x, y, z]) => {
  const r = pane.getBoundingClientRect();
  const place = new THREE.Vector3(x, z, -y).project(viewer.camera);
  return [r.left + (0.5 + 0.5 * place.x) * r.width, r.top + (0.5 - 0.5 * place.y) * r.height];
})(%s)"""
REFUSAL = "document.getElementById('plan-refusal').textContent"
CTRL = 2


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    arm = rrtik.load_robot("planar", parameters={"lengths": [1.0, 0.8], "radius": 0.04})
    obstacles = [
        rrtik.Obstacle("ball", rrtik.Sphere(0.2), [-1.0, 1.2, 0.0]),
        rrtik.Obstacle("wall", rrtik.Box([0.1, 3.0, 0.4]), [-2.2, 0.0, 0.0]),
        rrtik.Obstacle("wedge", rrtik.Prism([[0, 0], [0.4, 0], [0, 0.4]], 0.2), [1.6, 1.4, -0.1]),
    ]
    problem = rrtik.Problem(rrtik.World(arm, rrtik.Scene(obstacles)), [-0.3, 0.4], [0.6, -0.6])
    text = page(problem, rrtik.plan(problem, "RRTConnect", seed=1).path)
    with planning_page(text, tmp_path_factory.mktemp("acts")) as browser:
        begin(browser)
        browser.ask("planning.obstacles.find(({ name }) => name === 'wall').locked = true; fillSelection()")
        yield browser


@pytest.fixture
def browser(opened: Browser) -> Browser:
    opened.ask(RESET)
    opened.ask(IDLE)
    opened.ask("showUndo(); showProblem()")
    return opened


def press(browser: Browser, key: str, code: int, modifiers: int = 0) -> None:
    for kind in ("keyDown", "keyUp"):
        browser.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, modifiers=modifiers)


def place(browser: Browser, point: list[float]) -> list[float]:
    return browser.ask(ON_SCREEN % point)


def pose_of_ball(browser: Browser) -> np.ndarray:
    return np.reshape(browser.ask("Array.from(state.obstacles[numberOf('ball')].pose)"), (4, 4))


def test_a_click_on_what_does_not_move_says_why(browser: Browser) -> None:
    spot = place(browser, [-2.2, 0.5, 0.0])
    browser.drag(spot, spot, 1)
    assert browser.ask("nameOf(selected)") == "wall"
    assert browser.ask("document.getElementById('plan-lock').checked")
    assert browser.ask(REFUSAL).startswith("wall is locked")
    assert browser.ask(
        "labels.filter(({ kind }) => kind === 'selected').map(({ element }) => element.textContent)"
    ) == ["wall (locked)"]

    spot = place(browser, [1.7, 1.5, 0.0])
    browser.drag(spot, spot, 1)
    assert browser.ask(REFUSAL).startswith("wedge stays")

    browser.ask("setVisible(['start ghost'], false); setVisible(['goal ghost'], false); 0")
    spot = place(browser, [0.478, -0.148, 0.0])
    browser.drag(spot, spot, 1)
    browser.ask("applyEyes('ghosts')")
    assert browser.ask(REFUSAL).startswith("planar itself follows the path")

    spot = browser.ask(SPOTS % "numberOf('ball')")[0]
    browser.drag(spot, spot, 1)
    assert browser.ask("nameOf(selected)") == "ball"
    assert browser.ask(REFUSAL) == ""
    names = "labels.filter(({ kind }) => kind === 'selected').map(({ element }) => element.textContent)"
    assert browser.ask(names) == ["ball"]


def test_the_ball_in_the_middle_follows_the_pointer_whatever_arrow_is_before_it(browser: Browser) -> None:
    browser.ask("select(numberOf('ball')); viewer.render()")
    before = pose_of_ball(browser)
    spot = place(browser, before[:3, 3].tolist())
    kind = "(([x, y]) => (pointerAt({ clientX: x, clientY: y }), hitHandle()?.userData.kind))(%s)"
    assert browser.ask(kind % spot) == "knob"
    wanted = [spot[0] + 24.0, spot[1] + 10.0]
    browser.drag(spot, wanted)
    browser.ask(IDLE)
    after = pose_of_ball(browser)
    np.testing.assert_allclose(place(browser, after[:3, 3].tolist()), wanted, atol=1e-3)
    np.testing.assert_array_equal(after[:3, :3], before[:3, :3])


def test_an_arrow_that_points_at_the_eye_cannot_be_pulled(browser: Browser) -> None:
    seen = "handles.children.filter(({ userData, visible }) => userData.kind === 'arrow' && visible).length"
    assert browser.ask(seen) == 2
    browser.ask("lookFrom('Front'); viewer.render()")
    assert browser.ask(seen) == 1


def test_escape_gives_up_a_drag_and_ctrl_z_undoes_one(browser: Browser) -> None:
    before = browser.ask("Array.from(state.goal)")
    spots = browser.ask(SPOTS % '"goal"')
    spot = spots[len(spots) // 2]
    acts = [("mousePressed", 0.0), ("mouseMoved", 8.0), ("mouseMoved", 16.0)]
    for kind, way in acts:
        browser.call("Input.dispatchMouseEvent", type=kind, x=spot[0] + way, y=spot[1] - way, button="left", buttons=1)
    assert browser.ask("Array.from(state.goal)") != before
    press(browser, "Escape", 27)
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=spot[0], y=spot[1] + 30, button="left", buttons=1)
    browser.call("Input.dispatchMouseEvent", type="mouseReleased", x=spot[0], y=spot[1] + 30, button="left")
    browser.ask(IDLE)
    assert browser.ask("Array.from(state.goal)") == before

    browser.drag(spot, [spot[0] - 20.0, spot[1] - 20.0])
    browser.ask(IDLE)
    assert browser.ask("Array.from(state.goal)") != before
    assert browser.ask("document.getElementById('plan-undo').disabled") is False
    press(browser, "z", 90, CTRL)
    browser.ask(IDLE)
    assert browser.ask("Array.from(state.goal)") == before
    assert browser.ask("document.getElementById('plan-undo').disabled") is True


def test_delete_removes_an_obstacle_but_not_while_one_types(browser: Browser) -> None:
    browser.ask("select(numberOf('ball'))")
    browser.ask("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    browser.ask("document.getElementById('plan-text').focus()")
    press(browser, "Delete", 46)
    assert browser.ask("state.obstacles[numberOf('ball')].shown") is True
    browser.ask("document.activeElement.blur()")
    press(browser, "Delete", 46)
    assert browser.ask("state.obstacles[numberOf('ball')].shown") is False
    press(browser, "Delete", 46)
    assert browser.ask(REFUSAL) == "start and goal stay; select an obstacle to remove it"


def test_buttons_of_the_player_rest_while_there_is_no_path(browser: Browser) -> None:
    rest = "[...document.querySelectorAll('#buttons button')].map(({ disabled }) => disabled)"
    assert browser.ask(rest) == [False] * 5
    browser.ask("replacePath([])")
    assert browser.ask(rest) == [True] * 5
    browser.ask("replacePath([state.start, state.goal])")
    assert browser.ask(rest) == [False] * 5


def test_what_is_added_leaves_both_ends_free_and_is_in_the_tree(browser: Browser) -> None:
    rows = "things.filter(({ group }) => group === 'obstacles').map(({ text }) => text)"
    assert browser.ask(rows) == ["ball", "wall", "wedge"]
    for shape in ("box", "sphere", "cylinder", "capsule"):
        browser.ask(f"addShape('{shape}')")
        browser.ask(IDLE)
        assert browser.ask("[...ENDS.keys()].every((end) => kernels.free(state[end]))")
    assert browser.ask(rows) == ["ball", "wall", "wedge", "box 1", "sphere 1", "cylinder 1", "capsule 1"]
    assert "7 obstacles" in browser.ask("document.getElementById('subtitle').textContent")
    browser.ask("select(numberOf('ball')); removeSelected()")
    assert browser.ask(rows) == ["wall", "wedge", "box 1", "sphere 1", "cylinder 1", "capsule 1"]
    browser.ask("undo()")
    assert browser.ask(rows)[:3] == ["ball", "wall", "wedge"]


def test_the_joint_space_stays_for_other_goals_and_goes_with_other_obstacles(browser: Browser) -> None:
    hidden = "document.getElementById('joint-space-section').hidden"
    dot = "['cx', 'cy'].map((name) => document.querySelector('#joint-space .goal').getAttribute(name))"
    assert browser.ask(hidden) is False
    before = browser.ask(dot)
    browser.ask("moveSelected(new THREE.Vector3(-0.05, 0.05, 0), 0)")
    browser.ask(IDLE)
    assert browser.ask(hidden) is False
    assert browser.ask(dot) != before
    assert browser.ask("document.querySelector('#joint-space .route').getAttribute('d').includes('L')")
    browser.ask("select(numberOf('ball')); remember(); moveSelected(new THREE.Vector3(-0.05, 0.05, 0), 0)")
    browser.ask(IDLE)
    assert browser.ask(hidden) is True
    browser.ask("undo()")
    assert browser.ask(hidden) is False


def test_sliders_make_room_for_the_moves_of_a_first_path(tmp_path: Path) -> None:
    problem = rrtik.load_problem("planar3_boxes")
    goal = rrtik.plan(problem, seed=1).path.end
    with planning_page(page(rrtik.Problem(problem.world, problem.start, goal)), tmp_path) as browser:
        sliders = "document.querySelectorAll('#joints input').length"
        assert browser.ask(sliders) == problem.robot.dof
        browser.ask("changed()")
        browser.wait("story.moves.length > 0")
        assert browser.ask(sliders) == 0
        assert browser.ask("document.querySelectorAll('#joints tr').length") == problem.robot.dof + 1
