"""Hands in a page that plans: what follows the pointer, how near a ghost comes, and what undo gives back."""

from collections.abc import Iterator

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.drawing.framing import obstacle_corners
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.page_planner import page_planner
from rrtik_tests.browser import Browser, planning_page
from rrtik_tests.page_drags import IDLE, RESET, SPOTS, begin, random_drags
from rrtik_tests.programs import needs_chromium

pytestmark = pytest.mark.kernels
DRAGS = 6
EYE = "viewer.camera.position.toArray()"


def test_what_is_large_or_carries_the_base_is_locked_at_first() -> None:
    problem = rrtik.load_problem("ur10_bin")
    locked = {}
    for whole in (1.75, 1.25):  # diagonal of what is shown [m]
        plan = page_planner(problem, problem.start, 0.1, whole=whole)
        assert plan is not None
        locked[whole] = {each["name"] for each in plan["obstacles"] if each["locked"]}

    solids = [obstacle for obstacle in problem.world.scene.obstacles if obstacle.shape.bounded]
    large = {each.name for each in solids if np.linalg.norm(np.ptp(obstacle_corners(each), axis=0)) > 0.5 * 1.25}
    assert locked[1.75] == {"stand"}  # 40 mm below the base, which is near beside 1.75 m
    assert locked[1.25] == large
    assert 0 < len(large) < len(solids)


@pytest.fixture(scope="module")
def problem() -> rrtik.Problem:
    return rrtik.load_problem("planar3_boxes")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory, problem: rrtik.Problem) -> Iterator[Browser]:
    text = page(problem, rrtik.plan(problem, seed=1).path)
    with planning_page(text, tmp_path_factory.mktemp("drags")) as opened:
        begin(opened)
        yield opened


@needs_chromium
def test_each_drag_ends_in_a_path_that_python_proves_or_in_a_word(browser: Browser, problem: rrtik.Problem) -> None:
    drags = list(random_drags(browser, problem, ["start", "goal", 0, 1], DRAGS, 1, handles=True, selects=True))
    outcomes = [drag.outcome for drag in drags]
    assert set(outcomes) == {"proven", "word"}, drags
    assert outcomes.count("proven") >= DRAGS // 3


@needs_chromium
def test_a_ghost_comes_as_near_as_the_arm_is_long_and_says_so(browser: Browser, problem: rrtik.Problem) -> None:
    """The nearest point to one far away is on the circle around the base whose radius is the length of the arm."""
    browser.ask(RESET)
    browser.ask("moveSelected(new THREE.Vector3(20, 7, 0), 0)")
    said = browser.ask(IDLE)
    robot = problem.robot
    wanted = np.add(robot.fk(np.array(browser.ask("firstState.goal"))).translation, [20.0, 7.0, 0.0])
    reached = robot.fk(np.array(said["state"]["goal"])).translation
    longest = np.linalg.norm(robot.fk(np.zeros(robot.dof)).translation)
    np.testing.assert_allclose(reached, longest * wanted / np.linalg.norm(wanted), atol=0.01 * longest)
    assert "goal: out of reach by" in said["refusal"]


@needs_chromium
def test_undo_gives_back_the_same_path_and_what_is_said_of_it(browser: Browser) -> None:
    shown = "[story.waypoints, story.times, document.title, document.getElementById('plan-state').textContent]"
    browser.ask(RESET)
    browser.ask(IDLE)
    before = browser.ask(shown)
    browser.ask("remember(); moveSelected(new THREE.Vector3(0.1, -0.1, 0), 0.2)")
    browser.ask(IDLE)
    assert browser.ask(shown) != before
    browser.ask("undo()")
    assert browser.ask(shown) == before
    browser.ask(IDLE)
    assert browser.ask(shown) == before


@needs_chromium
def test_only_what_is_selected_and_not_locked_follows_the_pointer_all_else_turns_the_view(browser: Browser) -> None:
    def drag_the_first_obstacle() -> tuple[bool, bool]:
        """Whether it has moved, and whether the view has."""
        before = browser.ask(EYE), browser.ask("state.obstacles[0].pose")
        browser.drag(spot, [spot[0] + 30.0, spot[1] + 10.0])
        browser.ask(IDLE)
        after = browser.ask(EYE), browser.ask("state.obstacles[0].pose")
        return after[1] != before[1], after[0] != before[0]

    browser.ask(RESET)
    browser.ask(IDLE)
    spots = browser.ask(SPOTS % 0)
    spot = spots[len(spots) // 2]
    assert drag_the_first_obstacle() == (False, True)
    browser.ask(RESET)
    browser.drag(spot, spot, 1)  # a click
    assert browser.ask("selected") == 0
    assert drag_the_first_obstacle() == (True, False)
    browser.ask(RESET)
    browser.ask("select(0); lockSelected(true)")
    assert drag_the_first_obstacle() == (False, True)
    assert browser.ask("handles.visible") is False
    browser.ask("lockSelected(false)")
