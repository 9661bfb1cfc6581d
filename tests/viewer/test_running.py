"""Pages whose obstacles move: the arm goes on planning among them; a World judges every posture where they were."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.model.scene import ConstantVelocity, TimedPoses
from rrtik_ompl.viewer.page import page
from rrtik_tests.browser import Browser, planning_page
from rrtik_tests.page_drags import SPOTS
from rrtik_tests.programs import needs_chromium

pytestmark = [
    pytest.mark.kernels,
    pytest.mark.usefixtures("coarse_arms"),
    needs_chromium,
]
STATE = "document.getElementById('plan-state').textContent"
REFUSAL = "document.getElementById('plan-refusal').textContent"
RUN = """(() => {
  if (clock.running) { endRun(); resetRun(); }
  state.seed = %d;
  const real = performance.now;
  let told = 0;
  performance.now = () => { told += 0.1; return told; };  // [ms]: a frame does as much on a busy machine
  startRun();
  const log = [];
  for (let n = 0; n < 1500; n += 1) {
    const done = advance(0.02);
    log.push([clock.time, clock.q.slice(), done, state.obstacles[2].pose.slice()]);
    if (%s && n === 20) moveObstacle(2, new THREE.Vector3(0, 0, -0.55), 0);
    if (done === "arrived" || done === "ended") break;
  }
  performance.now = real;
  endRun();
  return [log, clock.plans];
})()"""


def moving_problem() -> rrtik.Problem:
    """A UR5 that turns across the way of a ball and of a box; a pillar stands far above."""
    stations = [pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, x), np.array([x, 0.45, 0.5])) for x in (-0.5, 0.5, -0.5)]
    there_and_back = TimedPoses([0.0, 2.0, 4.0], stations)
    scene = rrtik.Scene(
        (
            rrtik.Obstacle("ball", rrtik.Sphere(0.08), [0.75, -0.3, 0.55], motion=ConstantVelocity([-0.05, 0.2, 0.0])),
            rrtik.Obstacle("box", rrtik.Box([0.1, 0.1, 0.1]), [-0.5, 0.45, 0.5], motion=there_and_back),
            rrtik.Obstacle("pillar", rrtik.Cylinder(0.05, 0.3), [0.35, 0.6, 1.1]),
        )
    )
    world = rrtik.World(rrtik.load_robot("ur5"), scene)
    return rrtik.Problem(world, [0.0, -1.2, 1.2, 0.2, 0.0, 0.0], [2.2, -1.2, 1.2, 0.2, 0.0, 0.0])


@pytest.fixture(scope="module")
def problem() -> rrtik.Problem:
    return moving_problem()


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory, problem: rrtik.Problem) -> Iterator[Browser]:
    folder = tmp_path_factory.mktemp("running")
    text = page(problem, rrtik.plan(problem, seed=1).path)
    with planning_page(text, folder) as opened:
        opened.coarsen_shadows()
        yield opened


@pytest.mark.parametrize("time", [-1.0, 0.0, 0.7, 2.0, 3.1, 4.0, 9.0])
def test_obstacles_are_where_python_has_them(browser: Browser, problem: rrtik.Problem, time: float) -> None:
    for k, obstacle in enumerate(problem.world.scene.at(time).obstacles):
        shown = np.reshape(browser.ask(f"poseAt({k}, {time})"), (4, 4))
        np.testing.assert_allclose(shown, obstacle.pose.homogeneous, atol=1e-12)


def world_at(problem: rrtik.Problem, time: float, pillar: list[float]) -> rrtik.World:
    scene = problem.world.scene.at(time)
    obstacles = [replace(obstacle, motion=None) for obstacle in scene.obstacles]
    obstacles[2] = replace(obstacles[2], pose=rrtik.pose(pillar[3:12:4]))
    return rrtik.World(problem.robot, rrtik.Scene(obstacles))


@pytest.mark.parametrize(("seed", "dragged"), [(1, False), (2, True)])
def test_the_arm_reaches_its_goal_and_touches_nothing(
    browser: Browser, problem: rrtik.Problem, seed: int, dragged: bool
) -> None:
    log, plans = browser.ask(RUN % (seed, json.dumps(dragged)))
    before, fastest = problem.start, problem.robot.velocity
    for time, q, _done, pillar in log:
        world = world_at(problem, time, pillar)
        assert world.clearance(q) > 0.0, time
        assert (np.abs(np.subtract(q, before)) <= 0.02 * fastest + 1e-9).all()
        before = q
    assert log[-1][2] == "arrived"
    np.testing.assert_array_equal(log[-1][1], problem.goal.q)
    assert plans >= 1  # the path of time 0 is blocked later
    browser.ask("state.obstacles[2].pose = planning.obstacles[2].first.pose.slice(); applyObstacle(2)")


def test_a_run_by_the_button_moves_the_arm_and_stops(browser: Browser, problem: rrtik.Problem) -> None:
    browser.ask("document.getElementById('run-start').click()")
    browser.wait(f"{STATE}.includes('on its way') && clock.time > 0")
    assert browser.ask("document.getElementById('run-start').textContent") == "Stop"
    browser.ask("document.getElementById('run-start').click()")
    browser.wait(f"{STATE}.includes('found in')")
    assert browser.ask("clock.time") == 0.0
    np.testing.assert_allclose(
        np.reshape(browser.ask("poseNow(0)"), (4, 4)), problem.world.scene.obstacles[0].pose.homogeneous
    )


def test_an_obstacle_is_dragged_during_a_run_and_the_heading_does_not_deny_the_path(browser: Browser) -> None:
    browser.ask("select(2); startRun()")
    spots = browser.ask(SPOTS % 2)
    spot = spots[len(spots) // 2]
    before = browser.ask("Array.from(state.obstacles[2].pose)")
    browser.drag(spot, [spot[0] + 20.0, spot[1] - 5.0])
    assert browser.ask("clock.running")
    assert browser.ask("document.title").endswith("obstacles move")
    assert browser.ask("Array.from(state.obstacles[2].pose)") != before
    browser.ask("undo()")
    assert "stop it" in browser.ask(REFUSAL)
    browser.ask("document.getElementById('run-start').click()")  # stops
    browser.ask("undo()")
    assert browser.ask("Array.from(state.obstacles[2].pose)") == before


def test_an_obstacle_on_stated_poses_cannot_be_dragged_and_others_can(browser: Browser) -> None:
    names = browser.ask("[...document.getElementById('plan-selected').options].map((each) => each.textContent)")
    assert names == ["start", "goal", "ball", "pillar"]


def test_a_saved_problem_keeps_its_motions(browser: Browser, problem: rrtik.Problem, tmp_path: Path) -> None:
    browser.ask("moveObstacle(0, new THREE.Vector3(0.1, 0, 0), 0)")
    (tmp_path / "problem.yaml").write_text(browser.ask("problemText()"), encoding="utf-8")
    browser.ask("moveObstacle(0, new THREE.Vector3(-0.1, 0, 0), 0)")
    saved: Any = rrtik.load_problem(tmp_path / "problem.yaml").world.scene.at(1.5).obstacles
    expected: Any = problem.world.scene.at(1.5).obstacles
    np.testing.assert_allclose(saved[0].pose.translation, np.add(expected[0].pose.translation, [0.1, 0, 0]), atol=1e-9)
    np.testing.assert_allclose(saved[1].pose.homogeneous, expected[1].pose.homogeneous, atol=1e-9)


def test_a_run_from_a_blocked_start_is_refused(browser: Browser) -> None:
    browser.ask("state.start = planning.goal.slice(); state.start[2] = 3.1; startRun()")
    assert "must be free" in browser.ask(REFUSAL)
    assert not browser.ask("clock.running")
    browser.ask("state.start = planning.start.slice(); changed()")


def test_a_page_that_asks_is_refused(problem: rrtik.Problem) -> None:
    with pytest.raises(rrtik.InputError, match="obstacles that move"):
        page(problem, rrtik.plan(problem, seed=1).path, asks=True)
