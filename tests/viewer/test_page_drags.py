"""Hands in a page that plans: what follows the pointer, how near a ghost comes, and what undo gives back."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.drawing.framing import obstacle_corners
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.page_planner import page_planner
from rrtik_tests.browser import planning_page
from rrtik_tests.page_drags import DragPage, Wanted
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
def opened(tmp_path_factory: pytest.TempPathFactory, problem: rrtik.Problem) -> Iterator[DragPage]:
    text = page(problem, rrtik.plan(problem, seed=1).path)
    with planning_page(text, tmp_path_factory.mktemp("drags")) as browser:
        yield DragPage(browser)


@needs_chromium
def test_a_ghost_is_drawn_twice_for_its_depth_and_its_glass_and_not_where_the_arm_stands(
    problem: rrtik.Problem, tmp_path: Path
) -> None:
    with planning_page(page(problem, rrtik.plan(problem, seed=1).path), tmp_path) as browser:
        counts = browser.ask("""(() => {
          const drawn = () => { viewer.render(); return viewer.renderer.info.render.triangles; };
          const without = (name) => {
            const meshes = [];
            node(name).traverse((item) => { if (item.isMesh) meshes.push(item); });
            drawn();  // shadows, too
            const all = drawn();
            for (const mesh of meshes) mesh.layers.disable(0);
            const less = all - drawn();
            for (const mesh of meshes) mesh.layers.enable(0);
            return less;
          };
          handles.visible = handsHidden = true;
          return [0, total].map((time) => {
            show(time);
            return ["start ghost", "goal ghost", "robot"].map(without);
          });
        })()""")
    (at_start, goal_ahead, arm), (start_behind, at_goal, same_arm) = counts
    assert at_start == at_goal == 0
    assert arm == same_arm > 0
    assert 0 < goal_ahead <= 2 * arm
    assert 0 < start_behind <= 2 * arm


@needs_chromium
def test_each_drag_ends_in_a_path_that_python_proves_or_in_a_word(opened: DragPage, problem: rrtik.Problem) -> None:
    drags = list(opened.some(problem, DRAGS, 1))
    outcomes = [drag.outcome for drag in drags]
    assert set(outcomes) == {"proven", "word"}, drags
    assert outcomes.count("proven") >= DRAGS // 3


@needs_chromium
def test_a_dragged_ghost_goes_by_the_way_that_the_pointer_goes_in_space(
    opened: DragPage, problem: rrtik.Problem
) -> None:
    robot = problem.robot
    followed = []
    for seed in range(4):
        drag = opened.make(Wanted("goal", by_handle=False, share=0.05, angle=1.5 * seed, seed=seed), problem)
        assert drag.said is not None
        before, after = (np.array(state["goal"]) for state in (opened.first, drag.said["state"]))
        way = robot.fk(after).translation - robot.fk(before).translation
        wanted = (0.02 + 0.05 * 0.38) * opened.first["size"] * np.array([np.cos(1.5 * seed), np.sin(1.5 * seed), 0.0])
        followed.append(drag.followed)
        if drag.followed:
            np.testing.assert_allclose(way, wanted, atol=1e-3)
    assert any(followed)


@needs_chromium
def test_a_ghost_comes_as_near_as_the_arm_is_long_and_says_so(opened: DragPage, problem: rrtik.Problem) -> None:
    """The nearest point to one far away is on the circle around the base whose radius is the length of the arm."""
    opened.reset()
    opened.browser.ask("moveSelected(new THREE.Vector3(20, 7, 0), 0)")
    said = opened.says()
    robot = problem.robot
    wanted = np.add(robot.fk(np.array(opened.first["goal"])).translation, [20.0, 7.0, 0.0])
    reached = robot.fk(np.array(said["state"]["goal"])).translation
    longest = np.linalg.norm(robot.fk(np.zeros(robot.dof)).translation)
    np.testing.assert_allclose(reached, longest * wanted / np.linalg.norm(wanted), atol=0.01 * longest)
    assert "goal: out of reach by" in said["refusal"]


@needs_chromium
def test_a_ghost_that_cannot_follow_stops_before_it_collides_and_says_with_what(
    opened: DragPage, problem: rrtik.Problem
) -> None:
    words = []
    for angle in np.arange(0.0, 2.0 * np.pi, 0.7):
        opened.reset()
        opened.browser.ask(f"moveSelected(new THREE.Vector3({20.0 * np.cos(angle)}, {20.0 * np.sin(angle)}, 0), 0)")
        said = opened.says()
        assert problem.world.valid(np.array(said["state"]["goal"]))
        assert said["refusal"].startswith("goal: out of reach by")
        words.append(said["refusal"])
    assert 0 < sum("; there" in word and "too near each other" in word for word in words) < len(words)


@needs_chromium
def test_undo_gives_back_the_same_path_and_what_is_said_of_it(opened: DragPage) -> None:
    shown = "[story.waypoints, story.times, document.title, document.getElementById('plan-state').textContent]"
    opened.reset()
    opened.says()
    before = opened.browser.ask(shown)
    opened.browser.ask("remember(); moveSelected(new THREE.Vector3(0.1, -0.1, 0), 0.2)")
    opened.says()
    assert opened.browser.ask(shown) != before
    opened.browser.ask("undo()")
    assert opened.browser.ask(shown) == before
    opened.says()
    assert opened.browser.ask(shown) == before


@needs_chromium
def test_only_what_is_selected_and_not_locked_follows_the_pointer_all_else_turns_the_view(opened: DragPage) -> None:
    def drag_the_first_obstacle() -> tuple[bool, bool]:
        """Whether it has moved, and whether the view has."""
        before = opened.browser.ask(EYE), opened.browser.ask("state.obstacles[0].pose")
        opened.browser.drag(spot, [spot[0] + 30.0, spot[1] + 10.0])
        opened.says()
        after = opened.browser.ask(EYE), opened.browser.ask("state.obstacles[0].pose")
        return after[1] != before[1], after[0] != before[0]

    opened.reset()
    opened.says()
    spot = opened.browser.ask("drags.aim(0, [0, 0], 1)")["press"]
    assert drag_the_first_obstacle() == (False, True)
    opened.reset()
    opened.browser.drag(spot, spot, 1)  # a click
    assert opened.browser.ask("selected") == 0
    assert drag_the_first_obstacle() == (True, False)
    opened.reset()
    opened.browser.ask("select(0); lockSelected(true)")
    assert drag_the_first_obstacle() == (False, True)
    assert opened.browser.ask("handles.visible") is False
    opened.browser.ask("lockSelected(false)")
