"""The page of several solutions of inverse kinematics: a table to go to each, few ghosts."""

from pathlib import Path

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.viewer.page import page
from rrtik_tests.browser import planning_page
from rrtik_tests.page_pictures import READY
from rrtik_tests.programs import needs_chromium

pytestmark = [pytest.mark.kernels, needs_chromium]
SHOWN = "robot.joints.map((_, j) => jointRows[j].value.textContent)"
CLICK = "document.querySelectorAll('#solutions tr')[%d].click()"


def rows(count: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(-0.7, 0.7, (count, 3))


def degrees(q: np.ndarray) -> list[str]:
    return [f"{value:.1f} deg".replace("-", "\u2212") for value in np.degrees(q)]


def test_the_arm_stands_at_the_first_solution_and_goes_to_the_one_that_is_clicked(tmp_path: Path) -> None:
    q = rows(20)
    with planning_page(page(rrtik.load_robot("planar3"), ghosts=q), tmp_path, READY) as browser:
        assert browser.ask("document.querySelectorAll('#solutions tr').length") == 1 + len(q)
        assert browser.ask(SHOWN) == degrees(q[0])
        assert browser.ask("drawnGhosts.length") <= 8
        assert browser.ask("new Set(drawnGhosts.map(({ color }) => color)).size === drawnGhosts.length")
        browser.ask(CLICK % 7)
        assert browser.ask(SHOWN) == degrees(q[6])
        assert browser.ask("document.querySelector('#solutions tr.moving td').textContent.trim()") == "7"


def test_on_a_page_that_plans_the_solution_becomes_the_goal_and_the_arm_stands_there(tmp_path: Path) -> None:
    q = rows(5)
    world = rrtik.World(rrtik.load_robot("planar3"))
    problem = rrtik.Problem(world, [0.0, 0.0, 0.0], q[0])
    with planning_page(page(problem, ghosts=q), tmp_path) as browser:
        browser.ask(CLICK % 4)
        browser.wait("story.moves.length > 0")
        assert browser.ask("Array.from(state.goal)") == pytest.approx(q[3])
        assert browser.ask(SHOWN) == degrees(q[3])
        marked = "document.querySelector('#solutions tr.moving td').textContent.trim()"
        assert browser.ask(marked) == "4"
        browser.ask(CLICK % 2)
        browser.wait(f"{marked} === '2'")
        browser.ask("undo()")
        assert browser.ask(marked) == "4"
        assert browser.ask("document.getElementById('plan-goal').value") == "3"
